"""The diagrams: frequency and damping over amplitude, impact sequence, frequency response, wall times."""
import os
import sys

import matplotlib
import numpy as np

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "postprocess"))
from plot_case import BLUE, GREEN, ORANGE, PURPLE, RED, STYLE  # noqa: E402  (it chooses matplotlib's back end)

import matplotlib.pyplot as plt  # noqa: E402

import paper  # noqa: E402

GREY = "#666666"
DOTS_PER_INCH = 120
RESPONSES = {"swept": ("swept sine", {"color": ORANGE, "linewidth": 2.6, "alpha": 0.8}),
             "response": ("harmonic balance", {"color": BLUE}),
             "stepped": ("stepped sine", {"color": RED, "marker": "o", "linestyle": "none", "markerfacecolor": "none"})}
matplotlib.rcParams.update({**STYLE, "lines.linewidth": 1.3, "lines.markersize": 4, "legend.fontsize": 7.5})


def save(figure, path):
    figure.savefig(path, dpi=DOTS_PER_INCH)
    plt.close(figure)


# ------------------------------------------------------------------------------------- frequency and damping over amplitude

def modal_figure(curves, path, most_damping, reference=None):
    """`curves`: [(label, Modal, its limit in the paper or None, style)]. Frequencies over each curve's own value at its smallest
    amplitude, as in the paper, or over `reference` where curves do not reach down to small amplitudes."""
    curves = [curve for curve in curves if curve[1] is not None]
    if not curves:
        return False
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
    for ax, letter in ((left, "a"), (right, "b")):
        ax.set(xscale="log", xlabel="amplitude at mid-span, um")
        ax.set_title(f"({letter})", loc="left")
    for label, modal, published, style in curves:
        limit = modal.limit()[0]
        if reference is None:
            label += f": {limit:.2f} Hz" + (f" (paper {published:.2f})" if published else "")
        left.plot(1e6 * modal.amplitude, modal.frequency / (reference or limit), label=label, **style)
        right.plot(1e6 * modal.amplitude, 100.0 * modal.damping, **style)
    paper_marks(left, right)
    over = "its value at the smallest amplitude" if reference is None else f"{reference:.2f} Hz"
    left.set(ylabel=f"frequency over {over}", ylim=(0.978, 1.002))
    right.set(ylabel="damping ratio, %", ylim=(0.0, most_damping))
    left.legend(title="frequency at the smallest amplitude" if reference is None else "ring-downs", title_fontsize=7.5,
                loc="lower left", alignment="left")
    right.legend(loc="upper left")
    save(figure, path)
    return True


def paper_marks(left, right):
    """What the paper states: less than 1 % up to 0.14 mm, damping that levels out at 0.1 %."""
    x = 1e6 * paper.DROP_AMPLITUDE
    low = left.get_xlim()[0]
    left.plot([low, x, x], [1.0 - paper.DROP] * 2 + [0.0], color=GREY, linewidth=0.8, linestyle="--", scalex=False,
              scaley=False)
    left.annotate(f"paper: above this line up to {x / 1e3:g} mm", (low, 1.0 - paper.DROP), xytext=(6, 3),
                  textcoords="offset points", fontsize=7, color=GREY)
    right.axhline(100.0 * paper.DAMPING, color=GREY, linewidth=0.8, linestyle="--",
                  label=f"paper: levels out at {100.0 * paper.DAMPING:g} %")


