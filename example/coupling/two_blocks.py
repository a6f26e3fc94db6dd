#!/usr/bin/env python3
"""Both couplings of half space and FE model against resolved FE contact: two pressed blocks.

    example/coupling/two_blocks.py --program MICROSLIP [--work FOLDER] [--cases hill bore ...]

The lower block stands fixed, a load presses on the upper one's top and a small one along x shears it. Coarse FE meshes with a
boundary-element grid and coupling = 'series' and 'scale_split', fine ones with contact at the FE nodes (grid = 'fe_nodes') as
the reference; the fine ones are halves, y > 0, held by stiff springs in the plane of symmetry. Writes a table and a picture
per case into the work folder.
"""
from dataclasses import dataclass

import h5py
import numpy as np

from blocks import ALUMINIUM, MM, STEEL, Body, Model, bored_plan, grid_plan, layers, lines
from compare import Raster, command_line, contact_points, distance, run, write_table

SPRING, WALL = 1e6, 1e12                       # N/m: all that holds the upper block where nothing touches; a symmetry node


@dataclass
class Case:
    """Blocks (lower, upper), surface, loads, and the meshes to compare."""
    plan: tuple = (48.0, 32.0)                 # mm
    lower_plan: tuple = None                   # mm, as the upper one
    heights: tuple = (12.0, 16.0)              # mm
    materials: tuple = (STEEL, STEEL)
    bore: str = ""                             # '', 'square' of 8 mm or 'round' of radius 4 mm
    wave: tuple = None                         # length along x, mm, and amplitude, um, of a surface of waves
    hill: float = 0.0                          # um
    force: float = 6000.0                      # N
    friction: float = 0.6
    steps: int = 1
    resolved: tuple = (2.0, 4 / 3, 1.0, 2 / 3)
    fine_y: float = 0.0                        # mm, spacing along y of resolved meshes with waves along x
    coarse: tuple = ()                         # (FE spacing, cells) or (FE spacing, cells, 'C3D20')
    split_only: tuple = ()                     # further ones, for 'scale_split' alone
    square: float = 2.0                        # mm, pressures are compared as means over squares


WAVE_MESHES = dict(plan=(24.0, 8.0), heights=(8.0, 8.0), force=2000.0, resolved=(0.5, 0.25, 0.125), fine_y=1.0,
                   coarse=((4.0, (96, 12)), (2.0, (96, 12))))
CASES = {
    "flat": Case(bore="square", resolved=(2.0, 4 / 3, 1.0), coarse=((4.0, (48, 32)), (2.0, (48, 32))), split_only=((2.0, (60, 40)),)),
    "hill": Case(bore="square", hill=12.0, coarse=((4.0, (48, 32)), (4.0, (48, 32), "C3D20"), (2.0, (72, 48))),
                 split_only=((2.0, (48, 32)), (2.0, (60, 40)), (2.0, (96, 64)), (4 / 3, (96, 64)))),
    "long waves": Case(wave=(8.0, 0.96), **WAVE_MESHES),
    "short waves": Case(wave=(2.0, 0.24), **WAVE_MESHES),
    "round bore": Case(plan=(32.0, 32.0), heights=(10.0, 12.0), bore="round", hill=6.0, force=5000.0,
                       resolved=(2.0, 1.0, 2 / 3), coarse=((4.0, (40, 40)), (2.0, (40, 40)))),
    "steel on aluminium": Case(plan=(32.0, 24.0), heights=(10.0, 10.0), materials=(ALUMINIUM, STEEL), hill=4.0, force=4000.0,
                               friction=0.3, steps=4, resolved=(2.0, 1.0, 2 / 3), coarse=((4.0, (40, 30)), (2.0, (40, 30)))),
    "unequal blocks": Case(plan=(32.0, 24.0), lower_plan=(48.0, 40.0), heights=(14.0, 8.0), hill=4.0, force=4000.0,
                           resolved=(2.0, 1.0, 2 / 3), coarse=((4.0, (40, 30)), (2.0, (40, 30)))),
}


def plan_mesh(case, size, spacing, half):
    x = lines(-size[0] / 2, size[0] / 2, spacing)
    y = lines(-size[1] / 2, size[1] / 2, max(spacing, case.fine_y) if half else spacing)
    if case.bore == "round":
        plan = bored_plan(x, y, 4.0, spacing)
    else:
        plan = grid_plan(x, y)
        if case.bore:
            plan = plan.keep(lambda a, b: (abs(a) > 4) | (abs(b) > 4))
    return plan.keep(lambda a, b: b > 0) if half else plan


