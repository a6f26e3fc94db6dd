"""Every number of the paper beside ours, from the result files."""
import csv
from dataclasses import dataclass

import numpy as np

import paper
from stages import LEVELS

NOTICEABLE = 1e-3        # of a frequency
COMPARED = (1e-6, 1e-4)  # m: between these amplitudes curves over amplitude are compared


@dataclass
class Row:
    """One line of the table. `paper` is a number or words; `holds` is whether a claim of the paper holds here too."""
    figure: str
    what: str
    unit: str
    paper: object
    ours: float
    holds: object = None


def rows(results):
    """All rows for which there are results."""
    every = []
    for part in (linear_rows, quasi_static_rows, ringdown_rows, settling_rows, resonance_rows):
        every += part(results)
    return every


def linear_rows(results):
    file = results.any()
    if file is None:
        return []
    frequency = file["linear_modes/frequency"][()]
    return [Row("tab. 3", f"linear frequency after preload, 1st {name}", "Hz", value, frequency[k])
            for k, (name, value) in enumerate(paper.LINEAR.items())]


def quasi_static_rows(results):
    qsma, epmc, flat = results.modal("qsma", "qsma"), results.modal("epmc", "epmc"), results.modal("flat", "qsma")
    lines = []
    for curve, name in ((qsma, "QSMA"), (epmc, "EPMC"), (flat, "flat")):
        if curve:
            title = "QSMA, flat pads (paper: Abaqus)" if name == "flat" else name
            lines.append(Row("7, 8", f"low-amplitude frequency, {title}", "Hz", paper.LIMITS[name], curve.limit()[0]))
    if flat and qsma:
        paper_ratio = paper.LIMITS["flat"] / paper.LIMITS["QSMA"] - 1.0
        lines.append(Row("7", "flat pads: low-amplitude frequency above that of the hill", "%", 100.0 * paper_ratio,
                         100.0 * (flat.limit()[0] / qsma.limit()[0] - 1.0)))
    if qsma:
        lines.append(Row("7", "low-amplitude damping ratio, QSMA", "%", 100.0 * paper.DAMPING, 100.0 * qsma.limit()[1]))
        drop = 1.0 - qsma.at(paper.DROP_AMPLITUDE)[0] / qsma.limit()[0]
        lines.append(Row("7", f"frequency drop at {paper.DROP_AMPLITUDE * 1e3:g} mm", "%", f"below {100.0 * paper.DROP:g}",
                         100.0 * drop, bool(drop < paper.DROP)))
        where = qsma.amplitude_of_drop(paper.DROP)
        if where:
            lines.append(Row("7", "amplitude at which the frequency has dropped by 1 % (gross slip begins)", "mm",
                             f"above {paper.DROP_AMPLITUDE * 1e3:g}", 1e3 * where, bool(where > paper.DROP_AMPLITUDE)))
    if qsma and epmc:
        lines += differences("8", "EPMC against QSMA", epmc, qsma, "well aligned")
    return lines


def ringdown_rows(results):
    lines = []
    qsma, settled = results.modal("qsma", "qsma"), results.ringdown("ringdown", 2)
    if settled:
        smallest = f"{1e6 * settled.amplitude[0]:.2g} um"
        lines.append(Row("8, 9", f"low-amplitude frequency, settled ring-down (at {smallest})", "Hz", paper.LIMITS["ring-down"],
                         settled.limit()[0]))
        lines.append(Row("8, 9", "low-amplitude damping ratio, settled ring-down", "%", 100.0 * paper.DAMPING,
                         100.0 * settled.limit()[1]))
    if settled and qsma:
        over = settled.limit()[0] / qsma.at(settled.amplitude[0])[0] - 1.0
        lines.append(Row("8", "settled ring-down above QSMA, frequency at the same low amplitude", "%",
                         100.0 * (paper.LIMITS["ring-down"] / paper.LIMITS["QSMA"] - 1.0), 100.0 * over, bool(over > NOTICEABLE)))
        lines += differences("8", "settled ring-down against QSMA", settled, qsma, "damping well aligned")
    after = results.modal("ringdown", "qsma")
    if after and qsma:
        lines.append(Row("8", "QSMA from the settled state against QSMA from the preload, frequency", "%", "",
                         100.0 * largest_difference(after, qsma)[0]))
    return lines


