"""Ends a small run at random moments and goes on with it: see scripts/kill_campaign."""
import os
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
import numpy

# Wall times, and how the run went on: different in every run.
NOT_COMPARED = re.compile(r"^timing/|/seconds|^checkpoint")


def small_case(shipped):
    """The shipped case on a coarse grid, with analyses of all kinds and many restart points."""
    with open(shipped) as file:
        text = file.read()
    folder = os.path.dirname(os.path.abspath(shipped))
    for old, new in [
        ("file = 's4_coarse.h5'", f"file = '{folder}/s4_coarse.h5'"),
        ("nx = 42, ny = 26", "nx = 12, ny = 8"),
        ("n_modes = 30", "n_modes = 8, cache = 'reduced.h5'"),
        ("ratio = 0.001", "ratio = 0.005"),
    ]:
        assert old in text, old
        text = text.replace(old, new)
    text = re.sub(r"analyses = .*", "analyses = 'preload', 'linear_modes', 'transient', 'ringdown', 'settling', 'qsma', "
                  "'epmc', 'harmonic_balance'", text)
    return text[: text.index("&transient")] + """
&transient duration = 2.0 /
&excitation load = 'impact', kind = 'half_sine', amplitude = 4000.0, duration = 0.5e-3 /
&ringdown mode = 1 /
&settling load = 'impact', amplitude = 3000.0, 2000.0, duration = 0.5e-3, interval = 0.6, periods = 3 /
&qsma largest_amplitude = 1.0e-4, levels = 5 /
&epmc amplitude_range = 1.0e-7, 1.0e-5, points = 6, harmonics = 1, samples = 8 /
&harmonic_balance
  load = 'impact', levels = 0.1, 0.5, frequency_range = 100.0, 120.0, harmonics = 1, samples = 8, frequency_step = 5.0
/
&output
  sensors = 'sensor', sensor_direction = 0, 0, 1, snapshots = 0.05, 0.2
  checkpoint_interval = 0.02, checkpoint_steps = 1500
/
"""


def datasets(path):
    """All datasets of a result file."""
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


def same(one, other):
    """The same bits (as far as values go: one NaN is as good as another)."""
    if isinstance(one, numpy.ndarray) and one.dtype.kind == "f" or isinstance(one, float):
        return numpy.array_equal(one, other, equal_nan=True)
    return numpy.array_equal(one, other)


