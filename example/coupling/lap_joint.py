#!/usr/bin/env python3
"""Both couplings of half space and FE model against resolved FE contact: a bolted lap joint.

    example/coupling/lap_joint.py --program MICROSLIP [--work FOLDER] [--coarse 4 2] [--resolved 2 1.33333333 1 0.8]

Two steel strips of 100 x 24 x 6 mm overlap by 40 mm, with a square bore of 8 mm in the middle; both outer ends stand
fixed. The bolt pulls on square washers of 16 mm; a crown keeps the rim of the pads open. Preload, linear modes, and quasi-static
modal analysis of the first bending mode in the plane of the joint, in which the strips turn against each other about the
bolt. Coarse FE meshes with a boundary-element grid and coupling = 'series' and 'scale_split', fine ones with contact at the
FE nodes as the reference. Writes lap_joint.csv and coupling_lap_joint.png into the work folder.
"""

import h5py
import numpy as np

from blocks import MM, STEEL, Body, Model, grid_plan, layers, lines
from compare import Raster, command_line, contact_points, distance, run, write_table

LENGTH, WIDTH, THICK, OVERLAP = 100.0, 24.0, 6.0, 40.0         # mm: a strip, and what both share
BORE, WASHER, BOLT, CROWN = 8.0, 16.0, 3000.0, 10.0            # mm, mm, N, um of gap at the corners of the pads
CELL, FINE_CELL = 0.8, 0.5                                     # mm, of the boundary-element grid
MODE, AMPLITUDES = 2, (1.3, 2.0, 3.0, 4.5, 6.5, 9.0, 12.0, 15.0)      # um at the washer, across the strips
ZONE = 11.0                                                    # mm: half of what is meshed finely, about; contact ends at 10


def graded(spacing, end):
    """Lines from the middle of a pad to its edge: even as far as contact goes, then 2 mm or a whole element if that is more."""
    zone = min(end, round(ZONE / spacing) * spacing)
    rest = np.linspace(zone, end, 1 + int(np.ceil((end - zone) / max(2.0, spacing) - 1e-9)))[1:]
    return np.concatenate((lines(0, zone, spacing), rest))


def write_model(path, spacing):
    """The upper strip and the same one turned by half a turn about y."""
    mirrored = lambda v: np.concatenate((-v[:0:-1], v))
    steps = [max(2.0, spacing)]
    while sum(steps) < LENGTH - OVERLAP:
        steps.append(min(4.0, 1.2 * steps[-1]))
    x = np.concatenate((mirrored(graded(spacing, OVERLAP / 2)),
                        OVERLAP / 2 + np.cumsum(steps) * (LENGTH - OVERLAP) / sum(steps)))
    y, z = mirrored(graded(spacing, WIDTH / 2)), layers(THICK, 0.75 * spacing)
    solid = lambda a, b: (abs(a) > BORE / 2) | (abs(b) > BORE / 2)
    model = Model([Body(grid_plan(x, y).keep(solid), z), Body(grid_plan(-x[::-1], y).keep(solid), -z[::-1])])
    half = lambda v, size: abs(v) < size / 2 + 1e-6
    for k, (name, turn) in enumerate((("upper", 1), ("lower", -1))):
        model.name(f"{name}_pad", k, lambda x, y, z: half(x, OVERLAP) & (z == 0))
        model.name(f"{name}_washer", k, lambda x, y, z: half(x, WASHER) & half(y, WASHER) & (abs(z - turn * THICK) < 1e-6))
        model.name(f"{name}_end", k, lambda x, y, z: abs(x - turn * (LENGTH - OVERLAP / 2)) < 1e-6)
        model.fix(f"{name}_end")
    model.write(path)


def write_crown(path):
    """The gap of the undeformed pads: a paraboloid, the same for all meshes and grids."""
    x, y = (np.linspace(-s / 2 - 1, s / 2 + 1, 5 * round(s) + 11) * MM for s in (OVERLAP, WIDTH))
    gap = CROWN * 1e-6 * (x[None, :]**2 + y[:, None]**2) / (0.5 * MM * np.hypot(OVERLAP, WIDTH))**2
    with h5py.File(path, "w") as f:
        for name, data in (("x", x), ("y", y), ("gap", gap)):
            f.create_dataset(name, data=data).attrs["units"] = "m"


def case_text(spacing, contact, cell):
    where = "grid = 'fe_nodes'" if contact == "resolved" else \
        f"nx = {round(OVERLAP / cell)}, ny = {round(WIDTH / cell)}, young_modulus = {STEEL[0]}, poisson_ratio = {STEEL[1]}, " \
        f"coupling = '{contact}'"
    return f"""&case title = 'lap joint', analyses = 'preload', 'linear_modes', 'qsma' /
&model source = 'hdf5', file = 'strips_{spacing:.4f}.h5' /
&interface name = 'joint', side_a = 'upper_pad', side_b = 'lower_pad', axis_1 = 1, 0, 0, friction = 0.6, {where} /
&topography source = 'file', file = 'crown.h5', sense = 'gap' /
&reduction n_modes = 20, cache = 'strips_{spacing:.4f}.cache' /
&load name = 'bolt', node_set = 'upper_washer', 'lower_washer', direction = 0, 0, -1, 0, 0, 1, size = 1.0, 1.0,
      distribution = 'area', 'area' /
&preload loads = 'bolt', load_scale = {BOLT} /
&linear_modes n_modes = 6 /
&qsma mode = {MODE}, amplitudes = {", ".join(f"{u * 1e-6}" for u in AMPLITUDES)}, steps = 2 /
&contact tolerance = 1e-8, compliance = 'dense' /
&output sensors = 'upper_washer', sensor_direction = 0, 1, 0 /
"""


