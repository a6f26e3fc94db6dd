#!/usr/bin/env python3
"""The S4 Beam with both couplings of half space and FE model: frequencies, damping over amplitude, pressure, time of a step.

    example/coupling/s4_both.py --program MICROSLIP --model s4_full.h5 [--work FOLDER] [--repeats 3]

`example/s4_beam/s4_qsma.nml` and `s4_ringdown.nml` with coupling = 'series' and 'scale_split'. The time integrations are run in
turn, first one coupling, then the other, and processor time is what counts: the machine may be busy. Writes s4_both.csv,
s4_both_curves.csv and coupling_s4.png into the work folder.
"""
import json
import os
import pathlib
import subprocess
import sys

import h5py
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "s4_beam/report"))

from case_edits import edited                                   # noqa: E402
from compare import command_line, full_path, run, write_table     # noqa: E402

COUPLINGS = ("series", "scale_split")
MM = 1e-3


def case_text(source, model, coupling, changes):
    text = (HERE.parent / "s4_beam" / source).read_text()
    return edited(text, {"model": None, "reduction": {"n_modes": "30", "cache": "'s4.cache'"},
                         "interface": {"coupling": f"'{coupling}'"}} | changes) + f"&model source = 'hdf5', file = '{model}' /\n"


def quasi_static(a, coupling):
    result = run(a.program, a.work, f"qsma_{coupling}", case_text("s4_qsma.nml", a.model, coupling, {}))
    if result is None:
        raise SystemExit(1)
    return result


def transient(a, coupling, k):
    """A time integration under the impact; its result, and the processor seconds at the end of each stage."""
    name = f"transient_{coupling}_{k}"
    record = a.work / f"{name}.json"
    if not record.exists():
        (a.work / f"{name}.nml").write_text(case_text("s4_ringdown.nml", a.model, coupling, {
            "case": {"analyses": "'preload', 'linear_modes', 'transient'"}, "ringdown": None,
            "transient": {"duration": str(a.duration)}, "output": {"snapshots": None}}))
        program = subprocess.Popen([a.program, "--output", f"{name}.h5", f"{name}.nml"], cwd=a.work, text=True,
                                   stdout=subprocess.PIPE)
        at = {line.split(":")[0].strip(): processor_seconds(program.pid) for line in program.stdout if ": " in line}
        if program.wait():
            raise SystemExit(f"{name} failed")
        record.write_text(json.dumps(at))
    return a.work / f"{name}.h5", json.loads(record.read_text())


def processor_seconds(pid):
    """User and system time of a process so far."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def summary(coupling, statics, transients):
    """What a coupling gives and costs: the least processor time of all repeats, a step with its part of the solver's start."""
    set_up = [at["contact"] - at["reduction"] for _, at in transients]
    with h5py.File(transients[0][0]) as f:
        steps, slip = f["transient/steps"][()], f["transient/contact/slip"][:].max()
        iterations = f["transient/iterations"][()] / steps
    per_step = [1e3 * (at["transient"] - at["linear modes about the preload, Hz"]) / steps for _, at in transients]
    with h5py.File(statics) as f:
        pads = [f[f"preload/interface_{k}/pressure"][:] for k in (1, 2)]
        row = dict(coupling=coupling, potential_points=f["model/contact_points"][()],
                   closed_points=sum((p > 0).sum() for p in pads),
                   largest_pressure_MPa=f"{max(np.nanmax(p) for p in pads) * 1e-6:.1f}")
        row |= {f"f{k}_Hz": f"{v:.2f}" for k, v in enumerate(f["linear_modes/frequency"][:10], 1)}
        estimate = "interface_1/coupling/error_estimate"
        row |= {f"error_estimate_{n}": f"{f[estimate][k]:.3f}" if estimate in f else "" for k, n in enumerate(("n", "t1", "t2"))}
    return row | dict(set_up_s=f"{min(set_up):.2f}", ms_per_step=f"{min(per_step):.3f}",
                      all_ms_per_step=" ".join(f"{v:.3f}" for v in per_step), largest_slip_points=slip,
                      iterations_per_step=f"{iterations:.2f}")


def curves(statics):
    """Frequency and friction damping of the first mode at the amplitudes of the series coupling."""
    with h5py.File(statics["series"]) as f:
        amplitude = f["qsma/amplitude"][:]
    table = [dict(amplitude_um=f"{u * 1e6:.3f}") for u in amplitude]
    for coupling, path in statics.items():
        with h5py.File(path) as f:
            at = lambda name: np.interp(np.log(amplitude), np.log(f["qsma/amplitude"][:]), f[f"qsma/{name}"][:])
            for row, hz, zeta in zip(table, at("frequency"), at("friction_damping_ratio")):
                row |= {f"{coupling}_Hz": f"{hz:.3f}", f"{coupling}_damping": f"{zeta:.6f}"}
    return table


def draw(path, statics, table):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    figure, axes = plt.subplots(2, 2, figsize=(9.5, 6.2), layout="constrained")
    column = lambda name: np.array([float(row[name]) for row in table])
    top = top_pressure(statics)
    for axis, (coupling, result), colour in zip(axes[0], statics.items(), ("tab:red", "tab:blue")):
        with h5py.File(result) as f:
            x, y = (f[f"interface_1/{c}"][:] / MM for c in "xy")
            image = axis.pcolormesh(x, y, f["preload/interface_1/pressure"][:] * 1e-6, cmap="inferno", vmin=0, vmax=top)
        axis.set(title=f"left pad, {coupling.replace('_', ' ')}", aspect="equal")
        amplitude = column("amplitude_um")
        axes[1, 0].semilogx(amplitude, column(f"{coupling}_Hz"), color=colour, label=coupling.replace("_", " "))
        axes[1, 1].loglog(amplitude, 100 * column(f"{coupling}_damping"), color=colour)
    figure.colorbar(image, ax=axes[0], label="pressure, MPa")
    axes[1, 0].set(xlabel="amplitude at mid-span, um", ylabel="frequency, Hz")
    axes[1, 1].set(xlabel="amplitude at mid-span, um", ylabel="damping ratio by friction, %")
    axes[1, 0].legend()
    figure.savefig(path, dpi=110)


def top_pressure(statics):
    """The pressure that all but one of a hundred closed points of the scale-split coupling stay below, MPa."""
    with h5py.File(statics["scale_split"]) as f:
        p = f["preload/interface_1/pressure"][:]
    return np.quantile(p[p > 0], 0.99) * 1e-6


def main():
    a = command_line(__doc__, "s4_both", model=dict(required=True, type=full_path), repeats=dict(type=int, default=3),
                     duration=dict(type=float, default=0.2, help="of the time integrations, s"))
    statics = {c: quasi_static(a, c) for c in COUPLINGS}
    transients = {c: [] for c in COUPLINGS}
    for k in range(a.repeats):
        for c in COUPLINGS:
            transients[c].append(transient(a, c, k))
    write_table(a.work / "s4_both.csv", [summary(c, statics[c], transients[c]) for c in COUPLINGS])
    table = curves(statics)
    write_table(a.work / "s4_both_curves.csv", table)
    print((a.work / "s4_both.csv").read_text() + (a.work / "s4_both_curves.csv").read_text())
    draw(a.work / "coupling_s4.png", statics, table)


if __name__ == "__main__":
    main()
