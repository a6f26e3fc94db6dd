#!/usr/bin/env python3
"""Tries to lose a user's file: see scripts/users_files.

    users_files.py PROGRAM [PART ...]

Every check starts the program in a folder of its own, as users would by mistake, and looks at all files afterwards. The last
line on stdout is "N passed, N failed"; the exit status is 0 if none failed.
"""
import hashlib
import os
import random
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "fuzz"))
import seeds  # noqa: E402

SECONDS = 60
BAD_INPUT = 2
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1"}

CASE = """&case title = 'two blocks', analyses = 'preload', 'linear_modes' /
&model source = 'hdf5', file = 'model.h5' /
&interface side_a = 'upper_pad', side_b = 'lower_pad', friction = 0.5, young_modulus = 2e11, poisson_ratio = 0.3
  nx = 4, ny = 3, topography = 'scan' /
&topography name = 'scan', source = 'file', file = 'surface.h5', sense = 'height', level = 'plane' /
&reduction n_modes = 8 /
&load name = 'press', node_set = 'top', direction = 0, 0, -1, size = 1.0 /
&preload loads = 'press', interface_force = 2000.0 /
&linear_modes n_modes = 4 /
"""
MATRICES = """&case analyses = 'preload' /
&model source = 'calculix', file = 'blocks', mesh_file = 'outer.inp', unit_length = 'mm', unit_mass = 't', unit_time = 's' /
&interface side_a = 'joint_upper', side_b = 'joint_lower', friction = 0.5, young_modulus = 2.1e11, poisson_ratio = 0.3
  nx = 4, ny = 3 /
&reduction n_modes = 6 /
&load name = 'push', node_set = 'joint_upper', direction = 0, 0, -1, size = 1.0 /
&preload loads = 'push', load_scale = 100.0, steps = 1 /
"""
#: Hours of time integration, published often.
LONG = """&case analyses = 'preload', 'linear_modes', 'transient' /
&model source = 'hdf5', file = 'model.h5' /
&interface side_a = 'upper_pad', side_b = 'lower_pad', friction = 0.5, young_modulus = 2e11, poisson_ratio = 0.3
  nx = 4, ny = 3 /
&reduction n_modes = 8 /
&damping ratio = 0.01, reference_mode = 1 /
&load name = 'press', node_set = 'top', direction = 0, 0, -1, size = 1.0 /
&preload loads = 'press', interface_force = 2000.0 /
&linear_modes n_modes = 4 /
&transient duration = DURATION /
&excitation load = 'press', kind = 'file', file = 'blow.txt', amplitude = 0.1 /
&output sensors = 'upper_end', sensor_direction = 0, 0, 1, checkpoint_interval = 0.05, checkpoint_steps = 1000, stride = 10 /
"""


def digest(path):
    """What is at a path, without opening anything that is no regular file."""
    mode = path.lstat().st_mode
    if stat.S_ISLNK(mode):
        return "link to " + os.readlink(path)
    if stat.S_ISREG(mode):
        return hashlib.sha256(path.read_bytes()).hexdigest()
    return stat.filemode(mode)


