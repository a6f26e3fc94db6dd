#!/usr/bin/env python3
"""Both couplings of half space and FE model against resolved FE contact: narrow pads at a free edge and away from it.

    example/coupling/free_edge.py --program MICROSLIP [--work FOLDER]

Two steel blocks of 32 x 12 mm, 6 mm high each, joined by two flat pads of 4 x 12 mm: at the free edges x = -16 and 16 mm, or 4 mm
from the middle. All of it is closed and sticks (initial pressure 10 MPa, friction 10). The top is pressed by 1 N and sheared by 1 N along x,
across the pads. What the pads add to the
compliance of the blocks joined all over is compared. Writes free_edge.csv into the work folder.
"""

import h5py
import numpy as np

from blocks import Body, Model, grid_plan, layers, lines
from compare import command_line, run, write_table
from two_blocks import SPRING, WALL, Case, interface

CASE = Case(plan=(32.0, 12.0), heights=(6.0, 6.0), force=1.0)
PADS = {"at the edge": (12.0, 16.0), "inside": (4.0, 8.0), "all over": (0.0, 16.0)}     # mm, abs(x)
MESHES = [("resolved", h) for h in (1.0, 0.5, 1 / 3)] + [(c, h) for c in ("series", "scale_split") for h in (4.0, 2.0, 1.0)]
CELL = 1 / 3                                                                            # mm


def write_model(path, spacing, half):
    a, b = CASE.plan
    plan = grid_plan(lines(-a / 2, a / 2, spacing), lines(0 if half else -b / 2, b / 2, spacing))
    first = 0.75 * spacing
    model = Model([Body(plan, -layers(CASE.heights[0], first)[::-1]), Body(plan, layers(CASE.heights[1], first))])
    for k, (name, far) in enumerate((("lower", -CASE.heights[0]), ("upper", CASE.heights[1]))):
        model.name(f"{name}_end", k, lambda x, y, z: abs(z - far) < 1e-6)
        for n, (inner, outer) in enumerate(PADS.values()):
            model.name(f"{name}_pad_{n}", k,
                       lambda x, y, z: (abs(z) < 1e-6) & (abs(x) > inner - 1e-6) & (abs(x) < outer + 1e-6))
        if half:
            model.name(f"{name}_middle", k, lambda x, y, z: abs(y) < 1e-6)
            model.ground(f"{name}_middle", WALL * len(model.sets[f"{name}_middle"]), (1,))
    model.fix("lower_end")
    model.ground("upper_end", SPRING / (2 if half else 1))
    model.write(path)


def case_text(model, where, pad, half):
    share = 0.5 if half else 1.0
    return f"""&case title = 'free edge', analyses = 'preload', 'transient' /
&model source = 'hdf5', file = '{model}.h5' /
&interface name = 'pads', side_a = 'upper_pad_{pad}', side_b = 'lower_pad_{pad}', axis_1 = 1, 0, 0, friction = 10,
   initial_pressure = 10e6, {where} /
&reduction n_modes = 60 /
&load name = 'press', node_set = 'upper_end', direction = 0, 0, -1, size = {CASE.force * share}, distribution = 'area' /
&load name = 'shear', node_set = 'upper_end', direction = 1, 0, 0, size = {CASE.force * share}, distribution = 'area' /
&preload loads = 'press', 'shear', load_scale = 1.0, 1.0 /
&contact tolerance = 1e-8, compliance = 'dense' /
! One step of nothing: its first sample is the preload, at the sensors
&transient time_step = 1e-8, duration = 2e-8 /
&excitation load = 'shear', kind = 'half_sine', amplitude = 1e-9, duration = 1e-8 /
&output sensors = 'upper_end', 'upper_end', sensor_direction = 0, 0, -1, 1, 0, 0 /
"""


def measure(program, work, name, contact, spacing):
    half, pad = contact == "resolved", list(PADS).index(name)
    model = f"edge_{spacing:.4f}{'_half' if half else ''}"
    if not (work / f"{model}.h5").exists():
        write_model(work / f"{model}.h5", spacing, half)
    outer = PADS[name][1]
    cells = round(2 * outer / CELL), round(CASE.plan[1] / CELL)
    result = run(program, work, f"{model}_{pad}_{contact}", case_text(model, interface(CASE, contact, cells), pad, half))
    if result is None:
        return None
    with h5py.File(result) as f:
        moved, counts = f["transient/sensor"][0], [int(f[f"preload/contact/{s}"][()]) for s in ("open", "slip")]
    return dict(pads=name, contact=contact, spacing=spacing, counts=counts,
                normal=moved[0] / CASE.force, across=moved[1] / CASE.force)


def main():
    a = command_line(__doc__, "free_edge")
    whole = measure(a.program, a.work, "all over", "resolved", 1.0)
    table = []
    for name in list(PADS)[:2]:
        results = [r for mesh in MESHES if (r := measure(a.program, a.work, name, *mesh))]
        reference = [r for r in results if r["contact"] == "resolved"][-1]
        for r in results:
            line = {"pads": name, "contact": r["contact"], "fe_spacing_mm": f"{r['spacing']:.4f}"}
            for key in ("normal", "across"):
                own = reference[key] - whole[key]
                line |= {f"{key}_nm_per_N": f"{r[key] * 1e9:.4f}", f"{key}_of_pads_nm_per_N": f"{(r[key] - whole[key]) * 1e9:.4f}",
                         f"{key}_compliance_deviation": f"{r[key] / reference[key] - 1:+.4f}",
                         f"{key}_of_pads_deviation": f"{(r[key] - whole[key]) / own - 1:+.4f}"}
            table.append(line | {"open_points": r["counts"][0], "slipping_points": r["counts"][1]})
    write_table(a.work / "free_edge.csv", table)
    print((a.work / "free_edge.csv").read_text())


if __name__ == "__main__":
    main()
