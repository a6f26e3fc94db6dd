#!/usr/bin/env python3
"""Pictures of a microslip result file.

    plot_case.py RESULT.h5 [--output PREFIX]

writes PREFIX_history.png (sensors), PREFIX_interface.png (pressure and slip ratio), PREFIX_energy.png (contact counts,
energies, balance error), PREFIX_modal.png (frequency and damping over amplitude) and PREFIX_overview.png (the others in
one). What the file does not hold is not drawn; files of
runs that still go on or were interrupted are fine. Only pictures that this script drew are replaced: others of these names are
left alone, and the exit status is 2. Needs h5py, numpy and matplotlib.
"""
import argparse
import io
import os
import sys

import h5py
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import matplotlib.ticker  # noqa: E402

# Distinguishable with all common colour deficiencies (Okabe and Ito).
BLUE, ORANGE, GREEN, RED, PURPLE = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7"
COLOURS = [BLUE, RED, GREEN, PURPLE, ORANGE]
NO_CONTACT = "#e4e4e4"
STATES = [("stick", BLUE), ("slip", RED), ("open", "#c4c4c4")]
STYLE = {"font.size": 9, "axes.titlesize": 9, "axes.labelsize": 9, "legend.fontsize": 8, "legend.frameon": False,
         "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.color": "#e8e8e8",
         "grid.linewidth": 0.6, "axes.axisbelow": True, "lines.linewidth": 0.9, "agg.path.chunksize": 20000}


#: Stands in every picture, so that it may be replaced by the next one.
DRAWN_BY = "microslip plot_case.py"


class WrongFile(Exception):
    """The file is not one that can be drawn; the message is for the user."""


class Result:
    """What a result file holds, as far as it is drawn. Missing parts are None or empty."""

    def __init__(self, path):
        if not os.path.isfile(path):
            raise WrongFile(f"{path}: no such file")
        try:
            with h5py.File(path, "r", locking=False) as file:
                program = file.attrs.get("program", "")
                if (program.decode() if isinstance(program, bytes) else program) != "microslip":
                    raise WrongFile(f"{path}: not a result file of microslip (no attribute program = 'microslip')")
                self.read(file)
        except (OSError, RuntimeError, KeyError) as fault:
            raise WrongFile(f"{path}: cannot be read as HDF5 ({fault})") from fault
        if self.time is None and not self.states:
            raise WrongFile(f"{path}: holds neither a preload nor a time series, nothing to draw")

    def read(self, file):
        """Read everything that can be drawn."""
        self.frequency = file["linear_modes/frequency"][()] if "linear_modes/frequency" in file else None
        self.interfaces = read_interfaces(file)
        self.states = read_states(file, self.interfaces)
        self.modal = read_modal(file)
        self.time, self.sensors, self.energy, self.contact = None, {}, {}, {}
        if "transient/time" not in file:
            return
        group = file["transient"]
        # In the file of an interrupted run the last samples may not be in all series.
        count = min(len(data) for data in series_of(group))
        if count < 2:
            return
        self.time = group["time"][:count]
        if "sensor" in group and group["sensor"].shape[1] > 0:
            values = group["sensor"][:count]
            names = group["sensor_name"].asstr()[()] if "sensor_name" in group else []
            for k in range(values.shape[1]):
                self.sensors[names[k] if k < len(names) else f"sensor {k + 1}"] = values[:, k] - values[0, k]
        self.energy = {name: data[:count] for name, data in group.get("energy", {}).items()}
        self.contact = {name: data[:count] for name, data in group.get("contact", {}).items()}

    def caption(self):
        """The linear frequencies in words."""
        if self.frequency is None or len(self.frequency) == 0:
            return ""
        shown = ", ".join(f"{f:.1f}" for f in self.frequency[:4])
        more = ", ..." if len(self.frequency) > 4 else ""
        return f"linear frequencies about the preload: {shown}{more} Hz"


def series_of(group):
    """All time series in /transient."""
    series = [group["time"]] + [group[name] for name in ("sensor", "modal_displacement") if name in group]
    for name in ("energy", "contact"):
        series += list(group.get(name, {}).values())
    return series