class Campaign:
    """The checks, counted."""

    def __init__(self, program):
        self.program = str(Path(program).resolve())
        self.passed = self.failed = 0
        self.top = Path(tempfile.mkdtemp())
        self.seeds = self.top / "seeds"
        self.seeds.mkdir()
        seeds.write_all(HERE / "fuzz" / "seeds", HERE / "data", self.seeds)

    def folder(self, **texts):
        """A new folder with the inputs and the case files `name=text`."""
        path = Path(tempfile.mkdtemp(dir=self.top))
        for name in ("model.h5", "surface.h5", "blow.txt", "blocks.sti", "blocks.mas", "blocks.dof"):
            shutil.copy(self.seeds / name, path)
        shutil.copy(self.seeds / "blocks.inp", path / "inner.inp")
        (path / "outer.inp").write_text("*INCLUDE, INPUT=inner.inp\n")
        for name, text in texts.items():
            (path / f"{name}.nml").write_text(text)
        return path

    def run(self, folder, *arguments, **options):
        """Run to the end: status, everything it said."""
        options.setdefault("env", ENVIRONMENT)
        try:
            done = subprocess.run([self.program, *map(str, arguments)], cwd=folder, capture_output=True, timeout=SECONDS,
                                  text=True, **options)
        except subprocess.TimeoutExpired:
            return "hangs", ""
        return done.returncode, done.stdout + done.stderr

    def verdict(self, name, *faults):
        """Count and print; faults that are empty are none."""
        faults = [fault for fault in faults if fault]
        if faults:
            self.failed += 1
            print(f"FAILED  {name}: {'; '.join(faults)}", flush=True)
        else:
            self.passed += 1
            print(f"ok      {name}", flush=True)

    def refused(self, name, folder, arguments, *words, status=BAD_INPUT, **options):
        """The program refuses, with these words in its message, and leaves everything as it was: in --check too."""
        for extra in (["--check"], []):
            before = {path: digest(path) for path in folder.rglob("*")}
            got, text = self.run(folder, *arguments, *extra, **options)
            after = {path: digest(path) for path in folder.rglob("*")}
            self.verdict(
                f"{name} {' '.join(extra)}",
                got != status and f"status {got}: {text[-300:]}",
                *[word not in text and f"'{word}' is not in: {text[-400:]}" for word in words],
                before != after and f"changed: {sorted(str(p) for p in {*before, *after} if before.get(p) != after.get(p))}")


def inputs(c):
    """Outputs that are inputs, by all the names these have."""
    texts = {"beam": CASE, "matrices": MATRICES, "long": LONG.replace("DURATION", "1e-4")}
    for case, victims in (("beam", ("beam.nml", "model.h5", "surface.h5")), ("long", ("blow.txt",)),
                          ("matrices", ("blocks.sti", "blocks.mas", "blocks.dof", "outer.inp", "inner.inp"))):
        for victim in victims:
            folder = c.folder(**texts)
            c.refused(f"--output {victim}", folder, [f"{case}.nml", "--output", victim], victim)
            c.refused(f"--write-model {victim}", folder, [f"{case}.nml", "--write-model", victim], victim)
            (folder / "cached.nml").write_text(texts[case].replace("&reduction ", f"&reduction cache = '{victim}', "))
            if victim != f"{case}.nml":
                c.refused(f"cache = {victim}", folder, ["cached.nml"], victim)
            (folder / "named.nml").write_text(texts[case] .replace("&output ", f"&output file = '{victim}', ") if "&output" in
                                              texts[case] else texts[case] + f"&output file = '{victim}' /\n")
            if victim != f"{case}.nml":
                c.refused(f"&output file = {victim}", folder, ["named.nml"], victim)
    for spelling in ("./model.h5", "sub/../model.h5", "same/model.h5", "symbolic.h5", "hard.h5", "ABSOLUTE", "chain.h5"):
        folder = c.folder(beam=CASE)
        (folder / "sub").mkdir()
        (folder / "same").symlink_to(".")
        (folder / "symbolic.h5").symlink_to("model.h5")
        (folder / "chain.h5").symlink_to("same/symbolic.h5")
        os.link(folder / "model.h5", folder / "hard.h5")
        c.refused(f"model by the name {spelling}", folder,
                  ["beam.nml", "--output", folder / "model.h5" if spelling == "ABSOLUTE" else spelling], "same file", "model.h5")
    for suffix in (".part", ".new"):
        folder = c.folder(beam=CASE.replace("model.h5", f"beam.h5{suffix}"))
        (folder / "model.h5").rename(folder / f"beam.h5{suffix}")
        c.refused(f"model is called as the working file {suffix}", folder, ["beam.nml"], f"beam.h5{suffix}", "working file")
    folder = c.folder(model=CASE)
    c.refused("case beside the model of its name", folder, ["model.nml"], "model.h5", "&output file")
    folder = c.folder(beam=CASE.replace("n_modes = 8", "cache = 'new.h5', n_modes = 8"))
    (folder / "link.h5").symlink_to("new.h5")
    for output in ("new.h5", "./new.h5", "link.h5"):
        c.refused(f"result = cache, not there yet: {output}", folder, ["beam.nml", "--output", output], "reduction cache")
    folder = c.folder(beam=CASE)
    (folder / "sub").mkdir()
    c.refused("case that is its own topography", c.folder(beam=CASE.replace("surface.h5", "beam.nml")),
              ["beam.nml", "--output", "beam.nml"], "beam.nml")


