"""Tied frequencies of the S4 Beam by CalculiX, the modes named by their shape, and a test of the stored matrices."""
import datetime
import math
import os

import numpy as np

import s4_calculix
import s4_mesh

MODES = 32
CUT_OFF = 5000.0  # Hz
NAMED = ("1st in-phase", "1st out-of-phase", "3rd out-of-phase")
# An independent model (36 000 nodes, same dimensions):
# tied radius (mm) -> the named modes (Hz), number of modes below the cut-off
REFERENCE = {math.inf: (218.5, 280.2, 1504.0, 28), 12.7: (213.7, 263.2, 1396.0, 29), 10.0: (212.0, 257.7, 1360.0, 30),
             8.73: (211.2, 254.1, 1336.0, 30), 7.65: (210.3, 249.4, 1307.0, 30), 6.67: (209.3, 242.8, 1269.0, 30)}


def tied_modes(mesh, radius, folder, threads):
    """Frequencies and shapes by CalculiX, with the pads tied within `radius` of the bolt axes."""
    pairs = s4_mesh.pad_pairs(mesh, radius)
    title = f"S4 Beam, pads tied: {radius_text(radius)}"
    s4_calculix.write_tied_deck(os.path.join(folder, "tied.inp"), mesh, pairs, MODES, title)
    s4_calculix.run(folder, "tied", threads)
    frequencies, shapes = s4_calculix.read_modes(os.path.join(folder, "tied.dat"), len(mesh.coordinates))
    shapes[:, pairs[:, 1]] = shapes[:, pairs[:, 0]]
    return frequencies, shapes


# --- modes by shape -----------------------------------------------------------------------------------------------

def named_modes(mesh, frequencies, shapes):
    """{name: frequency} of the lowest bending mode of each kind: phase between the beams, number of half waves."""
    upper, lower = (outer_centre_line(mesh, sign) for sign in (+1, -1))
    found = {}
    for frequency, shape in zip(frequencies, shapes):
        w_upper, w_lower = shape[upper, 2], shape[lower, 2]
        if w_upper @ w_upper + w_lower @ w_lower < 0.8 * np.sum(shape[np.concatenate([upper, lower])]**2):
            continue  # lateral, torsional or axial
        cosine = w_upper @ w_lower / math.sqrt((w_upper @ w_upper) * (w_lower @ w_lower))
        if abs(cosine) < 0.9:
            continue  # one beam moves more than the other
        half_waves = {1: "1st", 2: "2nd", 3: "3rd"}.get(count_half_waves(w_upper))
        found.setdefault(f"{half_waves} {'in' if cosine > 0 else 'out-of'}-phase", frequency)
    return {name: found.get(name, math.nan) for name in NAMED}


def outer_centre_line(mesh, sign):
    """Nodes at y = 0, z = +-12.7 of a slender part, along x."""
    x, y, z = mesh.coordinates.T
    clear_of_pads = (x > s4_mesh.PAD_LENGTH + 1e-4) & (x < s4_mesh.LENGTH - s4_mesh.PAD_LENGTH - 1e-4)
    line = np.flatnonzero(clear_of_pads & (abs(y) < 1e-4) & (abs(z - sign * s4_mesh.HEIGHT) < 1e-4))
    return line[np.argsort(x[line])]


def count_half_waves(deflection):
    clear = deflection[abs(deflection) > 0.1 * abs(deflection).max()]
    return 1 + np.count_nonzero(np.diff(np.sign(clear)))


# --- the stored matrices ------------------------------------------------------------------------------------------

def matrix_frequencies(mesh, shapes, folder, job):
    """Rayleigh quotients (as Hz) of CalculiX's tied shapes with the stored matrices, hidden dofs condensed."""
    path = os.path.join(folder, job)
    dofs = s4_calculix.read_dofs(path + ".dof")
    stiffness, mass = (s4_calculix.read_matrix(path + ending, len(dofs)) for ending in (".sti", ".mas"))
    hidden = dofs[:, 0] >= len(mesh.coordinates)
    stiffness, mass = s4_calculix.condense_hidden(stiffness, mass, hidden)
    node, component = dofs[~hidden].T
    vectors = shapes[:, node, component].T
    quotients = np.sum(vectors * (stiffness @ vectors), axis=0) / np.sum(vectors * (mass @ vectors), axis=0)
    return np.sqrt(quotients) / (2 * np.pi)


# --- output -------------------------------------------------------------------------------------------------------

def radius_text(radius):
    return "whole pad" if math.isinf(radius) else f"r = {radius:g} mm"


def comparison_line(radius, frequencies, named):
    """One row: measured, the reference and the difference in per cent."""
    reference = REFERENCE.get(radius, (math.nan,) * 4)
    cells = [f"{named[name]:8.2f} ({value:6.1f}, {100 * (named[name] / value - 1):+5.2f} %)"
             for name, value in zip(NAMED, reference)]
    return f"{radius_text(radius):>11}  " + "  ".join(cells) + f"  {np.sum(frequencies < CUT_OFF)} ({reference[3]})"


class Table:
    """Tied frequencies as text: one line per mode."""

    def __init__(self, path, size, mesh):
        self.path, self.size = path, size
        with open(path, "w") as table:
            table.write(f"# Tied frequencies of the S4 Beam, {size} model: {len(mesh.coordinates)} nodes, C3D8I\n"
                        "# Made by example/s4_beam/build_model --check with CalculiX "
                        f"{s4_calculix.version()} (*FREQUENCY), {datetime.date.today()}\n"
                        "# radius: pad nodes up to this distance (mm) from a bolt axis are tied; inf = the whole pad\n"
                        "size,radius_mm,mode,frequency_hz,name\n")

    def add(self, radius, frequencies, named):
        names = {frequency: name for name, frequency in named.items()}
        with open(self.path, "a") as table:
            for mode, frequency in enumerate(frequencies[frequencies < CUT_OFF], 1):
                table.write(f"{self.size},{radius:g},{mode},{frequency:.4f},{names.get(frequency, '')}\n")
