"""Stiffness and mass of solid elements, many at once: C3D8I (incompatible modes, condensed) and C3D20 (fully integrated)."""
import numpy as np

CORNERS = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
                    [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float)
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
NODES = np.vstack((CORNERS, [0.5 * (CORNERS[a] + CORNERS[b]) for a, b in EDGES]))


def shapes_8(at):
    """Trilinear shape functions and their derivatives by the local coordinates, (8) and (3, 8)."""
    parts = 1 + at * CORNERS
    shape = parts.prod(axis=1) / 8
    return shape, np.array([np.delete(parts, d, 1).prod(axis=1) * CORNERS[:, d] / 8 for d in range(3)])


def shapes_20(at):
    """Serendipity shape functions and their derivatives, (20) and (3, 20)."""
    parts = 1 + at * NODES
    gradient = np.empty((3, 20))
    shape = np.empty(20)
    c, total = slice(0, 8), (at * CORNERS).sum(axis=1)
    base = parts[c].prod(axis=1) / 8
    shape[c] = base * (total - 2)
    for d in range(3):
        others = np.delete(parts[c], d, 1).prod(axis=1) / 8
        gradient[d, c] = CORNERS[:, d] * (others * (total - 2) + base)
    for k in range(8, 20):
        flat = int(np.flatnonzero(NODES[k] == 0)[0])
        others = [d for d in range(3) if d != flat]
        bubble = 1 - at[flat] ** 2
        shape[k] = bubble * parts[k, others].prod() / 4
        gradient[flat, k] = -2 * at[flat] * parts[k, others].prod() / 4
        gradient[others[0], k] = bubble * NODES[k, others[0]] * parts[k, others[1]] / 4
        gradient[others[1], k] = bubble * NODES[k, others[1]] * parts[k, others[0]] / 4
    return shape, gradient


def gauss_points(n):
    x, w = np.polynomial.legendre.leggauss(n)
    return [(np.array([x[i], x[j], x[k]]), w[i] * w[j] * w[k]) for i, j, k in np.ndindex(n, n, n)]


def strains(gradient):
    """(elements, 6, 3 n) from the derivatives of n functions by x, y, z, (elements, 3, n)."""
    m, _, n = gradient.shape
    strain = np.zeros((m, 6, n, 3))
    for row, pairs in enumerate((((0, 0),), ((1, 1),), ((2, 2),), ((1, 0), (0, 1)), ((2, 1), (1, 2)), ((2, 0), (0, 2)))):
        for derivative, component in pairs:
            strain[:, row, :, component] += gradient[:, derivative]
    return strain.reshape(m, 6, 3 * n)


def solid(points, young, poisson, density):
    """Stiffness and mass of the elements whose nodes stand at points (elements, 8 or 20, 3): two (elements, 3 n, 3 n)."""
    m, n, _ = points.shape
    shapes, order = (shapes_8, 2) if n == 8 else (shapes_20, 3)
    g = young / (2 * (1 + poisson))
    lame = 2 * g * poisson / (1 - 2 * poisson)
    law = np.diag([2 * g] * 3 + [g] * 3) + np.pad(np.full((3, 3), lame), (0, 3))
    extra = 3 if n == 8 else 0
    K, M = np.zeros((m, 3 * (n + extra), 3 * (n + extra))), np.zeros((m, 3 * n, 3 * n))
    middle = np.einsum("dn,mnc->mdc", shapes(np.zeros(3))[1], points)
    for at, weight in gauss_points(order):
        shape, local = shapes(at)
        jacobian = np.einsum("dn,mnc->mdc", local, points)
        size = np.linalg.det(jacobian)
        gradient = np.linalg.solve(jacobian, np.broadcast_to(local, (m, 3, n)))
        if extra:           # bubbles by the Jacobian of the middle: the patch test holds
            bubble = np.linalg.solve(middle, np.broadcast_to(np.diag(-2 * at), (m, 3, 3)))
            bubble = bubble * (np.linalg.det(middle) / size)[:, None, None]
            gradient = np.concatenate((gradient, bubble), axis=2)
        strain = strains(gradient)
        K += (weight * size)[:, None, None] * (strain.transpose(0, 2, 1) @ (law @ strain))
        M += (weight * size * density)[:, None, None] * np.kron(np.outer(shape, shape), np.eye(3))
    if extra:
        a = 3 * n
        K = K[:, :a, :a] - K[:, :a, a:] @ np.linalg.solve(K[:, a:, a:], K[:, a:, :a])
    return 0.5 * (K + K.transpose(0, 2, 1)), M