def several(c):
    """Cases of one command line."""
    folder = c.folder(a=CASE, b=CASE, c=CASE.replace("n_modes = 8", "cache = 'a.h5', n_modes = 8"), d=CASE + "&output file = 'x.h5' /\n",
                      e=CASE + "&output file = 'sub/../x.h5' /\n", f=CASE + "&output file = 'b.nml' /\n",
                      g=CASE + "&output file = 'x.h5.part' /\n", h=CASE.replace("surface.h5", "a.h5"))
    (folder / "sub").mkdir()
    c.refused("the same case twice", folder, ["a.nml", "a.nml"], "a.h5")
    c.refused("the same case by two names", folder, ["a.nml", "./a.nml"], "a.h5")
    c.refused("cases of one name in two folders", folder, ["a.nml", "sub/../a.nml"], "a.h5")
    c.refused("cache of one is the result of the other", folder, ["a.nml", "c.nml"], "a.h5", "reduction cache")
    c.refused("two results of one name", folder, ["d.nml", "e.nml"], "x.h5")
    c.refused("result is the other case", folder, ["f.nml", "b.nml"], "b.nml")
    c.refused("result is the other's working file", folder, ["d.nml", "g.nml"], "x.h5.part")
    c.refused("result is the other's topography", folder, ["a.nml", "h.nml"], "a.h5")
    c.refused("one model of two cases", folder, ["a.nml", "b.nml", "--write-model", "m.h5"], "--write-model")
    c.refused("--output of two cases", folder, ["a.nml", "b.nml", "--output", "m.h5"], "--output")
    status, text = c.run(folder, "a.nml", "b.nml")
    c.verdict("two cases that do not meet are run", status != 0 and text)


def kinds(c):
    """What is no regular file, and names that are none."""
    for kind, word in (("fifo", "FIFO"), ("socket", "socket"), ("folder", "folder"), ("device", "device"), ("null", "device")):
        for role in ("--output", "--write-model", "cache", "result.h5.part", "result.h5.new", "model", "surface"):
            text = CASE.replace("n_modes = 8", "n_modes = 8, cache = 'thing'") if role == "cache" else CASE
            if role in ("model", "surface"):
                text = text.replace(f"{role}.h5", "thing")
            folder = c.folder(beam=text)
            name = role if role.startswith("result") else "thing"
            path = folder / name
            if kind == "fifo":
                os.mkfifo(path)
            elif kind == "socket":
                held = socket.socket(socket.AF_UNIX)
                os.chdir(folder)
                held.bind(name)
            elif kind == "folder":
                path.mkdir()
            elif kind == "null":
                # Not the system's own: who may write it could lose it to a fault of the program.
                if os.geteuid() == 0:
                    os.mknod(folder / "null", 0o600 | stat.S_IFCHR, os.makedev(1, 3))
                path.symlink_to("null" if os.geteuid() == 0 else "/dev/null")
            else:
                try:
                    os.mknod(path, 0o600 | stat.S_IFCHR, os.makedev(1, 3))
                except OSError:
                    continue
            arguments = ["beam.nml", *([role, "thing"] if role.startswith("--") else ["--output", "result.h5"])]
            c.refused(f"{kind} as {role}", folder, arguments, name, *([word] if not role.startswith("result") else []))
    folder = c.folder(beam=CASE)
    (folder / "locked").mkdir()
    (folder / "circle").symlink_to("circle")
    (folder / "nowhere").symlink_to("no_folder/result.h5")
    for output, *words in (("missing/result.h5", "missing"), ("locked/", "slash"), ("-", "standard output"), ("", "name"),
                           ("a" * 300 + ".h5", "name"), ("a/" * 3000 + "b.h5", "folder"), ("a" * 251 + ".h5", "name"), (".", "folder"),
                           ("circle", "circle"), ("nowhere", "no_folder"), ("beam.nml/result.h5", "folder")):
        c.refused(f"--output '{output[:40]}'", folder, ["beam.nml", "--output", output], *words)
    path = folder / "protected.h5"
    c.run(folder, "beam.nml", "--output", path)
    path.chmod(0o444)
    c.refused("write-protected result", folder, ["beam.nml", "--output", path], "protected")
    if os.geteuid() != 0:
        (folder / "locked").chmod(0o555)
        c.refused("write-protected folder", folder, ["beam.nml", "--output", "locked/result.h5"], "locked")


