"""The studies: what is varied, against which reference. Each is a list of variations of one case; the short and the full
benchmark differ in the case and in the lists only."""
import math
from dataclasses import dataclass, field, replace

from cases import Case
from models import model_file

REFERENCE_TOLERANCE = 1e-13


@dataclass
class Variation:
    label: str        # at its point in the diagram
    curve: str        # the points of one curve belong together
    case: Case
    references: list  # the first of these cases that runs is the reference


@dataclass
class Study:
    name: str
    title: str
    text: str
    parameter: str              # what is varied: a column of the table (tables.py), an axis of the diagram
    variations: list
    labels: str = ""            # what the labels of the variations are, if not values of the parameter
    diagram: str = "precision"  # or "scaling", "threads" (diagrams.py)
    missing: list = field(default_factory=list)  # what cannot be run here, and why


def short_studies(program, folder):
    """{name: what makes the study}; about two minutes on two cores."""
    base = Case(model=model_file("coarse", program, folder))
    brief = replace(base, duration=2.4e-3, snapshots=(2.4e-3,))
    grids = [(20, 13), (28, 18), (42, 26), (63, 40)]
    return {
        "time_step": lambda: time_step_study(base, [4e-5, 2e-5, 1e-5, 5e-6], 1.25e-6),
        "modes": lambda: modes_study(replace(base, time_step=1e-5), [5, 10, 20, 30], 60),
        "grid": lambda: grid_study(base, grids[:3], grids[3:]),
        "tolerance": lambda: tolerance_study(base, [1e-3, 1e-5, 1e-7, 1e-9]),
        "solvers": lambda: solver_study([
            ("20 x 13 cells", hard_impact(replace(base, nx=20, ny=13)), [1e-3, 1e-5, 1e-7], [1e-3, 1e-5, 1e-7]),
            ("42 x 26 cells", hard_impact(base), [1e-3, 1e-5, 1e-7], [1e-2])]),
        "scaling": lambda: scaling_study(hard_impact(replace(base, time_step=5e-6), 80), grids, {
            "condensed, chosen points": ({}, math.inf),
            "condensed fft, chosen points": ({"compliance": "fft"}, 2500),
            "jacobi_eliminated, chosen points": ({"solver": "jacobi_eliminated"}, 2500)}),
        "threads": lambda: thread_study([
            ("42 x 26 cells", brief, ["condensed", "jacobi_eliminated"]),
            ("63 x 40 cells", replace(brief, nx=63, ny=40), ["condensed"])], [1, 2]),
    }


def full_studies(program, folder):
    """Hours: mainly the plain Jacobi iteration."""
    base = Case(model=model_file("full", program, folder), nx=84, ny=53)
    small = Case(model=model_file("coarse", program, folder), nx=20, ny=13)
    middle = replace(base, nx=42, ny=26)
    large = replace(base, nx=126, ny=79, duration=2.4e-3, snapshots=(2.4e-3,))
    tolerances = [1e-2, 1e-4, 1e-6, 1e-8]
    grids = [(20, 13), (28, 18), (42, 26), (63, 40), (84, 53), (126, 79)]
    finest = [(200, 125), (168, 106)]
    return {
        "time_step": lambda: time_step_study(base, [4e-5, 2e-5, 1e-5, 5e-6, 2.5e-6, 1.25e-6], 3.125e-7),
        "modes": lambda: modes_study(replace(base, time_step=5e-6), [5, 10, 15, 20, 30, 45, 60, 90], 120),
        "grid": lambda: grid_study(base, grids, [*finest, grids[-1]]),
        "mesh": lambda: mesh_study(base, ["coarse", "medium", "full", "fine"], program, folder),
        "tolerance": lambda: tolerance_study(base, [10.0 ** -k for k in range(2, 12)]),
        "solvers": lambda: solver_study([
            ("coarse FE, 20 x 13 cells", hard_impact(small), tolerances, [1e-2, 1e-4, 1e-6, 1e-8]),
            ("full FE, 42 x 26 cells", hard_impact(middle), tolerances, [1e-2, 1e-4, 1e-6]),
            ("full FE, 84 x 53 cells", hard_impact(base), tolerances, [1e-2])]),
        "scaling": lambda: scaling_study(hard_impact(replace(base, time_step=1e-5), 40), grids + finest[::-1], {
            "condensed, chosen points": ({}, math.inf),
            "condensed, all points": ({"potential": "all"}, math.inf),
            "condensed fft, chosen points": ({"compliance": "fft"}, math.inf),
            "jacobi_eliminated, chosen points": ({"solver": "jacobi_eliminated"}, 10_000)}),
        "threads": lambda: thread_study([
            (name, case, ["condensed", "jacobi_eliminated"])
            for name, case in (("42 x 26 cells", middle), ("84 x 53 cells", base), ("126 x 79 cells", large))], [1, 2]),
    }


def hard_impact(case, steps=20):
    """A few steps that slip: an impact so hard that by their end nearly all closed points do."""
    duration = steps * case.time_step
    # The pulse begins linearly, so the displacement with the cube of time.
    return replace(case, amplitude=4000.0 * (4e-4 / duration) ** 3, duration=duration, snapshots=(duration,))


