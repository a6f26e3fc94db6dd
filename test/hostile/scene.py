"""A folder with a small right model in several forms, runs of the program in it, and what must hold after every run."""

import hashlib
import os
import re
import resource
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).resolve().parent
BLOCKS = HERE.parent / "cases" / "14_nodal_frames_and_triangles"
# Hz, of the two blocks when tied, printed by CalculiX (test/cases/14_nodal_frames_and_triangles/case.md).
TIED = [34106.70, 36828.03, 42566.13]
# Words that only a crash prints.
CRASH = re.compile(r"Backtrace for this error|SIGSEGV|Fortran runtime error|\*\*\* .* \*\*\*: terminated|double free|core dumped|"
                   r"At line \d+ of file|AddressSanitizer|runtime error:")
# s; a run takes well below one second.
TIME_LIMIT = 90

CASE = """&case title='block', analyses='preload','linear_modes' /
&model source='calculix', file='m', mesh_file='mesh.inp', unit_length='mm', unit_mass='t', unit_time='s' /
&interface name='joint', side_a='a_contact', side_b='b_contact', friction=0.5, grid='fe_nodes' /
&reduction n_modes=20 /
&load name='press', node_set='top', direction=0,0,-1, size=1.0, distribution='area' /
&preload loads='press', interface_force=1000.0 /
&linear_modes n_modes=6 /
"""
SCAN = """&case title='scan', analyses='preload' /
&model source='hdf5', file='model.h5' /
&interface name='joint', side_a='a_contact', side_b='b_contact', friction=0.5, young_modulus=200e9, poisson_ratio=0.0, nx=16, ny=12, topography='scan' /
&topography name='scan', source='file', file='scan.h5', sense='height' /
&reduction n_modes=10 /
&load name='press', node_set='top', direction=0,0,-1, size=1.0, distribution='area' /
&preload loads='press', interface_force=1000.0 /
"""
KICK = """&case title='kick', analyses='preload','linear_modes','transient' /
&model source='hdf5', file='model.h5' /
&interface name='joint', side_a='a_contact', side_b='b_contact', friction=0.5, grid='fe_nodes' /
&reduction n_modes=10 /
&load name='press', node_set='top', direction=0,0,-1, size=1.0, distribution='area' /
&load name='push', node_set='top', direction=1,0,0, size=1.0, distribution='area' /
&preload loads='press', interface_force=1000.0 /
&linear_modes n_modes=3 /
&damping mass_proportional=200.0 /
&transient duration=DURATION /
&excitation load='push', kind='file', file='kick.txt', amplitude=100.0 /
&output sensors='top', sensor_direction=1,0,0, stride=10, checkpoint_steps=500 /
"""
INPUTS = ("block.nml", "m.inp", "m.sti", "m.mas", "m.dof", "mesh.inp", "sets.inp", "scan.nml", "model.h5", "scan.h5", "kick.nml",
          "kick.txt")


def hill_scan(path, shape=(41, 31), units=("mm", "um"), height=10.0):
    """A hill off centre on a pad of 40 mm x 30 mm, in the program's own layout: z[x, y]."""
    x, y = np.linspace(-22, 22, shape[0]), np.linspace(-17, 17, shape[1])
    z = -height * ((x[:, None] - 8.0)**2 + (y[None, :] - 6.0)**2) / 40.0**2
    with h5py.File(path, "w") as file:
        for name, values, unit in (("x", x, units[0]), ("y", y, units[0]), ("z", z, units[1])):
            file[name] = values
            file[name].attrs["units"] = unit


def make_originals(program, folder):
    """The right inputs, made once: CalculiX's matrices, the same model in HDF5, a scan, a table."""
    shutil.copy(BLOCKS / "m.inp", folder / "m.inp")
    subprocess.run(["ccx", "-i", "m"], cwd=folder, capture_output=True, timeout=120, check=True)
    deck = (BLOCKS / "mesh.inp").read_text()
    cut = deck.index("*NSET, NSET=a_contact")
    (folder / "mesh.inp").write_text(deck[:cut] + "*INCLUDE, INPUT=sets.inp\n")
    (folder / "sets.inp").write_text(deck[cut:])
    (folder / "block.nml").write_text(CASE)
    (folder / "scan.nml").write_text(SCAN)
    (folder / "kick.nml").write_text(KICK.replace("DURATION", "2.0e-3"))
    (folder / "kick.txt").write_text("0 0\n1e-4 1\n2e-4 0\n")
    hill_scan(folder / "scan.h5")
    subprocess.run([program, "--write-model", "model.h5", "block.nml"], cwd=folder, capture_output=True, timeout=120, check=True)
    for path in folder.iterdir():
        if path.name not in INPUTS:
            path.unlink()


@dataclass
class Outcome:
    status: int
    said: str
    seconds: float

    def fault(self):
        """What no run may do, whatever its input: '' if it did none of it."""
        if self.status == -99:
            return f"still running after {TIME_LIMIT} s"
        if self.status < 0 or self.status not in (0, 1, 2, 129, 130, 141, 143):
            return f"ended with status {self.status}: {self.said[-300:]}"
        if CRASH.search(self.said):
            return f"crashed: {CRASH.search(self.said).group(0)}: {self.said[-300:]}"
        if self.status and not self.said.strip():
            return f"status {self.status} without a word"
        return ""


