#!/usr/bin/env python3
"""Cases from users' reports with what must come out of them: right values, or a refusal that names the cause.

    test/cases/check.py --program PROGRAM [FOLDER | FOLDER/CASE.nml ...]

Every folder holds case files, their inputs and `expected.json`, which lists every case file of the folder:

    "CASE.nml": {
      "status": 0,                      exit status
      "says": ["text", ...],            each is part of what the program printed (log and messages)
      "silent": ["text", ...],          none of these is
      "warnings": 0,                    how many warnings the result file holds (if given)
      "values": [{                      datasets of the result file
        "dataset": "linear_modes/frequency",
        "part": [[5, 10], [0, 40]],     rows, columns, ... of the dataset, first and behind the last (if not all of it)
        "take": "first",                first (as many as expected), last, max, min, mean, range, count, share (of what is above 0):
                                        of all numbers (NaN left out); amplitude: half the range of the last 15 %
        "expected": [34106.7, 36828.0],
        "relative": 1e-6}],             or "absolute"
      "edit": [["old", "new"]],         texts replaced in the case file before it is run
      "options": ["--check"],           more arguments
      "threads": 1,                     OMP_NUM_THREADS
      "seconds": 120}                   longest run time

CalculiX (`ccx`) makes the matrices that a case names (`source = 'calculix', file = 'BASE'`) from BASE.inp. Runs take place in
copies of the folders. The last line is "N passed, N failed"; the exit status is 0 if none failed.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).resolve().parent
TAKE = {"first": lambda values, n: values[:n], "last": lambda values, n: values[-n:],
        "max": lambda values, n: [values.max()], "min": lambda values, n: [values.min()],
        "mean": lambda values, n: [values.mean()], "range": lambda values, n: [np.ptp(values)],
        "count": lambda values, n: [values.size], "share": lambda values, n: [np.mean(values > 0)],
        "amplitude": lambda values, n: [0.5 * np.ptp(values[-(3 * values.size // 20):])]}


def make_matrices(folder):
    """All matrices that the cases of a folder name, by CalculiX."""
    named = re.compile(r"source\s*=\s*'calculix'\s*,\s*file\s*=\s*'([^']*)'")
    bases = {base for case in folder.glob("*.nml") for base in named.findall(case.read_text(errors="replace"))}
    for base in sorted(bases):
        if (folder / f"{base}.inp").exists() and not (folder / f"{base}.sti").exists():
            subprocess.run(["ccx", "-i", base], cwd=folder, capture_output=True, timeout=120,
                           env={**os.environ, "OMP_NUM_THREADS": "1"})


def value_faults(result, rows):
    """What is wrong with the datasets of a result file, one text each."""
    with h5py.File(result) as file:
        for row in rows:
            if row["dataset"] not in file:
                yield f"{row['dataset']} is missing"
                continue
            values = np.asarray(file[row["dataset"]][tuple(slice(*part) for part in row.get("part", []))], dtype=float).ravel()
            values = values[~np.isnan(values)]
            expected = np.atleast_1d(np.asarray(row["expected"], dtype=float))
            found = np.asarray(TAKE[row.get("take", "first")](values, expected.size))
            allowed = row["absolute"] if "absolute" in row else row["relative"] * np.abs(expected)
            if found.shape != expected.shape or not np.all(np.abs(found - expected) <= allowed):
                yield f"{row['dataset']} ({row.get('take', 'first')}): {found}, expected {expected} within {allowed}"


def faults_of(program, folder, case, wanted):
    """What is wrong with one run, one text each."""
    result = folder / "results" / f"{case}.h5"
    for old, new in wanted.get("edit", []):
        (folder / case).write_text((folder / case).read_text().replace(old, new))
    environment = {**os.environ, "OMP_NUM_THREADS": str(wanted.get("threads", 1))}
    command = [program, case, *(["--output", str(result)] if "--write-model" not in wanted.get("options", []) else []),
               *wanted.get("options", [])]
    try:
        run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, timeout=wanted.get("seconds", 120))
    except subprocess.TimeoutExpired:
        yield f"still running after {wanted.get('seconds', 120)} s"
        return
    said = (run.stdout + run.stderr).decode(errors="replace")
    if run.returncode != wanted["status"]:
        yield f"status {run.returncode}, expected {wanted['status']}: {said.strip().splitlines()[-1:]}"
        return
    for text in wanted.get("says", []):
        if text not in said:
            yield f"does not say '{text}': {said.strip().splitlines()[-3:]}"
    for text in wanted.get("silent", []):
        if text in said:
            yield f"says '{text}'"
    if wanted["status"] == 2 and result.exists():
        yield "refused, but there is a result file"
    if "warnings" in wanted:
        with h5py.File(result) as file:
            if file.attrs["warnings"] != wanted["warnings"]:
                yield f"{file.attrs['warnings']} warnings, expected {wanted['warnings']}"
    if wanted.get("values"):
        if result.exists():
            yield from value_faults(result, wanted["values"])
        else:
            yield "no result file"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("selected", nargs="*", help="folders, or case files in folders")
    arguments = parser.parse_args()
    program = str(Path(arguments.program).resolve())
    if shutil.which("ccx") is None:
        sys.exit("ccx (CalculiX) is not installed: scripts/setup installs it")

    def is_selected(name, case):
        return not arguments.selected or any(Path(s).name == name or Path(s).parts[-2:] == (name, case) for s in arguments.selected)

    jobs, passed, failed = [], 0, 0
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for source in sorted(path for path in HERE.iterdir() if path.is_dir() and path.name != "__pycache__"):
            cases = sorted(path.name for path in source.glob("*.nml") if is_selected(source.name, path.name))
            if not cases:
                continue
            listed = source / "expected.json"
            wanted = json.loads(listed.read_text()) if listed.exists() else {}
            folder = Path(scratch) / source.name
            shutil.copytree(source, folder)
            (folder / "results").mkdir()
            make_matrices(folder)
            for case in cases:
                if case in wanted:
                    jobs.append((f"{source.name}/{case}", pool.submit(
                        lambda *job: list(faults_of(*job)), program, folder, case, wanted[case])))
                else:
                    jobs.append((f"{source.name}/{case}", pool.submit(lambda: ["not listed in expected.json"])))
        for name, job in jobs:
            faults = job.result()
            passed, failed = passed + (not faults), failed + bool(faults)
            print(f"{'FAILED' if faults else 'ok    '}  {name}", *faults, sep="\n          ", flush=True)
    print(f"{passed} passed, {failed} failed")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