def modal_figures(results, folder):
    """[(file, whether it is there, caption)]: figures 7, 8 and 9."""
    qsma, settled = results.modal("qsma", "qsma"), results.ringdown("ringdown", 2)
    figures = [("figure_07.png", 1.0, None, "Quasi-static modal analysis (QSMA), with the hill and with flat pads", [
        ("hill", qsma, paper.LIMITS["QSMA"], {"color": BLUE, "marker": "o", "markersize": 3}),
        ("flat", results.modal("flat", "qsma"), paper.LIMITS["flat"], {"color": RED, "marker": "s", "markersize": 3})])]
    figures.append(("figure_08.png", 1.0, None, "The first mode by quasi-static analysis, nonlinear mode (EPMC) and ring-down", [
        ("QSMA", qsma, paper.LIMITS["QSMA"], {"color": BLUE, "linewidth": 4.0, "alpha": 0.4}),
        ("ring-down, 1st impact", results.ringdown("ringdown", 1), None, {"color": GREEN, "linewidth": 2.2}),
        ("ring-down, settled", settled, paper.LIMITS["ring-down"], {"color": "black", "linestyle": "--"}),
        ("QSMA, settled", results.modal("ringdown", "qsma"), None, {"color": ORANGE, "linestyle": ":"}),
        ("EPMC", results.modal("epmc", "epmc"), paper.LIMITS["EPMC"], {"color": RED, "marker": "x", "linestyle": "none"})]))
    caption = "The first mode from the ring-downs after impacts of three levels"
    figures.append(("figure_09.png", 0.6, settled and settled.limit()[0], caption, [
        ("high impact, settled", settled, None, {"color": "black", "linewidth": 1.0}),
        ("high impact", results.ringdown("levels", 3), None, {"color": RED, "linewidth": 4.0, "alpha": 0.5}),
        ("medium impact", results.ringdown("levels", 2), None, {"color": ORANGE, "linewidth": 2.5}),
        ("low impact", results.ringdown("levels", 1), None, {"color": BLUE, "linewidth": 2.5, "linestyle": "--"})]))
    return [(name, modal_figure(lines, os.path.join(folder, name), most, reference), caption)
            for name, most, reference, caption, lines in figures]


# ------------------------------------------------------------------------------------------------------------ settling

def settling_figure(results, path):
    """Figure 13: the sequence of impacts, and damping (and frequency) after each of them."""
    if "settling" not in results:
        return False
    time, motion = results.deflection("settling")
    starts = results.impact_times("settling")
    figure, axes = plt.subplot_mosaic([["time", "time"], ["damping", "frequency"]], figsize=(10.0, 6.6), layout="constrained")
    top = axes["time"]
    top.plot(time, 1e3 * motion, color=BLUE, linewidth=0.4)
    static = 1e3 * (results["settling"]["settling/static_position"][:, 0] - results["settling"]["settling/sensor"][0, 0])
    top.step(starts, np.append(static[1:], static[-1]), where="post", color=RED, linewidth=1.0, label="static position")
    for sign in (1, -1):
        top.axhline(sign * 1e3 * paper.PEAK, color=GREY, linewidth=0.8, linestyle="--",
                    label=f"paper: {1e3 * paper.PEAK:g} mm, high impact" if sign > 0 else None)
    top.set(xlabel="time, s", ylabel="displacement at mid-span, mm", xlim=(starts[0], starts[-1]))
    top.legend(loc="upper left")
    widths = [4.0, 2.2, 1.6, 0.8, 3.0, 1.0]
    colours = [PURPLE, BLUE, GREEN, RED, ORANGE, "black"]
    for k in range(1, len(starts)):
        modal = results.ringdown("settling", k)
        style = {"color": colours[k - 1], "linewidth": widths[k - 1], "label": f"impact {k}",
                 "linestyle": "--" if k in (4, 6) else "-"}
        axes["damping"].plot(1e6 * modal.amplitude, 100.0 * modal.damping, **style)
        axes["frequency"].plot(1e6 * modal.amplitude, modal.frequency, **style)
    axes["damping"].set(ylabel="damping ratio, %")
    axes["frequency"].set(ylabel="frequency, Hz")
    axes["damping"].axhline(100.0 * paper.DAMPING, color=GREY, linewidth=0.8, linestyle="--", label="paper: levels out here")
    axes["damping"].legend(loc="upper left")
    for ax in (axes["damping"], axes["frequency"]):
        ax.set(xscale="log", xlabel="amplitude at mid-span, um")
    for (name, ax), letter in zip(axes.items(), "abc"):
        ax.set_title(f"({letter})", loc="left")
    save(figure, path)
    return True


