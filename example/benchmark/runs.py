"""Runs the program on a case, one run after another, and measures it."""
import os
import resource
import statistics
import subprocess
import threading
from dataclasses import dataclass, field, replace

import h5py

PATIENCE = 0.2  # s: runs are repeated until their steps took this together, or REPEATS times
REPEATS = 3


@dataclass
class Run:
    """What came of a case. `failure` is empty if it ran to its end."""
    case: object
    result: str                                  # result file
    failure: str = ""
    seconds: dict = field(default_factory=dict)  # by stage of the program; medians over the repeats
    repeats: int = 1
    memory: float = float("nan")                 # bytes, the most it held
    own: float = float("nan")                    # cores that it used, mean; the least of the repeats
    others: float = float("nan")                 # cores that other processes used meanwhile, mean; the most of the repeats

    def setup_seconds(self):
        """Contact matrices and preload, without reading and reduction."""
        return self.seconds["contact matrices"] + self.seconds["preload"]


class Runner:
    """Keeps what was run: studies share runs of the same case."""

    def __init__(self, program, folder, time_limit):
        self.program, self.folder, self.time_limit = os.path.abspath(program), os.path.abspath(folder), time_limit
        self.known = {}
        os.makedirs(self.folder, exist_ok=True)

    def run(self, case):
        """Run a case, several times if its steps are over soon."""
        if case not in self.known:
            self.known[case] = self.measure(case)
        return self.known[case]

    def measure(self, case):
        path = os.path.join(self.folder, f"run_{len(self.known):03d}.nml")
        if not os.path.exists(self.cache(case)):  # neither time nor memory of the reduction are to be measured
            self.once(replace(case, nx=20, ny=13, solver="condensed", compliance="", potential="auto", duration=case.time_step,
                              snapshots=(case.time_step,)), path)
        runs = [self.once(case, path)]
        while not runs[-1].failure and len(runs) < REPEATS and sum(run.seconds["transient"] for run in runs) < PATIENCE:
            runs.append(self.once(case, path))
        last = runs[-1]
        if not last.failure:
            last.seconds = {stage: statistics.median(run.seconds[stage] for run in runs) for stage in last.seconds}
            last.repeats = len(runs)
            last.own, last.others = min(run.own for run in runs), max(run.others for run in runs)
        return last

    def cache(self, case):
        """Where the reduced model is kept for all runs with it."""
        model = os.path.splitext(os.path.basename(case.model))[0]
        return os.path.join(self.folder, f"{model}_{case.n_modes}.cache")

    def once(self, case, path):
        with open(path, "w") as file:
            file.write(case.text(self.cache(case)))
        run = Run(case, path[:-4] + ".h5")
        log = path[:-4] + ".log"
        if os.path.exists(run.result):
            os.remove(run.result)
        clock = Processors()
        status, killed, usage = self.execute([self.program, "--output", run.result, path], log, case.threads)
        run.own, run.others = clock.shares(usage)
        run.memory = 1024.0 * usage.ru_maxrss
        if killed:
            run.failure = f"stopped after {self.time_limit:.0f} s{steps_done(run.result, case)}"
        elif status != 0:
            run.failure = f"exit status {status}: {last_words(log)}"
        else:
            with h5py.File(run.result, "r") as file:
                run.seconds = dict(zip(file["timing/stage"].asstr()[()], map(float, file["timing/seconds"][()])))
        return run

    def execute(self, command, log, threads):
        """Exit status, whether the time limit ended it, and the process's use of the machine."""
        environment = dict(os.environ, OMP_NUM_THREADS=str(threads))
        with open(log, "w") as output:
            process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, env=environment,
                                       preexec_fn=limit_memory)
        late = threading.Event()
        timer = threading.Timer(self.time_limit, lambda: (late.set(), process.kill()))
        timer.start()
        try:
            _, status, usage = os.wait4(process.pid, 0)
        finally:
            timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        return process.returncode, late.is_set(), usage


class Processors:
    """How busy the machine was with other work since this was made."""

    def __init__(self):
        self.busy, self.all = self.read()

    @staticmethod
    def read():
        """Busy and all seconds of one processor, mean over them."""
        with open("/proc/stat") as file:
            ticks = [int(word) for word in file.readline().split()[1:9]]
        return sum(ticks) - ticks[3] - ticks[4], sum(ticks)

    def shares(self, usage):
        """Cores used by the process with this usage, and by all others."""
        busy, everything = self.read()
        elapsed = max((everything - self.all) / os.cpu_count(), 1.0)
        own = (usage.ru_utime + usage.ru_stime) * os.sysconf("SC_CLK_TCK")
        return own / elapsed, max(busy - self.busy - own, 0.0) / elapsed


def limit_memory():
    """What does not fit must fail, not swap."""
    most = int(0.9 * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def last_words(log):
    """The last line that is neither progress nor backtrace, for the table."""
    with open(log, errors="replace") as file:
        lines = [line.strip() for line in file.read().replace("\r", "\n").splitlines() if line.strip()]
    lines = [line for line in lines if not line.startswith(("transient ", "wall time", "#", "at ", "Backtrace", "Error termination"))]
    return lines[-1].replace(os.path.dirname(os.path.abspath(log)) + os.sep, "")[:200] if lines else "no message"


def steps_done(result, case):
    """What an interrupted run had reached."""
    try:
        with h5py.File(result, "r", locking=False) as file:
            return f", {max(len(file['transient/time']) - 1, 0)} of {case.steps()} steps in its file"
    except (OSError, KeyError):
        return ", before the first step"
