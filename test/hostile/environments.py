"""Attempts on the environment: threads, limits, names of files and folders, standard input and output."""

import os
import subprocess

from scene import limits

MB = 2**20


def threads(scene, rng):
    """What the environment can say of threads."""
    choices = {"OMP_THREAD_LIMIT": ["1", "2", "3"], "OMP_DYNAMIC": ["true", "false"], "OMP_MAX_ACTIVE_LEVELS": ["0", "1", "8"],
               "OMP_NUM_THREADS": ["1", "2", "3", "1000", "1000000", "2,2", "0", "-1", "x"], "OMP_NESTED": ["true"],
               "OPENBLAS_NUM_THREADS": ["1", "2", "500"], "GOTO_NUM_THREADS": ["7"], "OMP_PROC_BIND": ["true", "close"],
               "OMP_SCHEDULE": ["dynamic,1"], "OMP_WAIT_POLICY": ["active", "passive"], "OMP_CANCELLATION": ["true"],
               "OMP_STACKSIZE": ["16k", "100k", "1M", "64M"], "OMP_PLACES": ["cores", "{0}"], "MICROSLIP_RESTARTED": ["1", "no"],
               "OPENBLAS_CORETYPE": ["Haswell", "nonsense"], "GOMP_SPINCOUNT": ["0", "infinity"]}
    environment = {name: rng.choice(choices[name]) for name in rng.sample(sorted(choices), rng.choice([1, 2, 3]))}
    environment.setdefault("OMP_NUM_THREADS", rng.choice([None, "2"]))
    options = rng.choice([[], [], ["--threads", "2"], ["--threads", "1000000"]])
    case = rng.choice(["block.nml", "scan.nml"])
    outcome = scene.run(*options, case, "--output", "out.h5", environment=environment)
    if outcome.status == 0:
        scene.right("out.h5", f"{environment} {options}")
    scene.expect(outcome.status in (0, 1, 2) and (outcome.status == 0 or outcome.said.strip()), f"{environment}")


def memory(scene, rng):
    """Limits of stack, address space and open files."""
    kind = rng.choice(["stack", "address_space", "files"])
    value = {"stack": [64 << 10, 128 << 10, 500 << 10, MB, 8 * MB], "files": [4, 6, 10, 64],
             "address_space": [100 * MB, 200 * MB, 280 * MB, 350 * MB, 500 * MB, 1000 * MB]}[kind]
    value = rng.choice(value)
    outcome = scene.run("scan.nml", "--output", "out.h5", preexec=limits(**{kind: value}),
                        environment={"OMP_NUM_THREADS": rng.choice(["1", "2"])})
    if outcome.status == 0:
        scene.right("out.h5", f"{kind} {value}")


def names(scene, rng):
    """Blanks, quotes, umlauts, brackets in names of folders and results."""
    folder = scene.folder / rng.choice(["with blank", "Prüfstand", "it's", 'say "x"', "a;b", "$HOME", "-dash", "x" * 200, "日本", "%41",
                                        "back\\slash", "[x]", "tab\there"])
    folder.mkdir()
    for name in ("block.nml", "m.sti", "m.mas", "m.dof", "mesh.inp", "sets.inp"):
        os.rename(scene.folder / name, folder / name)
        scene.protected[f"{folder.name}/{name}"] = scene.protected.pop(name)
    if rng.random() < 0.5:
        outcome = scene.run("block.nml", "--output", "../out.h5", cwd=folder)
    else:
        outcome = scene.run(folder / "block.nml", "--output", scene.folder / "out.h5")
    # CalculiX, and so this program, may take *INCLUDE relative to the current folder.
    scene.expect(outcome.status in (0, 2), f"folder {folder.name}: {outcome.status}")
    if outcome.status == 0:
        scene.right("out.h5", f"folder {folder.name}")


def streams(scene, rng):
    """Standard streams that are closed, full, or hold the case."""
    way = rng.choice(["stdin case", "pipe", "full", "closed", "no home", "locale"])
    if way == "stdin case":
        outcome = scene.run("-", "--output", "out.h5", text=(scene.folder / "block.nml").read_bytes())
    elif way == "pipe":
        outcome = scene.run("/dev/stdin", "--output", "out.h5", text=(scene.folder / "scan.nml").read_bytes())
    elif way == "full":
        with open("/dev/full", "w") as full:
            outcome = scene.run("block.nml", "--output", "out.h5", stdout=full)
        scene.expect(outcome.status in (0, 1, 141), f"stdout full: {outcome.status}")
        return
    elif way == "closed":
        def close():
            limits()()
            for descriptor in rng_streams:
                os.close(descriptor)
        rng_streams = rng.choice([(0,), (1,), (0, 1)])
        outcome = scene.run("block.nml", "--output", "out.h5", preexec=close, stdout=subprocess.DEVNULL)
    elif way == "no home":
        outcome = scene.run("block.nml", "--output", "out.h5", environment={"HOME": None, "PATH": None, "TMPDIR": "/no/such", "USER": None})
    else:
        outcome = scene.run("block.nml", "--output", "out.h5", environment={"LC_ALL": rng.choice(["de_DE.UTF-8", "xx", "C", "tr_TR"]),
                                                                            "LANG": "de_DE"})
    scene.expect(outcome.status == 0, f"{way}: {outcome.status}: {outcome.said[-200:]}")
    if outcome.status == 0:
        scene.right("out.h5", way)


def arguments(scene, rng):
    """Command lines with mistakes."""
    line = rng.choice([["--chek", "block.nml"], ["block.nml", "--output"], ["--threads", "two", "block.nml"], ["--threads", "-1", "block.nml"],
                       ["--output", "--check", "block.nml"], [], ["block"], ["blok.nml"], ["m.sti"], ["model.h5"], ["scan.h5", "--check"],
                       ["."], ["/dev/null"], ["block.nml", "no.nml"], ["--restart", "--check", "no.nml"], ["--output", "", "block.nml"],
                       ["--write-model", "", "block.nml"], ["--output", "a.h5", "block.nml", "scan.nml"], ["--quiet", "--verbose", "block.nml"]])
    scene.refused(scene.run(*line), " ".join(line))


KINDS = [threads, threads, memory, names, streams, arguments]
