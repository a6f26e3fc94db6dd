"""The columns of all tables; rows of runs; CSV, HDF5 and Markdown."""
import csv
import time
from collections import namedtuple

import h5py
import numpy as np

from errors import compare, read_result

Column = namedtuple("Column", "name unit form meaning")
# In the tables of the report only those of SHOWN; everything in the files.
COLUMNS = [Column(*column) for column in [
    ("label", "", "", "variation"),
    ("curve", "", "", "solver and scene"),
    ("solver", "", "", "solver"),
    ("tolerance", "1", ".0e", "tolerance of the contact solver"),
    ("modes", "1", "d", "modes kept"),
    ("time_step", "s", ".4g", "time step"),
    ("threads", "1", "d", "threads"),
    ("fe_coordinates", "1", "d", "boundary coordinates of the FE model"),
    ("grid_points", "1", "d", "grid points of both pads"),
    ("contact_points", "1", "d", "contact points (potential contact)"),
    ("closed_points", "1", "d", "points closed by the preload"),
    ("most_slipping", "1", "d", "points that slip, the most in any step"),
    ("steps", "1", "d", "time steps"),
    ("iterations_per_step", "1", ".4g", "iterations per step"),
    ("ms_per_step", "ms", ".4g", "wall time per step"),
    ("s_per_ms", "s/ms", ".4g", "wall time per simulated ms"),
    ("times_faster", "1", ".4g", "times faster than the plain solver that is not more accurate"),
    ("stepping", "s", ".4g", "wall time of all steps"),
    ("start", "s", ".3g", "wall time of the start of the time integration, before its first step"),
    ("setup", "s", ".3g", "wall time of contact matrices and preload"),
    ("memory", "MB", ".0f", "memory, the most"),
    ("sensor_l2", "1", ".1e", "sensor history, L2 error"),
    ("sensor_max", "1", ".1e", "sensor history, largest error"),
    ("force_l2", "1", ".1e", "contact tractions, L2 error"),
    ("force_max", "1", ".1e", "contact tractions, largest error"),
    ("friction_loss_error", "1", ".1e", "friction loss, error"),
    ("linear_frequency_error", "1", ".1e", "first linear frequency, error"),
    ("frequency", "Hz", ".5g", "frequency of the ring-down"),
    ("damping", "1", ".4g", "damping ratio of the ring-down"),
    ("frequency_error", "1", ".1e", "frequency of the ring-down, error"),
    ("damping_error", "1", ".1e", "damping ratio of the ring-down, error"),
    ("largest_balance_error", "1", ".1e", "energy balance error over the largest kinetic energy"),
    ("largest_residual", "1", ".1e", "largest violation of the contact laws"),
    ("unconverged_steps", "1", "d", "steps that did not converge"),
    ("repeats", "1", "d", "runs of which the time is the median"),
    ("own", "cores", ".2f", "cores that the run used"),
    ("others", "cores", ".2f", "cores in use by other processes meanwhile"),
    ("reference", "", "", "the reference is: another run, or this one"),
    ("day", "", "", "when it was measured"),
    ("commit", "", "", "commit of the program"),
    ("failure", "", "", "why there is no result"),
]]
BY_NAME = {column.name: column for column in COLUMNS}
SHOWN = ["label", "curve", "fe_coordinates", "contact_points", "iterations_per_step", "ms_per_step", "s_per_ms", "times_faster", "start", "setup", "memory", "sensor_l2",
         "sensor_max", "force_l2", "force_max", "friction_loss_error", "linear_frequency_error", "frequency", "damping",
         "damping_error", "largest_balance_error", "unconverged_steps", "own", "others"]
HEADINGS = {"iterations_per_step": "iterations / step", "ms_per_step": "ms / step", "s_per_ms": "s / simulated ms",
            "times_faster": "times faster", "start": "start, s", "setup": "set-up, s", "memory": "memory, MB",
            "sensor_l2": "sensor L2", "sensor_max": "sensor max", "force_l2": "force L2", "force_max": "force max",
            "friction_loss_error": "friction loss", "linear_frequency_error": "linear f1", "frequency": "f, Hz",
            "damping": "damping ratio", "damping_error": "its error", "largest_balance_error": "energy balance", "unconverged_steps": "not converged",
            "own": "own, cores", "others": "others, cores", "curve": "solver, scene", "contact_points": "contact points",
            "fe_coordinates": "FE coordinates"}


def label_of(name):
    """A column in words, with its unit, for an axis."""
    column = BY_NAME[name]
    return column.meaning if column.unit in ("", "1") else f"{column.meaning}, {column.unit}"


