#!/usr/bin/env python3
"""Both couplings of half space and FE model against resolved FE contact: two pressed steel blocks.

    example/coupling/two_blocks.py --program MICROSLIP [--work FOLDER] [--coarse 4 2] [--resolved 2 1.33333333 1]

Two blocks of 48 x 32 mm, 12 and 16 mm high, with a square bore of 8 mm, bricks with incompatible modes; the lower one
stands fixed, 6 kN press on the upper one's top, and 24 N along x shear it. Surfaces: flat, and a hill of
12 um. Coarse FE meshes with a boundary-element grid and coupling = 'series' and 'scale_split', fine ones with contact at
the FE nodes (grid = 'fe_nodes') as the reference. Writes table.csv and pressure.png into the work folder.
"""
import argparse
import csv
import pathlib
import subprocess

import h5py
import numpy as np
import scipy.sparse as sp

MM = 1e-3
SIZE, BORE, HEIGHTS = (48.0, 32.0), 8.0, (12.0, 16.0)          # mm: plan, bore, lower and upper block
E, NU, RHO, FORCE, SHEAR = 194e9, 0.2854, 7861.0, 6000.0, 24.0
CELLS = (60, 40)                                               # boundary-element grid, 0.8 mm
SURFACES = ("flat", "hill")
PATCH = 2.0                                                    # mm, pressures are compared as means over squares
SPRING = 1e6                                                   # N/m, holds the upper block where nothing touches


def layers(height, spacing):
    """Thicknesses away from the interface: 0.75 of the spacing, growing by 1.35."""
    n, first = 1, 0.75 * spacing
    while first * (1.35**n - 1) / 0.35 < height:
        n += 1
    thickness = first * 1.35 ** np.arange(n)
    return thickness * height / thickness.sum()


def brick(edge):
    """Stiffness and mass of a rectangular brick with three incompatible modes per direction, condensed."""
    corner = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float)
    g = E / (2 * (1 + NU))
    lame = 2 * g * NU / (1 - 2 * NU)
    law = np.diag([2 * g] * 3 + [g] * 3) + np.pad(np.full((3, 3), lame), (0, 3))
    volume = np.prod(edge) / 8
    K, M = np.zeros((33, 33)), np.zeros((24, 24))
    for at in corner / np.sqrt(3):
        parts = 1 + at * corner
        shape = parts.prod(axis=1) / 8
        gradient = np.array([shape / parts[:, d] * corner[:, d] * 2 / edge[d] for d in range(3)])
        bubble = np.diag(-2 * at * 2 / np.asarray(edge))
        strain = np.zeros((6, 33))
        for k, (x, y, z) in enumerate(np.vstack((gradient.T, bubble.T))):
            strain[:, 3 * k:3 * k + 3] = [[x, 0, 0], [0, y, 0], [0, 0, z], [y, x, 0], [0, z, y], [z, 0, x]]
        K += volume * strain.T @ law @ strain
        M += volume * RHO * np.kron(np.outer(shape, shape), np.eye(3))
    return K[:24, :24] - K[:24, 24:] @ np.linalg.solve(K[24:, 24:], K[24:, :24]), M


def write_matrix(group, matrix, units):
    upper = sp.triu(matrix, format="csr")
    upper.sort_indices()
    step = np.diff(upper.indices, prepend=0)
    step[upper.indptr[:-1]] = 0
    for name, data, unit in (("row_length", np.diff(upper.indptr).astype("i4"), "1"),
                             ("column_step", step.astype("i4"), "1"), ("value", upper.data, units)):
        group.create_dataset(name, data=data, compression="gzip", compression_opts=1, shuffle=True).attrs["units"] = unit


