#!/usr/bin/env python3
"""Renders table.csv of this folder as table.md: counts of verdicts, then a row per scene.

    render.py TABLE.csv TABLE.md
"""

import collections
import csv
import sys

VERDICTS = "holds", "reported", "refused", "WRONG"


def number(text):
    """1.10E-11 as 1e-11, 0.00E+00 as 0."""
    value = float(text)
    return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e") if value else "0"


def cell(rows):
    """Verdicts, violation and energy error of a solver on a scene, or on several of one name."""
    parts = []
    for verdict in VERDICTS:
        some = [row for row in rows if row["verdict"] == verdict]
        if not some:
            continue
        steps = sum(int(row["steps"]) for row in some)
        failed = sum(int(row["unconverged"]) for row in some)
        text = verdict if len(rows) == 1 else f"{len(some)} {verdict}"
        if verdict != "refused" and failed < steps:
            worst = [number(max((row[name] for row in some), key=float)) for name in ("residual", "energy_error")]
            text += " " + ", ".join(worst)
        if failed:
            text += f" ({failed} of {steps})"
        parts.append(text)
    return "; ".join(parts)


def main():
    with open(sys.argv[1], newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file, skipinitialspace=True))
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    solvers = list(dict.fromkeys(row["solver"] for row in rows))
    at = collections.defaultdict(list)
    for row in rows:
        at[row["scene"], row["solver"]].append(row)
    count = collections.Counter((row["solver"], row["verdict"]) for row in rows)
    number_of_scenes = sum(len(at[scene, solvers[0]]) for scene in scenes)
    lines = ["# Contact at the limits, scene by scene", "",
             f"{number_of_scenes} scenes, {len(rows)} rows. Made by `render.py` from `table.csv`.", "",
             "| solver | " + " | ".join(VERDICTS) + " |", "| --- |" + " --- |" * len(VERDICTS)]
    for solver in solvers:
        lines.append(f"| `{solver}` | " + " | ".join(str(count[solver, verdict]) for verdict in VERDICTS) + " |")
    lines.append("| all | " + " | ".join(str(sum(count[s, v] for s in solvers)) for v in VERDICTS) + " |")
    lines += ["", "Per scene and solver: verdict, largest violation of the laws over the largest force (with other units: largest",
              "difference of the forces), largest error of the energy books; in brackets the steps that did not converge. Random scenes",
              "of one kind stand in one row.", "",
              "| scene | " + " | ".join(f"`{solver}`" for solver in solvers) + " |", "| --- |" + " --- |" * len(solvers)]
    for scene in scenes:
        lines.append(f"| {scene} | " + " | ".join(cell(at[scene, solver]) for solver in solvers) + " |")
    with open(sys.argv[2], "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