def foreign(c):
    """Files that the program did not write."""
    def text(path):
        path.write_text("measured by hand, not to be repeated\n")

    def picture(path):
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))

    def other(path):
        with h5py.File(path, "w") as file:
            file["microslip"] = np.arange(10.0)
            file.attrs["program"] = "another"

    def old_model(path):
        shutil.copy(c.seeds / "model.h5", path)

    def empty(path):
        path.touch()

    def cut(path):
        folder = c.folder(beam=CASE)
        c.run(folder, "beam.nml", "--output", "whole.h5")
        path.write_bytes((folder / "whole.h5").read_bytes()[:5000])

    for make in (text, picture, other, old_model, empty, cut):
        folder = c.folder(beam=CASE, cached=CASE.replace("n_modes = 8", "cache = 'thing.h5', n_modes = 8"))
        make(folder / "thing.h5")
        before = digest(folder / "thing.h5")
        c.refused(f"--output over {make.__name__}", folder, ["beam.nml", "--output", "thing.h5"], "thing.h5", "not overwritten")
        c.refused(f"--restart from {make.__name__}", folder, ["beam.nml", "--output", "thing.h5", "--restart"], "thing.h5")
        c.refused(f"--write-model over {make.__name__}", folder, ["beam.nml", "--write-model", "thing.h5"], "thing.h5", "not overwritten")
        status, said = c.run(folder, "cached.nml")
        c.verdict(f"cache over {make.__name__}", status != 0 and said, "warning" not in said and f"no warning: {said}",
                  digest(folder / "thing.h5") != before and "changed")
        if make in (empty, cut):
            continue
        for suffix in (".part", ".new"):
            (folder / "thing.h5").rename(folder / f"result.h5{suffix}")
            c.refused(f"{suffix} is {make.__name__}", folder, ["beam.nml", "--output", "result.h5"], f"result.h5{suffix}")
            (folder / f"result.h5{suffix}").rename(folder / "thing.h5")
    folder = c.folder(beam=CASE.replace("n_modes = 8", "cache = 'cache.h5', n_modes = 8"))
    status, said = c.run(folder, "beam.nml")
    status_model, said_model = c.run(folder, "beam.nml", "--write-model", "written.h5")
    c.verdict("result, cache and model", status != 0 and said, status_model != 0 and said_model)
    for role, path in (("--output", "cache.h5"), ("--output", "written.h5"), ("--write-model", "beam.h5"), ("--write-model", "cache.h5")):
        c.refused(f"{role} over {path}", folder, ["beam.nml", role, path], path)
    (folder / "beam.nml").write_text(CASE.replace("n_modes = 8", "cache = 'written.h5', n_modes = 8"))
    before = digest(folder / "written.h5")
    status, said = c.run(folder, "beam.nml", "--output", "other.h5")
    c.verdict("cache over a written model", status != 0 and said, digest(folder / "written.h5") != before and "changed")
    for name, again in (("result", ["beam.nml"]), ("model", ["beam.nml", "--write-model", "written.h5"])):
        status, said = c.run(folder, *again)
        c.verdict(f"a {name} is written again", status != 0 and said)
    # The user's link and permissions stay, and so does another name of the old results.
    (folder / "far").mkdir()
    (folder / "far" / "target.h5").symlink_to("../really.h5")
    (folder / "link.h5").symlink_to("far/target.h5")
    status, said = c.run(folder, "beam.nml", "--output", "link.h5")
    c.verdict("result by a link that leads nowhere yet", status != 0 and said, not (folder / "link.h5").is_symlink() and "link gone",
              not (folder / "really.h5").is_file() and "no result")
    (folder / "really.h5").chmod(0o640)
    os.link(folder / "really.h5", folder / "kept.h5")
    before = digest(folder / "kept.h5")
    status, said = c.run(folder, "beam.nml", "--output", "link.h5")
    c.verdict("result by a link, again", status != 0 and said, not (folder / "link.h5").is_symlink() and "link gone",
              (folder / "really.h5").stat().st_mode & 0o777 != 0o640 and "permissions", digest(folder / "kept.h5") != before and "copy changed",
              digest(folder / "really.h5") == before and "not written")
    (folder / "really.h5.part").symlink_to("beam.nml")
    c.refused("working file is a link", folder, ["beam.nml", "--output", "link.h5"], "really.h5.part")
    # What a run of the program leaves behind may be replaced.
    (folder / "really.h5.part").unlink()
    for suffix in (".part", ".new"):
        (folder / f"really.h5{suffix}").touch()
        status, said = c.run(folder, "beam.nml", "--output", "really.h5")
        c.verdict(f"empty {suffix} of an ended run", status != 0 and said, (folder / f"really.h5{suffix}").exists() and "is left")


