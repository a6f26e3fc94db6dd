"""Hexahedral mesh of the S4 Beam: two C-beams, two bolts, four washers, heads and nuts (mm).

The plan view (x-y) is meshed once with gmsh: concentric rings round each bolt axis, inside a square as wide as
the beam, then straight strips. Everything that stands above a plan-view region is that region's quadrilaterals
swept through z. Nodes are named by (plan node, z level, side); `side` differs only on the pads at z = 0, where
the upper and the lower beam keep their own, coinciding nodes. Whatever touches elsewhere shares its nodes.
"""
import math
from dataclasses import dataclass

import numpy as np

# Published (see README.md)
LENGTH, HALF_WIDTH, HEIGHT = 508.0, 15.875, 12.7
PAD_LENGTH, RECESS = 50.8, 3.175
BOLT_AXES = {"left": 25.4, "right": 482.6}
# Assumed: a 5/16 in bolt with normal clearance and a standard washer
SHANK, BORE, WASHER = 3.97, 4.365, 8.73
HEAD = 6.67  # disc with the area of the hexagon, 12.7 mm across flats
WASHER_THICKNESS, HEAD_THICKNESS = 1.59, 5.16
WASHER_TOP = HEIGHT + WASHER_THICKNESS
HEAD_TOP = WASHER_TOP + HEAD_THICKNESS
SENSOR_X = 254.0


@dataclass(frozen=True)
class Fineness:
    """Element counts. `around`: per ring, a multiple of 8; `rings`: radii of the element rings outside the bore."""
    around: int
    rings: tuple
    outer: int      # between the last ring and the square
    strip: int      # along x, from the square to the end of the pad
    span: int       # along the slender part
    recess: int     # through the pad's own 3.175 mm
    thickness: int  # through the 9.525 mm of the slender part
    shank: int      # along the shank from z = 0 to the top of the washer
    head: int
    core: float = 0.62  # half diagonal of the square in the middle of the shank over the shank's radius


SIZES = {
    "full": Fineness(48, (5.5, HEAD, 7.65, WASHER, 10.0, 12.7), outer=2, strip=3, span=60, recess=2, thickness=3,
                     shank=5, head=2),
    "coarse": Fineness(24, (HEAD, WASHER, 12.7), outer=1, strip=2, span=40, recess=1, thickness=2, shank=2, head=1),
}


@dataclass
class Mesh:
    coordinates: np.ndarray  # (nodes, 3)
    elements: dict           # part name -> (elements, 8) node indices, Abaqus order
    node_sets: dict          # name -> node indices, ascending


@dataclass
class Plan:
    points: np.ndarray  # (nodes, 2)
    quads: dict         # region -> (elements, 4), counter-clockwise


def build_mesh(fineness):
    plan = mesh_plan(fineness)
    nodes = NodeNames(plan.points)
    elements = {part: sweep(plan, regions, levels, side, nodes)
                for part, regions, levels, side in parts(fineness)}
    coordinates = nodes.coordinates()
    return Mesh(coordinates, elements, node_sets(coordinates, elements, fineness))


# --- plan view ----------------------------------------------------------------------------------------------------

def mesh_plan(fineness):
    """Quadrilaterals of the plan view, by region."""
    import gmsh
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("plan")
        surfaces = PlanGeometry(gmsh.model.geo, fineness).draw()
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(2)
        return read_plan(gmsh.model.mesh, surfaces)
    finally:
        gmsh.finalize()


def read_plan(gmsh_mesh, surfaces):
    tags, xyz, _ = gmsh_mesh.getNodes()
    index = np.full(int(tags.max()) + 1, -1)
    quads = {}
    for region, surface_tags in surfaces.items():
        blocks = []
        for tag in surface_tags:
            types, _, nodes = gmsh_mesh.getElements(2, tag)
            assert list(types) == [3], "the plan view must consist of quadrilaterals"
            blocks.append(nodes[0].astype(int).reshape(-1, 4))
        quads[region] = np.vstack(blocks)
    used = np.unique(np.concatenate([q.ravel() for q in quads.values()]))
    index[used] = np.arange(len(used))
    points = np.empty((int(tags.max()) + 1, 2))
    points[tags.astype(int)] = xyz.reshape(-1, 3)[:, :2]
    points = points[used]
    return Plan(points, {region: counter_clockwise(points, index[q]) for region, q in quads.items()})