def settling_rows(results):
    if "settling" not in results:
        return []
    time, motion = results.deflection("settling")
    starts = results.impact_times("settling")
    amplitude = results["settling"]["settling/amplitude"][()]
    first = (time >= starts[0]) & (time < starts[1])
    peak = np.max(np.abs(motion[first]))
    lines = [Row("12, 13", "peak at the sensor, first high impact", "mm", 1e3 * paper.PEAK, 1e3 * peak)]
    stronger = int(np.argmax(amplitude > 1.5 * amplitude[0])) + 1  # the first super-high impact, counted from 1
    for level, impact in (("high", 1), ("super-high", stronger)):
        slip = results.largest("settling", lambda k, n=impact: results.field("settling", k, "largest_slip", n))
        rest = results.largest("settling", lambda k, n=impact: results.residual_slip("settling", k, n, n - 1))
        for name, ours, theirs in (("largest slip", slip, 0), ("residual slip", rest, 1)):
            lines.append(Row("sec. 3.5", f"{name}, first {level} impact", "um", 1e6 * paper.SLIP[level][theirs], 1e6 * ours))
    static = results["settling"]["settling/static_position"][:, 0]
    lines.append(Row("13", "static shift at the sensor, first super-high impact", "um", 1e6 * paper.STATIC_SHIFT,
                     1e6 * abs(static[stronger] - static[stronger - 1])))
    lines.append(Row("sec. 3.5", f"closed points that slip, mean from {paper.SETTLED:g} s after the first impact", "%",
                     "a few spots", 100.0 * slipping_share(results, starts[0] + paper.SETTLED, starts[1])))
    for impact, title in ((0, "after preload"), (2, "after the 2nd impact"), (5, "after the 5th impact")):
        ratio = results.largest("settling", lambda k, n=impact: results.field("settling", k, "slip_ratio", n))
        lines.append(Row("14", f"largest residual slip ratio {title}", "1", "negligible" if impact == 0 else "", ratio))
    return lines + repeated_rows(results, stronger - 1)


def repeated_rows(results, count):
    """Equal impacts, the first `count`: do the later ones give the same?"""
    curves = [results.ringdown("settling", k) for k in range(1, count + 1)]
    first, later = largest_difference(curves[0], curves[1]), [largest_difference(curve, curves[1]) for curve in curves[2:]]
    lines = []
    for k, name in enumerate(("frequency", "damping ratio")):
        worst = max(difference[k] for difference in later)
        lines.append(Row("13", f"impacts 2 to {count} among themselves, {name}", "%", "the same", 100.0 * worst,
                         bool(worst < paper.ALIKE)))
        lines.append(Row("13", f"impact 1 against impact 2, {name}", "%", "", 100.0 * first[k]))
    return lines


def slipping_share(results, begin, end):
    group = results["settling"]["settling"]
    time = group["time"][()]
    inside = (time > begin) & (time < end)
    slip, stick = (group[f"contact/{name}"][()][inside] for name in ("slip", "stick"))
    return float(np.mean(slip / (slip + stick)))


def resonance_rows(results):
    lines = []
    for level, kinds in results.responses().items():
        if "response" not in kinds:
            continue
        f0, a0 = kinds["response"].resonance()
        lines.append(Row("16", f"{level} level: resonance by harmonic balance, frequency", "Hz", "", f0))
        lines.append(Row("16", f"{level} level: amplitude there", "mm", "", 1e3 * a0))
        for kind in ("stepped", "swept"):
            if kind not in kinds:
                continue
            f, a = kinds[kind].resonance()
            against = f"{level} level: {kind} sine against harmonic balance"
            lines.append(Row("16", f"{against}, amplitude at resonance", "%", f"agree (within {100.0 * paper.ALIKE:g})",
                             100.0 * (a / a0 - 1.0), bool(abs(a / a0 - 1.0) < paper.ALIKE)))
            lines.append(Row("16", f"{against}, frequency of resonance", "%", "agree", 100.0 * (f / f0 - 1.0)))
        if "stepped" in kinds:
            curve = kinds["stepped"]
            off = curve.amplitude / kinds["response"].at(curve.shifted) - 1.0
            near = (curve.amplitude > 0.5 * a0) & np.isfinite(off)
            what = f"{level} level: stepped sine against harmonic balance, largest difference above half the peak"
            lines.append(Row("16", what, "%", "agree", 100.0 * np.max(np.abs(off[near]))))
    return lines