def pictures(c):
    """What scripts/run draws beside the results."""
    folder = c.folder(beam=CASE)
    c.run(folder, "beam.nml")
    plot = [sys.executable, str(HERE.parent / "example" / "postprocess" / "plot_case.py"), "beam.h5"]
    (folder / "beam_interface.png").write_bytes(b"a photograph")
    done = subprocess.run(plot, cwd=folder, capture_output=True, text=True)
    c.verdict("a picture of the user stays", (folder / "beam_interface.png").read_bytes() != b"a photograph" and "lost",
              "beam_interface.png" not in done.stderr and f"not told: {done.stderr}", done.returncode == 0 and "status 0")
    (folder / "beam_interface.png").unlink()
    for _ in range(2):
        done = subprocess.run(plot, cwd=folder, capture_output=True, text=True)
        c.verdict("own pictures are drawn again", done.returncode != 0 and done.stderr,
                  not (folder / "beam_interface.png").read_bytes().startswith(b"\x89PNG") and "no picture")


def together(c):
    """Runs at the same time on one result."""
    for locking in (None, "FALSE", "TRUE"):
        environment = dict(ENVIRONMENT)
        environment.pop("HDF5_USE_FILE_LOCKING", None)
        if locking:
            environment["HDF5_USE_FILE_LOCKING"] = locking
        folder = c.folder(long=LONG.replace("DURATION", "1e3"))
        first = subprocess.Popen([c.program, "long.nml"], cwd=folder, env=environment, stdout=subprocess.PIPE,
                                 stderr=subprocess.STDOUT, text=True)
        if not wait_for(lambda: (folder / "long.h5").exists(), first):
            first.kill()
            c.verdict("first run publishes", "it did not: " + first.communicate()[0])
            continue
        for options in ([], ["--restart"], ["--output", "./long.h5"]):
            status, said = c.run(folder, "long.nml", *options, env=environment)
            c.verdict(f"second run, locking {locking} {' '.join(options)}", status != BAD_INPUT and f"status {status} {said}",
                      "another run" not in said and said, not (folder / "long.h5.part").exists() and ".part is gone")
        first.send_signal(signal.SIGTERM)
        said = first.communicate(timeout=SECONDS)[0]
        c.verdict(f"the first run, locking {locking}", first.returncode != 143 and f"status {first.returncode} {said}",
                  *readable(folder / "long.h5"), (folder / "long.h5.part").exists() and ".part is left")
    folder = c.folder(beam=CASE)
    runs = [subprocess.Popen([c.program, "beam.nml"], cwd=folder, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                             text=True) for _ in range(8)]
    said = [run.communicate(timeout=SECONDS)[0] for run in runs]
    c.verdict("eight at once", not any(run.returncode == 0 for run in runs) and "none came to its end",
              *[f"{run.returncode}: {text}" for run, text in zip(runs, said) if run.returncode not in (0, BAD_INPUT)],
              *readable(folder / "beam.h5", "linear_modes/frequency"), *[str(path) for path in folder.glob("beam.h5.*")])