def read_modal(file):
    """Frequency and damping ratio over amplitude, by the analyses that give them."""
    groups = [("QSMA, Masing's rule", "qsma", "qsma"), ("QSMA, hysteresis loops", "qsma/cycle", "qsma/cycle"),
              ("ring-down, Fourier transform", "ringdown", "ringdown"), ("ring-down, peaks", "ringdown/peaks", "ringdown")]
    return {label: (file[where]["amplitude"][()], file[group]["frequency"][()], file[group]["damping_ratio"][()])
            for label, group, where in groups if group in file}


def read_interfaces(file):
    """Axes, grid points and names of the interfaces by group name."""
    interfaces = {}
    for name in sorted((n for n in file if n.startswith("interface_")), key=lambda n: int(n.split("_")[1])):
        group = file[name]
        label = group.attrs.get("name", name)
        interfaces[name] = {"x": group["x"][()], "y": group["y"][()], "inside": ~np.isnan(group["height"][()]),
                            "label": label.decode() if isinstance(label, bytes) else label}
    return interfaces


def read_states(file, interfaces):
    """Pressure and slip ratio after the preload and at the last snapshot: [(title, {interface: fields})]."""
    names = ("pressure", "slip_ratio")
    states = []
    fields = {k: {n: file[f"preload/{k}/{n}"][()] for n in names} for k in interfaces if f"preload/{k}/slip_ratio" in file}
    if fields:
        states.append(("after the preload", fields))
    snapshot = file.get("transient/snapshot")
    series = [snapshot[f"{k}/{n}"] for k in interfaces for n in names if f"{k}/{n}" in snapshot] if snapshot else []
    last = min([len(s) for s in series], default=0) - 1
    if last >= 0 and len(series) == 2 * len(interfaces):
        fields = {k: {n: snapshot[f"{k}/{n}"][last] for n in names} for k in interfaces}
        states.append((f"at {snapshot['time'][last] * 1e3:.4g} ms", fields))
    return states


# ------------------------------------------------------------------------------------------------------------ units

def scaled(largest, unit):
    """Factor and name of the unit in which numbers up to `largest` (SI) read well."""
    for factor, prefix in ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"), (1e12, "p")):
        if largest * factor >= 1.0:
            return factor, prefix + unit
    return 1.0, unit


def largest_of(arrays):
    """Largest finite absolute value."""
    return max((np.nanmax(np.abs(a), initial=0.0) for a in arrays), default=0.0)


def time_axis(result):
    """Times in ms, or in s for long runs."""
    if result.time[-1] < 5.0:
        return result.time * 1e3, "time / ms"
    return result.time, "time / s"


# ------------------------------------------------------------------------------------------------------------ panels

def draw_history(ax, result, zoom=False):
    """Sensor displacements; `zoom` shows some periods round the largest one."""
    time, label = time_axis(result)
    size = largest_of(result.sensors.values())
    # Displacements of hundreds of micrometres read better than tenths of millimetres.
    factor, unit = (1e6, "µm") if 1e-7 <= size < 5e-3 else scaled(size, "m")
    shown = slice(None)
    if zoom:
        shown = zoom_range(result)
    for (name, values), colour in zip(result.sensors.items(), COLOURS * len(result.sensors)):
        ax.plot(time[shown], values[shown] * factor, color=colour, label=name)
    ax.set_xlabel(label)
    ax.set_ylabel(f"displacement / {unit}")
    ax.set_title("sensors, from the preloaded state" if not zoom else "detail", loc="left")
    ax.margins(x=0)
    if not zoom:
        legend_above(ax)


def zoom_range(result):
    """Five periods of the lowest linear mode, or a tenth of the run, from just before the largest displacement."""
    length = 0.1 * result.time[-1]
    if result.frequency is not None and len(result.frequency) and result.frequency[0] > 0:
        length = min(5.0 / result.frequency[0], result.time[-1])
    peak = result.time[np.argmax(np.max(np.abs(np.array(list(result.sensors.values()))), axis=0))]
    start = max(0.0, min(peak - 0.1 * length, result.time[-1] - length))
    return slice(*np.searchsorted(result.time, [start, start + length]))


