#!/usr/bin/env python3
"""Throws damaged input at the program and reports every fault of the program (README.md of this folder).

    fuzz.py --program PROGRAM [--count N] [--seed S] [--runs R] [--batch B] [--keep FOLDER] [--hdf5-bytes]

A fault: death by a signal or by the run-time library, no end in time, an exit status that is not 0, 1 or 2, NaN in a report, a case
that is neither reported on nor refused with a message that names it, a case that had to be refused and was not. Batches that
fail are halved until one case is left. Exit status 1 if there are faults; their inputs are kept in FOLDER.
"""

import argparse
import collections
import pathlib
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import h5py
import numpy as np

import mutate
import seeds

HERE = pathlib.Path(__file__).resolve().parent
#: Case whose interrupted results are damaged.
RESTARTED = "dynamics"
CASES = ("dynamics", "sines", "periodic", "calculix", "gmsh", "nodes", "pressed", "split", "response")
#: What only a program that fell over writes.
CRASH = re.compile(r"Fortran runtime|Backtrace for|Error termination|SIG[A-Z]{3,}|HDF5-DIAG|Operating system error|STOP |"
                   r"terminate called|corrupted|free\(\)|malloc|Killed")
# Advice on unknown points ("must be NaN") is no number.
NOT_A_NUMBER = re.compile(r"(?<!be )(?<!it )(?<!points )\b[-+]?(nan|inf|infinity)\b|\*{4,}", re.I)
MEMORY = 4 * 2**30
#: s of processor time: for a batch to start, for a case that is read, for one that is run. How much longer it may take by the clock.
START, CHECK, RUN = 20.0, 1.0, 60.0
WAITING = 60.0


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True, type=pathlib.Path)
    parser.add_argument("--count", type=int, default=1000, help="damaged inputs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--runs", type=int, default=0, help="how many of the accepted ones are run as well")
    parser.add_argument("--restarts", type=int, default=0, help="how many damaged results of an interrupted run are gone on with")
    parser.add_argument("--batch", type=int, default=100, help="inputs per process")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for the inputs that show a fault")
    parser.add_argument("--hdf5-bytes", action="store_true", help="damage any byte of HDF5 files (README.md)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        return Campaign(options, pathlib.Path(folder)).run()


class Campaign:
    """One sequence of inputs."""

    def __init__(self, options, folder):
        self.options, self.folder = options, folder
        self.program = options.program.resolve()
        seeds.write_all(HERE / "seeds", HERE.parent / "data", folder)
        self.text = {name: (folder / f"{name}.nml").read_text() for name in CASES}
        self.faults = collections.Counter()
        self.count = collections.Counter()
        self.accepted = []

    def run(self):
        """All inputs; the exit status."""
        started = time.time()
        paths = [self.folder / f"{name}.nml" for name in CASES]
        self.judge(paths, {path.stem: "accept" for path in paths})
        for path in sorted((HERE / "corpus").glob("*.nml")):
            shutil.copytree(HERE / "corpus", self.folder / "corpus", dirs_exist_ok=True)
            self.judge([self.folder / "corpus" / path.name], {path.stem: "refuse"})
        for first in range(0, self.options.count, self.options.batch):
            numbers = range(first, min(first + self.options.batch, self.options.count))
            expected = {}
            paths = [self.make(number, expected) for number in numbers]
            self.count["claimed"] += len(expected)
            self.judge(paths, expected)
            self.clean()
        self.restart()
        seconds = time.time() - started
        print(f"{self.options.count} inputs in {seconds:.0f} s: {self.count['accepted']} accepted, "
              f"{self.count['refused']} refused ({self.count['claimed']} had to be), {self.count['run']} run, "
              f"{self.count['restarts']} gone on with ({self.count['restarts refused']} refused), {sum(self.faults.values())} faults of {len(self.faults)} kinds")
        for signature, times in self.faults.most_common():
            print(f"{times:6d}  {signature}")
        return 1 if self.faults else 0

    def make(self, number, expected):
        """Write the input of a number; it depends on the seed and the number alone."""
        rng = random.Random(f"{self.options.seed}/{number}")
        name = rng.choice(CASES)
        stem, text = f"c{number:07d}", self.text[name]
        files = re.findall(r"(?<!_)(?<=file = ')(?!fuzzed)[^']*", text)
        if rng.random() < 0.55:
            text, must_fail = mutate.case_text(text, rng, list(self.text.values()))
            if must_fail:
                expected[stem] = "refuse"
        else:
            # Another name for the damaged file, in the case too.
            files += re.findall(r"(?<=mesh_file = ')[^']*", text)
            old = rng.choice(files)
            new = f"{stem}_{old}"
            if old == "blocks":
                damaged = rng.choice(("sti", "mas", "dof"))
                for suffix in ("sti", "mas", "dof"):
                    if self.damage(f"{old}.{suffix}", f"{new}.{suffix}", rng if suffix == damaged else None):
                        expected[stem] = "refuse"
            elif self.damage(old, new, rng):
                expected[stem] = "refuse"
            text = text.replace(f"'{old}'", f"'{new}'")
        path = self.folder / f"{stem}.nml"
        path.write_bytes(text.encode("utf-8", "replace"))
        return path

    def damage(self, old, new, rng):
        """A damaged copy of a file of the seeds; a plain one without `rng`. Tells whether it must be refused."""
        old, new = self.folder / old, self.folder / new
        if rng is None:
            shutil.copyfile(old, new)
            return False
        if old.suffix == ".h5":
            return mutate.hdf5(old, new, rng, self.options.hdf5_bytes)
        text, must_fail = mutate.data_text(old.read_text(), rng)
        new.write_text(text, encoding="utf-8", errors="replace")
        # Meshes hold names too.
        return must_fail and old.suffix in (".txt", ".sti", ".mas")

    def judge(self, paths, expected, check=True):
        """Run a batch; halve it if something is wrong."""
        fault, accepted = self.fault_of(paths, expected, check)
        if fault is None:
            self.count["accepted"] += len(accepted) if check else 0
            self.count["refused"] += len(paths) - len(accepted) if check else 0
            self.count["run"] += 0 if check else len(paths)
            if check:
                for path in accepted:
                    if self.count["run"] < self.options.runs and "corpus" not in path.parts:
                        self.judge([path], {}, check=False)
        elif len(paths) > 1:
            self.judge(paths[:len(paths) // 2], expected, check)
            self.judge(paths[len(paths) // 2:], expected, check)
        else:
            self.faults[fault] += 1
            print(f"{paths[0].name}: {fault}", flush=True)
            if self.options.keep and self.faults[fault] <= 3:
                self.options.keep.mkdir(parents=True, exist_ok=True)
                for path in self.folder.glob(f"{paths[0].stem}*"):
                    shutil.copy(path, self.options.keep)

    def fault_of(self, paths, expected, check):
        """What is wrong with the program's answer to a batch (None: nothing), and the cases that it accepted."""
        limit = START + len(paths) * (CHECK if check else RUN)
        command = [self.program, "--threads", "1", *(["--check"] if check else [])]
        command += [path.relative_to(self.folder) for path in paths]
        try:
            done = subprocess.run(command, cwd=self.folder, capture_output=True, timeout=WAITING * limit, stdin=subprocess.DEVNULL,
                                  preexec_fn=lambda: limit_process(limit))
        except subprocess.TimeoutExpired:
            return f"waits for something for {WAITING * limit:.0f} s", []
        if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            return f"no end within {limit:.0f} s", []
        output, errors = done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace")
        if done.returncode not in (0, 1, 2) or CRASH.search(errors):
            words = CRASH.search(errors)
            line = errors[words.start():].splitlines()[0] if words else ""
            at = re.search(r"At line.*|at \S*\.f90:\d+", errors)
            return f"status {done.returncode}: {line[:120]} {at.group() if at else ''}", []
        accepted = [path for path in paths if path.stem not in errors]
        if bool(done.returncode) != (len(accepted) < len(paths)):
            return f"status {done.returncode}, but {len(paths) - len(accepted)} cases are named in messages: {errors[:100]}", []
        for path in accepted:
            if expected.get(path.stem) == "refuse":
                return "accepted what had to be refused", []
            if check and path.name not in output:
                return "neither refused nor reported on", []
            if not check and (found := not_finite(self.folder / f"{path.stem}.h5")):
                return f"not finite in the result: {found}", []
        for path in paths:
            if expected.get(path.stem) == "accept" and path not in accepted:
                return f"a seed is refused: {errors[:500]}", []
        if check and NOT_A_NUMBER.search(output):
            return f"not a number in the report: {NOT_A_NUMBER.search(output).group()}", []
        return None, accepted

    def restart(self):
        """Damage the result of an interrupted run and go on with it."""
        case, left = self.folder / f"{RESTARTED}.nml", self.folder / "left.h5"
        if self.options.restarts == 0:
            return
        command = [self.program, "--threads", "1", "--quiet", "--output"]
        subprocess.run([*command, "whole.h5", case.name], cwd=self.folder, check=True)
        # A limit on the size of files ends it on the way.
        limit = 2 * (self.folder / "whole.h5").stat().st_size // 3
        subprocess.run([*command, left.name, case.name], cwd=self.folder, check=False, stderr=subprocess.DEVNULL,
                       preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
        for number in range(self.options.restarts):
            damaged = self.folder / "damaged.h5"
            mutate.hdf5(left, damaged, random.Random(f"{self.options.seed}/restart/{number}"), False)
            done = subprocess.run([*command, damaged.name, "--restart", case.name], cwd=self.folder, capture_output=True,
                                  preexec_fn=lambda: limit_process(RUN), check=False)
            said = done.stderr.decode(errors="replace").splitlines()
            errors = "\n".join(line for line in said if not line.startswith("microslip: warning: "))
            self.count["restarts"] += 1
            self.count["restarts refused"] += done.returncode == 2
            if done.returncode not in (0, 1, 2) or CRASH.search(errors) or bool(done.returncode) != bool(errors):
                fault = f"restart: status {done.returncode}: {errors[:200]}"
                self.faults[fault] += 1
                print(f"restart {number}: {fault}", flush=True)

    def clean(self):
        """Remove the inputs of a batch."""
        for path in self.folder.glob("c[0-9]*"):
            path.unlink()


def limit_process(seconds):
    """No more than `MEMORY` for the process, and so many seconds of processor time."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 1))


def not_finite(path):
    """The first dataset of a result that is not finite; '' if there is none."""
    bad = []

    def look(name, item):
        if not isinstance(item, h5py.Dataset) or item.dtype.kind != "f":
            return
        # Fields on a grid are NaN where the grid has no point.
        wrong = np.isinf if "interface_" in name else lambda values: ~np.isfinite(values)
        if np.any(wrong(item[...])):
            bad.append(name)

    if path.exists():
        with h5py.File(path) as file:
            file.visititems(look)
    return bad[0] if bad else ""


if __name__ == "__main__":
    sys.exit(main())
