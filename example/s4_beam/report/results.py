"""What the report takes from the result files. SI units; what is not there is None."""
import os
from dataclasses import dataclass

import h5py
import numpy as np

from stages import LEVELS


@dataclass
class Modal:
    """Frequency and damping ratio over amplitude, amplitudes ascending."""
    amplitude: np.ndarray
    frequency: np.ndarray
    damping: np.ndarray

    def limit(self):
        """Frequency and damping ratio at the smallest amplitude."""
        return self.frequency[0], self.damping[0]

    def at(self, amplitude):
        """Frequency and damping ratio at amplitudes in between."""
        x = np.log(amplitude)
        return [np.interp(x, np.log(self.amplitude), y, np.nan, np.nan) for y in (self.frequency, self.damping)]

    def amplitude_of_drop(self, part):
        """Where the frequency has fallen by this part for the first time; None if nowhere."""
        below = np.flatnonzero(self.frequency < (1.0 - part) * self.frequency[0])
        if not len(below):
            return None
        k = below[0]
        return float(np.interp(-(1.0 - part) * self.frequency[0], -self.frequency[k - 1:k + 1], self.amplitude[k - 1:k + 1]))


def without_leapfrog(frequency, time_step):
    """The frequency at which an exact integration would do the same: omega = (2/dt) sin(omega_leapfrog dt/2)."""
    return np.sin(np.pi * frequency * time_step) / (np.pi * time_step)


@dataclass
class Response:
    """Amplitude over frequency of excitation, frequencies ascending. `shifted`: the frequency without the leapfrog's error."""
    frequency: np.ndarray
    amplitude: np.ndarray
    shifted: np.ndarray

    def resonance(self):
        """Frequency and amplitude of the peak: a parabola through what is within 3 % of it, three points at least."""
        top = np.argsort(self.amplitude)[::-1]
        near = max(3, np.count_nonzero(self.amplitude > 0.97 * self.amplitude[top[0]]))
        x0 = self.shifted[top[0]]
        a, b, c = np.polyfit(self.shifted[top[:near]] - x0, self.amplitude[top[:near]], 2)
        return x0 - b / (2.0 * a), c - b * b / (4.0 * a)

    def at(self, frequencies):
        """Amplitudes in between, by cubics through the next four points; NaN outside."""
        values = np.full(len(frequencies), np.nan)
        for n, x in enumerate(frequencies):
            k = int(np.searchsorted(self.shifted, x))
            if 0 < k < len(self.shifted):
                some = slice(max(k - 2, 0), k + 2)
                nodes = self.shifted[some]
                weights = [np.prod((x - np.delete(nodes, j)) / (node - np.delete(nodes, j))) for j, node in enumerate(nodes)]
                values[n] = np.dot(weights, self.amplitude[some])
        return values


class Results:
    """The finished result files of all stages."""

    def __init__(self, folder, stages):
        self.files = {}
        for stage in stages:
            path = os.path.join(folder, stage.name + ".h5")
            if os.path.isfile(path):
                self.files[stage.name] = h5py.File(path, "r")

    def __contains__(self, name):
        return name in self.files

    def __getitem__(self, name):
        return self.files[name]

    def close(self):
        for file in self.files.values():
            file.close()

    def any(self):
        """Some file, for what all share: the one with flat pads does not."""
        return next((file for name, file in self.files.items() if name != "flat"), None)

    def seconds(self, name):
        """{stage of the program: wall time}; None without that file."""
        if name not in self:
            return None
        timing = self[name]["timing"]
        return dict(zip(timing["stage"].asstr()[()], map(float, timing["seconds"][()])))

    def modal(self, name, group):
        """From `group` of a stage's file, 'settling/ringdown_1' say."""
        if name not in self or group not in self[name]:
            return None
        data = self[name][group]
        columns = [data[key][()] for key in ("amplitude", "frequency", "damping_ratio")]
        order = np.argsort(columns[0])
        return Modal(*(column[order] for column in columns))

    def ringdown(self, name, impact):
        """After an impact, from 1, without the leapfrog's error."""
        modal = self.modal(name, f"settling/ringdown_{impact}")
        if modal:
            modal.frequency = without_leapfrog(modal.frequency, self.time_step(name))
        return modal

    def response(self, kind, level):
        """`kind`: 'response' (harmonic balance), 'stepped', 'swept'."""
        name = f"{kind}_{level}"
        if name not in self:
            return None
        if kind == "response":
            data = self[name]["harmonic_balance"]
            order = np.argsort(data["frequency"][()])
            frequency = data["frequency"][()][order]
            return Response(frequency, data["amplitude"][()][order], frequency)
        data = self[name]["transient/harmonics"]
        # The last window of every frequency counts.
        last = np.append(np.diff(data["step"][()]) != 0, True)
        frequency = data["frequency"][()][last]
        amplitude = np.sqrt(np.sum(data["amplitude"][()][last, 1:, 0] ** 2, axis=1))
        order = np.argsort(frequency)
        return Response(frequency[order], amplitude[order], without_leapfrog(frequency[order], self.time_step(name)))

    def responses(self):
        """{level: {kind: response}} of what is there."""
        every = {level: {kind: self.response(kind, level) for kind in ("response", "stepped", "swept")} for level in LEVELS}
        every = {level: {kind: r for kind, r in kinds.items() if r is not None} for level, kinds in every.items()}
        return {level: kinds for level, kinds in every.items() if kinds}

    def group_of(self, name):
        """The time integration of a stage: its group."""
        return self[name]["settling" if "settling" in self[name] else "transient"]

    def duration(self, name):
        """Simulated time."""
        return float(self.group_of(name)["time"][-1])

    def time_step(self, name):
        group = self.group_of(name)
        return self.duration(name) / int(group["steps"][()])

    def impact_times(self, name):
        """Begin of every impact, and the end."""
        count = self[name]["settling/amplitude"].shape[0]
        return np.linspace(0.0, self.duration(name), count + 1)

    def deflection(self, name):
        """Time and displacement of the sensor from the preload."""
        group = self[name]["settling"]
        return group["time"][()], group["sensor"][:, 0] - group["sensor"][0, 0]

    def interfaces(self, name):
        return sorted(key for key in self[name] if key.startswith("interface_"))

    def field(self, name, interface, key, impact):
        """A map [y, x] of the settling, of the impact with this number (0: before the first)."""
        return self[name][f"settling/{interface}/{key}"][impact]

    def residual_slip(self, name, interface, impact, since):
        """Distance [y, x] between the residual states after two impacts."""
        return np.hypot(*(self.field(name, interface, key, impact) - self.field(name, interface, key, since)
                          for key in ("slip_1", "slip_2")))

    def largest(self, name, make):
        """Largest number of the maps make(interface) of all interfaces."""
        return max(float(np.nanmax(make(interface))) for interface in self.interfaces(name))