def limits(stack=None, address_space=None, file_size=None, files=None):
    """A function that sets limits in a new process; sizes in bytes."""
    def set_them():
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        for which, value in ((resource.RLIMIT_STACK, stack), (resource.RLIMIT_AS, address_space),
                             (resource.RLIMIT_FSIZE, file_size), (resource.RLIMIT_NOFILE, files)):
            if value is not None:
                resource.setrlimit(which, (value, value))
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        # Whoever runs the tests may ignore these (nohup, a background job).
        for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM, signal.SIGPIPE):
            signal.signal(number, signal.SIG_DFL)
    return set_them


class Scene:
    """One attempt's folder."""

    def __init__(self, program, originals, folder, reference):
        self.program, self.folder, self.reference = program, Path(folder), reference
        self.faults = []
        for name in INPUTS:
            shutil.copy(originals / name, self.folder / name)
        self.protect(*INPUTS)

    def protect(self, *names):
        """From now on these files must stay as they are."""
        if not hasattr(self, "protected"):
            self.protected = {}
        for name in names:
            self.protected[name] = self.digest(name)

    def digest(self, name):
        path = self.folder / name
        if path.is_symlink() and not path.exists():
            return "dangling " + os.readlink(path)
        if not path.exists():
            return "gone"
        if not path.is_file():
            return f"no file {path.stat().st_mode}"
        return hashlib.sha256(path.read_bytes()).hexdigest()

    def write(self, name, text):
        (self.folder / name).write_text(text)
        self.protect(name)

    def edit(self, name, old, new, count=1):
        """Replace a text in a file; the file that comes out is the input of this attempt."""
        text = (self.folder / name).read_text()
        assert old in text, (name, old)
        self.write(name, text.replace(old, new, count))

    def start(self, *arguments, environment=None, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, preexec=None, cwd=None):
        settings = {"OMP_NUM_THREADS": "1", **(environment or {})}
        settings = {**os.environ, **settings}
        return subprocess.Popen([self.program, *map(str, arguments)], cwd=cwd or self.folder, stdout=stdout, stdin=stdin,
                                stderr=subprocess.PIPE, preexec_fn=preexec or limits(),
                                env={k: v for k, v in settings.items() if v is not None})

    def finish(self, process, text=None, ends_early=False):
        """Wait for the end. `ends_early`: a signal may end it before it begins."""
        began = time.monotonic()
        try:
            out, err = process.communicate(text, timeout=TIME_LIMIT)
            status = process.returncode
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
            status = -99
        outcome = Outcome(status, ((out or b"") + (err or b"")).decode(errors="replace"), time.monotonic() - began)
        if outcome.fault() and not (ends_early and -16 < outcome.status < 0):
            self.faults.append(outcome.fault())
        return outcome

    def run(self, *arguments, text=None, **settings):
        if text is not None:
            settings["stdin"] = subprocess.PIPE
        return self.finish(self.start(*arguments, **settings), text=text)

    def expect(self, condition, words):
        if not condition:
            self.faults.append(words)

    def refused(self, outcome, why):
        self.expect(outcome.status == 2, f"{why}: status {outcome.status}, expected 2: {outcome.said[-250:]}")

    def right(self, result, why=""):
        """The result file holds the right values."""
        try:
            with h5py.File(self.folder / result) as file:
                scan = "title='scan'" in file["setup/input"][()].decode()
                title, name = ("pressure", "preload/interface_1/pressure") if scan else ("modes", "linear_modes/frequency")
                found, wanted = np.nan_to_num(np.asarray(file[name][()], dtype=float)), self.reference[title]
                found = found if scan else found[:len(wanted)]
                good = found.shape == wanted.shape and np.allclose(found, wanted, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())
                if not good:
                    self.faults.append(f"{why}: wrong {title}: {found.ravel()[:3]} for {np.ravel(wanted)[:3]}")
                return good
        except (OSError, KeyError) as fault:
            self.faults.append(f"{why}: {result} cannot be read: {fault}")
            return False

    def loudest(self, result):
        """The largest severity of the warnings in a result file, 0 without."""
        with h5py.File(self.folder / result) as file:
            return int(np.max(file["warnings/severity"][()])) if "warnings" in file else 0

    def not_in_silence(self, case, result, why, severity=2):
        """A doubtful input is refused, fails, or is told with at least this severity; or it changed nothing."""
        outcome = self.run(case, "--output", result)
        if outcome.status != 0:
            return outcome
        if self.loudest(result) < severity:
            faults = len(self.faults)
            if not self.right(result, why):
                del self.faults[faults:]
                self.faults.append(f"{why}: passed in silence")
        return outcome

    def close(self):
        """All protected files are as they were."""
        for name, before in self.protected.items():
            after = self.digest(name)
            if after != before:
                self.faults.append(f"{name} was changed ({after[:12]})")
        return self.faults
