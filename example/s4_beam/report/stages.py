"""The runs behind the report: each is a shipped case of the full model, with a few keys changed."""
import os
from dataclasses import dataclass

from case_edits import edited

CASES = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
COARSE = os.path.join(CASES, "..", "..", "input", "s4_coarse.h5")

# Factors on the modal load: impacts, and harmonic loads that give about 0.04 mm and 0.13 mm at resonance.
LOW, MEDIUM, HIGH, SUPER_HIGH = 51.0, 170.0, 510.0, 2040.0
LEVELS = {"medium": 0.2, "high": 1.6}
# The less is lost to friction the longer the vibration lags behind a sweep (Hz/s) and takes to become steady.
RATES = {"medium": 0.0625, "high": 0.125}
STEADY = {"medium": {"steady_tolerance": "1e-4", "most_windows": "60"}, "high": {"steady_tolerance": "5e-4", "most_windows": "40"}}


@dataclass(frozen=True)
class Stage:
    """One run. `changes` as in case_edits."""
    name: str
    title: str
    source: str
    changes: dict


def stages():
    """In the order in which they run: the cheap ones first."""
    only = "'preload', 'linear_modes', "
    shaker, response, mode = "load shaker", "harmonic_balance", "epmc"
    qsma = {"smallest_amplitude": "1e-7", "largest_amplitude": "2.5e-4", "levels": "61"}  # to where gross slip begins
    yield Stage("qsma", "quasi-static modal analysis from the preload", "s4_qsma.nml", {
        "reduction": {"cache": None}, "qsma": qsma})  # so that this one has the time of the reduction
    yield Stage("flat", "quasi-static modal analysis, flat pads, 42 x 26 cells", "s4_qsma.nml", {
        "interface": {"nx": "42", "ny": "26", "topography": None}, "topography": None,
        "qsma": {**qsma, "levels": "21", "largest_amplitude": "1.5e-4"}})
    yield Stage("epmc", "nonlinear mode by harmonic balance (EPMC)", "s4_frf.nml", {
        "case": {"analyses": only + "'epmc'"}, response: None, shaker: None,
        mode: {"amplitude_range": "1e-7, 1.8e-4", "points": "30"}})
    yield Stage("levels", "a low, a medium and a high impact", "s4_settling.nml", {
        "settling": {"amplitude": f"{LOW}, {MEDIUM}, {HIGH}", "interval": "0.6"}})
    yield Stage("ringdown", "two high impacts with 3 s of ring-down each, then quasi-static modal analysis", "s4_settling.nml", {
        "case": {"analyses": only + "'settling', 'qsma'"},
        "settling": {"amplitude": f"2*{HIGH}", "interval": "3.0"}, "qsma": {**qsma, "largest_amplitude": "2e-4"}})
    yield Stage("settling", "four high and two super-high impacts", "s4_settling.nml", {})
    for level, factor in LEVELS.items():
        yield Stage(f"response_{level}", f"frequency response by harmonic balance, {level} level", "s4_frf.nml", {
            "case": {"analyses": only + "'harmonic_balance'"}, mode: None,
            response: {"levels": str(factor), "frequency_range": "204.0, 209.0", "frequency_step": "0.1", "response_step": "0.1"}})
    for level, factor in LEVELS.items():
        yield Stage(f"swept_{level}", f"swept sine by time integration, {level} level", "s4_swept_sine.nml",
                    {"excitation": {"amplitude": str(factor), "rate": str(RATES[level])}})
    for level, factor in LEVELS.items():
        yield Stage(f"stepped_{level}", f"stepped sine by time integration, {level} level", "s4_stepped_sine.nml",
                    {"excitation": {"amplitude": str(factor)} | STEADY[level]})


def case_text(stage, model, folder):
    """The case file of a stage on a model: 'full' as CalculiX left it, 'coarse', or an HDF5 file of the full model."""
    with open(os.path.join(CASES, stage.source), encoding="utf-8") as file:
        text = file.read()
    built = os.path.join(CASES, "build", "s4_full")
    where = {"file": f"'{built}'", "mesh_file": f"'{built}.inp'"}
    changes = {}
    if model != "full":
        changes["model"] = None
        where = {"source": "'hdf5'", "file": f"'{os.path.abspath(COARSE if model == 'coarse' else model)}'"}
    if model == "coarse":
        text = text.replace("full model", "coarse model")
        changes["interface"] = {"nx": "42", "ny": "26"}
    text = edited(edited(text, changes), {"model": where})
    text = edited(text, {"reduction": {"cache": f"'{os.path.abspath(os.path.join(folder, 'reduction.h5'))}'"}})
    return f"! {stage.source} for `{stage.name}`: {stage.title}\n" + edited(text, stage.changes)