# --------------------------------------------------------------------------------------------------- frequency response

def response_figure(results, path):
    """Figure 16: harmonic balance, stepped and swept sine; below, how far these two are from it."""
    responses = results.responses()
    if not responses:
        return False
    figure, axes = plt.subplots(2, len(responses), figsize=(5.2 * len(responses), 6.2), layout="constrained", squeeze=False,
                                height_ratios=[2.4, 1.0], sharex="col")
    backbone = results.modal("epmc", "epmc")
    for (top, bottom), (level, kinds), letter in zip(axes.T, responses.items(), "ab"):
        for kind, (label, style) in RESPONSES.items():
            if kind in kinds:
                amplitude = 1e6 * kinds[kind].resonance()[1]
                top.plot(kinds[kind].frequency, 1e6 * kinds[kind].amplitude, **style,
                         label=f"{label}: {amplitude:.4g} um at resonance")
        limits, peak = top.get_xlim(), max(np.max(curve.amplitude) for curve in kinds.values())
        if backbone:
            top.plot(backbone.frequency, 1e6 * backbone.amplitude, color=GREY, linestyle=":", label="nonlinear mode (EPMC)")
        top.set(ylabel="amplitude at mid-span, um", xlim=limits, ylim=(0.0, 1.3e6 * peak))
        top.set_title(f"({letter}) {level} level", loc="left")
        top.legend(loc="upper left", frameon=True, framealpha=0.9, edgecolor="none")
        draw_differences(bottom, kinds)
    save(figure, path)
    return True


def draw_differences(ax, kinds):
    """From harmonic balance: of the stepped sine at the same frequency, of the sweep, which lags behind, at resonance."""
    ax.axhspan(-100.0 * paper.ALIKE, 100.0 * paper.ALIKE, color="#dddddd", label=f"within {100.0 * paper.ALIKE:g} %")
    truth = kinds.get("response")
    if truth and "stepped" in kinds:
        curve, (label, style) = kinds["stepped"], RESPONSES["stepped"]
        ax.plot(curve.frequency, 100.0 * (curve.amplitude / truth.at(curve.shifted) - 1.0), label=label, **style)
    if truth and "swept" in kinds:
        frequency, amplitude = kinds["swept"].resonance()
        ax.plot(frequency, 100.0 * (amplitude / truth.resonance()[1] - 1.0), "*", color=ORANGE, markersize=11,
                markeredgecolor="black", label="swept sine, resonance")
    ax.set(xlabel="frequency of the load, Hz", ylabel="from harmonic balance, %", ylim=(-3.0, 3.0))
    ax.legend(loc="lower left", ncols=3, fontsize=7)


# ---------------------------------------------------------------------------------------------------------- wall times

def wall_figure(walls, path):
    """Bars of wall times here and in the paper."""
    if not walls:
        return False
    figure, ax = plt.subplots(figsize=(8.0, 0.5 * len(walls) + 1.2), layout="constrained")
    for k, (_, _, _, ours, theirs) in enumerate(walls):
        for value, shift, colour in ((ours, 0.2, BLUE), (theirs, -0.2, ORANGE)):
            if value:
                ax.barh(k - shift, value, height=0.36, color=colour)
                ax.annotate(f" {in_words(value)}", (value, k - shift), va="center", fontsize=7.5)
    ax.set(xscale="log", xlabel="wall time, s", yticks=range(len(walls)), yticklabels=[with_spans(line) for line in walls])
    ax.margins(x=0.15)
    ax.invert_yaxis()
    ax.grid(axis="y", visible=False)
    for colour, label in ((BLUE, "microslip, this machine"), (ORANGE, "paper, 24 threads")):
        ax.barh([np.nan], [np.nan], color=colour, label=label)
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    save(figure, path)
    return True


def with_spans(line):
    what, ours, theirs = line[:3]
    return what if ours is None or ours < 0.1 else f"{what}\n({ours:.1f} s simulated; paper {theirs:g} s)"


def in_words(seconds):
    for size, unit in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"
