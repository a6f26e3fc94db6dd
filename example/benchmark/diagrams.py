"""The pictures of the report: run time against error, scaling, threads, convolution."""
import os
import sys

import matplotlib
import numpy as np

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "postprocess"))
from plot_case import COLOURS, STYLE  # noqa: E402  (it chooses matplotlib's back end)

import matplotlib.pyplot as plt  # noqa: E402

from tables import BY_NAME, empty, label_of  # noqa: E402

ROUNDING = 1e-16  # errors below are drawn here
MEASURES = ["sensor_l2", "force_l2", "friction_loss_error"]
MARKERS = "osD^vP"
NEAR = 0.04       # points of a curve nearer than this part of the axes share their label
matplotlib.rcParams.update({**STYLE, "lines.markersize": 5, "lines.linewidth": 1.2})


def draw(study, rows, path):
    """Draw a study's picture; False if it has no two points to draw."""
    rows = [row for row in rows if not row["failure"]]
    if study.diagram == "precision":  # errors are drawn there: not without a reference
        rows = [row for row in rows if not empty(row.get("force_l2"))]
    if len(rows) < 2:
        return False
    figure, axes = plt.subplots(1, 2, figsize=(11.0, 4.6), layout="constrained")
    {"precision": precision, "scaling": scaling, "threads": threads}[study.diagram](axes, study, rows)
    figure.suptitle(study.title, x=0.01, ha="left", fontsize=11)
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return True


def curves(rows):
    """{curve: its rows}"""
    names = dict.fromkeys(row["curve"] for row in rows)
    return {name: [row for row in rows if row["curve"] == name] for name in names}


def series_of(rows):
    """[(name, rows, error)]: the error measures of one curve, or one error measure of several curves."""
    parts = curves(rows)
    if len(parts) == 1:
        return [(label_of(measure).replace(", L2 error", "").replace(", error", ""), rows, measure) for measure in MEASURES
                if any(not empty(row.get(measure)) for row in rows)]
    return [(name, part, "force_l2") for name, part in parts.items()]


def styles(names):
    """One style per curve: a colour for what stands before the comma in its name, marker and line for what follows."""
    heads, tails = ([list(dict.fromkeys(parts)) for parts in zip(*(name.partition(", ")[::2] for name in names))])
    for head, tail in (name.partition(", ")[::2] for name in names):
        colour, line = heads.index(head), tails.index(tail)
        marker = line if len(tails) > 1 else colour
        yield {"color": COLOURS[colour % len(COLOURS)], "marker": MARKERS[marker % len(MARKERS)],
               "linestyle": ["-", "--", ":"][line % 3]}


def precision(axes, study, rows):
    """Left: error over what is varied. Right: run time against error, every point with its label."""
    series = [(*item, style) for item, style in zip(series_of(rows), styles([name for name, _, _ in series_of(rows)]))]
    for name, part, measure, style in series:
        error = drawn([row.get(measure, np.nan) for row in part])
        axes[0].loglog([row[study.parameter] for row in part], error, label=name, **style)
        axes[1].loglog(error, [row["s_per_ms"] for row in part], label=name, **style)
    several = len(curves(rows)) > 1
    error = "relative error of the contact tractions (L2)" if several else "relative error (L2)"
    axes[0].set(xlabel=label_of(study.parameter), ylabel=error, title="error")
    axes[1].set(xlabel=error, ylabel=label_of("s_per_ms"), title="run time against error")
    room(axes[1])
    if study.name == "time_step":
        slope(axes[0], -1, 2, "2nd order")
    # The labels go with every curve, or with one where all curves share their run times.
    for _, part, measure, style in series if several else series[:1]:
        points = list(zip(drawn([row.get(measure, np.nan) for row in part]), [row["s_per_ms"] for row in part]))
        name_points(axes[1], points, [row["label"] for row in part], style["color"])
        name_ticks(axes[0], study, part)
    legend(axes[0], several)
    if not several:  # there the labels have the colours of the curves
        legend(axes[1], several)


def scaling(axes, study, rows):
    """Time per step, set-up and memory over the number of contact points."""
    for (name, part), style in zip(curves(rows).items(), styles(curves(rows))):
        part = sorted(part, key=lambda row: row["contact_points"])
        points = [row["contact_points"] for row in part]
        axes[0].loglog(points, [row["ms_per_step"] for row in part], label=name, **style)
        axes[1].loglog(points, [row["setup"] for row in part], **style)
        axes[1].loglog(points, [row["memory"] * 1e-3 for row in part], **{**style, "linestyle": ":", "markerfacecolor": "none"})
        name_points(axes[0], list(zip(points, [row["ms_per_step"] for row in part])), [row["label"] for row in part],
                    style["color"])
    axes[0].set(xlabel=label_of("contact_points"), ylabel=label_of("ms_per_step"), title="a slipping step")
    axes[1].set(xlabel=label_of("contact_points"), ylabel="s, GB", title="before the first step")
    room(axes[0])
    slope(axes[0], -1, 1, "N")
    slope(axes[0], -1, 2, "N²", "--")
    legend(axes[0], True)
    # The colours are those of the steps.
    axes[1].plot([], [], "o-", color="grey", label="set-up, s")
    axes[1].plot([], [], "o:", color="grey", markerfacecolor="none", label="memory, GB")
    legend(axes[1], True)