def legend_above(ax):
    """The legend on the line of the title."""
    handles, names = ax.get_legend_handles_labels()
    ax.legend(handles, names, loc="lower right", ncols=len(names), bbox_to_anchor=(1.0, 0.99), borderaxespad=0.1,
              columnspacing=1.0, handlelength=1.1, handletextpad=0.5)


def draw_counts(ax, result):
    """Contact states over time, stacked to the number of points in potential contact."""
    time, label = time_axis(result)
    ax.stackplot(time, *[result.contact[key] for key, _ in STATES], labels=[key for key, _ in STATES],
                 colors=[colour for _, colour in STATES], alpha=0.8, linewidth=0)
    if "converged" in result.contact and np.any(result.contact["converged"] == 0):
        failed = time[result.contact["converged"] == 0]
        ax.plot(failed, np.zeros_like(failed), "k|", label=f"{len(failed)} not converged", clip_on=False)
    ax.set_xlabel(label)
    ax.set_ylabel("contact points")
    ax.set_title("contact", loc="left")
    ax.margins(0)
    legend_above(ax)


def draw_energies(ax, result):
    """Where the work of the loads went: stored (kinetic and elastic), lost to damping, lost to friction."""
    time, label = time_axis(result)
    energy = result.energy
    factor, unit = scaled(largest_of(energy.values()), "J")
    parts = [energy["kinetic"] + energy["elastic"], energy["viscous_loss"], energy["friction_loss"]]
    ax.stackplot(time, *[part * factor for part in parts], labels=["stored", "damping", "friction"],
                 colors=[BLUE, ORANGE, RED], alpha=0.8, linewidth=0)
    ax.plot(time, energy["external_work"] * factor, color="black", label="work")
    ax.set_xlabel(label)
    ax.set_ylabel(f"energy / {unit}")
    ax.set_title("energy", loc="left")
    ax.margins(x=0)
    legend_above(ax)


def draw_balance(ax, result):
    """Error of the energy balance over the largest work of the loads; its first digits only: it starts at zero."""
    time, label = time_axis(result)
    error = np.abs(result.energy["balance_error"])
    work = largest_of([result.energy["external_work"]])
    error = error / work if work > 0 else error
    peak = largest_of([error])
    ax.semilogy(time, np.where(error > 0, error, np.nan), color="black", linewidth=0.7)
    if peak > 0:
        ax.set_ylim(max(1e-5 * peak, 0.5 * np.min(error[error > 0])), 3.0 * peak)
    ax.set_xlabel(label)
    ax.set_ylabel("error / work of loads" if work > 0 else "error / J")
    ax.set_title("energy balance error", loc="left")
    ax.set_xlim(time[0], time[-1])


def draw_map(ax, interface, values, cmap, limit):
    """A field on one interface: colour where closed, grey where open, white where there is no grid point.

    Contact points at the FE nodes are lists, not maps: dots."""
    x, y = interface["x"] * 1e3, interface["y"] * 1e3
    if values.ndim == 1:
        closed = np.isfinite(values)
        ax.scatter(x[~closed], y[~closed], s=9, color=NO_CONTACT)
        image = ax.scatter(x[closed], y[closed], s=9, c=values[closed], cmap=cmap, vmin=0.0, vmax=limit)
        ax.set_aspect("equal")
    else:
        image = draw_cells(ax, interface, values, cmap, limit)
    ax.grid(False)
    for side in ax.spines.values():
        side.set_visible(False)
    ax.tick_params(length=2, labelsize=8)
    ax.yaxis.set_major_locator(matplotlib.ticker.MaxNLocator(5, steps=[1, 2, 5, 10], prune="both"))
    return image


def draw_cells(ax, interface, values, cmap, limit):
    """A map on the grid of an interface."""
    x, y = interface["x"] * 1e3, interface["y"] * 1e3
    half = [0.5 * (a[1] - a[0]) if len(a) > 1 else 0.5 for a in (x, y)]
    place = {"origin": "lower", "aspect": "equal", "interpolation": "nearest",
             "extent": (x[0] - half[0], x[-1] + half[0], y[0] - half[1], y[-1] + half[1])}
    grey = matplotlib.colors.ListedColormap([NO_CONTACT])
    ax.imshow(np.ma.masked_where(~interface["inside"], np.zeros(values.shape)), cmap=grey, **place)
    return ax.imshow(np.ma.masked_invalid(values), cmap=cmap, vmin=0.0, vmax=limit, **place)


