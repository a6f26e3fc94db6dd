"""Writes CalculiX decks of the S4 Beam, runs CalculiX and reads what it leaves. Units: mm, t, s (so N, MPa)."""
import os
import re
import shutil
import subprocess
import textwrap

import numpy as np
import scipy.sparse as sp

YOUNGS_MODULUS, POISSON_RATIO, DENSITY = 194000.0, 0.2854, 7.861e-9
COMMAND = "ccx"
HIDDEN_NODES = 3  # that CalculiX adds to every C3D8I


def available():
    return shutil.which(COMMAND) is not None


def version():
    answer = subprocess.run([COMMAND, "-v"], capture_output=True, text=True).stdout.split()
    return answer[-1] if answer else "unknown"


# --- decks --------------------------------------------------------------------------------------------------------

def write_matrix_deck(path, mesh, title):
    """Mesh, sets, material, supports; the step stores the matrices. The pads are not tied."""
    step = ["*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "*END STEP"]
    write_deck(path, mesh, mesh.elements, title, step)


def write_tied_deck(path, mesh, pairs, modes, title):
    """The same with every lower node of `pairs` replaced by the upper one; prints frequencies and shapes."""
    renamed = np.arange(len(mesh.coordinates))
    renamed[pairs[:, 1]] = pairs[:, 0]
    elements = {part: renamed[nodes] for part, nodes in mesh.elements.items()}
    step = ["*STEP", "*FREQUENCY", str(modes), "*NODE PRINT, NSET=all", "U", "*END STEP"]
    write_deck(path, mesh, elements, title, step)


def write_deck(path, mesh, elements, title, step):
    with open(path, "w") as deck:
        deck.writelines(f"** {line}\n" for line in textwrap.wrap(title, 100))
        deck.write("** Units: mm, t, s, N, MPa\n*NODE, NSET=all\n")
        deck.writelines(f"{k}, {x:.9g}, {y:.9g}, {z:.9g}\n" for k, (x, y, z) in enumerate(mesh.coordinates, 1))
        first = 1
        for part, nodes in elements.items():
            deck.write(f"*ELEMENT, TYPE=C3D8I, ELSET={part}\n")
            deck.writelines(f"{k}, " + ", ".join(map(str, row)) + "\n" for k, row in enumerate(nodes + 1, first))
            first += len(nodes)
        deck.write("*ELSET, ELSET=solid\n" + "".join(f"{part},\n" for part in elements))
        for name, nodes in mesh.node_sets.items():
            deck.write(f"*NSET, NSET={name}\n" + "\n".join(number_lines(nodes)) + "\n")
        deck.write(f"*MATERIAL, NAME=steel\n*ELASTIC\n{YOUNGS_MODULUS:g}, {POISSON_RATIO:g}\n*DENSITY\n{DENSITY:g}\n"
                   "*SOLID SECTION, ELSET=solid, MATERIAL=steel\n*BOUNDARY\nsupport, 1, 3\n")
        deck.write("\n".join(step) + "\n")


def number_lines(nodes, per_line=10):
    return [", ".join(str(node + 1) for node in nodes[k:k + per_line]) + "," for k in range(0, len(nodes), per_line)]


def run(folder, job, threads):
    """Runs CalculiX on folder/job.inp; its output goes to job.log."""
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads))
    with open(os.path.join(folder, job + ".log"), "w") as log:
        status = subprocess.run([COMMAND, job], cwd=folder, stdout=log, stderr=subprocess.STDOUT, env=environment)
    with open(log.name) as log:
        text = log.read()
    if status.returncode != 0 or "*ERROR" in text:
        raise RuntimeError(f"CalculiX failed on {job}.inp; the last lines of {log.name}:\n" + text[-800:])


def tidy(folder, job):
    """Removes what CalculiX leaves behind beside the matrices."""
    for name in (job + ending for ending in (".12d", ".cvg", ".dat", ".frd", ".log", ".sta")):
        if os.path.exists(os.path.join(folder, name)):
            os.remove(os.path.join(folder, name))
    spooles_log = os.path.join(folder, "spooles.out")
    if os.path.exists(spooles_log) and os.path.getsize(spooles_log) == 0:
        os.remove(spooles_log)


# --- results ------------------------------------------------------------------------------------------------------

def read_modes(path, node_count):
    """Frequencies (Hz) and shapes (modes, nodes, 3) from a .dat file; nodes without elements do not move."""
    frequencies, displacements, in_table = [], [], False
    with open(path) as dat:
        for line in dat:
            words = line.split()
            if "E I G E N V A L U E   O U T P U T" in line:
                in_table = True
            elif "P A R T I C I P A T I O N" in line:
                in_table = False
            elif in_table and len(words) == 5 and words[0].isdigit():
                frequencies.append(float(words[3]))
            elif line.startswith(" displacements"):
                displacements.append([])
            elif displacements and len(words) == 4:
                displacements[-1].append(line)
    assert len(displacements) == len(frequencies), f"{path} is incomplete"
    shapes = np.zeros((len(frequencies), node_count, 3))
    for shape, lines in zip(shapes, displacements):
        text = re.sub(r"(\d)([-+]\d{3})", r"\1E\2", " ".join(lines))  # Fortran writes 1.5E-200 as 1.5-200
        columns = np.array(text.split(), dtype=float).reshape(-1, 4)
        shape[columns[:, 0].astype(int) - 1] = columns[:, 1:]
    return np.array(frequencies), shapes


def read_matrix(path, size):
    """Symmetric sparse matrix from CalculiX's triplets of one triangle."""
    row, column, value = np.fromfile(path, sep=" ").reshape(-1, 3).T
    row, column = row.astype(np.int32) - 1, column.astype(np.int32) - 1
    triangle = sp.coo_matrix((value, (row, column)), shape=(size, size)).tocsr()
    return triangle + sp.triu(triangle, 1).T + sp.tril(triangle, -1).T


def read_dofs(path):
    """(node, component) of every row, counted from 0."""
    with open(path) as dof:
        pairs = [line.strip().split(".") for line in dof]
    return np.array(pairs, dtype=int) - 1


def condense_hidden(stiffness, mass, hidden):
    """Static (Guyan) condensation of the hidden dofs of C3D8I, whose stiffness is block diagonal (9 x 9)."""
    kept, gone = np.flatnonzero(~hidden), np.flatnonzero(hidden)
    k_gg, k_gk = stiffness[gone][:, gone].tocsr(), stiffness[gone][:, kept]
    follow = -invert_blocks(k_gg) @ k_gk
    m_kg_follow = mass[kept][:, gone] @ follow
    condensed_mass = mass[kept][:, kept] + m_kg_follow + m_kg_follow.T + follow.T @ mass[gone][:, gone] @ follow
    return (stiffness[kept][:, kept] + k_gk.T @ follow).tocsr(), condensed_mass.tocsr()


def invert_blocks(matrix, size=3 * HIDDEN_NODES):
    count = matrix.shape[0] // size
    entries = matrix.tocoo()
    assert np.all(entries.row // size == entries.col // size), "the hidden dofs of two elements are coupled"
    blocks = np.zeros((count, size, size))
    blocks[entries.row // size, entries.row % size, entries.col % size] = entries.data
    return sp.bsr_matrix((np.linalg.inv(blocks), np.arange(count), np.arange(count + 1)), shape=matrix.shape).tocsr()
