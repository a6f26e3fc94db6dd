"""The same case again, with another number of threads, and built with other flags: see scripts/independence."""
import os
import re
import subprocess
import sys
import tempfile

import numpy

from kill_campaign import datasets, same

# Wall times; and how long the iterations were, which tells of the run and not of the structure.
TIMES = re.compile(r"^timing/|/seconds")
EFFORT = re.compile(r"/iterations$|/periods$|^model/reduction/|evaluations$|/rescues$|/set_changes$")
# Largest difference over the largest value of a dataset. Other threads and flags round differently; the contact solver then
# stops elsewhere within its tolerance of 1e-10, and a step that ends on the other side of a state's border stays within it.
# Residuals, estimates and balances are small themselves: they may differ by SMALL.
TOLERANCE = 1e-8
RESIDUALS = re.compile(r"residual|error|balance|closure|contradiction|change$|deviation|repeat_error")
SMALL = 1e-8
# Share of the counts of points in a state that may differ: points at the border of two states.
COUNTS, BORDER = re.compile(r"contact/(open|stick|slip)$|counts"), 0.02


def small_case(shipped):
    """The shipped case on a coarse grid, with an analysis of each kind."""
    with open(shipped) as file:
        text = file.read()
    folder = os.path.dirname(os.path.abspath(shipped))
    for old, new in [("file = 's4_coarse.h5'", f"file = '{folder}/s4_coarse.h5'"), ("nx = 42, ny = 26", "nx = 12, ny = 8"),
                     ("n_modes = 30", "n_modes = 8"), ("ratio = 0.001", "ratio = 0.005")]:
        assert old in text, old
        text = text.replace(old, new)
    analyses = "'preload', 'linear_modes', 'qsma', 'transient', 'ringdown', 'harmonic_balance'"
    text = re.sub(r"analyses = .*", f"analyses = {analyses}", text)
    return text[: text.index("&transient")] + """
&load name = 'shaker', kind = 'modal', mode = 1 /
&qsma largest_amplitude = 1.0e-4, levels = 5 /
&transient duration = 0.2 /
&excitation load = 'impact', kind = 'half_sine', amplitude = 500.0, duration = 0.5e-3 /
&ringdown mode = 1 /
&harmonic_balance load = 'shaker', levels = 1.0, frequency_range = 195.0, 215.0, harmonics = 3 /
&output sensors = 'sensor', sensor_direction = 0, 0, 1, snapshots = 0.05, 0.2 /
"""


def run(program, threads, folder, name):
    """Run the case; its datasets."""
    path = os.path.join(folder, name + ".h5")
    done = subprocess.run([program, "case.nml", "--quiet", "--threads", str(threads), "--output", path], cwd=folder,
                          stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit(f"{name}: the run failed: {done.stderr}")
    return datasets(path)


def scale(name, values):
    """What the differences of a dataset are compared with: its largest value, but for numbers that may be nothing but rounding."""
    group, last = name.rpartition("/")[::2]
    if last.startswith("traction_"):
        name = f"{group}/pressure"
    elif last == "slip_ratio":
        return 1.0
    elif last.endswith("_loss"):
        work = [other for other in (f"{group}/external_work", f"{group}/work") if other in values]
        name = (work or [name])[0]
    return numpy.nanmax(numpy.abs(numpy.asarray(values[name], float)), initial=0.0)


def difference(name, values, others):
    """By how much two datasets differ (0: not at all; above 1: more than they may), in words too."""
    one, other = numpy.asarray(values[name]), numpy.asarray(others[name])
    if one.shape != other.shape:
        return numpy.inf, f"{one.shape} and {other.shape}"
    if one.size == 0 or one.dtype.kind not in "fiu":
        return (0.0 if same(one, other) else numpy.inf), "text"
    one, other = one.astype(float), other.astype(float)
    apart = numpy.abs(one - other)
    if numpy.any(numpy.isnan(one) != numpy.isnan(other)):
        return numpy.inf, "NaN in one of them"
    if COUNTS.search(name):
        return numpy.mean(apart != 0) / BORDER, f"{numpy.count_nonzero(apart)} of {apart.size} counts"
    most = numpy.nanmax(apart, initial=0.0)
    if RESIDUALS.search(name.rpartition("/")[2]):
        return most / SMALL, f"{most:.1e} absolute"
    most /= scale(name, values) or 1.0
    return most / TOLERANCE, f"{most:.1e}"


def compare(title, one, other, exactly):
    """Print what differs most; whether all is well."""
    names = sorted(name for name in {*one, *other} if not TIMES.search(name) and (exactly or not EFFORT.search(name)))
    missing = [name for name in names if name not in one or name not in other]
    both = [name for name in names if name not in missing]
    if exactly:
        faults = missing + [name for name in both if not same(one[name], other[name])]
        words = [f"{name} has other bits" for name in faults]
        equal = len(names) - len(faults)
    else:
        found = sorted(((*difference(name, one, other), name) for name in both), reverse=True)
        faults = missing + [name for size, _, name in found if not size <= 1.0]
        words = [f"{name} {apart}" for _, apart, name in found[:max(4, len(faults))]]
        equal = sum(size == 0.0 for size, _, _ in found)
    verdict = "FAILED" if faults else "ok    "
    print(f"{verdict}  {title}: {equal} of {len(names)} datasets equal", *words, sep="\n          ", flush=True)
    return not faults


def main():
    optimised, checked, shipped = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "case.nml"), "w") as file:
            file.write(small_case(shipped))
        first = run(optimised, 1, folder, "first")
        two = run(optimised, 2, folder, "two")
        good = [
            compare("again, one thread", first, run(optimised, 1, folder, "again"), True),
            compare("again, two threads", two, run(optimised, 2, folder, "two_again"), True),
            compare("one thread and two", first, two, False),
            compare("optimised build and checked build", first, run(checked, 1, folder, "checked"), False),
        ]
    print(f"{sum(good)} passed, {len(good) - sum(good)} failed")
    sys.exit(0 if all(good) else 1)


if __name__ == "__main__":
    main()
