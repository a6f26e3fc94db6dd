#!/usr/bin/env python3
"""Finds keys of the case file that are accepted and change nothing.

    test/key_effects.py --program PROGRAM [NAME ...]

Every variation below sets one key of a right case to another allowed value. It must change the results, or be refused (exit
status 2), or be one of the keys whose task is another one (file names, titles, how often the file is published). Results are
all numbers of the result file but times, memory and the texts of the set-up. Takes some minutes; not a part of scripts/test.

The model is that of test/cases/16_measured_surface, two blocks with matrices by CalculiX (`ccx`).
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).resolve().parent
SOURCE = HERE / "cases" / "16_measured_surface"
MODEL = "source='calculix', file='m', mesh_file='mesh.inp', unit_length='mm', unit_mass='t', unit_time='s'"
#: What tells nothing about the motion.
LEFT_OUT = ("setup", "provenance", "timing", "memory", "run", "warnings")


def groups(**others):
    """The groups of a right case, in order; `others` replace or add (None: removes)."""
    base = {
        "case": "analyses='preload', 'linear_modes', 'transient'",
        "model": MODEL,
        "interface": "name='joint', side_a='a_contact', side_b='b_contact', friction=0.3, young_modulus=200e9, "
                     "poisson_ratio=0.3, nx=16, ny=12",
        "topography": "name='hill', source='hill', height=4e-6, center=3e-3, 2e-3",
        "reduction": "n_modes=12",
        "load": "name='press', node_set='top', direction=0,0,-1, size=1.0, distribution='area'",
        "load 2": "name='push', node_set='top', direction=1,0.3,0.2, size=1.0",
        "preload": "loads='press', interface_force=1000.0",
        "linear_modes": "n_modes=4",
        "transient": "duration=4e-4",
        "excitation": "load='push', kind='half_sine', amplitude=200.0, duration=1e-4",
        "output": "sensors='top', sensor_direction=1,0,0, snapshots=2e-4"}
    base.update(others)
    return {name: text for name, text in base.items() if text is not None}


RINGDOWN = groups(case="analyses='preload', 'linear_modes', 'transient', 'ringdown'", transient="duration=3e-3",
                  ringdown="periods=4", damping="modal_ratio=0.01", output="sensors='top', sensor_direction=1,0,0")
QSMA = groups(case="analyses='preload', 'linear_modes', 'qsma'", transient=None, excitation=None, **{"load 2": None},
              qsma="largest_amplitude=1e-7, levels=3", output="sensors='top', sensor_direction=1,0,0")
SETTLING = groups(case="analyses='preload', 'linear_modes', 'settling'", transient=None, excitation=None,
                  settling="load='push', amplitude=200.0, impacts=2, duration=1e-4, interval=1e-3, periods=5",
                  damping="modal_ratio=0.01", output="sensors='top', sensor_direction=1,0,0")
BALANCE = groups(case="analyses='preload', 'linear_modes', 'harmonic_balance'", transient=None, excitation=None,
                 damping="modal_ratio=0.01", output="sensors='top', sensor_direction=1,0,0",
                 harmonic_balance="load='push', levels=5.0, frequency_range=1000.0, 3000.0, harmonics=3, samples=20")
EPMC = groups(case="analyses='preload', 'linear_modes', 'epmc'", transient=None, excitation=None, **{"load 2": None},
              output="sensors='top', sensor_direction=1,0,0",
              epmc="amplitude_range=1e-9, 1e-8, points=3, harmonics=3, samples=20")
SINE = groups(excitation="load='push', kind='harmonic', amplitude=100.0, frequency=8000.0")
STEPPED = groups(excitation="load='push', kind='stepped_sine', amplitude=100.0, frequency_from=20000.0, frequency_to=30000.0, "
                            "frequency_count=3, settle_periods=3, measure_periods=3, harmonics=1", transient="",
                 reduction="n_modes=12", output="sensors='top', sensor_direction=1,0,0")
SWEPT = groups(excitation="load='push', kind='swept_sine', amplitude=100.0, frequency_from=20000.0, frequency_to=30000.0, "
                          "rate=1e7, measure_periods=3, harmonics=1", transient="",
               output="sensors='top', sensor_direction=1,0,0")
TABLE = groups(excitation="load='push', kind='file', file='table.txt'")
SCAN = groups(case="analyses='preload'", linear_modes=None, transient=None, excitation=None, output=None, **{"load 2": None},
              topography="name='scan', source='file', file='right_scan.h5', sense='height'")
NODES = groups(case="analyses='preload'", linear_modes=None, transient=None, excitation=None, output=None, **{"load 2": None},
               interface="name='joint', side_a='a_contact', side_b='b_contact', friction=0.3, grid='fe_nodes'")
SCALED = groups(case="analyses='preload'", linear_modes=None, transient=None, excitation=None, output=None,
                preload="loads='press', 'push', load_scale=1000.0, 100.0")
FINE = {**SCALED, "interface": SCALED["interface"].replace("nx=16, ny=12", "nx=28, ny=20"),
        "topography": SCALED["topography"].replace("height=4e-6", "height=60e-6")}
PRESSED = groups(case="analyses='preload', 'linear_modes'", transient=None, excitation=None, output=None,
                 preload="loads='push', load_scale=100.0", topography=None, load=None,
                 interface="name='joint', side_a='a_contact', side_b='b_contact', friction=0.3, young_modulus=200e9, "
                           "poisson_ratio=0.3, nx=16, ny=12, initial_pressure=1e6")

STUCK = {name: text for name, text in {**PRESSED, "case": "analyses='linear_modes'"}.items() if name not in ("preload", "load 2")}

#: (case, group, keys to set); a key that is there already is replaced.
VARIATIONS = [
    (SCALED, "model", "unit_length='m'"), (SCALED, "model", "unit_mass='kg'"), (SCALED, "model", "unit_time='ms'"),
    (SCALED, "interface", "axis_1=0,1,0"), (SCALED, "interface", "friction=0.1"), (SCALED, "interface", "young_modulus=100e9"),
    (SCALED, "interface", "poisson_ratio=0.1"), (SCALED, "interface", "young_modulus=200e9, 70e9"),
    (SCALED, "interface", "nx=14"), (SCALED, "interface", "ny=10"), (SCALED, "interface", "extent=-15e-3,15e-3,-10e-3,10e-3"),
    (SCALED, "interface", "holes=0,0,4e-3"), (SCALED, "interface", "coupling='series'"), (SCALED, "interface", "initial_pressure=1e6"),
    (FINE, "interface", "potential='all'"), (FINE, "interface", "potential_margin=30e-6"),
    (SCALED, "interface", "region=0,1,0,1,0,1"), (SCALED, "interface", "plane_normal=0,0,1"),
    (STUCK, "interface", "potential_margin=1e-9"),
    (PRESSED, "interface", "initial_pressure=2e6"), (PRESSED, "interface", "topography='hill'"),
    (NODES, "interface", "axis_1=0,1,0"),
    (NODES, "interface", "coupling='series'"), (NODES, "interface", "extent=-1,1,-1,1"), (NODES, "contact", "compliance='dense'"),
    *[(SCALED, "topography", keys) for keys in (
        "height=5e-6", "center=0,0", "level='mean'", "level='plane'", "filter_wavelength=5e-3", "offset=1e-3,0", "rotation=10",
        "scale=2", "sense='gap'", "layout='z[y,x]'", "unit_length='mm'", "x_name='x'", "file='right_scan.h5'")],
    *[(SCAN, "topography", keys) for keys in (
        "level='mean'", "level='plane'", "filter_wavelength=5e-3", "offset=1e-3,0", "rotation=2", "scale=2", "sense='gap'",
        "layout='z[y,x]'", "layout='z[x,y]'", "unit_length='mm'", "unit_length='um'", "z_name='gap'", "height=1e-6", "center=0,0")],
    (SCALED, "reduction", "method='macneal'"), (SCALED, "reduction", "n_modes=20"), (SCALED, "reduction", "cache='cache.h5'"),
    (SCALED, "damping", "modal_ratio=0.01"), (SCALED, "damping", "ratio=0.01, reference_mode=1"),
    (SCALED, "damping", "mass_proportional=10"),
    *[(groups(), "damping", keys) for keys in (
        "modal_ratio=0.02", "ratio=0.02, reference_mode=1", "ratio=0.02, reference_mode=2",
        "ratio=0.02, reference_mode=1, reference='preloaded'", "mass_proportional=100")],
    *[(groups(), "contact", keys) for keys in (
        "solver='jacobi'", "solver='newton'", "solver='gauss_seidel'", "tolerance=1e-5", "max_iterations=1", "max_iterations=50",
        "normal_law='velocity'", "compliance='dense'", "compliance='fft'")],
    (SCALED, "contact", "normal_law='velocity'"), (SCALED, "contact", "max_iterations=1"), (SCALED, "contact", "tolerance=1e-3"),
    (groups(), "load", "distribution='uniform'"), (groups(), "load", "size=2.0"), (groups(), "load", "direction=0,0.1,-1"),
    (groups(), "load", "mode=1"), (groups(), "load", "motion='rotation'"), (groups(), "load", "center=1,1"),
    (groups(), "load 2", "size=2.0"), (groups(), "load 2", "distribution='area'"), (groups(), "preload", "interface_force=900"),
    (groups(), "preload", "steps=3"), (SCALED, "preload", "load_scale=1000,120"), (SCALED, "preload", "steps=3"),
    (groups(), "linear_modes", "n_modes=3"), (groups(), "transient", "duration=3e-4"), (groups(), "transient", "time_step=1e-7"),
    (groups(), "transient", "safety=0.5"), (groups(), "transient", "time_step=1e-7, safety=0.5"),
    *[(groups(), "excitation", keys) for keys in (
        "amplitude=100", "start=5e-5", "duration=5e-5", "times=0,2e-4", "times=0,2e-4, start=1e-5", "frequency=100", "phase=90",
        "ramp=1e-4", "rate=1", "harmonics=3", "file='table.txt'")],
    *[(SINE, "excitation", keys) for keys in ("frequency=9000", "phase=90", "ramp=1e-4", "start=1e-4", "duration=1e-4")],
    *[(STEPPED, "excitation", keys) for keys in (
        "settle_periods=4", "measure_periods=4", "harmonics=2", "steady_tolerance=1e-3", "steady_tolerance=1e-3, most_windows=3",
        "most_windows=3", "frequency_count=4", "frequency_to=28000", "frequencies=20000,25000", "phase=30", "ramp=1e-4",
        "start=1e-4", "sweep='log'", "rate=1")],
    *[(SWEPT, "excitation", keys) for keys in (
        "rate=2e7", "sweep='log', rate=5e4", "frequency_to=28000", "measure_periods=4", "harmonics=2", "phase=30", "ramp=1e-4",
        "start=1e-4", "settle_periods=3", "steady_tolerance=1e-3")],
    *[(TABLE, "excitation", keys) for keys in ("amplitude=2", "start=1e-5", "phase=30", "ramp=1e-4", "duration=1e-4")],
    *[(QSMA, "qsma", keys) for keys in (
        "mode=2", "amplitudes=1e-8,2e-8", "largest_amplitude=2e-7", "smallest_amplitude=1e-8", "levels=4", "spacing='linear'",
        "sensor='top'", "steps=2", "cycle=.true.", "cycle_steps=8", "cycle=.true., cycle_steps=8")],
    *[(RINGDOWN, "ringdown", keys) for keys in ("mode=1", "sensor='top'", "periods=5", "overlap=0.5", "start=4e-4")],
    *[(SETTLING, "settling", keys) for keys in (
        "amplitude=100", "impacts=3", "duration=5e-5", "interval=1.2e-3", "mode=2", "periods=4", "ringdown=.true.",
        "time_step=1e-7", "safety=0.5", "amplitude=200,100", "amplitude=200,100, impacts=2")],
    *[(BALANCE, "harmonic_balance", keys) for keys in (
        "levels=6.0", "frequency_range=1000,3100", "harmonics=4", "samples=30", "frequency_step=100", "response_step=0.1",
        "tolerance=1e-3", "max_points=3", "sensor='top'")],
    *[(EPMC, "epmc", keys) for keys in (
        "mode=2", "amplitude_range=1e-9,2e-8", "points=4", "harmonics=4", "samples=30", "response_step=0.001", "tolerance=1e-3",
        "max_points=2", "sensor='top'")],
    *[(groups(), "output", keys) for keys in (
        "sensors='top', 'top', sensor_direction=1,0,0,0,0,1", "sensor_direction=0,0,1", "stride=2", "snapshots=1e-4",
        "checkpoint_interval=1", "checkpoint_steps=10")],
    (QSMA, "output", "snapshots=1e-4"), (QSMA, "output", "stride=2"), (QSMA, "output", "checkpoint_steps=10"),
    (QSMA, "contact", "normal_law='velocity'"), (BALANCE, "contact", "normal_law='velocity'"),
    (QSMA, "damping", "modal_ratio=0.02"), (EPMC, "damping", "modal_ratio=0.02"),
    (groups(), "case", "title='another'"),
]
#: Accepted without an effect on the results, and why.
EXPECTED = {
    ("case", "title='another'"): "a text",
    ("reduction", "cache='cache.h5'"): "the same reduced model, kept",
    ("output", "checkpoint_interval=1"): "when the file is published",
    ("contact", "compliance='dense'"): "the choice of 'auto' here",
    ("ringdown", "sensor='top'"): "the default", ("qsma", "sensor='top'"): "the default",
    ("harmonic_balance", "sensor='top'"): "the default", ("epmc", "sensor='top'"): "the default",
    ("qsma", "cycle=.true."): "loops run by themselves here",
    ("topography", "layout='z[x,y]'"): "what the file's shape says",
    ("topography", "level='mean'"): "a constant; the highest point is put at 0 afterwards",
    ("contact", "max_iterations=50"): "a limit that is not reached",
    ("contact", "max_iterations=1"): "a limit that is not reached",
}


def text_of(case):
    return "\n".join(f"&{name.split()[0]} {text} /" for name, text in case.items()) + "\n"


def keys_in(text):
    """Pieces key=value[, value...] of a group's text."""
    pieces, depth = [], False
    for piece in text.split(","):
        quoted = piece.count("'") % 2
        if "=" in piece and not depth:
            pieces.append(piece.strip())
        elif pieces:
            pieces[-1] += "," + piece
        depth ^= bool(quoted)
    return pieces