def processor_time():
    """s, of all runs that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def fill(path):
    """A file of all the room that is left."""
    with open(path, "wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            pass


class Campaign:
    def __init__(self, program, folder, seed):
        self.program, self.folder = program, folder
        self.random = random.Random(seed)
        self.case = os.path.join(folder, "case.nml")
        self.environment = dict(os.environ, OMP_NUM_THREADS="1")
        self.passed = self.failed = 0

    def start(self, *options, limit=None, folder=None):
        """A run of the case."""
        def set_limit():
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        return subprocess.Popen(
            [self.program, self.case, "--quiet", *options], cwd=folder or self.folder, env=self.environment,
            preexec_fn=set_limit, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )

    def verdict(self, name, faults):
        """Count and print."""
        if faults:
            self.failed += 1
            print(f"FAILED  {name}: {'; '.join(faults)}", flush=True)
        else:
            self.passed += 1
            print(f"ok      {name}", flush=True)

    def reference(self):
        """The undisturbed run."""
        path = os.path.join(self.folder, "reference.h5")
        # The first one fills the cache of the reduction, which the file tells of.
        for _ in range(2):
            start, before = time.monotonic(), processor_time()
            process = self.start("--output", path)
            message = process.communicate()[1]
            self.seconds, self.processor_seconds = time.monotonic() - start, processor_time() - before
            if process.returncode != 0:
                sys.exit(f"the undisturbed run failed: {message}")
        self.whole = {name: value for name, value in datasets(path).items() if not NOT_COMPARED.search(name)}
        print(f"undisturbed run: {self.seconds:.1f} s, {len(self.whole)} datasets", flush=True)

    def check_beginning(self, path):
        """Faults of a file that an ended run left: series are beginnings of the whole ones."""
        try:
            found = datasets(path)
        except OSError as error:
            return [f"{os.path.basename(path)} cannot be read: {error}"]
        faults = []
        for name in ("transient", "settling"):
            if f"{name}/time" not in found:
                continue
            length = len(found[f"{name}/time"])
            for part in ("time", "sensor", "modal_displacement", "energy/elastic", "contact/residual"):
                value, whole = found[f"{name}/{part}"], self.whole[f"{name}/{part}"]
                if len(value) != length or not same(value, whole[:length]):
                    faults.append(f"{name}/{part} is no beginning of the whole")
        # Curves and levels come in their order; a level's record of its analysis is there in the end only.
        for name in ("qsma", "qsma/positive", "qsma/negative", "epmc", "harmonic_balance"):
            if f"{name}/amplitude" not in found:
                continue
            length = len(found[f"{name}/amplitude"])
            for part in ("amplitude", "frequency", "damping_ratio", "harmonics", "load", "friction_loss"):
                if f"{name}/{part}" not in self.whole or f"{name}/{part}" not in found:
                    continue
                value, whole = found[f"{name}/{part}"], self.whole[f"{name}/{part}"]
                if len(value) != length or not same(value, whole[:length]):
                    faults.append(f"{name}/{part} is no beginning of the whole")
        return faults

    def check_whole(self, path):
        """Faults of a file that must be complete."""
        found = {name: value for name, value in datasets(path).items() if not name.startswith("timing/")}
        faults = [f"{name} is missing" for name in self.whole if name not in found]
        faults += [f"{name} is too much" for name in found if name not in self.whole and not NOT_COMPARED.search(name)]
        faults += [f"{name} has other bits" for name, value in self.whole.items() if name in found
                   and not same(found[name], value)]
        if any(name.startswith("checkpoint") for name in found):
            faults.append("/checkpoint is left")
        if os.path.exists(path + ".part"):
            faults.append("the working file is left")
        return faults

    def go_on(self, path, faults):
        """Let it come to its end, and compare."""
        process = self.start("--output", path, "--restart")
        message = process.communicate()[1]
        if process.returncode != 0:
            return faults + [f"--restart ends with {process.returncode}: {message.strip()}"]
        return faults + self.check_whole(path)

    def killed(self, number):
        """Ended by signals three times, at any moment of the run, then continued."""
        path = os.path.join(self.folder, "killed.h5")
        for left in (path, path + ".part"):
            if os.path.exists(left):
                os.remove(left)
        history, faults = [], []
        for _ in range(3):
            how = self.random.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
            delay = self.random.uniform(0.0, 0.7*self.seconds)
            process = self.start("--output", path, "--restart")
            try:
                process.wait(delay)
            except subprocess.TimeoutExpired:
                process.send_signal(how)
            message = process.communicate()[1]
            history.append(f"{how.name} after {delay:.2f} s: {process.returncode}")
            # Before the program has set its handlers a signal ends it as any process.
            if process.returncode not in (0, -how, 128 + how):
                faults.append(f"{history[-1]}: {message.strip()}")
            if os.path.exists(path):
                faults += self.check_beginning(path)
        self.verdict(f"run {number} ({', '.join(history)})", self.go_on(path, faults))

    def limited(self, number):
        """A limit on the size of files stands for a full disk."""
        path = os.path.join(self.folder, "limited.h5")
        for left in (path, path + ".part"):
            if os.path.exists(left):
                os.remove(left)
        whole = os.path.getsize(os.path.join(self.folder, "reference.h5"))
        limit = int(self.random.uniform(0.02, 0.98)*whole)
        process = self.start("--output", path, limit=limit)
        message = process.communicate(timeout=10*self.seconds + 60)[1]
        faults = []
        if process.returncode != 1 or "cannot" not in message:
            faults.append(f"status {process.returncode}, message '{message.strip()}'")
        if os.path.exists(path):
            faults += self.check_beginning(path)
        self.verdict(f"limit {number} at {limit} bytes (file: {os.path.exists(path)})", self.go_on(path, faults))

    def full_disk(self):
        """A small file system in memory; and one that may not be written."""
        disk = os.path.join(self.folder, "disk")
        os.mkdir(disk)
        whole = os.path.getsize(os.path.join(self.folder, "reference.h5"))
        mount = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={16*whole}", "tmpfs", disk], capture_output=True, check=False)
        if mount.returncode != 0:
            print("skipped: a full disk and one that may not be written (no permission to mount one)", flush=True)
            return
        try:
            path = os.path.join(disk, "result.h5")
            process = self.start("--output", path)
            while process.poll() is None and not os.path.exists(path):
                time.sleep(0.001)
            filler = os.path.join(disk, "filler")  # what was free when the run began is taken by others
            fill(filler)
            message = process.communicate()[1]
            faults = [] if process.returncode == 1 else [f"status {process.returncode}"]
            faults += [] if "cannot" in message else [f"message '{message.strip()}'"]
            faults += self.check_beginning(path) if os.path.exists(path) else ["nothing was published"]
            faults += ["the working file is left"] if os.path.exists(path + ".part") else []
            self.verdict("full disk", faults)
            os.remove(filler)
            self.verdict("room on the disk that was full", self.go_on(path, []))
            subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
            start = processor_time()
            process = self.start("--output", os.path.join(disk, "other.h5"))
            message = process.communicate()[1]
            faults = [] if process.returncode == 2 and "cannot be written" in message else [f"{process.returncode}: {message}"]
            faults += [] if processor_time() - start < 0.5*self.processor_seconds else ["the fault was found late"]
            self.verdict("a folder that may not be written", faults)
        finally:
            subprocess.run(["umount", disk], check=False)

    def old_file_stays(self):
        """A file of an earlier run stays until there is something to take its place."""
        path = os.path.join(self.folder, "old.h5")
        shutil.copy(os.path.join(self.folder, "reference.h5"), path)
        process = self.start("--output", path, limit=1000)
        process.communicate()
        faults = [] if process.returncode in (1, 2) else [f"status {process.returncode}"]
        self.verdict("an old result file stays", faults + self.check_whole(path))


def main():
    program, shipped = sys.argv[1:3]
    count = int(sys.argv[3]) if len(sys.argv) > 3 else 20
    seed = int(sys.argv[4]) if len(sys.argv) > 4 else 1
    with tempfile.TemporaryDirectory() as folder:
        campaign = Campaign(os.path.abspath(program), folder, seed)
        with open(campaign.case, "w") as file:
            file.write(small_case(shipped))
        campaign.reference()
        campaign.old_file_stays()
        campaign.full_disk()
        for number in range(1, count + 1):
            campaign.killed(number)
            if number % 3 == 1:
                campaign.limited(number)
        print(f"{campaign.passed} passed, {campaign.failed} failed")
    return 1 if campaign.failed else 0


if __name__ == "__main__":
    sys.exit(main())