def measure(program, work, contact, spacing, cell=CELL):
    """What a mesh gives: frequencies, damping at the amplitudes asked for, pressure on a raster."""
    model = work / f"strips_{spacing:.4f}.h5"
    if not model.exists():
        write_model(model, spacing)
    if not (work / "crown.h5").exists():
        write_crown(work / "crown.h5")
    grid = f"_grid_{cell}" if cell != CELL else ""
    result = run(program, work, f"lap_{contact}_{spacing:.4f}{grid}", case_text(spacing, contact, cell))
    if result is None:
        raise SystemExit(1)
    raster = Raster((OVERLAP, WIDTH), lambda x, y: (abs(x) > BORE / 2) | (abs(y) > BORE / 2))
    with h5py.File(result) as f:
        q = f["qsma"]
        level = lambda v: np.interp(np.log(AMPLITUDES), np.log(q["amplitude"][:] * 1e6), v)
        pressure = raster.field(*contact_points(f, "preload/interface_1/pressure")) * 1e-6
        return dict(contact=contact, spacing=spacing, cell="" if contact == "resolved" else cell,
                    tied=f["model/tied_frequency"][MODE - 1], frequency=f["linear_modes/frequency"][:6],
                    curve=level(q["frequency"][:]), damping=level(q["friction_damping_ratio"][:]),
                    closed=(pressure > 0).sum() * raster.step**2,
                    pressure=pressure, squares=raster.means(pressure, 2.0))


def table_row(r, reference):
    """Deviations from the reference; of the frequency also over that of the tied strips, with less of the meshes' own error."""
    f, wanted = (v["frequency"][MODE - 1] for v in (r, reference))
    row = dict(contact=r["contact"], fe_spacing_mm=f"{r['spacing']:.3f}", cell_mm=r["cell"], closed_mm2=f"{r['closed']:.1f}",
               closed_deviation=f"{r['closed'] / reference['closed'] - 1:+.4f}",
               pressure_deviation_squares=f"{distance(r['squares'], reference['squares']):.4f}",
               **{f"f{k}_Hz": f"{v:.2f}" for k, v in enumerate(r["frequency"], 1)},
               tied_f_Hz=f"{r['tied']:.2f}", f_deviation=f"{f / wanted - 1:+.5f}",
               f_over_tied_deviation=f"{f / r['tied'] * reference['tied'] / wanted - 1:+.5f}")
    for u, zeta, wanted in zip(AMPLITUDES, r["damping"], reference["damping"]):
        row |= {f"damping_{u}um": f"{zeta:.6f}", f"damping_deviation_{u}um": f"{zeta / wanted - 1:+.4f}"}
    return row


def draw(path, results):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    figure = plt.figure(figsize=(11, 6), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(1, 1.5))
    last = {r["contact"]: r for r in results}
    axes, top = above.subplots(1, 3), np.quantile(last["resolved"]["pressure"], 0.998)
    for axis, r in zip(axes, last.values()):
        image = axis.imshow(r["pressure"], origin="lower", vmin=0, vmax=top, cmap="inferno",
                            extent=(-OVERLAP / 2, OVERLAP / 2, -WIDTH / 2, WIDTH / 2))
        axis.set_title(f"{r['contact'].replace('_', ' ')}, FE {r['spacing']:.2g} mm", fontsize=9)
    above.colorbar(image, ax=axes, label="pressure, MPa")
    damping, frequency = below.subplots(1, 2)
    colour = {"resolved": "black", "series": "tab:red", "scale_split": "tab:blue"}
    rank = lambda r: sorted(q["spacing"] for q in results if q["contact"] == r["contact"]).index(r["spacing"])
    style = lambda r: ("-", "--", "-.", ":")[min(rank(r), 3)]
    for r in results:
        label = f"{r['contact'].replace('_', ' ')}, {r['spacing']:.2g} mm"
        damping.loglog(AMPLITUDES, 100 * r["damping"].clip(1e-8), color=colour[r["contact"]], ls=style(r), label=label)
        frequency.semilogx(AMPLITUDES, r["curve"], color=colour[r["contact"]], ls=style(r), label=label)
    ticks = dict(xlabel="amplitude at the washer, um", xticks=AMPLITUDES, xticklabels=[f"{u:g}" for u in AMPLITUDES])
    damping.set(ylabel="damping ratio by friction, %", yticks=(0.1, 0.3, 1, 3), yticklabels=("0.1", "0.3", "1", "3"), **ticks)
    frequency.set(ylabel="frequency, Hz", **ticks)
    for axis in (damping, frequency):
        axis.minorticks_off()
    damping.legend(fontsize=7)
    figure.savefig(path, dpi=110)


def main():
    a = command_line(__doc__, "lap_joint", coarse=dict(type=float, nargs="+", default=[4.0, 2.0]),
                     resolved=dict(type=float, nargs="+", default=[2.0, 4 / 3, 1.0, 0.8]))
    results = [measure(a.program, a.work, contact, h)
               for contact, spacings in (("resolved", a.resolved), ("series", a.coarse), ("scale_split", a.coarse))
               for h in spacings]
    reference = results[len(a.resolved) - 1]
    fine = [measure(a.program, a.work, contact, a.coarse[-1], FINE_CELL) for contact in ("series", "scale_split")]
    write_table(a.work / "lap_joint.csv", [table_row(r, reference) for r in results + fine])
    print((a.work / "lap_joint.csv").read_text())
    draw(a.work / "coupling_lap_joint.png", results)


if __name__ == "__main__":
    main()