def draw_maps(figure, axes, result, states, names):
    """Maps on a grid of axes: one row per state, pressure and slip ratio of every interface side by side."""
    closed = {}
    for _, fields in states:
        for name in names:
            pressure = fields[name]["pressure"]
            closed[id(pressure)] = np.where(pressure > 0, pressure, np.nan)
    peak = largest_of(closed.values())
    # One overloaded corner must not hide the rest.
    values = np.concatenate([c[np.isfinite(c)] for c in closed.values()])
    limit = max(np.percentile(values, 99.5), 0.5 * peak) if len(values) else 1.0
    for row, (title, fields) in enumerate(states):
        for k, name in enumerate(names):
            interface = result.interfaces[name]
            left, right = axes[row][2 * k:2 * k + 2]
            pressure = draw_map(left, interface, closed[id(fields[name]["pressure"])] * 1e-6, "viridis", limit * 1e-6)
            ratio = draw_map(right, interface, fields[name]["slip_ratio"], "inferno_r", 1.0)
            if row == 0:
                left.set_title(f"{interface['label']}: pressure", loc="left")
                right.set_title(f"{interface['label']}: slip ratio", loc="left")
            for ax in (left, right):
                ax.tick_params(labelbottom=row == len(states) - 1, labelleft=ax is axes[row][0])
                if row == len(states) - 1:
                    ax.set_xlabel("x / mm")
        axes[row][0].set_ylabel(f"{title}\ny / mm")
    every = [ax for line in axes for ax in line]
    figure.colorbar(ratio, ax=every, location="right", shrink=0.9, pad=0.01, aspect=30).set_label(
        "slip ratio  $|t|/(\\mu p)$,  grey: open")
    figure.colorbar(pressure, ax=every, location="right", shrink=0.9, pad=0.01, aspect=30,
                    extend="max" if peak > limit else "neither").set_label("pressure / MPa")


# ----------------------------------------------------------------------------------------------------------- figures

def history_figure(result):
    """Sensors: the whole run and a detail."""
    figure, axes = plt.subplots(2, 1, figsize=(8.0, 5.2), layout="constrained")
    draw_history(axes[0], result)
    draw_history(axes[1], result, zoom=True)
    finish(figure, result)
    return figure


def interface_figure(result):
    """Pressure and slip ratio of all interfaces and states."""
    names = list(result.interfaces)
    shape = result.interfaces[names[0]]
    ratio = np.ptp(shape["y"]) / max(np.ptp(shape["x"]), 1e-30)
    size = (4.8 * len(names) + 1.8, len(result.states) * (2.25 * min(max(ratio, 0.3), 2.0) + 0.12) + 0.9)
    figure, axes = plt.subplots(len(result.states), 2 * len(names), figsize=size, layout="constrained", squeeze=False)
    draw_maps(figure, axes, result, result.states, names)
    finish(figure, result)
    return figure


def energy_figure(result):
    """Contact counts, energies and balance error over time."""
    panels = time_panels(result)
    figure, axes = plt.subplots(len(panels), 1, figsize=(8.0, 2.5 * len(panels)), layout="constrained", squeeze=False)
    for ax, draw in zip(axes[:, 0], panels):
        draw(ax, result)
    finish(figure, result)
    return figure


def modal_figure(result):
    """Frequency and damping ratio over amplitude."""
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.6), layout="constrained")
    styles = [dict(marker="o", markersize=4), dict(marker="x", markersize=5, linestyle="none"), {}, dict(linestyle="--")]
    for k, (label, (amplitude, frequency, damping)) in enumerate(result.modal.items()):
        for ax, values in zip(axes, (frequency, 100.0 * damping)):
            ax.plot(1.0e6 * amplitude, values, color=COLOURS[k], label=label, **styles[k % len(styles)])
    for ax, label in zip(axes, ("frequency, Hz", "damping ratio, %")):
        ax.set(xscale="log", xlabel="amplitude at the sensor, um", ylabel=label)
    axes[0].legend(loc="lower left")
    finish(figure, result)
    return figure