def write_model(path, spacing):
    """Both blocks with elements of about `spacing` mm in the plane of the joint."""
    nx, ny = round(SIZE[0] / spacing), round(SIZE[1] / spacing)
    if any(abs(d / spacing - round(d / spacing)) > 1e-4 for d in (*SIZE, (SIZE[0] - BORE) / 2, (SIZE[1] - BORE) / 2)):
        raise SystemExit(f"FE spacing {spacing} mm: the mesh does not meet the edges of block and bore")
    x, y = np.linspace(-SIZE[0] / 2, SIZE[0] / 2, nx + 1), np.linspace(-SIZE[1] / 2, SIZE[1] / 2, ny + 1)
    middle = lambda a: 0.5 * (a[1:] + a[:-1])
    solid = ~((np.abs(middle(x))[:, None] < BORE / 2) & (np.abs(middle(y))[None, :] < BORE / 2))
    points, bricks, sets, edges = [], [], {}, []
    first = 0
    for name, sign, height in (("lower", -1, HEIGHTS[0]), ("upper", 1, HEIGHTS[1])):
        z = np.concatenate(([0.0], np.cumsum(layers(height, spacing)))) * sign
        z.sort()
        index = -np.ones((nx + 1, ny + 1, len(z)), int)
        i, j = np.nonzero(solid)
        for k in range(len(z) - 1):
            for a, b, c in np.ndindex(2, 2, 2):
                index[i + a, j + b, k + c] = 0
        used = np.argwhere(index.transpose(2, 1, 0) == 0)[:, ::-1]
        index[tuple(used.T)] = first + np.arange(len(used))
        points.append(np.column_stack((x[used[:, 0]], y[used[:, 1]], z[used[:, 2]])))
        joint, far = (len(z) - 1, 0) if sign < 0 else (0, len(z) - 1)
        sets[f"{name}_pad"] = index[:, :, joint][index[:, :, joint] >= 0]
        sets[f"{name}_end"] = index[:, :, far][index[:, :, far] >= 0]
        for k in range(len(z) - 1):
            c = [index[i + a, j + b, k + d] for d in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
            bricks.append(np.column_stack(c))
            edges.append((x[1] - x[0], y[1] - y[0], z[k + 1] - z[k]))
        first += len(used)
    points = np.vstack(points) * MM
    n = 3 * len(points)
    K, M = sp.csr_matrix((n, n)), sp.csr_matrix((n, n))
    for connectivity, edge in zip(bricks, edges):
        k, m = brick(np.array(edge) * MM)
        rows = (3 * connectivity[:, :, None] + np.arange(3)).reshape(len(connectivity), 24)
        at = np.repeat(rows, 24, axis=1).ravel(), np.tile(rows, 24).ravel()
        K += sp.coo_matrix((np.tile(k.ravel(), len(rows)), at), (n, n)).tocsr()
        M += sp.coo_matrix((np.tile(m.ravel(), len(rows)), at), (n, n)).tocsr()
    spring = np.zeros(n)
    spring.reshape(-1, 3)[sets["upper_end"]] = SPRING / len(sets["upper_end"])
    K += sp.diags(spring)
    free = np.ones((len(points), 3), bool)
    free[sets["lower_end"]] = False
    rows = np.flatnonzero(free)
    with h5py.File(path, "w") as f:
        f.attrs["format"], f.attrs["format_version"] = "microslip model", 1
        f["coordinates"], f["node_label"] = points, np.arange(1, len(points) + 1)
        f["elements/C3D8I"] = np.vstack(bricks) + 1
        for name, nodes in sets.items():
            f[f"node_sets/{name}"] = np.sort(nodes) + 1
        f["rows/node"], f["rows/component"] = rows // 3 + 1, rows % 3 + 1
        write_matrix(f.create_group("stiffness"), K[rows][:, rows], "N/m")
        write_matrix(f.create_group("mass"), M[rows][:, rows], "kg")
        f["mass"].attrs["form"] = "rows"


def case_text(spacing, kind, surface):
    where = "grid = 'fe_nodes'" if kind == "resolved" else \
        f"nx = {CELLS[0]}, ny = {CELLS[1]}, young_modulus = {E}, poisson_ratio = {NU}, coupling = '{kind}'"
    topography = {"flat": "source = 'flat'", "hill": "source = 'hill', height = 12e-6"}[surface]
    return f"""&case title = 'two blocks', analyses = 'preload', 'linear_modes', 'transient' /
&model source = 'hdf5', file = 'blocks_{spacing:.4f}.h5' /
&interface name = 'joint', side_a = 'upper_pad', side_b = 'lower_pad', friction = 0.6, {where} /
&topography {topography} /
&reduction n_modes = 12, cache = 'blocks_{spacing:.4f}.cache' /
&load name = 'press', node_set = 'upper_end', direction = 0, 0, -1, size = {FORCE}, distribution = 'area' /
&load name = 'shear', node_set = 'upper_end', direction = 1, 0, 0, size = {SHEAR}, distribution = 'area' /
&preload loads = 'press', 'shear', load_scale = 1.0, 1.0 /
&linear_modes n_modes = 6 /
&contact tolerance = 1e-7{"" if kind == "resolved" else ", compliance = 'fft'"} /
! One step of nothing: its first sample is the preload, at the sensors
&transient time_step = 1e-8, duration = 2e-8 /
&excitation load = 'shear', kind = 'half_sine', amplitude = 1e-9, duration = 1e-8 /
&output sensors = 'upper_end', 'upper_end', sensor_direction = 0, 0, -1, 1, 0, 0 /
"""


def pressure_map(f):
    """Pressure on a raster of 0.1 mm, every contact point with the rectangle that belongs to it."""
    raster = 0.1
    x = np.arange(-SIZE[0] / 2 + raster / 2, SIZE[0] / 2, raster)
    y = np.arange(-SIZE[1] / 2 + raster / 2, SIZE[1] / 2, raster)
    px, py = f["interface_1/x"][:] / MM, f["interface_1/y"][:] / MM
    p = f["preload/interface_1/pressure"][:]
    if p.ndim == 1:
        ux, uy = np.unique(px.round(6)), np.unique(py.round(6))
        table = np.zeros((len(uy), len(ux)))
        table[np.searchsorted(uy, py.round(6)), np.searchsorted(ux, px.round(6))] = p
        px, py, p = ux, uy, table
    nearest = lambda grid, at: np.abs(grid[None, :] - at[:, None]).argmin(axis=1)
    fine = np.nan_to_num(p)[np.ix_(nearest(py, y), nearest(px, x))]
    fine[(np.abs(y)[:, None] < BORE / 2) & (np.abs(x)[None, :] < BORE / 2)] = 0.0
    return fine


def means(fine):
    n = round(PATCH / 0.1)
    return fine.reshape(fine.shape[0] // n, n, fine.shape[1] // n, n).mean(axis=(1, 3))


def run(program, work, spacing, kind, surface):
    name = f"{surface}_{kind}_{spacing:.4f}"
    model = work / f"blocks_{spacing:.4f}.h5"
    if not model.exists():
        write_model(model, spacing)
    result = work / f"{name}.h5"
    if not result.exists():
        (work / f"{name}.nml").write_text(case_text(spacing, kind, surface))
        log = subprocess.run([program, "--output", result.name, f"{name}.nml"], cwd=work, text=True, capture_output=True)
        (work / f"{name}.log").write_text(log.stdout + log.stderr)
        if log.returncode:
            raise SystemExit(f"{name}: {log.stderr}")
    with h5py.File(result) as f:
        fine, moved = pressure_map(f), f["transient/sensor"][0]
        return dict(spacing=spacing, kind=kind, surface=surface, fine=fine, patches=means(fine),
                    normal=FORCE / moved[0], tangential=SHEAR / moved[1], closed=(fine > 0).sum() * 0.01,
                    frequency=f["linear_modes/frequency"][:6], force=fine.sum() * 1e-8)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--program", required=True, type=lambda p: str(pathlib.Path(p).resolve()))
    arguments.add_argument("--work", type=pathlib.Path, default=pathlib.Path("two_blocks"))
    arguments.add_argument("--coarse", type=float, nargs="+", default=[4.0, 2.0])
    arguments.add_argument("--resolved", type=float, nargs="+", default=[2.0, 4 / 3, 1.0])
    arguments.add_argument("--surfaces", nargs="+", choices=SURFACES, default=SURFACES)
    a = arguments.parse_args()
    a.work.mkdir(exist_ok=True)
    results = [run(a.program, a.work, h, kind, surface) for surface in a.surfaces
               for kind, spacings in (("resolved", a.resolved), ("series", a.coarse), ("scale_split", a.coarse))
               for h in spacings]
    with open(a.work / "table.csv", "w", newline="") as out:
        table = csv.writer(out)
        table.writerow(["surface", "contact", "fe_spacing_mm", "normal_N_per_um", "normal_deviation", "tangential_N_per_um",
                        "tangential_deviation", "closed_mm2",
                        "closed_deviation", "pressure_deviation_squares", "pressure_deviation_points"] + [f"f{k}_Hz" for k in range(1, 7)])
        for r in results:
            reference = [s for s in results if s["surface"] == r["surface"] and s["kind"] == "resolved"][-1]
            off = lambda key: r[key] / reference[key] - 1
            field = lambda key: np.linalg.norm(r[key] - reference[key]) / np.linalg.norm(reference[key])
            table.writerow([r["surface"], r["kind"], f"{r['spacing']:.3f}", f"{r['normal'] * 1e-6:.1f}",
                            f"{off('normal'):+.4f}", f"{r['tangential'] * 1e-6:.1f}", f"{off('tangential'):+.4f}",
                            f"{r['closed']:.0f}", f"{off('closed'):+.4f}",
                            f"{field('patches'):.4f}", f"{field('fine'):.4f}"]
                           + [f"{f:.0f}" for f in r["frequency"]])
    print((a.work / "table.csv").read_text())
    draw(a, results)


def draw(a, results):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    columns = [("resolved", a.resolved[-1]), ("series", a.coarse[-1]), ("scale_split", a.coarse[-1])]
    figure, axes = plt.subplots(len(a.surfaces), 3, figsize=(10, 2.4 * len(a.surfaces)), squeeze=False, layout="constrained")
    for row, surface in zip(axes, a.surfaces):
        shown = [next(r for r in results if (r["surface"], r["kind"], r["spacing"]) == (surface, *c)) for c in columns]
        top = np.quantile(shown[0]["fine"], 0.995) * 1e-6
        for axis, r in zip(row, shown):
            image = axis.imshow(r["fine"] * 1e-6, origin="lower", vmin=0, vmax=top, cmap="inferno",
                                extent=(-SIZE[0] / 2, SIZE[0] / 2, -SIZE[1] / 2, SIZE[1] / 2))
            axis.set_title(f"{surface}: {r['kind'].replace('_', ' ')}, FE {r['spacing']:.2g} mm", fontsize=9)
        figure.colorbar(image, ax=row, label="pressure, MPa")
    figure.savefig(a.work / "pressure.png", dpi=110)


if __name__ == "__main__":
    main()