def varied(case, group, keys):
    """The case with some keys of a group set."""
    new = {piece.split("=")[0].strip(): piece for piece in keys_in(keys)}
    old = [piece for piece in keys_in(case.get(group, "")) if piece.split("=")[0].strip() not in new]
    return {**case, group: ", ".join([*old, *new.values()])}


def run(program, folder, name, case):
    """Exit status, what was said, numbers of the result file."""
    (folder / f"{name}.nml").write_text(text_of(case))
    done = subprocess.run([program, f"{name}.nml", "--output", f"{name}_out.h5"], cwd=folder, capture_output=True, timeout=600,
                          env={**os.environ, "OMP_NUM_THREADS": "1"})
    said = (done.stdout + done.stderr).decode(errors="replace")
    numbers = {}
    result = folder / f"{name}_out.h5"
    if result.exists():
        with h5py.File(result) as file:
            def keep(path, item):
                if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and path.split("/")[0] not in LEFT_OUT \
                        and "seconds" not in path:
                    numbers[path] = item[()]
            file.visititems(keep)
    return done.returncode, said, numbers


def differ(one, other):
    """Datasets that differ."""
    return [path for path in sorted(set(one) | set(other)) if path not in one or path not in other
            or np.shape(one[path]) != np.shape(other[path]) or not np.array_equal(one[path], other[path], equal_nan=True)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    parser.add_argument("names", nargs="*", help="only groups of these names")
    arguments = parser.parse_args()
    program = str(Path(arguments.program).resolve())
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name in ("m.inp", "mesh.inp", "right_scan.h5"):
            shutil.copy(SOURCE / name, folder)
        (folder / "table.txt").write_text("0 0\n1e-4 100\n2e-4 0\n3e-4 50\n")
        subprocess.run(["ccx", "-i", "m"], cwd=folder, capture_output=True, timeout=120, env={**os.environ, "OMP_NUM_THREADS": "1"})
        chosen = [v for v in VARIATIONS if not arguments.names or v[1].split()[0] in arguments.names]
        bases, faults = {}, 0
        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            for case, *_ in chosen:
                if text_of(case) not in bases:
                    bases[text_of(case)] = pool.submit(run, program, folder, f"base{len(bases)}", case)
            jobs = [(v, pool.submit(run, program, folder, f"case{k}", varied(*v))) for k, v in enumerate(chosen)]
            for (case, group, keys), job in jobs:
                base = bases[text_of(case)].result()
                status, said, numbers = job.result()
                last = said.strip().splitlines()[-1][-300:] if said.strip() else ""
                changed = differ(base[2], numbers)
                if base[0] != 0:
                    verdict, fault = f"base case failed: {base[1].strip().splitlines()[-1][-300:]}", True
                elif status == 2:
                    verdict, fault = f"refused: {last}", False
                elif status != 0:
                    verdict, fault = f"status {status}: {last}", False
                elif changed:
                    verdict, fault = f"{len(changed)} datasets differ", False
                elif (group, keys) in EXPECTED:
                    verdict, fault = f"no effect: {EXPECTED[group, keys]}", False
                else:
                    verdict, fault = "NO EFFECT", True
                faults += fault
                print(f"{'FAILED' if fault else 'ok    '}  &{group} {keys}: {verdict}", flush=True)
    print(f"{len(chosen) - faults} passed, {faults} failed")
    sys.exit(faults > 0)


if __name__ == "__main__":
    main()