def largest_difference(curve, reference):
    """Largest relative differences in frequency and damping ratio, at the amplitudes of the curve."""
    inside = (curve.amplitude >= COMPARED[0]) & (curve.amplitude <= COMPARED[1])
    theirs = reference.at(curve.amplitude[inside])
    return [float(np.nanmax(np.abs(a[inside] / b - 1.0))) for a, b in zip((curve.frequency, curve.damping), theirs)]


def differences(figure, what, curve, reference, words):
    found = largest_difference(curve, reference)
    return [Row(figure, f"{what}, {name}, largest difference up to 0.1 mm", "%", words, 100.0 * value)
            for name, value in zip(("frequency", "damping ratio"), found)]


# ---------------------------------------------------------------------------------------------------------- wall times

def wall_rows(results):
    """[(what, simulated s here, in the paper; wall s here, in the paper)], None where there is no number."""
    lines = []
    first = results.seconds("qsma") or {}  # the other stages take the reduced model from a cache
    for what, key in (("component mode synthesis", "reduction"), ("contact matrices", "contact matrices"),
                      ("preload", "preload"), ("quasi-static modal analysis", "qsma")):
        if key in first:
            lines.append((what, None, None, first[key], paper.WALL[key]))
    if "epmc" in results:
        lines.append(("nonlinear mode (EPMC)", None, None, results.seconds("epmc")["epmc"], None))
    if "levels" in results:
        seconds, span = integration_seconds(results, "levels"), results.duration("levels")
        lines.append(("1 ms of ring-down, mean over three impacts", 1e-3, 1e-3, 1e-3 * seconds / span,
                      paper.WALL["ringdown per ms"]))
    if "settling" in results:
        lines.append(("settling, six impacts", results.duration("settling"), paper.SIMULATED["settling"],
                      integration_seconds(results, "settling"), paper.WALL["settling"]))
    both = [name for name in (f"response_{level}" for level in LEVELS) if name in results]
    if len(both) == len(LEVELS):
        seconds = sum(results.seconds(name)["harmonic balance"] for name in both)
        lines.append(("harmonic balance, both levels", None, None, seconds, None))
    for kind in ("stepped", "swept"):
        both = [name for name in (f"{kind}_{level}" for level in LEVELS) if name in results]
        if len(both) == len(LEVELS):
            lines.append((f"{kind} sine, both levels", sum(map(results.duration, both)), paper.SIMULATED[kind],
                          sum(integration_seconds(results, name) for name in both), paper.WALL[kind]))
    return lines


def integration_seconds(results, name):
    """Wall time of the time integration with its start and its output."""
    seconds = results.seconds(name)
    return sum(seconds.get(key, 0.0) for key in ("transient start", "transient", "settling", "write"))


# ------------------------------------------------------------------------------------------------------------- writing

def write_csv(path, every, walls):
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["figure", "quantity", "unit", "paper", "microslip", "holds"])
        for row in every:
            writer.writerow([row.figure, row.what, row.unit, shown(row.paper), shown(row.ours), word(row.holds)])
        for what, _, _, ours, theirs in walls:
            writer.writerow(["", f"wall time: {what}", "s", shown(theirs), shown(ours), ""])


def shown(value):
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:.6g}" if abs(value) >= 100.0 else f"{value:.4g}"


def word(holds):
    return {None: "", True: "yes", False: "no"}[holds]
