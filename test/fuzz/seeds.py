"""The files that the case seeds name: a small model of two blocks, a measured surface, a mesh of gmsh."""

import itertools
import shutil

import h5py
import numpy as np

CORNERS = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])


def write_all(seeds, data, folder):
    """Put every file of the seeds into a folder; `data`: the test data of the repository."""
    for path in seeds.iterdir():
        shutil.copy(path, folder)
    for suffix in ("sti", "mas", "dof", "inp"):
        shutil.copy(data / f"joined_blocks_c3d8i.{suffix}", folder / f"blocks.{suffix}")
    write_gmsh(folder / "blocks.inp", folder / "blocks.msh")
    write_surface(folder / "surface.h5")
    write_model(folder / "model.h5")


def brick(edge, young, poisson, density):
    """Stiffness and lumped mass of a brick."""
    shear = young / (2 * (1 + poisson))
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    stiffness = np.zeros((24, 24))
    for at in CORNERS / np.sqrt(3):
        gradient = np.array([[c[d] * np.prod([1 + at[e] * c[e] for e in range(3) if e != d]) / 4 / edge[d] for c in CORNERS]
                             for d in range(3)])
        strain = np.zeros((6, 24))
        for k, (a, b) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
            strain[k, a::3] += gradient[b]
            if a != b:
                strain[k, b::3] += gradient[a]
        stiffness += np.prod(edge) / 8 * strain.T @ law @ strain
    return stiffness, density * np.prod(edge) / 8


def write_model(path):
    """Two blocks of 2 x 2 x 1 bricks on one another, held at x = 0; 40 x 20 x 10 mm each, steel."""
    cells, edge = (2, 2, 1), np.array([0.02, 0.01, 0.01])
    lattice = list(itertools.product(range(cells[0] + 1), range(cells[1] + 1), range(cells[2] + 1)))
    nodes = [(*np.array(place) * edge - [0, 0, 0.01 * side], *place, side) for side in (0, 1) for place in lattice]
    place_of = {node[3:]: k for k, node in enumerate(nodes)}
    nodes = np.array(nodes)
    elements = [[place_of[tuple(np.array(cell) + (c + 1) // 2) + (side,)] for c in CORNERS]
                for side in (0, 1) for cell in itertools.product(*map(range, cells))]
    stiffness, mass = brick(edge, 2e11, 0.3, 7800.0)
    K, M = np.zeros((3 * len(nodes),) * 2), np.zeros(len(nodes))
    for element in elements:
        rows = [3 * n + c for n in element for c in range(3)]
        K[np.ix_(rows, rows)] += stiffness
        M[element] += mass
    free = np.flatnonzero(nodes[:, 0] > 0)
    rows = [3 * n + c for n in free for c in range(3)]
    sets = {"upper_pad": (nodes[:, 6] == 0) & (nodes[:, 5] == 0), "lower_pad": (nodes[:, 6] == 1) & (nodes[:, 5] == 1),
            "top": (nodes[:, 6] == 0) & (nodes[:, 5] == 1), "upper_end": (nodes[:, 6] == 0) & (nodes[:, 3] == 2)}
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "microslip model", 1
        file["coordinates"], file["node_label"] = nodes[:, :3], np.arange(1, len(nodes) + 1)
        file["elements/C3D8"] = np.array(elements) + 1
        for name, chosen in sets.items():
            file[f"node_sets/{name}"] = np.flatnonzero(chosen & (nodes[:, 0] > 0)) + 1
        file["rows/node"], file["rows/component"] = np.repeat(free + 1, 3), np.tile([1, 2, 3], len(free))
        write_matrix(file.create_group("stiffness"), K[np.ix_(rows, rows)])
        write_matrix(file.create_group("mass"), np.diag(M))
        file["mass"].attrs["form"] = "nodes"


def write_matrix(group, matrix):
    """One triangle by rows, as doc/model_file.md has it."""
    columns = [[i] + [j for j in range(i + 1, len(matrix)) if matrix[i, j] != 0] for i in range(len(matrix))]
    group["row_length"] = [len(row) for row in columns]
    group["column_step"] = np.concatenate([np.diff(row, prepend=row[0]) for row in columns])
    group["value"] = np.concatenate([matrix[i, row] for i, row in enumerate(columns)])


def write_surface(path):
    """Heights of 13 x 9 points with one unknown."""
    with h5py.File(path, "w") as file:
        file["x"], file["y"] = np.linspace(-30, 30, 13), np.linspace(-20, 20, 9)
        z = 1e-3 * np.add.outer(np.arange(13) ** 2, np.arange(9.0))
        z[0, 0] = np.nan
        file["z"] = z
        for name in "xyz":
            file[name].attrs["units"] = "mm"


def write_gmsh(inp, msh):
    """The Abaqus mesh of the test data as gmsh 2.2 with physical groups for its node sets."""
    cards, nodes, elements, sets = "", [], [], {}
    for line in inp.read_text().splitlines():
        if line.startswith("*"):
            cards = line.upper()
            continue
        words = [w for w in line.replace(",", " ").split()]
        if cards.startswith("*NODE,"):
            nodes.append(words)
        elif cards.startswith("*ELEMENT,"):
            elements.append(words)
        elif cards.startswith("*NSET,"):
            sets.setdefault(cards.split("NSET=")[1].lower(), []).extend(words)
    points = [(k + 1, n) for k, name in enumerate(sets) for n in sets[name]]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(sets))]
    lines += [f'0 {k + 1} "{name}"' for k, name in enumerate(sets)] + ["$EndPhysicalNames", "$Nodes", str(len(nodes))]
    lines += [" ".join(n) for n in nodes] + ["$EndNodes", "$Elements", str(len(elements) + len(points))]
    lines += [f"{k + 1} 15 2 {tag} {tag} {n}" for k, (tag, n) in enumerate(points)]
    lines += [f"{len(points) + int(e[0])} 5 2 99 1 {' '.join(e[1:])}" for e in elements] + ["$EndElements", ""]
    msh.write_text("\n".join(lines))
