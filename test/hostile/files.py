"""Attempts on the user's files: results, caches and models that are other files; runs side by side; ends at any moment."""

import os
import signal
import socket
import stat
import subprocess
import time

import h5py
import numpy as np

from scene import INPUTS, KICK


def alias(scene, rng, name):
    """Another name of the same file."""
    folder = scene.folder
    way = rng.choice(["itself", "dot", "absolute", "symlink", "hard link", "through a folder", "up and down", "double slash"])
    if way == "itself":
        return name
    if way == "dot":
        return "./" + name
    if way == "absolute":
        return str(folder / name)
    if way == "double slash":
        return f".//{name}"
    if way == "symlink":
        (folder / "alias.h5").symlink_to(name)
        return "alias.h5"
    if way == "hard link":
        os.link(folder / name, folder / "alias.h5")
        scene.protect("alias.h5")
        return "alias.h5"
    if way == "through a folder":
        (folder / "here").symlink_to(".", target_is_directory=True)
        return "here/" + name
    (folder / "sub").mkdir()
    return "sub/../" + name


USED = {"block.nml": ("block.nml", "m.sti", "m.mas", "m.dof", "mesh.inp", "sets.inp"),
        "scan.nml": ("scan.nml", "model.h5", "scan.h5"), "kick.nml": ("kick.nml", "model.h5", "kick.txt")}


def result_is_input(scene, rng):
    """A result, a cache or a written model that is an input."""
    case = rng.choice(sorted(USED))
    victim = alias(scene, rng, rng.choice(USED[case]))
    how = rng.choice(["--output", "&output", "cache", "--write-model"])
    extra = ["--check"] if rng.random() < 0.4 and how != "--write-model" else []
    if how in ("--output", "--write-model"):
        outcome = scene.run(*extra, how, victim, case)
    else:
        text = (scene.folder / case).read_text()
        if how == "cache":
            text = text.replace("&reduction ", f"&reduction cache='{victim}', ")
        elif "&output" in text:
            text = text.replace("&output ", f"&output file='{victim}', ")
        else:
            text += f"&output file='{victim}' /\n"
        linked = (scene.folder / "alias.h5").exists() and os.path.samefile(scene.folder / "alias.h5", scene.folder / case)
        scene.write(case, text)
        if linked:
            scene.protect("alias.h5")
        outcome = scene.run(*extra, case, *([] if how == "&output" else ["--output", "fine.h5"]))
    scene.refused(outcome, f"{how} {victim} of {case}")


def default_name_is_input(scene, rng):
    """model.nml beside model.h5, scan.nml beside scan.h5."""
    name = rng.choice(["model.nml", "scan.nml"])
    scene.write(name, (scene.folder / "scan.nml").read_text())
    scene.refused(scene.run(*(["--check"] if rng.random() < 0.3 else []), name), f"{name} without --output")


def foreign_file(scene, rng):
    """A file of somebody else has the name of a result, a cache, a working file or a picture."""
    content = {"text": b"my notes\n", "picture": b"\x89PNG\r\n\x1a\n" + b"\0" * 64, "csv": b"1,2,3\n", "zip": b"PK\x03\x04" + b"\0" * 40}
    kind = rng.choice([*content, "hdf5"])
    what = rng.choice(["result", "cache", "part", "new", "written model"])
    name = {"result": "out.h5", "cache": "cache.h5", "part": "out.h5.part", "new": "out.h5.new", "written model": "written.h5"}[what]
    if kind == "hdf5":
        with h5py.File(scene.folder / name, "w") as file:
            file["measured"] = np.arange(10.0)
    else:
        (scene.folder / name).write_bytes(content[kind])
    scene.protect(name)
    if what == "written model":
        outcome = scene.run("--write-model", name, "block.nml")
        scene.refused(outcome, f"--write-model over a foreign {kind}")
        return
    if what == "cache":
        scene.edit("block.nml", "&reduction ", "&reduction cache='cache.h5', ")
    outcome = scene.run("block.nml", "--output", "out.h5")
    if what == "result":
        scene.refused(outcome, f"{what} is a foreign {kind}")
    elif what == "cache" and outcome.status == 0:
        scene.expect(scene.loudest("out.h5") > 0, f"a cache that is a foreign {kind} is not told")
        scene.right("out.h5", f"beside a foreign {name}")
    elif outcome.status == 0:
        scene.right("out.h5", f"beside a foreign {name}")


