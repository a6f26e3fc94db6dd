"""Runs the program on the stages; what was finished with the same case file is not run again."""
import os
import subprocess
import time

import h5py

from stages import case_text


class Runner:
    """Case files, logs and results of a model in a folder."""

    def __init__(self, program, model, folder):
        self.program, self.model, self.folder = program, model, folder
        os.makedirs(folder, exist_ok=True)

    def path(self, stage, ending):
        return os.path.join(self.folder, stage.name + ending)

    def finished(self, stage):
        """Whether the result of this very case file is there."""
        try:
            with h5py.File(self.path(stage, ".h5"), "r") as file:
                return file["setup/input"].asstr()[()] == case_text(stage, self.model, self.folder)
        except (OSError, KeyError):
            return False

    def write_case(self, stage):
        with open(self.path(stage, ".nml"), "w", encoding="utf-8") as file:
            file.write(case_text(stage, self.model, self.folder))

    def check(self, stage):
        """Have the program read the case; what is wrong with it, or nothing."""
        self.write_case(stage)
        answer = subprocess.run([self.program, "--check", self.path(stage, ".nml")], capture_output=True, text=True)
        return "" if answer.returncode == 0 else f"{stage.name}: {answer.stderr}{answer.stdout}"

    def run(self, stage):
        """Run a stage if need be; what went wrong, or nothing."""
        if self.finished(stage):
            print(f"{stage.name}: there already", flush=True)
            return ""
        log, running = self.path(stage, ".log"), self.path(stage, "_running.h5")
        self.write_case(stage)
        print(f"{stage.name}: {stage.title} (progress in {log}) ...", end="", flush=True)
        began = time.time()
        with open(log, "w", encoding="utf-8") as output:
            status = subprocess.run([self.program, "--output", running, self.path(stage, ".nml")], stdout=output,
                                    stderr=subprocess.STDOUT).returncode
        if status != 0:
            print(f" exit status {status}")
            return f"{stage.name}: exit status {status}: {last_line(log)}"
        os.replace(running, self.path(stage, ".h5"))  # only whole results have that name
        print(f" {time.time() - began:.0f} s", flush=True)
        return ""


def last_line(log):
    with open(log, encoding="utf-8", errors="replace") as file:
        lines = file.read().replace("\r", "\n").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "no message")