def wait_for(condition, process):
    """Until it holds; false if it never does."""
    end = time.monotonic() + SECONDS
    while time.monotonic() < end and process.poll() is None:
        if condition():
            return True
        time.sleep(0.02)
    return condition()


def readable(path, dataset="transient/time"):
    """Faults of a result file."""
    try:
        with h5py.File(path, "r") as file:
            if file[dataset].size == 0:
                yield f"{dataset} is empty"
    except (OSError, KeyError, RuntimeError) as fault:
        yield f"{path.name} cannot be read: {fault}"


def caches(c):
    """Damaged caches, and runs that begin together on one."""
    text = CASE.replace("n_modes = 8", "cache = 'cache.h5', n_modes = 8")
    folder = c.folder(beam=text)
    status, said = c.run(folder, "beam.nml")
    c.verdict("cache is written", status != 0 and said, "cache" in said.partition("warnings")[2] and said)
    whole = (folder / "cache.h5").read_bytes()
    expected = frequencies(folder)

    def scaled(path, name):
        with h5py.File(path, "r+") as file:
            file[name][...] *= 1.1

    def reshaped(path):
        with h5py.File(path, "r+") as file:
            values = file["K_bb"][()]
            del file["K_bb"]
            file["K_bb"] = values[:-1]

    def signed(path):
        scaled(path, "K_bb")
        path.write_bytes(path.read_bytes() + whole[-35:])

    generator = random.Random(1)

    def flip(path):
        data = bytearray(whole)
        data[generator.randrange(4096, len(data))] ^= 1 << generator.randrange(8)
        path.write_bytes(data)

    def flip_head(path):
        data = bytearray(whole)
        data[generator.randrange(len(data) // 8 + 1)] ^= 1 << generator.randrange(8)
        path.write_bytes(data)

    def unreadable(path):
        path.chmod(0)

    damages = [(f"{name} changed", lambda path, name=name: scaled(path, name)) for name in ("K_ii", "K_bi", "K_bb", "frequency", "pattern_b")]
    damages += [("another shape", reshaped), ("changed, old checksum behind it", signed)]
    damages += [("a bit", flip)] * 6 + [("a bit near the head", flip_head)] * 6
    damages += [(f"cut to {n}", lambda path, n=n: path.write_bytes(whole[:n])) for n in
                (0, 1, 7, 100, 3000, len(whole) // 2, len(whole) - 36, len(whole) - 1)]
    damages += [("longer", lambda path: path.write_bytes(whole + b"x")), ("text", lambda path: path.write_text("garbage")),
                ("zeros", lambda path: path.write_bytes(bytes(len(whole))))]
    if os.geteuid() != 0:
        damages.append(("unreadable", unreadable))
    for name, damage in damages:
        (folder / "cache.h5").unlink(missing_ok=True)
        (folder / "cache.h5").write_bytes(whole)
        damage(folder / "cache.h5")
        status, said = c.run(folder, "beam.nml")
        c.verdict(f"cache damaged: {name}", status != 0 and f"status {status} {said}", "cache" not in said.partition("warnings")[2]
                  and f"no warning: {said}", not np.array_equal(frequencies(folder), expected) and "other frequencies")
    (folder / "cache.h5").unlink()
    for name, (cache, make) in {"folder is missing": ("no/cache.h5", lambda: None),
                                "its working file is the user's": ("cache.h5", lambda: (folder / "cache.h5.new").write_text("mine"))}.items():
        (folder / "beam.nml").write_text(text.replace("cache.h5", cache))
        make()
        status, said = c.run(folder, "beam.nml")
        c.verdict(f"cache that cannot be written: {name}", status != 0 and said, "cache not written" not in said and said)
    c.verdict("the user's file beside the cache", (folder / "cache.h5.new").read_text() != "mine" and "lost")
    (folder / "cache.h5.new").unlink()
    for round in range(3):
        names = [f"run{k}" for k in range(8)]
        folder = c.folder(**{name: text for name in names})
        if round == 2:
            (folder / "cache.h5").write_bytes(whole[:5000])
        runs = [subprocess.Popen([c.program, f"{name}.nml"], cwd=folder, env=ENVIRONMENT, stdout=subprocess.PIPE,
                                 stderr=subprocess.STDOUT, text=True) for name in names]
        said = [run.communicate(timeout=2 * SECONDS)[0] for run in runs]
        c.verdict(f"eight runs begin together on one cache, {round}", *[f"status {run.returncode} {text}" for run, text in zip(runs, said)
                                                                      if run.returncode != 0],
                  *["other frequencies" for name in names if not np.array_equal(frequencies(folder, name), expected)],
                  not (folder / "cache.h5").exists() and "no cache", *[path.name for path in folder.glob("cache.h5.*")])
        status, said = c.run(folder, "run0.nml")
        c.verdict("and the cache is good", status != 0 and said, "taken from" not in said and said)


def frequencies(folder, name="beam"):
    """Of the linear modes."""
    with h5py.File(folder / f"{name}.h5") as file:
        return file["linear_modes/frequency"][()]


def signals(c):
    """Results are kept when the terminal or the reader of the log is gone."""
    for number in (signal.SIGHUP, signal.SIGTERM, signal.SIGINT, signal.SIGPIPE):
        folder = c.folder(long=LONG.replace("DURATION", "1e3").replace("interval = 0.05", "interval = 1e6"))
        # Whoever runs the tests may ignore the signal (nohup, a background job).
        run = subprocess.Popen([c.program, "long.nml"], cwd=folder, env=ENVIRONMENT, stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True, preexec_fn=lambda: signal.signal(number, signal.SIG_DFL))
        # Two analyses are published; then time is integrated for a while.
        wait_for(lambda: (folder / "long.h5").exists() and "linear_modes" in datasets(folder / "long.h5"), run)
        time.sleep(1.0)
        run.send_signal(number)
        said = run.communicate(timeout=SECONDS)[1]
        c.verdict(f"{number.name}", run.returncode != 128 + number and f"status {run.returncode} {said}", *readable(folder / "long.h5"),
                  number.name not in said and said, (folder / "long.h5.part").exists() and ".part is left")
    folder = c.folder(long=LONG.replace("DURATION", "0.5"))
    done = subprocess.run(f"'{c.program}' --verbose long.nml | head -n 1; exit ${{PIPESTATUS[0]}}", cwd=folder, env=ENVIRONMENT, shell=True,
                          executable="/bin/bash", capture_output=True, text=True, timeout=SECONDS)
    c.verdict("| head", done.returncode != 141 and f"status {done.returncode} {done.stderr}", *readable(folder / "long.h5", "preload/interface_force"))
    status, said = c.run(folder, "long.nml", "--restart")
    c.verdict("| head, then --restart", status != 0 and said, *readable(folder / "long.h5"))
    for name, redirection in (("closed", ">&-"), ("closed, all", ">&- 2>&- <&-"), ("on a full disk", ">/dev/full"),
                              ("on a full disk, both", ">/dev/full 2>&1")):
        for start in ("", "MICROSLIP_RESTARTED=1 "):
            folder = c.folder(beam=CASE)
            done = subprocess.run(f"{start}'{c.program}' beam.nml {redirection}", cwd=folder, env=ENVIRONMENT, shell=True,
                                  executable="/bin/bash", capture_output=True, text=True, timeout=SECONDS)
            c.verdict(f"standard output {name} {start}", done.returncode != 0 and f"status {done.returncode} {done.stderr}",
                      *readable(folder / "beam.h5", "linear_modes/frequency"))
    folder = c.folder(long=LONG.replace("DURATION", "1e3"))
    run = subprocess.Popen(["nohup", c.program, "long.nml"], cwd=folder, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    wait_for(lambda: (folder / "long.h5").exists(), run)
    run.send_signal(signal.SIGHUP)
    time.sleep(1.0)
    c.verdict("nohup", run.poll() is not None and f"ended with {run.poll()}")
    run.terminate()
    run.wait()


def datasets(path):
    """Groups of a result file; none while it cannot be read."""
    try:
        with h5py.File(path, "r") as file:
            return list(file)
    except OSError:
        return []


def restarts(c):
    """Files that --restart cannot go on with."""
    folder = c.folder(long=LONG.replace("DURATION", "1e3"))
    run = subprocess.Popen([c.program, "long.nml"], cwd=folder, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    wait_for(lambda: (folder / "long.h5").exists(), run)
    run.kill()
    run.wait()
    c.verdict("killed", not (folder / "long.h5.part").exists() and "no .part", *readable(folder / "long.h5", "preload/interface_force"))
    whole = (folder / "long.h5").read_bytes()
    for version in (0, 2, 99):
        with h5py.File(folder / "long.h5", "r+") as file:
            file.attrs.modify("format_version", np.int32(version))
        c.refused(f"format_version {version}", folder, ["long.nml", "--restart"], "long.h5", *(["format_version"] if version else []))
        (folder / "long.h5").write_bytes(whole)
    with h5py.File(folder / "long.h5", "r+") as file:
        file.attrs["format"] = "microslip model"
    c.refused("another kind", folder, ["long.nml", "--restart"], "long.h5", "model")
    (folder / "long.h5").write_bytes(whole)
    with h5py.File(folder / "long.h5", "r+") as file:
        for name in list(file.attrs):
            if name == "format":
                del file.attrs[name]
    (folder / "long.nml").write_text((folder / "long.nml").read_text().replace("1e3", "1e2"))
    c.refused("another case", folder, ["long.nml", "--restart"], "another case")
    status, said = c.run(folder, "long.nml", "--restart", "--write-model", "m.h5")
    c.verdict("--restart with --write-model", status != BAD_INPUT and said)
    (folder / "long.nml").write_text((folder / "long.nml").read_text().replace("1e2", "1e-3"))
    status, said = c.run(folder, "long.nml")
    c.verdict("results of version 0.1.0, and what it left, are replaced", status != 0 and said, (folder / "long.h5.part").exists() and ".part")


PARTS = (inputs, several, kinds, foreign, pictures, together, caches, signals, restarts)


def main():
    campaign = Campaign(sys.argv[1])
    try:
        for part in PARTS:
            if part.__name__ in sys.argv[2:] or len(sys.argv) == 2:
                part(campaign)
    finally:
        shutil.rmtree(campaign.top, ignore_errors=True)
    print(f"{campaign.passed} passed, {campaign.failed} failed")
    return 1 if campaign.failed or not campaign.passed else 0


if __name__ == "__main__":
    sys.exit(main())
