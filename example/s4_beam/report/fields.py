"""The maps: residual slip ratio, residual slip and largest slip, largest slip ratio."""
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import MaxNLocator

import paper
from curves import save  # first: it knows where plot_case is
from plot_case import draw_map

MARGIN = 3.0  # mm
WIDTH = 2.7   # of a map, inches
LEAST_RATIO = 0.01
RATIO = "slip ratio  $|t|/(\\mu p)$"


def shape(results, name, interface):
    """What draw_map wants to know of an interface."""
    group = results[name][interface]
    label = group.attrs.get("name", interface)
    return {"x": group["x"][()], "y": group["y"][()], "inside": ~np.isnan(group["height"][()]),
            "label": label.decode() if isinstance(label, bytes) else label}


def reach_of(results, name, interface, maps):
    """The part of an interface in which any of its maps has a number, with a margin, in mm: ((x, x), (y, y))."""
    group = results[name][interface]
    known = np.any([np.isfinite(values) for values in maps], axis=0)
    part = []
    for axis, there in ((group["x"][()], known.any(axis=0)), (group["y"][()], known.any(axis=1))):
        part.append((1e3 * axis[there].min() - MARGIN, 1e3 * axis[there].max() + MARGIN))
    return part


def draw_maps(results, name, columns, path):
    """One column of maps per (title, field of an interface, factor, colours, scale label, limit): the interfaces below each
    other. A limit of None is the largest of the column; below LEAST_RATIO a slip ratio shows nothing."""
    interfaces = results.interfaces(name)
    every = [[factor * make(interface) for interface in interfaces] for _, make, factor, _, _, _ in columns]
    reach = [reach_of(results, name, interface, [maps[k] for maps in every]) for k, interface in enumerate(interfaces)]
    height = WIDTH * np.ptp(reach[0][1]) / np.ptp(reach[0][0]) + 0.25
    figure, axes = plt.subplots(len(interfaces), len(columns), layout="constrained", squeeze=False,
                                figsize=(WIDTH * len(columns) + 0.6, height * len(interfaces) + 1.2))
    for column, (maps, (title, _, _, colours, scale, limit)) in enumerate(zip(every, columns)):
        peak = max(float(np.nanmax(values)) for values in maps)
        if "ratio" in scale:
            peak = max(peak, LEAST_RATIO)
        for row, (interface, values, (across, along)) in enumerate(zip(interfaces, maps, reach)):
            ax, place = axes[row, column], shape(results, name, interface)
            image = draw_map(ax, place, values, colours, limit or peak or 1.0)
            words = f"{place['label']}: largest {np.nanmax(values):.3g}"
            ax.set_title(f"{title}\n{words}" if row == 0 else words, loc="left", fontsize=8)
            last, first = row == len(interfaces) - 1, column == 0
            ax.set(xlabel="x, mm" if last else "", ylabel="y, mm" if first else "", xlim=across, ylim=along)
            ax.tick_params(labelbottom=last, labelleft=first)
        figure.colorbar(image, ax=list(axes[:, column]), location="bottom", shrink=0.9, pad=0.01, aspect=25,
                        ticks=MaxNLocator(4)).set_label(scale)
    save(figure, path)
    return True


def residual_ratio(results, path):
    """Figure 14: after the preload, the second and the fifth impact."""
    if "settling" not in results:
        return False
    when = [(0, "after preload"), (2, "after the 2nd impact (high)"), (5, "after the 5th impact (super-high)")]
    return draw_maps(results, "settling", [
        (title, lambda k, n=n: results.field("settling", k, "slip_ratio", n), 1.0, "inferno_r", f"residual {RATIO}",
         1.0 if n == 5 else None) for n, title in when], path)


def slips(results, path):
    """Largest and residual slip of the first impact and the first super-high one."""
    if "settling" not in results:
        return False
    columns = []
    for n, impact, level in ((1, "1st impact", "high"), (5, "5th impact", "super-high")):
        largest, residual = (f"paper {1e6 * value:.3g} um" for value in paper.SLIP[level])
        columns += [
            (f"largest slip, {impact}\n({level}; {largest})",
             lambda k, n=n: results.field("settling", k, "largest_slip", n), 1e6, "viridis", "slip, um", None),
            (f"residual slip, {impact}\n({residual})",
             lambda k, n=n: results.residual_slip("settling", k, n, n - 1), 1e6, "viridis", "slip, um", None)]
    return draw_maps(results, "settling", columns, path)


def largest_ratio(results, path):
    """Figure 17: impacts of three levels."""
    if "levels" not in results:
        return False
    return draw_maps(results, "levels", [
        (f"{title} impact", lambda k, n=n: results.field("levels", k, "largest_slip_ratio", n), 1.0, "inferno_r",
         f"largest {RATIO}", 1.0) for n, title in ((3, "high"), (2, "medium"), (1, "low"))], path)