def special_file(scene, rng):
    """A result that is no regular file."""
    kind = rng.choice(["fifo", "null", "full", "folder", "socket", "dangling link"])
    path = scene.folder / "out.h5"
    target = "out.h5"
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "null" and os.geteuid() == 0:
        os.mknod(scene.folder / "null", 0o600 | stat.S_IFCHR, os.makedev(1, 3))
        path.symlink_to("null")
    elif kind == "null":
        path.symlink_to("/dev/null")
    elif kind == "full" and os.geteuid() == 0:
        # Not the system's own: who may write it could lose it to a fault of the program.
        os.mknod(path, 0o600 | stat.S_IFCHR, os.makedev(1, 7))
    elif kind == "full":
        target = "/dev/full"
    elif kind == "folder":
        path.mkdir()
    elif kind == "socket":
        # A socket's path has at most some hundred letters.
        here = os.getcwd()
        os.chdir(scene.folder)
        socket.socket(socket.AF_UNIX).bind("out.h5")
        os.chdir(here)
    else:
        path.symlink_to("nowhere/out.h5")
    if target == "out.h5":
        scene.protect("out.h5")
    what = rng.choice(["--output", "--write-model", "cache"])
    if what == "cache":
        scene.edit("block.nml", "&reduction ", f"&reduction cache='{target}', ")
        outcome = scene.run("block.nml", "--output", "fine.h5")
    else:
        outcome = scene.run(what, target, "block.nml")
    scene.expect(outcome.status in (1, 2) or (what == "cache" and outcome.status == 0 and kind == "dangling link"),
                 f"{what} {kind}: status {outcome.status}")


def same_result(scene, rng):
    """Two cases of one command line with one result."""
    (scene.folder / "sub").mkdir()
    other = rng.choice(["block.nml", "./block.nml", "sub/block.nml", str(scene.folder / "block.nml")])
    if other.startswith("sub"):
        text = (scene.folder / "block.nml").read_text().replace("'m'", "'../m'").replace("'mesh.inp'", "'../mesh.inp'")
        scene.write("sub/block.nml", text)
    scene.refused(scene.run("block.nml", other), f"block.nml and {other}")
    scene.expect(not (scene.folder / "block.h5").exists(), "refused, but something was run")


def side_by_side(scene, rng):
    """Two runs on one result: one is refused, the other's result is whole."""
    settings = {"HDF5_USE_FILE_LOCKING": rng.choice(["FALSE", "TRUE"])}
    scene.write("kick.nml", KICK.replace("DURATION", "4.0e-2"))
    first = scene.start("kick.nml", "--output", "out.h5", environment=settings)
    time.sleep(0.05 + 0.6 * rng.random())
    second = scene.run(*(["--restart"] if rng.random() < 0.3 else []), "kick.nml", "--output", "out.h5", environment=settings)
    outcome = scene.finish(first)
    statuses = sorted([outcome.status, second.status])
    scene.expect(statuses[0] == 0, f"two runs: {statuses}: {second.said[-200:]} {outcome.said[-200:]}")
    scene.right("out.h5", "two runs on one result")


def shared_cache(scene, rng):
    """Runs that start together on one cache."""
    scene.edit("block.nml", "&reduction ", "&reduction cache='cache.h5', ")
    runs = [scene.start("block.nml", "--output", f"out{k}.h5") for k in range(rng.choice([2, 3]))]
    for k, run in enumerate(runs):
        outcome = scene.finish(run)
        scene.expect(outcome.status == 0, f"run {k} on a shared cache: {outcome.status}: {outcome.said[-200:]}")
        if outcome.status == 0:
            scene.right(f"out{k}.h5", "shared cache")


def ended(scene, rng):
    """Ended by a signal at any moment; going on gives the right result."""
    which = rng.choice([signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGKILL])
    scene.write("kick.nml", KICK.replace("DURATION", "2.0e-2"))
    process = scene.start("kick.nml", "--output", "out.h5")
    # Before it has begun to watch for signals, the system ends it.
    while process.poll() is None and not is_caught(process.pid, which):
        time.sleep(0.001)
    time.sleep(0.8 * rng.random())
    process.send_signal(which)
    if which == signal.SIGKILL:
        process.communicate()
    else:
        # Before the program watches for signals nothing is begun, and the system ends it.
        outcome = scene.finish(process, ends_early=not (scene.folder / "out.h5.part").exists())
        scene.expect(outcome.status in (0, 128 + which, -which), f"{which.name}: status {outcome.status}")
    if (scene.folder / "out.h5").exists():
        with h5py.File(scene.folder / "out.h5") as file:
            file.attrs["program"]
    outcome = scene.run("--restart", "kick.nml", "--output", "out.h5")
    scene.expect(outcome.status == 0, f"restart after {which.name}: {outcome.status}: {outcome.said[-200:]}")
    if outcome.status == 0:
        scene.right("out.h5", f"restart after {which.name}")