def time_panels(result):
    """What can be drawn over time besides the sensors."""
    panels = []
    if all(key in result.contact for key, _ in STATES):
        panels.append(draw_counts)
    if all(key in result.energy for key in ("kinetic", "elastic", "external_work", "viscous_loss", "friction_loss")):
        panels += [draw_energies, draw_balance] if "balance_error" in result.energy else [draw_energies]
    return panels


def overview_figure(result):
    """Everything on one page of 1600 x 1100 pixels."""
    figure = plt.figure(figsize=(11.43, 7.86), layout="constrained")
    panels = time_panels(result) if result.time is not None else []
    with_maps = bool(result.states)
    heights = [1.25 if len(result.states) > 1 else 2.2, 1.0]
    parts = figure.subfigures(2, 1, height_ratios=heights) if with_maps else [figure]
    rows = parts[0].subfigures(2, 1) if panels and result.sensors else [parts[0], parts[0]]
    if result.sensors:
        left, right = rows[0].subplots(1, 2, width_ratios=[2, 1])
        draw_history(left, result)
        draw_history(right, result, zoom=True)
    if panels:
        widths = [1.15, 1.35, 1.0][:len(panels)]
        for ax, draw in zip(np.atleast_1d(rows[1].subplots(1, len(panels), width_ratios=widths)), panels):
            draw(ax, result)
    if with_maps:
        names = list(result.interfaces)[:2]
        axes = parts[1].subplots(len(result.states), 2 * len(names), squeeze=False)
        draw_maps(parts[1], axes, result, result.states, names)
    finish(figure, result)
    return figure


def finish(figure, result):
    """The caption below all panels, and some air."""
    figure.get_layout_engine().set(w_pad=0.08, h_pad=0.06)
    if result.caption():
        figure.supxlabel(result.caption(), fontsize=8.5, color="#444444")


def draw_all(result, prefix):
    """Draw what there is; the names of the files, and of those that are there and belong to somebody else."""
    figures = {}
    with plt.rc_context(STYLE):
        if result.sensors:
            figures["history"] = history_figure(result)
        if result.states:
            figures["interface"] = interface_figure(result)
        if result.time is not None and time_panels(result):
            figures["energy"] = energy_figure(result)
        if len(figures) > 1:
            figures["overview"] = overview_figure(result)
        if result.modal:
            figures["modal"] = modal_figure(result)
        written, refused = [], []
        for name, figure in figures.items():
            path = f"{prefix}_{name}.png"
            if not may_be_replaced(path):
                refused.append(path)
                continue
            picture = io.BytesIO()
            figure.savefig(picture, dpi=140, metadata={"Software": DRAWN_BY}, pil_kwargs={"optimize": True})
            with open(path, "wb") as file:
                file.write(picture.getbuffer())
            written.append(path)
    return written, refused


def may_be_replaced(path):
    """Whether there is no such file, or a picture that this script drew."""
    if not os.path.lexists(path):
        return True
    if not os.path.isfile(path):
        return False
    with open(path, "rb") as file:
        head = file.read(4096)
    return head.startswith(b"\x89PNG") and b"tEXtSoftware\0" + DRAWN_BY.encode() in head


def main():
    parser = argparse.ArgumentParser(description="Draw the pictures of a microslip result file.")
    parser.add_argument("result", metavar="RESULT.h5", help="result file of microslip")
    parser.add_argument("--output", metavar="PREFIX",
                        help="start of the names of the pictures (default: the file's name without .h5, in this folder)")
    arguments = parser.parse_args()
    prefix = arguments.output or os.path.splitext(os.path.basename(arguments.result))[0]
    try:
        written, refused = draw_all(Result(arguments.result), prefix)
    except WrongFile as fault:
        print(f"plot_case.py: {fault}", file=sys.stderr)
        return 2
    except OSError as fault:
        print(f"plot_case.py: cannot write the pictures: {fault}", file=sys.stderr)
        return 2
    if written:
        print("\n".join(written))
    for path in refused:
        print(f"plot_case.py: {path}: is there already, and is no picture of this script: it is not overwritten; move it away, "
              "or give the pictures other names (--output PREFIX)", file=sys.stderr)
    return 2 if refused else 0


if __name__ == "__main__":
    sys.exit(main())
