"""FE models of prismatic bodies for the coupling studies: plan meshes, extruded bricks, the model file (doc/model_file.md).

Lengths are mm here and m in the file. Bodies whose plan meshes agree have node pairs where they touch.
"""
from dataclasses import dataclass, field

import h5py
import numpy as np
import scipy.sparse as sp

from elements import EDGES, solid

MM = 1e-3
STEEL = (194e9, 0.2854, 7861.0)
ALUMINIUM = (70e9, 0.33, 2700.0)


@dataclass
class Plan:
    """A mesh of quadrilaterals: points (n, 2) and corners (m, 4), counter-clockwise."""
    points: np.ndarray
    quads: np.ndarray

    def keep(self, inside):
        """The quadrilaterals whose middle is inside(x, y)."""
        middle = self.points[self.quads].mean(axis=1)
        quads = self.quads[inside(middle[:, 0], middle[:, 1])]
        used, quads = np.unique(quads, return_inverse=True)
        return Plan(self.points[used], quads.reshape(-1, 4))


def lines(start, end, spacing):
    """Equally spaced lines that meet both ends."""
    n = round((end - start) / spacing)
    if abs(n * spacing - (end - start)) > 1e-4 * spacing:
        raise SystemExit(f"FE spacing {spacing} mm does not divide {end - start} mm")
    return np.linspace(start, end, n + 1)


def grid_plan(x, y):
    """All rectangles between the lines x and y."""
    nx, ny = len(x), len(y)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(nx - 1), np.arange(ny - 1), indexing="ij"))
    number = lambda a, b: a * ny + b
    quads = np.column_stack((number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)))
    return Plan(np.column_stack([a.ravel() for a in np.meshgrid(x, y, indexing="ij")]), quads)


def bored_plan(x, y, radius, spacing):
    """A round bore in the middle: rectangles outside a square of twice its size, mapped quadrilaterals between both."""
    half = 2 * radius
    outside = grid_plan(x, y).keep(lambda a, b: (abs(a) > half) | (abs(b) > half))
    side = np.linspace(-half, half, round(2 * half / spacing) + 1)[:-1]
    full = np.full_like(side, half)
    square = np.vstack([np.column_stack(c) for c in ((side, -full), (full, side), (-side, full), (-full, -side))])
    circle = square / np.linalg.norm(square, axis=1)[:, None] * radius
    rings, around = max(1, round(radius / spacing)), len(square)
    points = np.vstack([circle + (square - circle) * k / rings for k in range(rings + 1)])
    k, a = (v.ravel() for v in np.meshgrid(np.arange(rings), np.arange(around), indexing="ij"))
    b = (a + 1) % around
    quads = np.column_stack((k * around + a, (k + 1) * around + a, (k + 1) * around + b, k * around + b))
    points = np.vstack((outside.points, points))
    _, first, same = np.unique(points.round(6), axis=0, return_index=True, return_inverse=True)
    return Plan(points[first], same.ravel()[np.vstack((outside.quads, quads + len(outside.points)))])


def layers(height, first, growth=1.35):
    """Distances from the interface: layers of about `first`, growing."""
    n = 1
    while first * (growth**n - 1) / (growth - 1) < height * (1 - 1e-9):
        n += 1
    thickness = first * growth ** np.arange(n)
    return np.concatenate(([0.0], np.cumsum(thickness * height / thickness.sum())))


@dataclass
class Body:
    """A plan extruded over the levels z, ascending; 8-node bricks, or 20-node ones."""
    plan: Plan
    z: np.ndarray
    material: tuple = STEEL
    quadratic: bool = False

    def mesh(self):
        """Points (n, 3) and connectivity in Abaqus order."""
        points, quads, m = self.plan.points, self.plan.quads, len(self.plan.points)
        level = np.concatenate([np.column_stack((points, np.full(m, z))) for z in self.z])
        bricks = np.concatenate([np.hstack((quads + k * m, quads + (k + 1) * m)) for k in range(len(self.z) - 1)])
        if not self.quadratic:
            return level, bricks
        ends = np.stack([np.sort(bricks[:, pair], axis=1) for pair in EDGES], axis=1)
        edges, number = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
        return (np.vstack((level, level[edges].mean(axis=1))),
                np.hstack((bricks, number.reshape(len(bricks), 12) + len(level))))


