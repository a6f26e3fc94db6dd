#!/usr/bin/env python3
"""Both couplings of half space and FE model against resolved FE contact: friction loops of two blocks under constant normal load.

    example/coupling/friction_loop.py --program MICROSLIP [--work FOLDER]

Two steel blocks of 24 x 16 mm, 6 and 4 mm high, with a hill of 6 um, are pressed together by 1500 N. A heavy mass that only moves along x rides on the upper one's top, held
by a spring: the first mode is its motion, and quasi-static modal analysis with `cycle` drives the top to and fro along x by forces
that are, but for 0.1 %, the same on all meshes. Loss of a cycle and secant stiffness (less the spring's) over the amplitude of the top.
Writes friction_loop.csv and friction_loop.png into the work folder.
"""

import h5py
import numpy as np
from scipy.interpolate import PchipInterpolator

from compare import command_line, run, write_table
from two_blocks import Case, build, interface, surface

CASE = Case(plan=(24.0, 16.0), heights=(6.0, 4.0), hill=6.0, force=1500.0, friction=0.3)
MASS, SPRING = 200.0, 2.5e8                                      # kg, N/m along x
AIMED = (0.12, 0.24, 0.38, 0.55)                               # um, of the top; the loops have less
AMPLITUDES = (0.1, 0.18, 0.3, 0.38, 0.46)                       # um, where they are compared
MESHES = [("resolved", h, None) for h in (1.0, 2 / 3, 0.5)] + \
         [(c, h, cells) for c in ("series", "scale_split") for h, cells in ((4.0, (24, 16)), (2.0, (24, 16)), (2.0, (48, 32)))]


def write_model(path, spacing, half):
    model = build(CASE, spacing, half)
    share = 0.5 if half else 1.0
    plan = model.bodies[1].plan
    a, b, c, d = plan.points[plan.quads].transpose(1, 2, 0)
    area = 0.5 * abs((c - a)[0] * (d - b)[1] - (c - a)[1] * (d - b)[0])
    weight = np.bincount(plan.quads.ravel(), np.repeat(area / 4, 4))
    model.ground("upper_end", share * SPRING, (0,), weight=weight)
    model.ground("upper_end", share * MASS, (0,), matrix="M", weight=weight)
    model.write(path)


def case_text(model, where, half, topography):
    return f"""&case title = 'friction loop', analyses = 'preload', 'linear_modes', 'qsma' /
&model source = 'hdf5', file = '{model}.h5' /
&interface name = 'joint', side_a = 'upper_pad', side_b = 'lower_pad', axis_1 = 1, 0, 0, friction = {CASE.friction}, {where} /
&topography {topography} /
&reduction n_modes = 8, cache = '{model}.cache' /
&load name = 'press', node_set = 'upper_end', direction = 0, 0, -1, size = {CASE.force * (0.5 if half else 1.0)}, distribution = 'area' /
&preload loads = 'press', load_scale = 1.0 /
&contact tolerance = {1e-8 if "fe_nodes" in where else 1e-6}, compliance = '{'dense' if "fe_nodes" in where else 'fft'}' /
&linear_modes n_modes = 2 /
&qsma mode = 1, amplitudes = {", ".join(f"{u * 1e-6}" for u in AIMED)}, steps = 4, cycle = .true., cycle_steps = 6 /
&output sensors = 'upper_end', sensor_direction = 1, 0, 0 /
"""


def measure(program, work, contact, spacing, cells):
    half = contact == "resolved"
    model = f"loop_{spacing:.4f}{'_half' if half else ''}"
    if not (work / f"{model}.h5").exists():
        write_model(work / f"{model}.h5", spacing, half)
    result = run(program, work, f"{model}_{contact}{f'_{cells[0]}' if cells else ''}",
                 case_text(model, interface(CASE, contact, cells), half, surface(CASE, work, "loop", half)))
    if result is None:
        return None
    with h5py.File(result) as f:
        stiffness = lambda frequency: MASS * (2 * np.pi * frequency) ** 2 - SPRING
        cycle = f["qsma/cycle"]
        return dict(contact=contact, spacing=spacing, cells=cells, amplitude=cycle["amplitude"][:],
                    loss=cycle["dissipated_energy"][:] * (2 if half else 1), secant=stiffness(cycle["frequency"][:]),
                    stuck=stiffness(f["linear_modes/frequency"][0]), closure=cycle["closure"][:].max())


def at(r, key):
    """Loss (J) or secant stiffness (N/m) at the amplitudes to compare, from the loops by monotone cubics in the logarithms."""
    return np.exp(PchipInterpolator(np.log(r["amplitude"]), np.log(r[key]))(np.log(np.array(AMPLITUDES) * 1e-6)))


def rows(results, reference):
    for r in results:
        loss, secant = at(r, "loss"), at(r, "secant")
        force = secant * np.array(AMPLITUDES) * 1e-6
        for k, u in enumerate(AMPLITUDES):
            yield {"contact": r["contact"], "fe_spacing_mm": f"{r['spacing']:.4f}",
                   "cells": "x".join(map(str, r["cells"])) if r["cells"] else "", "amplitude_um": u,
                   "force_over_friction_limit": f"{force[k] / (CASE.friction * CASE.force):.3f}",
                   "loss_J": f"{loss[k]:.4e}", "loss_deviation": f"{loss[k] / at(reference, 'loss')[k] - 1:+.4f}",
                   "secant_N_per_um": f"{secant[k] * 1e-6:.2f}",
                   "secant_deviation": f"{secant[k] / at(reference, 'secant')[k] - 1:+.4f}",
                   "stuck_N_per_um": f"{r['stuck'] * 1e-6:.2f}",
                   "largest_closure": f"{r['closure']:.1e}"}


def draw(path, results):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    figure, axes = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
    style = {"resolved": ("k", "FE contact"), "series": ("C3", "series"), "scale_split": ("C0", "scale split")}
    for r in results:
        kind = [s for s in results if s["contact"] == r["contact"]]
        color, name = style[r["contact"]]
        finest = r is kind[-1]
        look = dict(color=color, marker="o" if finest else "", ms=3.5, lw=1.3 if finest else 0.8, ls="-" if finest else ":",
                    label=f"{name}, FE {r['spacing']:.2g} mm")
        axes[0].loglog(r["amplitude"] * 1e6, r["loss"], **look)
        axes[1].plot(r["amplitude"] * 1e6, r["secant"] * 1e-6, **look)
    for axis, label in zip(axes, ("loss of a cycle, J", "secant stiffness, N/um")):
        axis.set_xlabel("amplitude of the top, um")
        axis.set_ylabel(label)
    axes[1].legend(fontsize=8)
    figure.savefig(path, dpi=110)


def main():
    a = command_line(__doc__, "friction_loop")
    results = [r for mesh in MESHES if (r := measure(a.program, a.work, *mesh))]
    reference = [r for r in results if r["contact"] == "resolved"][-1]
    write_table(a.work / "friction_loop.csv", list(rows(results, reference)))
    print((a.work / "friction_loop.csv").read_text())
    draw(a.work / "friction_loop.png", results)


if __name__ == "__main__":
    main()