def time_step_study(base, steps, finest):
    reference = replace(base, time_step=finest)
    return Study(
        "time_step", "Time step",
        f"Error of the time integration alone: the reference is the same case with a time step of {micro(finest)}.",
        "time_step",
        [Variation(micro(dt), base.solver, replace(base, time_step=dt), [reference]) for dt in steps])


def modes_study(base, numbers, most):
    reference = replace(base, n_modes=most)
    return Study(
        "modes", "Number of modes",
        f"Error of the reduction: the reference keeps {most} modes. All with a time step of {micro(base.time_step)}, which "
        "is stable with the most modes; with fewer a longer one would do.",
        "modes",
        [Variation(str(n), base.solver, replace(base, n_modes=n), [reference]) for n in numbers])


def grid_study(base, grids, finest):
    references = [replace(base, nx=nx, ny=ny) for nx, ny in finest]
    return Study(
        "grid", "Boundary-element grid",
        f"Error of the contact grid; the reference has {cells(finest[0])} on each pad"
        + (", or the next coarser of this list that runs: " + ", ".join(map(cells, finest[1:])) if finest[1:] else "")
        + ". Different grids are compared by forces on patches, and resolve the bore differently.",
        "grid_points",
        [Variation(f"{nx}x{ny}", base.solver, replace(base, nx=nx, ny=ny), references) for nx, ny in grids],
        labels="cells on each pad")


def mesh_study(base, names, program, folder):
    """Meshes from coarse to fine. Those that cannot be made here are told, not run."""
    found, missing = {}, []
    for name in names:
        try:
            found[name] = replace(base, model=model_file(name, program, folder))
        except RuntimeError as fault:
            missing.append(f"mesh {name}: {fault}")
    *others, finest = found
    return Study(
        "mesh", "Finite-element mesh",
        f"Error of the FE mesh, with {cells((base.nx, base.ny))} on each pad: the reference is the mesh `{finest}` "
        "(doc/benchmark.md), itself not converged: every mesh adds its own compliance at the pads to that of the half space.",
        "fe_coordinates",
        [Variation(name, base.solver, found[name], [found[finest]]) for name in others], missing=missing)


def tolerance_study(base, tolerances):
    reference = replace(base, tolerance=REFERENCE_TOLERANCE)
    return Study(
        "tolerance", "Tolerance of the contact solver",
        f"Error of the contact solver alone, over {1e3 * base.duration:.3g} ms: the reference is the condensed solver at "
        f"{power(REFERENCE_TOLERANCE)}.",
        "tolerance",
        [Variation(power(tolerance), solver, replace(base, solver=solver, tolerance=tolerance), [reference])
         for solver in ("condensed", "jacobi_eliminated") for tolerance in tolerances])


def solver_study(scenes):
    """[(name, case, tolerances, those of the plain solver)], every solver on every one."""
    return Study(
        "solvers", "Solvers side by side",
        "The same few steps by every solver, under an impact that makes nearly all closed points slip by their end. Only the "
        f"error of the solver: the reference of each scene is the condensed one at {power(REFERENCE_TOLERANCE)}. *times faster*: "
        "against the cheapest run of the plain solver `jacobi` on this scene that is not more accurate in the contact forces. "
        "The time is that of the steps; the start of the solvers (matrices, factors) is in its own column.",
        "tolerance",
        [Variation(power(tolerance), f"{solver}, {name}", replace(case, solver=solver, tolerance=tolerance),
                   [replace(case, tolerance=REFERENCE_TOLERANCE)])
         for name, case, tolerances, plain in scenes
         for solver, values in (("condensed", tolerances), ("jacobi_eliminated", tolerances), ("jacobi", plain))
         for tolerance in values])


def scaling_study(base, grids, curves):
    """`curves`: {name: (what is different from the base case, grid points up to which it is tried)}."""
    references = [replace(base, nx=nx, ny=ny) for nx, ny in sorted(grids, reverse=True)]
    return Study(
        "scaling", "Number of contact points",
        f"{base.steps()} slipping steps on grids of growing fineness. *chosen points*: the program picks those that may come "
        "into contact, as by default; *all points*: every grid point takes part (`potential = 'all'`). The program chooses "
        "whether it holds matrices; with *fft* it must not (`compliance = 'fft'`). The reference is the finest grid that ran. "
        "What does not fit is a row that says so.",
        "contact_points",
        [Variation(f"{nx}x{ny}", name, replace(base, nx=nx, ny=ny, **changes), references)
         for name, (changes, limit) in curves.items() for nx, ny in grids if 2 * nx * ny <= limit],
        labels="cells on each pad", diagram="scaling")


def thread_study(scenes, counts):
    """[(name, case, solvers)]"""
    return Study(
        "threads", "Threads",
        f"The same case with OMP_NUM_THREADS at different values; the reference of the errors is the run with {counts[0]}.",
        "threads",
        [Variation(str(n), f"{solver}, {name}", replace(case, threads=n, solver=solver),
                   [replace(case, threads=counts[0], solver=solver)])
         for name, case, solvers in scenes for solver in solvers for n in counts], diagram="threads")


def micro(seconds):
    return f"{1e6 * seconds:.4g} µs"


def power(tolerance):
    return f"{tolerance:.0e}".replace("e-0", "e-")


def cells(grid):
    return f"{grid[0]} x {grid[1]} cells"