@dataclass
class Model:
    """Bodies one after the other, node sets, springs, supports."""
    bodies: list
    points: np.ndarray = None
    body: np.ndarray = None
    elements: dict = field(default_factory=dict)
    sets: dict = field(default_factory=dict)

    def __post_init__(self):
        points, body, first = [], [], 0
        mesh = [b.mesh() for b in self.bodies]
        n = 3 * sum(len(p) for p, _ in mesh)
        self.K, self.M = sp.csr_matrix((n, n)), sp.csr_matrix((n, n))
        for k, (b, (p, connectivity)) in enumerate(zip(self.bodies, mesh)):
            for part in np.array_split(connectivity, 1 + len(connectivity) // 3000):
                stiffness, mass = solid(p[part] * MM, *b.material)
                rows = (3 * (part + first)[:, :, None] + np.arange(3)).reshape(len(part), -1)
                at = np.repeat(rows, rows.shape[1], axis=1).ravel(), np.tile(rows, rows.shape[1]).ravel()
                self.K += sp.coo_matrix((stiffness.ravel(), at), (n, n)).tocsr()
                self.M += sp.coo_matrix((mass.ravel(), at), (n, n)).tocsr()
            kind = "C3D20" if b.quadratic else "C3D8I"
            self.elements.setdefault(kind, []).append(connectivity + first)
            points.append(p)
            body.append(np.full(len(p), k))
            first += len(p)
        self.points, self.body = np.vstack(points), np.concatenate(body)
        self.free = np.ones((len(self.points), 3), bool)

    def name(self, name, body, where):
        """Name the nodes of a body where where(x, y, z) holds."""
        x, y, z = self.points.T
        nodes = np.flatnonzero((self.body == body) & where(x, y, z))
        if not len(nodes):
            raise ValueError(f"{name}: no nodes")
        self.sets[name] = nodes

    def fix(self, name):
        self.free[self.sets[name]] = False

    def ground(self, name, stiffness, components=(0, 1, 2), matrix="K", weight=None):
        """Springs of `stiffness` N/m in all to the ground (matrix = 'M': a mass that only moves along these directions)."""
        nodes = self.sets[name]
        weight = np.ones(len(nodes)) if weight is None else weight
        diagonal = np.zeros(self.free.shape)
        diagonal[np.ix_(nodes, components)] = (stiffness * weight / weight.sum())[:, None]
        setattr(self, matrix, getattr(self, matrix) + sp.diags(diagonal.ravel()))

    def write(self, path):
        rows = np.flatnonzero(self.free)
        with h5py.File(path, "w") as f:
            f.attrs["format"], f.attrs["format_version"] = "microslip model", 1
            f["coordinates"], f["node_label"] = self.points * MM, np.arange(1, len(self.points) + 1)
            for kind, connectivity in self.elements.items():
                f[f"elements/{kind}"] = np.vstack(connectivity) + 1
            for name, nodes in self.sets.items():
                f[f"node_sets/{name}"] = nodes + 1
            f["rows/node"], f["rows/component"] = rows // 3 + 1, rows % 3 + 1
            write_matrix(f.create_group("stiffness"), self.K[rows][:, rows], "N/m")
            write_matrix(f.create_group("mass"), self.M[rows][:, rows], "kg")
            f["mass"].attrs["form"] = "rows"


def write_matrix(group, matrix, units):
    upper = sp.triu(matrix, format="csr")
    upper.sort_indices()
    step = np.diff(upper.indices, prepend=0)
    step[upper.indptr[:-1]] = 0
    for name, data, unit in (("row_length", np.diff(upper.indptr).astype("i4"), "1"),
                             ("column_step", step.astype("i4"), "1"), ("value", upper.data, units)):
        group.create_dataset(name, data=data, compression="gzip", compression_opts=1, shuffle=True).attrs["units"] = unit