def build(case, spacing, half, quadratic=False):
    """The model of both blocks, with elements of about `spacing` mm in the plane of the joint."""
    first = 0.75 * spacing
    lower = Body(plan_mesh(case, case.lower_plan or case.plan, spacing, half), -layers(case.heights[0], first)[::-1],
                 case.materials[0], quadratic)
    upper = Body(plan_mesh(case, case.plan, spacing, half), layers(case.heights[1], first), case.materials[1], quadratic)
    model = Model([lower, upper])
    a, b = (s / 2 + 1e-6 for s in case.plan)
    for k, (name, far) in enumerate((("lower", -case.heights[0]), ("upper", case.heights[1]))):
        model.name(f"{name}_pad", k, lambda x, y, z: (abs(z) < 1e-6) & (abs(x) < a) & (abs(y) < b))
        model.name(f"{name}_end", k, lambda x, y, z: abs(z - far) < 1e-6)
        if half:
            model.name(f"{name}_middle", k, lambda x, y, z: abs(y) < 1e-6)
            model.ground(f"{name}_middle", WALL * len(model.sets[f"{name}_middle"]), (1,))
    model.fix("lower_end")
    model.ground("upper_end", SPRING / (2 if half else 1))
    return model


def interface(case, contact, cells):
    """Keys of &interface: contact points and coupling."""
    if contact == "resolved":
        return "grid = 'fe_nodes'"
    young, poisson = (", ".join(str(case.materials[k][m]) for k in (1, 0)) for m in (0, 1))
    holes = ", holes = 0, 0, 4e-3" if case.bore == "round" else ""
    return f"nx = {cells[0]}, ny = {cells[1]}, young_modulus = {young}, poisson_ratio = {poisson}, coupling = '{contact}'{holes}"


def case_text(case, model, where, half, topography):
    share = 0.5 if half else 1.0
    return f"""&case title = 'two blocks', analyses = 'preload', 'transient' /
&model source = 'hdf5', file = '{model}.h5' /
&interface name = 'joint', side_a = 'upper_pad', side_b = 'lower_pad', axis_1 = 1, 0, 0, friction = {case.friction}, {where} /
&topography {topography} /
&reduction n_modes = 60, cache = '{model}.cache' /
&load name = 'press', node_set = 'upper_end', direction = 0, 0, -1, size = {case.force * share}, distribution = 'area' /
&load name = 'shear', node_set = 'upper_end', direction = 1, 0, 0, size = {0.004 * case.force * share}, distribution = 'area' /
&preload loads = 'press', 'shear', load_scale = 1.0, 1.0, steps = {case.steps} /
&contact tolerance = 1e-7, compliance = '{'dense' if "fe_nodes" in where else 'fft'}' /
! One step of nothing: its first sample is the preload, at the sensors
&transient time_step = 1e-8, duration = 2e-8 /
&excitation load = 'shear', kind = 'half_sine', amplitude = 1e-9, duration = 1e-8 /
&output sensors = 'upper_end', 'upper_end', sensor_direction = 0, 0, -1, 1, 0, 0 /
"""


def height(case, x, y):
    """The surface at x, y (mm), in m: waves along x, or a raised cosine down to the corners of the pad."""
    if case.wave:
        return case.wave[1] * 1e-6 * np.cos(2 * np.pi * x / case.wave[0]) + 0 * y
    return case.hill * 1e-6 * np.cos(np.pi * np.hypot(x, y) / np.hypot(*case.plan)) ** 2


def surface(case, work, name, half):
    """The surface as a file; its coordinates count from the middle of the pad, or of the half pad."""
    path = work / f"{name.replace(' ', '_')}{'_half' if half else ''}_surface.h5"
    if not path.exists():
        x, y = (np.linspace(-0.51 * s, 0.51 * s, n) for s, n in zip(case.plan, (1601, 5 if case.wave else 801)))
        with h5py.File(path, "w") as f:
            f["x"], f["y"] = x * MM, (y - case.plan[1] / 4 * half) * MM
            f["z"] = height(case, x[:, None], y[None, :])
    return f"source = 'file', file = '{path.name}', sense = 'height', unit_length = 'm'"


