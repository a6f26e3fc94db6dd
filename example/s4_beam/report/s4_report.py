#!/usr/bin/env python3
"""The paper's figures and numbers on the S4 Beam: runs the analyses, draws the pictures, writes the table beside the paper's.
scripts/s4_report calls this; --help.

What was finished with the same case file is not run again: an interrupted report goes on where it was, and without anything
to run it is drawn anew. Exit status: 0 done; 1 a run failed (the report is of the others); 2 wrong command line.
"""
import argparse
import os
import sys

import comparison
import document
from results import Results
from runner import Runner
from stages import CASES, stages


def main():
    options = parse_command_line()
    every = list(stages())
    runner = Runner(options.program, options.model, os.path.join(options.output, "work"))
    failures = []
    for stage in every:
        if options.only and stage.name not in options.only:
            continue
        failure = runner.check(stage) if options.check else runner.run(stage)
        if failure:
            print(failure, file=sys.stderr)
            failures.append(failure)
        if not options.check:
            publish(options, runner, every, failures)  # after every stage: there is always a report of what there is
    print(f"cases in {runner.folder}" if options.check else os.path.join(options.output, "report.md"))
    return 1 if failures else 0


def publish(options, runner, every, failures):
    """Pictures, table and report of the stages that are finished."""
    pictures = os.path.join(options.output, "pictures")
    os.makedirs(pictures, exist_ok=True)
    results = Results(runner.folder, [stage for stage in every if runner.finished(stage)])
    rows, walls = comparison.rows(results), comparison.wall_rows(results)
    comparison.write_csv(os.path.join(options.output, "comparison.csv"), rows, walls)
    drawn = document.draw(results, walls, pictures)
    model = options.model if options.model in ("full", "coarse") else "full"
    document.write(options.output, model, options.program, results, every, rows, walls, drawn, failures)
    results.close()


def parse_command_line():
    names = [stage.name for stage in stages()]
    parser = argparse.ArgumentParser(prog="scripts/s4_report", description="The paper's figures and numbers on the S4 Beam.",
                                     epilog=f"Stages: {', '.join(names)}.")
    parser.add_argument("--program", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--model", default="full", metavar="MODEL", help="full (default; example/s4_beam/build_model makes it), coarse "
                        "(shipped; twenty minutes), or an HDF5 file of the full model")
    parser.add_argument("--only", metavar="STAGE,...", help="run only these stages; the report is of all that are finished")
    parser.add_argument("--check", action="store_true", help="write the case files and have the program check them; run nothing")
    parser.add_argument("--output", metavar="DIR", help="default: s4_report_full or s4_report_coarse in the current folder")
    options = parser.parse_args()
    options.only = options.only.split(",") if options.only else []
    for name in options.only:
        if name not in names:
            parser.error(f"no stage '{name}'; there are: {', '.join(names)}")
    needed = {"full": os.path.join(CASES, "build", "s4_full.sti"), "coarse": ""}.get(options.model, options.model)
    if needed and not os.path.isfile(needed):
        hint = " (example/s4_beam/build_model makes it)" if options.model == "full" else ""
        parser.error(f"the model is not there: {needed}{hint}")
    options.output = options.output or f"s4_report_{'coarse' if options.model == 'coarse' else 'full'}"
    return options


if __name__ == "__main__":
    sys.exit(main())
