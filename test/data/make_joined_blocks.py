#!/usr/bin/env python3
"""Makes joined_blocks*.inp, .sti, .mas, .dof with CalculiX and prints its frequencies of the joined blocks.

Two steel blocks of 2 x 1 x 1 elements, the lower one fixed at its bottom, stacked on a joint plane where each has its
own nodes at the same places. The matrices are those of the separate blocks; the frequencies come from CalculiX with
the upper block's elements using the lower block's joint nodes. Needs `ccx` and nothing else. Units: mm, t, s.

    test/data/make_joined_blocks.py [FOLDER]      default: the folder of this script
"""
import os
import subprocess
import sys
import tempfile

CELLS = 2, 1                            # elements along x and y, of both blocks
EXTENT = 24.0, 18.0                     # mm, along x and y
LOWER, JOINT, UPPER = -20.0, 0.0, 30.0  # mm, z of bottom, joint and top
MODES = 8
ZERO = 1e-14                            # of the mean of the diagonals: 14 digits are written
STEP = "*STEP\n*FREQUENCY{}\n*END STEP\n"

# Half-edge positions of the nodes of a brick in Abaqus order: 8 corners, then 12 mid-sides
CORNERS = [(x, y, z) for z in (0, 2) for x, y in ((0, 0), (2, 0), (2, 2), (0, 2))]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
BRICK = CORNERS + [tuple((a + b) // 2 for a, b in zip(CORNERS[i], CORNERS[j])) for i, j in EDGES]


def mesh_block(nodes_per_element, first_label, z_low, z_high):
    """{half-edge position: (label, coordinates)} and the elements as lists of half-edge positions."""
    elements = [[(2 * i + x, 2 * j + y, z) for x, y, z in BRICK[:nodes_per_element]]
                for j in range(CELLS[1]) for i in range(CELLS[0])]
    places = sorted({place for element in elements for place in element}, key=lambda place: place[::-1])
    nodes = {place: (first_label + k, (place[0] / 2 / CELLS[0] * EXTENT[0], place[1] / 2 / CELLS[1] * EXTENT[1],
                                       z_low + place[2] / 2 * (z_high - z_low))) for k, place in enumerate(places)}
    return nodes, elements


def deck(kind, joined, step):
    """CalculiX input; `joined` lets the upper elements use the lower block's joint nodes."""
    count = 8 if kind == "C3D8I" else 20
    lower, lower_elements = mesh_block(count, 1, LOWER, JOINT)
    upper, upper_elements = mesh_block(count, 1 + len(lower), JOINT, UPPER)
    sets = {"joint_upper": [node for place, (node, _) in upper.items() if place[2] == 0],
            "joint_lower": [node for place, (node, _) in lower.items() if place[2] == 2],
            "support": [node for place, (node, _) in lower.items() if place[2] == 0]}
    label = {"lower": {place: node for place, (node, _) in lower.items()},
             "upper": {place: lower[place[:2] + (2,)][0] if joined and place[2] == 0 else node
                       for place, (node, _) in upper.items()}}
    text = ("** Two steel blocks on a joint plane, the lower one fixed at its bottom; units mm, t, s.\n"
            "** Made by make_joined_blocks.py\n*NODE, NSET=all\n")
    text += "".join(f"{node}, {x:g}, {y:g}, {z:g}\n" for node, (x, y, z) in [*lower.values(), *upper.values()])
    number = 0
    for block, elements in (("lower", lower_elements), ("upper", upper_elements)):
        text += f"*ELEMENT, TYPE={kind}, ELSET={block}\n"
        for element in elements:
            number += 1
            labels = [number] + [label[block][place] for place in element]
            lines = [", ".join(map(str, labels[k:k + 11])) for k in range(0, len(labels), 11)]
            text += ",\n".join(lines) + "\n"
    text += "*ELSET, ELSET=solid\nlower, upper\n"
    for name, members in sets.items():
        text += f"*NSET, NSET={name}\n" + "".join(
            ", ".join(map(str, members[k:k + 10])) + ",\n" for k in range(0, len(members), 10))
    return text + ("*MATERIAL, NAME=steel\n*ELASTIC\n210000., 0.3\n*DENSITY\n7.85e-9\n"
                   "*SOLID SECTION, ELSET=solid, MATERIAL=steel\n*BOUNDARY\nsupport, 1, 3\n") + step


def calculix(folder, job, text):
    with open(os.path.join(folder, job + ".inp"), "w") as file:
        file.write(text)
    answer = subprocess.run(["ccx", job], cwd=folder, capture_output=True, text=True)
    if answer.returncode != 0 or "*ERROR" in answer.stdout:
        raise SystemExit(answer.stdout[-800:])


def thinned(text):
    """The lines of a matrix file less the zeros off the diagonal, rounded ones too; values kept in all their digits."""
    entries = [(int(row), int(column), float(value)) for row, column, value in map(str.split, text.splitlines())]
    diagonal = {row: value for row, column, value in entries if row == column}
    return "".join(f"{i} {j} {value!r}\n" for i, j, value in entries
                   if i == j or abs(value) > ZERO * (diagonal[i] * diagonal[j]) ** 0.5)


def printed_frequencies(path):
    """Hz column of a .dat file, as text."""
    rows = []
    with open(path) as dat:
        for line in dat:
            if "P A R T I C I P A T I O N" in line:
                return rows
            words = line.split()
            if len(words) == 5 and words[0].isdigit():
                rows.append(words[3])
    return rows


def make(target, name, kind):
    with tempfile.TemporaryDirectory() as folder:
        text = deck(kind, False, STEP.format(", SOLVER=MATRIXSTORAGE"))
        calculix(folder, name, text)
        for ending in (".inp", ".sti", ".mas", ".dof"):
            with open(os.path.join(folder, name + ending)) as file:
                content = file.read()
            with open(os.path.join(target, name + ending), "w") as file:
                file.write(thinned(content) if ending in (".sti", ".mas") else content)
        calculix(folder, "joined", deck(kind, True, STEP.format(f"\n{MODES}")))
        print(f"{name}, {kind}, blocks joined, Hz:", *printed_frequencies(os.path.join(folder, "joined.dat")))


if __name__ == "__main__":
    target = sys.argv[1] if len(sys.argv) > 1 else os.path.dirname(os.path.abspath(__file__))
    make(target, "joined_blocks", "C3D20R")
    make(target, "joined_blocks_c3d8i", "C3D8I")
