#!/usr/bin/env python3
"""Checks the error measures on histories and fields whose errors are known. Prints nothing if they are right."""
import math

import numpy as np

from errors import history_error, patch_forces, ring_down, traction_error

ROUNDING = 1e-12


def grid(nx, ny, function):
    """Cell centres on [-3, 3] x [-2, 2] and a traction field (1, 3, ny, nx) on them."""
    x, y = (np.arange(nx) + 0.5) / nx * 6.0 - 3.0, (np.arange(ny) + 0.5) / ny * 4.0 - 2.0
    return x, y, np.stack([function(*np.meshgrid(x, y))] * 3)[None]


def main():
    fine, coarse = np.linspace(0.0, 1.0, 401), np.linspace(0.0, 1.0, 101)
    l2, largest = history_error(coarse, 1.1 * np.sin(coarse), fine, np.sin(fine))
    assert math.isclose(l2, 0.1, rel_tol=ROUNDING) and math.isclose(largest, 0.1, rel_tol=ROUNDING)

    # The same grid: cell by cell. Another grid: patches keep the resultant, and a constant is the same on every grid.
    one, other, finest = (grid(nx, ny, lambda x, y: 1.0 + x * y**2) for nx, ny in ((20, 13), (60, 39), (400, 260)))
    assert traction_error([one], [one]) == (0.0, 0.0)
    assert np.allclose(patch_forces(*one).sum((-1, -2)), one[2].mean((-1, -2)) * 24.0, rtol=ROUNDING)
    assert traction_error([other], [finest])[0] < traction_error([one], [finest])[0] / 3.0
    flat = [grid(nx, ny, lambda x, y: 2.0 + 0.0 * x) for nx, ny in ((20, 13), (33, 17))]
    assert traction_error(flat[:1], flat[1:])[1] < ROUNDING

    # A decaying sine: its energy falls with twice the rate of its displacement.
    time, omega, zeta = np.linspace(0.0, 0.05, 20001), 2.0 * math.pi * 200.0, 0.01
    frequency, damping = ring_down(time, np.exp(-zeta * omega * time) * np.sin(omega * time), np.exp(-2.0 * zeta * omega * time), 1e-3)
    assert math.isclose(frequency, 200.0, rel_tol=1e-6) and math.isclose(damping, zeta, rel_tol=1e-6)


if __name__ == "__main__":
    main()
