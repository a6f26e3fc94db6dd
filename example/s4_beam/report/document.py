"""report.md: the table, the pictures, the wall times, what ran where."""
import os
import sys

import curves
import fields
from comparison import shown, word

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "benchmark"))
import report as benchmark_report  # noqa: E402

NOTES = """\
What differs from the paper: the surface measured there is not public. Here a synthetic hill of the same height lies on both
pads, and bores, bolts and supports are partly assumed (example/s4_beam/README.md). Frequencies thus differ by one to three
per cent. What an impact leaves behind is much less here. As tried on the coarse model, a hill 3 mm off the bore, the normal
contact law on velocity level, and the measured surface of another beam (input/s4_measured.nml) do not change that: at most
0.02 um of residual slip after a high impact, and the settled frequency stays that of QSMA.

*Holds* says whether a statement of the paper is true of our numbers as well."""


def draw(results, walls, folder):
    """[(file, caption)] of all pictures for which there are results."""
    path = lambda name: os.path.join(folder, name)  # noqa: E731
    drawn = list(curves.modal_figures(results, folder))
    drawn += [
        ("figure_13.png", curves.settling_figure(results, path("figure_13.png")),
         "A sequence of impacts: the sensor, and damping and frequency after each"),
        ("figure_14.png", fields.residual_ratio(results, path("figure_14.png")), "Residual slip ratio (grey: open or moving)"),
        ("slip.png", fields.slips(results, path("slip.png")),
         "Largest slip during an impact, and what it leaves behind (section 3.5)"),
        ("figure_16.png", curves.response_figure(results, path("figure_16.png")), "Frequency response, three ways. Below: "
         "differences from harmonic balance, the stepped sine at the same frequency without the leapfrog's known error in frequency, the "
         "sweep, which lags behind, at resonance"),
        ("figure_17.png", fields.largest_ratio(results, path("figure_17.png")), "Largest slip ratio during impacts of three levels"),
        ("wall_times.png", curves.wall_figure(walls, path("wall_times.png")), "Wall times"),
    ]
    return [(name, caption) for name, made, caption in drawn if made]


def write(folder, model, program, results, stages, rows, walls, pictures, failures):
    file = results.any()
    surroundings = benchmark_report.environment(program, file.filename if file else None)
    if file:
        surroundings += [("model", f"{model}: {int(file['model/boundary_coordinates'][()])} boundary coordinates, "
                          f"{int(file['model/grid_points'][()])} grid points, {int(file['model/contact_points'][()])} of them in "
                          f"potential contact, {int(file['model/modes'][()])} modes"),
                         ("threads", str(int(file.attrs["threads"])))]
    lines = [f"# The S4 Beam beside the paper, {model} model", "",
             "Numbers and pictures of arXiv 2603.26446 (Linder, Najera-Flores, Kuether, Krack), and ours, which `scripts/s4_report` read "
             "from the result files. As a table for machines: `comparison.csv`.", "", NOTES, ""]
    lines += table(("figure", "quantity", "unit", "paper", "microslip", "holds"), [
        (row.figure, row.what, row.unit, shown(row.paper), shown(row.ours), word(row.holds)) for row in rows])
    for name, caption in pictures:
        title = "Figure " + str(int(name[7:9])) if name.startswith("figure_") else caption.partition(",")[0]
        lines += [f"## {title}", "", caption + ".", "", f"![{title}](pictures/{name})", ""]
    lines += table(("wall time", "simulated s", "paper, simulated s", "microslip, s", "paper, s", "times faster"), [
        (what, shown(span), shown(theirs_span), shown(ours), shown(theirs), faster(span, theirs_span, ours, theirs))
        for what, span, theirs_span, ours, theirs in walls])
    lines += ["*Times faster* is per simulated second where there is one. The paper's machine: i9-13900K, 24 threads.", "", "## Runs", ""]
    lines += table(("stage", "what", "case", "wall time, s"), [
        (stage.name, stage.title, stage.source, f"{sum(results.seconds(stage.name).values()):.1f}" if stage.name in results else "-")
        for stage in stages])
    lines += [f"FAILED: {failure}" for failure in failures] + ([""] if failures else [])
    lines += table(("", ""), surroundings)
    with open(os.path.join(folder, "report.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines).rstrip() + "\n")


def table(heads, lines):
    clean = [[str(cell).replace("|", "\\|") for cell in line] for line in lines]
    return ["| " + " | ".join(heads) + " |", "| --- " * len(heads) + "|", *["| " + " | ".join(line) + " |" for line in clean], ""]


def faster(span, theirs_span, ours, theirs):
    if not ours or not theirs:
        return ""
    ratio = theirs / ours * (span / theirs_span if span else 1.0)
    return f"{ratio:.0f}" if ratio >= 10.0 else f"{ratio:.1f}"
