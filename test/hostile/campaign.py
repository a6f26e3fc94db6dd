#!/usr/bin/env python3
"""Hostile runs: wrong and awkward files, models, units, environments and neighbours, as strangers have them.

    test/hostile/campaign.py --program PROGRAM [--count 1000] [--seed 1] [--jobs N] [--only KIND] [--keep FOLDER]

An attempt depends on the seed and its number alone. It fails if a wrong input passes in silence (status 0, a wrong value and
no warning of the severity it deserves), if a file of the user's is changed, if a run hangs, crashes or ends without
a word. The last line is "N passed, N failed"; the exit status is 0 if none failed.
"""

import argparse
import collections
import os
import random
import shutil
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np

import environments
import files
import models
from scene import TIED, Scene, make_originals

KINDS = files.KINDS + models.KINDS + environments.KINDS


def find_reference(program, originals, scratch):
    """What the right inputs give, held against CalculiX."""
    folder = scratch / "reference"
    folder.mkdir()
    scene = Scene(program, originals, folder, {})
    for case in ("block", "scan", "kick"):
        outcome = scene.run(f"{case}.nml", "--output", f"{case}_out.h5")
        if outcome.status != 0:
            sys.exit(f"the right inputs are not run: {outcome.said}")
    with h5py.File(folder / "block_out.h5") as file:
        modes = file["linear_modes/frequency"][:3]
    if not np.allclose(modes, TIED, rtol=1e-6):
        sys.exit(f"the right inputs give {modes}, not {TIED}")
    with h5py.File(folder / "scan_out.h5") as file:
        pressure = np.nan_to_num(file["preload/interface_1/pressure"][()])
    return {"modes": modes, "pressure": pressure}


def attempt(number, arguments, originals, scratch, reference):
    """One attempt: its kind and its faults."""
    rng = random.Random(f"{arguments.seed} {number}")
    kinds = [kind for kind in KINDS if arguments.only in (None, kind.__name__)]
    kind = rng.choice(kinds)
    folder = scratch / str(number)
    folder.mkdir()
    scene = Scene(arguments.program, originals, folder, reference)
    kind(scene, rng)
    faults = scene.close()
    if faults and arguments.keep:
        shutil.copytree(folder, Path(arguments.keep) / f"{arguments.seed}_{number}_{kind.__name__}", symlinks=True, dirs_exist_ok=True,
                        ignore=lambda where, names: [name for name in names if not ((Path(where) / name).is_file() or
                                                                                   (Path(where) / name).is_dir())])
    shutil.rmtree(folder, ignore_errors=True)
    return kind.__name__, faults


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True, type=lambda path: str(Path(path).resolve()))
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--only", choices=sorted({kind.__name__ for kind in KINDS}))
    parser.add_argument("--keep", help="folder for the inputs of attempts that fail")
    arguments = parser.parse_args()
    tried, failed = collections.Counter(), collections.Counter()
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(arguments.jobs) as pool:
        scratch = Path(scratch)
        originals = scratch / "originals"
        originals.mkdir()
        make_originals(arguments.program, originals)
        reference = find_reference(arguments.program, originals, scratch)
        jobs = [pool.submit(attempt, number, arguments, originals, scratch, reference) for number in range(arguments.count)]
        for number, job in enumerate(jobs):
            kind, faults = job.result()
            tried[kind] += 1
            failed[kind] += bool(faults)
            for fault in faults:
                print(f"FAILED  {number} {kind}: {' '.join(fault.split())}", flush=True)
    for kind in sorted(tried):
        print(f"{kind:24s} {tried[kind]:5d} tried {failed[kind]:5d} failed")
    print(f"{tried.total() - failed.total()} passed, {failed.total()} failed")
    sys.exit(failed.total() > 0)


if __name__ == "__main__":
    main()
