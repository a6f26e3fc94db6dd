"""Results and how far they are from a reference. All errors are relative to the reference (doc/benchmark.md)."""
from dataclasses import dataclass

import h5py
import numpy as np

PATCHES = (8, 5)  # along x and y, where two grids are compared


@dataclass
class Result:
    """What the errors need of a result file."""
    time: np.ndarray       # s
    sensor: np.ndarray     # m, from the preloaded state
    energy: np.ndarray     # J, kinetic and elastic
    friction_loss: float   # J, at the end
    frequency: np.ndarray  # Hz, linear modes about the preload
    tractions: list        # per interface: x, y, array (snapshot, 3, y, x) in Pa
    facts: dict            # single numbers of the run


def read_result(path):
    """Read a complete result file."""
    with h5py.File(path, "r") as file:
        transient = file["transient"]
        sensor = transient["sensor"][:, 0]
        return Result(
            time=transient["time"][()], sensor=sensor - sensor[0],
            energy=transient["energy/kinetic"][()] + transient["energy/elastic"][()],
            friction_loss=float(transient["energy/friction_loss"][-1]),
            frequency=file["linear_modes/frequency"][()],
            tractions=[read_tractions(file, name) for name in sorted(transient["snapshot"]) if name != "time"],
            facts={"commit": str(file.attrs.get("commit", ""))[:12], "grid_points": int(file["model/grid_points"][()]), "contact_points": int(file["model/contact_points"][()]),
                   "closed_points": int(file["preload/contact/stick"][()] + file["preload/contact/slip"][()]),
                   "most_slipping": int(transient["contact/slip"][()].max()),
                   "fe_coordinates": int(file["model/boundary_coordinates"][()]),
                   **{name: float(transient[name][()]) for name in ("steps", "iterations", "unconverged_steps",
                                                                   "largest_residual", "largest_balance_error")}})


def read_tractions(file, name):
    group = file["transient/snapshot/" + name]
    fields = [np.nan_to_num(group[field][()]) for field in ("pressure", "traction_1", "traction_2")]
    return file[name]["x"][()], file[name]["y"][()], np.stack(fields, axis=1)


def history_error(time, values, reference_time, reference):
    """Relative L2 and maximum difference of two histories, at the common times of the coarser one."""
    fine, coarse = (reference_time, time) if len(reference_time) >= len(time) else (time, reference_time)
    coarse = coarse[coarse <= fine[-1] * (1.0 + 1e-12)]
    ours, theirs = np.interp(coarse, time, values), np.interp(coarse, reference_time, reference)
    return relative(ours - theirs, theirs)


def traction_error(tractions, reference):
    """Relative L2 and maximum difference of contact tractions: by cells, or as forces on patches if the grids differ."""
    ours, theirs = [], []
    for (x, y, field), (x_ref, y_ref, field_ref) in zip(tractions, reference, strict=True):
        if field.shape != field_ref.shape:
            field, field_ref = patch_forces(x, y, field), patch_forces(x_ref, y_ref, field_ref)
        ours.append(field.ravel())
        theirs.append(field_ref.ravel())
    ours, theirs = np.concatenate(ours), np.concatenate(theirs)
    return relative(ours - theirs, theirs)


def patch_forces(x, y, field):
    """Forces (..., patch y, patch x), N, of tractions that are constant in every cell."""
    return shares(y, PATCHES[1]) @ field @ shares(x, PATCHES[0]).T


def shares(centres, n):
    """(n, cells): length of every cell that lies in each of n equal parts of the whole, m."""
    step = (centres[-1] - centres[0]) / (len(centres) - 1)
    edges = centres[0] + step * (np.arange(len(centres) + 1) - 0.5)
    bounds = np.linspace(edges[0], edges[-1], n + 1)
    low, high = np.maximum(bounds[:-1, None], edges[:-1]), np.minimum(bounds[1:, None], edges[1:])
    return np.maximum(high - low, 0.0)


def relative(difference, reference):
    """L2 norms and maxima over one another."""
    size, peak = np.linalg.norm(reference), np.max(np.abs(reference), initial=0.0)
    return (float(np.linalg.norm(difference) / size) if size > 0 else np.nan,
            float(np.max(np.abs(difference), initial=0.0) / peak) if peak > 0 else np.nan)


def ring_down(time, displacement, energy, after):
    """Frequency (Hz) and damping ratio between the first and the last zero crossing after a time; NaN with less than two."""
    crossed = np.flatnonzero((displacement[:-1] * displacement[1:] < 0.0) & (time[:-1] > after))
    if len(crossed) < 2:
        return np.nan, np.nan
    k = crossed[[0, -1]]
    share = displacement[k] / (displacement[k] - displacement[k + 1])
    at = time[k] + share * (time[k + 1] - time[k])
    left = energy[k] + share * (energy[k + 1] - energy[k])
    cycles = 0.5 * (len(crossed) - 1)
    return float(cycles / (at[1] - at[0])), float(np.log(left[0] / left[1]) / (4.0 * np.pi * cycles))


def compare(result, reference, pulse):
    """All errors of a result, by column name (tables.py)."""
    sensor = history_error(result.time, result.sensor, reference.time, reference.sensor)
    force = traction_error(result.tractions, reference.tractions)
    frequency, damping = ring_down(result.time, result.sensor, result.energy, pulse)
    right_frequency, right_damping = ring_down(reference.time, reference.sensor, reference.energy, pulse)
    loss = reference.friction_loss
    return {"sensor_l2": sensor[0], "sensor_max": sensor[1], "force_l2": force[0], "force_max": force[1],
            "friction_loss_error": abs(result.friction_loss - loss) / abs(loss) if loss else np.nan,
            "linear_frequency_error": abs(result.frequency[0] / reference.frequency[0] - 1.0),
            "frequency": frequency, "damping": damping,
            "frequency_error": abs(frequency / right_frequency - 1.0), "damping_error": abs(damping / right_damping - 1.0)}
