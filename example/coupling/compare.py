"""Runs of the program and pressure fields of different meshes side by side."""
import argparse
import csv
import pathlib
import subprocess

import h5py
import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import cKDTree

MM = 1e-3


def full_path(path):
    return str(pathlib.Path(path).resolve())


def command_line(description, work, **options):
    """Arguments of a study: --program, --work (a folder, made if need be) and `options`, the keywords of each."""
    arguments = argparse.ArgumentParser(description=description.split("\n")[0])
    arguments.add_argument("--program", required=True, type=full_path)
    arguments.add_argument("--work", type=pathlib.Path, default=pathlib.Path(work))
    for name, keywords in options.items():
        arguments.add_argument(f"--{name}", **keywords)
    a = arguments.parse_args()
    a.work.mkdir(exist_ok=True)
    return a


def run(program, work, name, text):
    """Run a case unless its result is there; the path of the result, None if the run failed (its log tells why)."""
    result = work / f"{name}.h5"
    if not result.exists():
        (work / f"{name}.nml").write_text(text)
        log = subprocess.run([program, "--output", result.name, f"{name}.nml"], cwd=work, text=True, capture_output=True)
        (work / f"{name}.log").write_text(log.stdout + log.stderr)
        if log.returncode:
            result.unlink(missing_ok=True)
            print(f"{name} failed: {log.stderr.strip()[-300:]}", flush=True)
            return None
    return result


def contact_points(f, dataset, interface=1):
    """x, y (mm) and the values at all contact points, lists or maps alike."""
    x, y = f[f"interface_{interface}/x"][:] / MM, f[f"interface_{interface}/y"][:] / MM
    v = f[dataset][:]
    if v.ndim == 2:
        x, y = (a.ravel() for a in np.meshgrid(x, y))
        v = v.ravel()
        x, y, v = (a[np.isfinite(v)] for a in (x, y, v))
    return x, y, v


class Raster:
    """Squares of `step` mm over a pad: `inside` tells which of them are in it; `mirror`: a half pad, y > 0, is mirrored."""

    def __init__(self, size, inside, step=0.1):
        self.step = step
        self.axes = [np.arange(-s / 2 + step / 2, s / 2, step) for s in size]
        self.x, self.y = np.meshgrid(*self.axes)
        self.inside = inside(self.x, self.y)

    def field(self, x, y, v, smooth=False):
        """Values on the raster: those of the nearest point, or (smooth) straight between the points."""
        if y.min() > -1e-6 - 0.5 * (y.max() - y.min()):         # a half pad
            x, y, v = np.append(x, x), np.append(y, -y), np.append(v, v)
        at = self.x[self.inside], self.y[self.inside]
        found = v[cKDTree(np.column_stack((x, y))).query(np.column_stack(at))[1]]
        if smooth:
            line = LinearNDInterpolator(np.column_stack((x, y)), v)(*at)
            found = np.where(np.isfinite(line), line, found)
        full = np.zeros(self.x.shape)
        full[self.inside] = found
        return full

    def means(self, fine, square):
        n = round(square / self.step)
        a, b = (s // n * n for s in fine.shape)
        return fine[:a, :b].reshape(a // n, n, b // n, n).mean(axis=(1, 3))


def distance(a, b):
    """Relative L2 norm of a - b, over b."""
    return np.linalg.norm(a - b) / np.linalg.norm(b)


def write_table(path, rows):
    """CSV of dictionaries with the same keys."""
    with open(path, "w", newline="") as out:
        table = csv.DictWriter(out, list(rows[0]))
        table.writeheader()
        table.writerows(rows)