def row_of(variation, run, reference):
    """The table row of a run; `reference` is a run too, or None."""
    case = run.case
    row = {"label": variation.label, "curve": variation.curve, "solver": case.solver, "tolerance": case.tolerance,
           "modes": case.n_modes, "time_step": case.time_step, "threads": case.threads, "grid_points": 2 * case.nx * case.ny,
           "steps": case.steps(), "memory": run.memory / 1e6, "own": run.own, "others": run.others, "failure": run.failure,
           "day": time.strftime("%Y-%m-%d"), "commit": ""}
    if run.failure:
        return row
    result = read_result(run.result)
    stepping = run.seconds["transient"]
    row.update(result.facts, stepping=stepping, start=run.seconds["transient start"], setup=run.setup_seconds(),
               repeats=run.repeats,
               iterations_per_step=result.facts["iterations"] / result.facts["steps"],
               ms_per_step=1e3 * stepping / result.facts["steps"], s_per_ms=1e-3 * stepping / case.duration)
    if reference is not None:
        truth = read_result(reference.result)
        row.update(compare(result, truth, case.pulse), reference=("this run" if reference is run else "another run")
                   + (", NOT CONVERGED" if truth.facts["unconverged_steps"] else ""))
    return row


def add_times_faster(rows):
    """Against the cheapest plain run of the same scene that is not more accurate (so that the comparison favours it). What
    of the plain run's time its core was not its own does not count: a disturbed machine must not flatter the others."""
    for row in rows:
        scene = row["curve"].partition(", ")[2]
        plain = [other["ms_per_step"] * min(other["own"], 1.0) for other in rows
                 if other["solver"] == "jacobi" and other["curve"].endswith(", " + scene) and other["failure"] == ""
                 and other.get("force_l2", -1.0) >= row.get("force_l2", np.inf)]
        if row["solver"] != "jacobi" and plain and row["failure"] == "":
            row["times_faster"] = min(plain) / row["ms_per_step"]


def write_csv(path, rows):
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([f"{c.name} [{c.unit}]" if c.unit else c.name for c in COLUMNS])
        for row in rows:
            writer.writerow([row.get(c.name, "") if not is_nan(row.get(c.name)) else "" for c in COLUMNS])


def read_csv(path):
    """The rows of a table that was written before."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = [{name.partition(" [")[0]: value for name, value in row.items()} for row in csv.DictReader(file)]
    return [{name: number(name, value) if BY_NAME[name].unit else value for name, value in row.items()
             if name in BY_NAME and (value or not BY_NAME[name].unit)} for row in rows]


def number(name, text):
    return round(float(text)) if BY_NAME[name].form == "d" else float(text)


def write_hdf5(path, tables, convolution, attributes):
    """One group per study, one dataset per column; NaN where a table has no number."""
    with h5py.File(path, "w") as file:
        file.attrs.update(attributes)
        for study, rows in tables:
            group = file.create_group(study.name)
            group.attrs["description"] = f"{study.title}. {study.text}"
            for column in COLUMNS:
                if column.unit:
                    data = group.create_dataset(column.name, data=[float(row.get(column.name, np.nan)) for row in rows])
                    data.attrs["units"] = column.unit
                else:
                    data = group.create_dataset(column.name, data=[row.get(column.name, "") for row in rows],
                                                dtype=h5py.string_dtype())
                data.attrs["description"] = column.meaning
        if convolution:
            rows, group = convolution[0], file.create_group("convolution")
            group.attrs["description"] = "products with the half-space compliance: points and seconds"
            for name in rows[0]:
                values = [row[name].strip() for row in rows]
                group.create_dataset(name, data=values if name == "materials" else [float(value or "nan") for value in values])


def markdown(study, rows):
    """The table of the report: columns without any number are left out."""
    names = [name for name in SHOWN if any(not empty(row.get(name)) for row in rows)]
    # What is the same in all rows is not shown, but for the number of contact points.
    names = [name for name in names if name not in ("curve", "fe_coordinates") or len({row.get(name) for row in rows}) > 1]
    headings = {**HEADINGS, "label": study.labels or BY_NAME[study.parameter].meaning}
    lines = ["| " + " | ".join(headings.get(name, name) for name in names) + " |", "| --- " * len(names) + "|"]
    lines += ["| " + " | ".join(shown(row, name) for name in names) + " |" for row in rows]
    return "\n".join(lines)


def shown(row, name):
    if row["failure"] and name == "ms_per_step":
        return row["failure"].replace("|", "/")
    value = row.get(name)
    if empty(value):
        return ""
    form = BY_NAME[name].form
    return value if form == "" else format(round(value) if form == "d" else value, form)


def is_nan(value):
    return isinstance(value, float) and np.isnan(value)


def empty(value):
    return value is None or value == "" or is_nan(value)