def measure(program, work, name, case, spacing, contact, cells=None, kind="C3D8I"):
    half = contact == "resolved"
    model = f"{name}_{kind}_{spacing:.4f}{'_half' if half else ''}".replace(" ", "_")
    if not (work / f"{model}.h5").exists():
        build(case, spacing, half, kind == "C3D20").write(work / f"{model}.h5")
    label = f"{model}_{contact}" + (f"_{cells[0]}" if cells else "")
    result = run(program, work, label, case_text(case, model, interface(case, contact, cells), half, surface(case, work, name, half)))
    if result is None:
        return None
    with h5py.File(result) as f:
        x, y, p = contact_points(f, "preload/interface_1/pressure")
        origin = f["interface_1/origin"][:] / MM
        moved, points = f["transient/sensor"][0], int(f["model/contact_points"][()])
    inside = {"": lambda a, b: a < 1e9, "round": lambda a, b: a**2 + b**2 > 16,
            "square": lambda a, b: (abs(a) > 4) | (abs(b) > 4)}[case.bore]
    raster = Raster(case.plan, inside)
    place = x + origin[0], y + origin[1]
    # The program lets the highest points touch: what they are below the true summit belongs to the approach.
    moved[0] += height(case, raster.x[raster.inside], raster.y[raster.inside]).max() - height(case, *place).max()
    fine, smooth = raster.field(*place, p), raster.field(*place, p, smooth=True)
    return dict(case=name, contact=contact, elements=kind, spacing=spacing, cells=cells, points=points,
                normal=case.force / moved[0], tangential=0.004 * case.force / moved[1], closed=(fine > 0).sum() * 0.01,
                carried=fine.sum() * 1e-8 / case.force, fine=fine, smooth=smooth, squares=raster.means(fine, case.square))


def row(r, reference):
    off = lambda key: f"{r[key] / reference[key] - 1:+.4f}"
    return {"case": r["case"], "contact": r["contact"], "elements": r["elements"], "fe_spacing_mm": f"{r['spacing']:.4f}",
            "cells": "x".join(map(str, r["cells"])) if r["cells"] else "", "points_in_potential_contact": r["points"],
            "normal_N_per_um": f"{r['normal'] * 1e-6:.2f}", "normal_deviation": off("normal"),
            "tangential_N_per_um": f"{r['tangential'] * 1e-6:.2f}", "tangential_deviation": off("tangential"),
            "closed_mm2": f"{r['closed']:.1f}", "closed_deviation": off("closed"),
            "pressure_deviation_squares": f"{distance(r['squares'], reference['squares']):.4f}",
            "pressure_deviation_points": f"{distance(r['smooth'], reference['smooth']):.4f}",
            "pressure_deviation_cells": f"{distance(r['fine'], reference['fine']):.4f}",
            "force_in_raster": f"{r['carried']:.4f}"}


def draw(path, name, case, results):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    same = lambda r: r["elements"] == "C3D8I" and r["cells"] in (None, case.coarse[-1][1])
    shown = [[r for r in results if r["contact"] == c and same(r)][-1] for c in ("resolved", "series", "scale_split")]
    size, positive = case.plan, shown[0]["fine"][shown[0]["fine"] > 0]
    top = np.quantile(positive, 0.99) * 1e-6
    figure, axes = plt.subplots(1, len(shown), figsize=(11, 0.9 + 3.3 * size[1] / size[0]), squeeze=False, layout="constrained")
    for axis, r in zip(axes[0], shown):
        image = axis.imshow(r["fine"] * 1e-6, origin="lower", vmin=0, vmax=top, cmap="inferno",
                            extent=(-size[0] / 2, size[0] / 2, -size[1] / 2, size[1] / 2))
        axis.set_title(f"{name}: {r['contact'].replace('_', ' ')}, FE {r['spacing']:.3g} mm", fontsize=9)
    figure.colorbar(image, ax=axes[0], label="pressure, MPa")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main():
    a = command_line(__doc__, "two_blocks", cases=dict(nargs="+", choices=CASES, default=list(CASES)))
    for name in a.cases:
        case = CASES[name]
        results = [measure(a.program, a.work, name, case, h, "resolved") for h in case.resolved]
        results += [measure(a.program, a.work, name, case, mesh[0], coupling, *mesh[1:]) for coupling, meshes in
                    (("series", case.coarse), ("scale_split", case.coarse + case.split_only)) for mesh in meshes]
        results = [r for r in results if r]
        reference = [r for r in results if r["contact"] == "resolved"][-1]
        stem = a.work / name.replace(" ", "_")
        write_table(stem.with_suffix(".csv"), [row(r, reference) for r in results])
        print(stem.with_suffix(".csv").read_text(), flush=True)
        draw(stem.with_suffix(".png"), name, case, results)


if __name__ == "__main__":
    main()