def is_caught(pid, number):
    """Whether a process handles a signal (one that cannot be handled counts as if it did)."""
    if number == signal.SIGKILL:
        return True
    try:
        with open(f"/proc/{pid}/status", encoding="ascii", errors="replace") as file:
            caught = next((int(line.split()[1], 16) for line in file if line.startswith("SigCgt:")), 0)
    except OSError:
        return True
    return bool(caught >> (number - 1) & 1)


def broken_pipe(scene, rng):
    """Standard output is closed while the program runs (`| head -1`)."""
    process = scene.start("kick.nml", "--output", "out.h5", stdout=subprocess.PIPE)
    process.stdout.read(rng.choice([1, 100]))
    process.stdout.close()
    process.stdout = None
    outcome = scene.finish(process)
    scene.expect(outcome.status in (0, 141), f"closed pipe: status {outcome.status}: {outcome.said[-200:]}")
    if outcome.status == 0:
        scene.right("out.h5", "closed pipe")
    else:
        outcome = scene.run("--restart", "kick.nml", "--output", "out.h5")
        scene.expect(outcome.status == 0 and scene.right("out.h5", "restart after a closed pipe"), "restart after a closed pipe")


def damaged_cache(scene, rng):
    """A cache that is damaged, of another model, or of another kind."""
    scene.edit("block.nml", "&reduction ", "&reduction cache='cache.h5', ")
    scene.run("block.nml", "--output", "first.h5")
    cache = scene.folder / "cache.h5"
    way = rng.choice(["bytes", "bits", "cut", "value", "shape", "empty", "gone dataset", "other model"])
    data = bytearray(cache.read_bytes()) if cache.exists() else bytearray(100)
    if way == "bytes":
        start = rng.randrange(len(data))
        data[start:start + 64] = bytes(rng.randrange(256) for _ in range(min(64, len(data) - start)))
    elif way == "bits":
        for _ in range(rng.choice([1, 10])):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    elif way == "cut":
        data = data[:rng.randrange(1, len(data))]
    elif way == "empty":
        data = data[:0]
    if way in ("bytes", "bits", "cut", "empty"):
        cache.write_bytes(data)
    elif way == "other model":
        scene.edit("block.nml", "n_modes=20", "n_modes=12")
    else:
        with h5py.File(cache, "r+") as file:
            names = []
            file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) and item.size > 0 else None)
            name = rng.choice(names)
            values = np.asarray(file[name][()])
            if way == "value" and values.dtype.kind == "f" and values.size:
                flat = np.atleast_1d(values).ravel().copy()
                flat[rng.randrange(flat.size)] *= 1.001
                file[name][...] = flat.reshape(values.shape) if values.shape else flat[0]
            else:
                attributes = dict(file[name].attrs)
                del file[name]
                if way == "shape" and values.ndim:
                    file[name] = values[:-1]
                    for key, item in attributes.items():
                        if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS"):
                            file[name].attrs[key] = item
    outcome = scene.run("block.nml", "--output", "out.h5")
    # An empty or unreadable file may be somebody else's: then it is refused.
    scene.expect(outcome.status == 0 or (outcome.status == 2 and way in ("bytes", "bits", "cut", "empty")),
                 f"cache with {way}: {outcome.status}: {outcome.said[-200:]}")
    if outcome.status == 0:
        scene.right("out.h5", f"cache with {way}")


def unwritable(scene, rng):
    """No folder, a name that is too long, a disk that is full."""
    way = rng.choice(["folder", "long", "slash", "full"])
    if way == "full":
        from scene import limits
        outcome = scene.run("kick.nml", "--output", "out.h5", preexec=limits(file_size=rng.choice([0, 4096, 60000, 200000])))
        scene.expect(outcome.status in (0, 1, 2), f"full disk: {outcome.status}")
        return
    target = {"folder": "no/such/folder/out.h5", "long": "x" * rng.choice([255, 300, 5000]) + ".h5", "slash": "out/"}[way]
    outcome = scene.run("block.nml", "--output", target)
    scene.expect(outcome.status in (1, 2), f"result in {target[:20]}: status {outcome.status}")


KINDS = [result_is_input, result_is_input, default_name_is_input, foreign_file, special_file, same_result, side_by_side, shared_cache,
         ended, broken_pipe, damaged_cache, damaged_cache, unwritable]
assert set(name for names in USED.values() for name in names) <= set(INPUTS)
