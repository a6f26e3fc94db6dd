#!/usr/bin/env python3
"""Run time against error: tables, diagrams and a report (doc/benchmark.md). scripts/benchmark calls this.

    benchmark.py --program MICROSLIP [--short] [--studies NAME ...] [--output DIR] [--convolution CSV]

Exit status: 0 done (rows may say that a run failed); 1 nothing ran; 2 wrong command line.
"""
import argparse
import os
import sys
import time

import diagrams
import report
import tables
from runs import Runner
from studies import full_studies, short_studies


def main():
    options = parse_command_line()
    began, load = time.time(), os.getloadavg()[0]
    for folder in ("tables", "pictures", "work/models"):
        os.makedirs(os.path.join(options.output, folder), exist_ok=True)
    runner = Runner(options.program, os.path.join(options.output, "work"), options.time_limit)
    make = short_studies if options.short else full_studies
    done = [(study, run_study(study, runner)) for study in make(options.program, os.path.join(options.output, "work", "models"))
            if not options.studies or study.name in options.studies]
    pictures = {}
    for study, rows in done:
        tables.write_csv(os.path.join(options.output, "tables", study.name + ".csv"), rows)
        picture = os.path.join("pictures", study.name + ".png")
        if diagrams.draw(study, rows, os.path.join(options.output, picture)):
            pictures[study.name] = picture
    ran = [run.result for run in runner.known.values() if not run.failure]
    surroundings = report.environment(options.program, ran[0] if ran else None)
    tables.write_hdf5(os.path.join(options.output, "benchmark.h5"), done, dict(surroundings))
    report.write_report(os.path.join(options.output, "report.md"), "short" if options.short else "full", surroundings, done,
                        pictures, convolution(options), (load, os.getloadavg()[0]), time.time() - began)
    print(f"{os.path.join(options.output, 'report.md')} after {time.time() - began:.0f} s")
    return 0 if ran else 1


def run_study(study, runner):
    """Run all variations and the references they need; the table's rows."""
    print(f"{study.title}:", flush=True)
    rows = []
    for variation in study.variations:
        run = runner.run(variation.case, start=study.few_steps)
        reference = None if run.failure else first_that_runs(variation.references, runner)
        rows.append(tables.row_of(variation, run, reference))
        print(line(rows[-1]), flush=True)
    if any(row["solver"] == "jacobi" for row in rows):
        tables.add_times_faster(rows)
    return rows


def first_that_runs(cases, runner):
    for case in cases:
        run = runner.run(case, repeat=False)
        if not run.failure:
            return run
    return None


def line(row):
    name = f"  {row['curve']}, {row['label']}: "
    return name + (row["failure"] or f"{row['ms_per_step']:.4g} ms/step, contact tractions to {row.get('force_l2', float('nan')):.1e}")


def convolution(options):
    """Table and picture of the products by FFT, if they were measured."""
    if not options.convolution:
        return None
    rows = report.read_csv(options.convolution)
    return rows, diagrams.convolution(rows, os.path.join(options.output, "pictures", "convolution.png"))


def parse_command_line():
    parser = argparse.ArgumentParser(prog="scripts/benchmark", description="Run time against error: tables, diagrams, report.")
    parser.add_argument("--program", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--convolution", metavar="CSV", help=argparse.SUPPRESS)
    parser.add_argument("--short", action="store_true", help="about two minutes, on the shipped coarse model")
    parser.add_argument("--studies", nargs="+", metavar="NAME", help="only these: time_step modes grid mesh tolerance solvers "
                        "scaling threads (default: all)")
    parser.add_argument("--output", metavar="DIR", help="default: benchmark_short or benchmark_full in the current folder")
    parser.add_argument("--time-limit", type=float, metavar="S", help="per run (default: 60 with --short, else 7200)")
    options = parser.parse_args()
    options.output = options.output or ("benchmark_short" if options.short else "benchmark_full")
    options.time_limit = options.time_limit or (60.0 if options.short else 7200.0)
    return options


if __name__ == "__main__":
    sys.exit(main())