def threads(axes, study, rows):
    """Times over the number of threads; right: how many times faster than with the fewest."""
    for (name, part), style in zip(curves(rows).items(), styles(curves(rows))):
        part = sorted(part, key=lambda row: row["threads"])
        number = [row["threads"] for row in part]
        axes[0].semilogy(number, [row["ms_per_step"] for row in part], label=name, **style)
        axes[1].plot(number, [part[0]["ms_per_step"] / row["ms_per_step"] for row in part], label=name, **style)
    numbers = sorted({row["threads"] for row in rows})
    axes[1].plot(numbers, [n / numbers[0] for n in numbers], color="grey", linewidth=0.8, label="ideal")
    axes[0].set(xlabel="threads", ylabel=label_of("ms_per_step"), title="time per step")
    axes[1].set(xlabel="threads", ylabel="times faster", title=f"against {numbers[0]} thread", ylim=(0, None))
    for ax in axes:
        ax.set_xticks(numbers)
        ax.margins(x=0.15)
    legend(axes[0], True)


def convolution(rows, path):
    """Time of products by FFT and by the dense matrix over the number of points, with the a N log2 N that fits the FFT's
    best; returns {materials: a in s}."""
    figure, ax = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
    factors = {}
    for name, colour in zip(dict.fromkeys(row["materials"] for row in rows), COLOURS):
        part = [row for row in rows if row["materials"] == name]
        n, seconds = (np.array([float(row[column]) for row in part]) for column in ("points", "fft_s"))
        factor = factors[name] = float(np.exp(np.mean(np.log(seconds / (n * np.log2(n))))))
        ax.loglog(n, 1e3 * seconds, "o", color=colour, label=f"FFT, {name} materials")
        ax.loglog(n, 1e3 * factor * n * np.log2(n), color=colour, linewidth=0.8, label=f"{1e9 * factor:.3g} ns · N log₂ N")
        dense = [row for row in part if row["dense_s"].strip()]
        ax.loglog([float(row["points"]) for row in dense], [1e3 * float(row["dense_s"]) for row in dense], "s:", color=colour,
                  markerfacecolor="none", label=f"dense matrix, {name} materials")
    ax.set(xlabel="points N", ylabel="one product, ms")
    ax.set_title("Product with the half-space compliance", loc="left")
    legend(ax, True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return factors


# ------------------------------------------------------------------------------------------------------------- helpers

def drawn(errors):
    """Errors for a logarithmic axis."""
    return np.maximum(np.asarray(errors, dtype=float), ROUNDING)


def room(ax):
    """Space round the points for their labels."""
    ax.margins(x=0.14, y=0.12)
    low, high = np.log10(ax.get_xlim()), np.log10(ax.get_ylim())
    for limits, setter in ((low, ax.set_xlim), (high, ax.set_ylim)):
        middle, half = limits.mean(), max(0.5 * np.ptp(limits), 0.35)
        setter(10 ** (middle - half), 10 ** (middle + half))


def name_ticks(ax, study, rows):
    """The variations' own names on the axis of what is varied."""
    if study.parameter != "tolerance":
        ax.set_xticks([row[study.parameter] for row in rows], [row["label"] for row in rows])
        ax.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)


def name_points(ax, points, names, colour):
    """Write its name at every point; points that lie together share one text."""
    at = ax.transData.transform(np.array(points)) / (np.array(ax.bbox.size))
    k = 0
    while k < len(points):
        last = k
        while last + 1 < len(points) and np.hypot(*(at[last + 1] - at[k])) < NEAR:
            last += 1
        text = names[k] if last == k else f"{names[k]} … {names[last]}"
        ax.annotate(text, points[k], xytext=(4, 4), textcoords="offset points", fontsize=7.5, color=colour)
        k = last + 1


def slope(ax, point, power, text, style="-"):
    """A line of a power through a point of the first curve."""
    line = ax.lines[0]
    x, y = np.array(line.get_xdata(), dtype=float), np.array(line.get_ydata(), dtype=float)
    limits = ax.get_ylim()
    ax.plot(x, y[point] * (x / x[point]) ** power, color="grey", linewidth=0.8, linestyle=style, label=text)
    ax.set_ylim(limits)


def legend(ax, small):
    ax.legend(fontsize=7 if small else 8, frameon=True, framealpha=0.85, edgecolor="none", loc="best")