def counter_clockwise(points, quads):
    diagonal_1, diagonal_2 = points[quads[:, 2]] - points[quads[:, 0]], points[quads[:, 3]] - points[quads[:, 1]]
    clockwise = diagonal_1[:, 0] * diagonal_2[:, 1] < diagonal_1[:, 1] * diagonal_2[:, 0]
    quads[clockwise] = quads[clockwise, ::-1]
    return quads


class PlanGeometry:
    """Draws the plan view with gmsh's built-in kernel; every surface is a transfinite, recombined four-sided patch."""

    def __init__(self, geo, fineness):
        self.geo, self.fineness = geo, fineness
        self.points, self.curves, self.surfaces = {}, {}, {}

    def draw(self):
        for axis in BOLT_AXES.values():
            self.draw_pad(axis)
        inner = [axis + sign * PAD_LENGTH / 2 for axis, sign in zip(BOLT_AXES.values(), (1, -1))]
        self.patch("span", self.rectangle(*inner), self.fineness.span, self.fineness.around // 4)
        return self.surfaces

    def draw_pad(self, axis):
        rings = [("shank", SHANK, 1), ("clearance", BORE, 1)]
        rings += [(region_of_ring(radius), radius, 1) for radius in self.fineness.rings]
        inside = self.corners(axis, self.fineness.core * SHANK / math.sqrt(2))
        self.patch("shank", inside, self.fineness.around // 4, self.fineness.around // 4)
        inside_center = None
        for region, radius, layers in rings:
            outside = self.corners(axis, radius / math.sqrt(2))
            self.ring(region, inside, outside, inside_center, self.point(axis, 0.0), layers)
            inside, inside_center = outside, self.point(axis, 0.0)
        square = self.corners(axis, HALF_WIDTH)
        self.ring("pad", inside, square, inside_center, None, self.fineness.outer)
        for edges in ((axis - PAD_LENGTH / 2, axis - HALF_WIDTH), (axis + HALF_WIDTH, axis + PAD_LENGTH / 2)):
            self.patch("pad", self.rectangle(*edges), self.fineness.strip, self.fineness.around // 4)

    def ring(self, region, inside, outside, inside_center, outside_center, layers):
        """Four patches between two closed outlines, straight or circular."""
        for k in range(4):
            corners = [inside[k], outside[k], outside[(k + 1) % 4], inside[(k + 1) % 4]]
            self.patch(region, corners, layers, self.fineness.around // 4, outside_center, inside_center)

    def patch(self, region, corners, count_1, count_2, center_2=None, center_4=None):
        a, b, c, d = corners
        loop = [self.curve(a, b, count_1), self.curve(b, c, count_2, center_2),
                self.curve(c, d, count_1), self.curve(d, a, count_2, center_4)]
        surface = self.geo.addPlaneSurface([self.geo.addCurveLoop(loop)])
        self.geo.mesh.setTransfiniteSurface(surface, cornerTags=corners)
        self.geo.mesh.setRecombine(2, surface)
        self.surfaces.setdefault(region, []).append(surface)

    def curve(self, start, end, count, center=None):
        key = (min(start, end), max(start, end))
        if key not in self.curves:
            if center is None:
                tag = self.geo.addLine(*key)
            else:
                tag = self.geo.addCircleArc(key[0], center, key[1])
            self.geo.mesh.setTransfiniteCurve(tag, count + 1)
            self.curves[key] = tag
        return self.curves[key] if start < end else -self.curves[key]

    def corners(self, axis, half):
        return [self.point(axis + sx * half, sy * half) for sx, sy in ((1, -1), (1, 1), (-1, 1), (-1, -1))]

    def rectangle(self, x_1, x_2):
        return [self.point(x, y) for x, y in ((x_1, -HALF_WIDTH), (x_2, -HALF_WIDTH), (x_2, HALF_WIDTH),
                                              (x_1, HALF_WIDTH))]

    def point(self, x, y):
        key = (round(x, 6), round(y, 6))
        if key not in self.points:
            self.points[key] = self.geo.addPoint(x, y, 0.0)
        return self.points[key]


def region_of_ring(radius):
    """Name of the ring that ends at this radius: what stands on it."""
    return "head" if radius <= HEAD else "washer" if radius <= WASHER else "pad"


# --- sweep through z ----------------------------------------------------------------------------------------------

def parts(fineness):
    """(name, plan regions, ascending z levels, side) of every part; parts with the same name are joined later."""
    recess = np.linspace(0.0, RECESS, fineness.recess + 1)
    above = np.linspace(RECESS, HEIGHT, fineness.thickness + 1)
    washer, head = np.array([HEIGHT, WASHER_TOP]), np.linspace(WASHER_TOP, HEAD_TOP, fineness.head + 1)
    shank = np.linspace(0.0, WASHER_TOP, fineness.shank + 1)
    column = np.concatenate([recess, above[1:]])
    pad, disc = ("head", "washer", "pad"), ("shank", "clearance", "head")
    shaft = np.concatenate([-shank[:0:-1], shank])
    listed = [("bolts", ("shank",), shaft, +1), ("heads", disc, head, +1), ("nuts", disc, -head[::-1], -1)]
    for side, name in ((+1, "upper"), (-1, "lower")):
        for part, regions, levels in (("beam_" + name, pad, column), ("beam_" + name + "_span", ("span",), above),
                                      ("washers_" + name, ("head", "washer"), washer)):
            listed.append((part, regions, levels if side > 0 else -levels[::-1], side))
    return listed


class NodeNames:
    """Numbers the nodes in the order in which they are first asked for."""

    def __init__(self, points):
        self.points, self.index, self.place = points, {}, []

    def __call__(self, plan_node, z, side, on_pad):
        level = round(z, 6) + 0.0
        key = (plan_node, level, side if on_pad and level == 0.0 else 0)
        if key not in self.index:
            self.index[key] = len(self.place)
            self.place.append((*self.points[plan_node], level))
        return self.index[key]

    def coordinates(self):
        return np.array(self.place)


def sweep(plan, regions, levels, side, nodes):
    quads = np.vstack([plan.quads[region] for region in regions])
    on_pad = "pad" in regions
    columns = np.unique(quads)
    number = np.zeros((len(levels), columns.max() + 1), dtype=int)
    for level, z in enumerate(levels):
        number[level, columns] = [nodes(column, z, side, on_pad) for column in columns]
    return np.vstack([np.hstack([number[k][quads], number[k + 1][quads]]) for k in range(len(levels) - 1)])


# --- node sets ----------------------------------------------------------------------------------------------------

def node_sets(coordinates, elements, fineness):
    x, y, z = coordinates.T
    first_layer = WASHER_TOP / fineness.shank
    tolerance = 1e-4
    shank = np.isin(np.arange(len(x)), elements["bolts"])
    sets = {}
    for end, axis in BOLT_AXES.items():
        near = abs(x - axis) < PAD_LENGTH / 2 + tolerance
        for side, sign in (("upper", +1), ("lower", -1)):
            beam = np.isin(np.arange(len(x)), elements["beam_" + side])
            sets[f"pad_{end}_{side}"] = near & beam & (abs(z) < tolerance)
            sets[f"bolt_{end}_plane_{side}"] = near & shank & (abs(z - sign * first_layer) < tolerance)
    on_axis = np.any([abs(x - axis) < tolerance for axis in BOLT_AXES.values()], axis=0)
    sets["support"] = shank & on_axis & (abs(z) < tolerance)
    middle = (abs(x - SENSOR_X) < tolerance) & (abs(y) < tolerance)
    sets["sensor"] = middle & (abs(z - HEIGHT) < tolerance)
    sets["sensor_lower"] = middle & (abs(z + HEIGHT) < tolerance)
    return {name: np.flatnonzero(chosen) for name, chosen in sets.items()}


def pad_pairs(mesh, radius=math.inf):
    """Coinciding (upper, lower) pad nodes within `radius` of a bolt axis."""
    pairs = []
    for end, axis in BOLT_AXES.items():
        upper, lower = (by_place(mesh, mesh.node_sets[f"pad_{end}_{side}"]) for side in ("upper", "lower"))
        gap = mesh.coordinates[upper] - mesh.coordinates[lower]
        assert abs(gap).max() < 1e-9, "the pads must have coinciding nodes"
        distance = np.hypot(mesh.coordinates[upper, 0] - axis, mesh.coordinates[upper, 1])
        pairs.append(np.column_stack([upper, lower])[distance < radius + 1e-4])
    return np.vstack(pairs)


def by_place(mesh, nodes):
    x, y, _ = np.round(mesh.coordinates[nodes], 4).T
    return nodes[np.lexsort((y, x))]
