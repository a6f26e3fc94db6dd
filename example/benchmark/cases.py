"""The cases of the benchmark: the S4 Beam of input/s4_ringdown.nml with everything that a study varies as a field."""
from dataclasses import dataclass


@dataclass(frozen=True)
class Case:
    """One run. SI units."""
    model: str                 # FE model, HDF5
    nx: int = 42               # cells of the grid on each of the two pads
    ny: int = 26
    n_modes: int = 30
    time_step: float = 2e-5
    duration: float = 9.6e-3   # two periods of the first mode
    snapshots: tuple = (2.4e-3, 9.6e-3)
    amplitude: float = 530.0   # of the impact in the shape of the first linear mode
    pulse: float = 0.48e-3     # its duration, a multiple of all time steps
    solver: str = "condensed"
    tolerance: float = 1e-10
    compliance: str = ""       # '' leaves the choice to the program
    potential: str = "auto"
    threads: int = 1           # OMP_NUM_THREADS, not a key of the case file

    def steps(self):
        return round(self.duration / self.time_step)

    def text(self, cache):
        """The case file; `cache` is the file for the reduced model."""
        compliance = f"  compliance = '{self.compliance}'\n" if self.compliance else ""
        return (
            "&case  title = 'benchmark', analyses = 'preload', 'linear_modes', 'transient' /\n"
            f"&model  source = 'hdf5', file = '{self.model}' /\n"
            + "".join(self.pad(side) for side in ("left", "right"))
            + "&topography  name = 'form', source = 'hill', height = 12.14e-6 /\n"
            f"&reduction  n_modes = {self.n_modes}, cache = '{cache}' /\n"
            "&damping  ratio = 0.001, reference_mode = 1 /\n"
            f"&contact\n  solver = '{self.solver}'\n  tolerance = {self.tolerance}\n  max_iterations = 1000000\n{compliance}/\n"
            + "".join(bolt(side) for side in ("left", "right"))
            + "&load  name = 'impact', kind = 'modal', mode = 1 /\n"
            "&preload  loads = 'bolt_left', 'bolt_right', interface_force = 2*2210.0 /\n"
            f"&transient  duration = {self.duration}, time_step = {self.time_step} /\n"
            f"&excitation  load = 'impact', kind = 'half_sine', amplitude = {self.amplitude}, duration = {self.pulse} /\n"
            f"&output  sensors = 'sensor', snapshots = {', '.join(map(str, self.snapshots))} /\n")

    def pad(self, side):
        return (f"&interface\n  name = '{side}', side_a = 'pad_{side}_upper', side_b = 'pad_{side}_lower'\n"
                f"  friction = 0.6, young_modulus = 194e9, poisson_ratio = 0.2854\n  nx = {self.nx}, ny = {self.ny}\n"
                f"  holes = 0.0, 0.0, 4.365e-3\n  topography = 'form', potential = '{self.potential}', coupling = 'series'\n/\n")


def bolt(side):
    """A bolt's two halves are pulled together."""
    return (f"&load\n  name = 'bolt_{side}', node_set = 'bolt_{side}_plane_upper', 'bolt_{side}_plane_lower'\n"
            "  direction = 0, 0, -1,  0, 0, 1\n  size = 2*1.0, distribution = 2*'area'\n/\n")
