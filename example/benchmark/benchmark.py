#!/usr/bin/env python3
"""Run time against error: tables, diagrams and a report (doc/benchmark.md). scripts/benchmark calls this; --help.

Exit status: 0 done (rows may say that a run failed); 1 nothing ran, or a model could not be made; 2 wrong command line.
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

UNDISTURBED = 0.85  # of its core: what a run with one thread has at least if the machine is left alone


def main():
    options = parse_command_line()
    began, load = time.time(), os.getloadavg()[0]
    work = os.path.join(options.output, "work")
    for folder in ("tables", "pictures", "work/models"):
        os.makedirs(os.path.join(options.output, folder), exist_ok=True)
    try:
        studies = (short_studies if options.short else full_studies)(options.program, os.path.join(work, "models"))
    except RuntimeError as fault:
        print(fault, file=sys.stderr)
        return 1
    runner = Runner(options.program, work, options.time_limit)
    convolution = measure_convolution(options)
    wanted = [name for name in studies if not options.studies or name in options.studies]
    earlier = {name: (make(), tables.read_csv(table_path(options, name))) for name, make in studies.items()
               if name not in wanted and os.path.exists(table_path(options, name))}
    done = {}
    for name in wanted:
        study = studies[name]()
        done[name] = (study, run_study(study, runner))
        write_study(options, *done[name])
        # After every study, so that an interrupted benchmark keeps what it has.
        publish(options, [{**earlier, **done}[name] for name in studies if name in earlier or name in done], convolution, runner,
                load, time.time() - began)
    print(f"{os.path.join(options.output, 'report.md')} after {time.time() - began:.0f} s")
    return 0 if any(not run.failure for run in runner.known.values()) else 1


def run_study(study, runner):
    """Run all variations and the references they need; the table's rows."""
    print(f"{study.title}:", flush=True)
    rows = []
    for variation in study.variations:
        run = runner.run(variation.case)
        reference = None if run.failure else first_that_runs(variation.references, runner)
        rows.append(tables.row_of(variation, run, reference))
        print(line(rows[-1]), flush=True)
    if any(row["solver"] == "jacobi" for row in rows):
        tables.add_times_faster(rows)
    return rows


def first_that_runs(cases, runner):
    for case in cases:
        run = runner.run(case)
        if not run.failure:
            return run
    return None


def line(row):
    name = f"  {row['curve']}, {row['label']}: "
    return name + (row["failure"] or f"{row['ms_per_step']:.4g} ms/step, contact tractions to {row.get('force_l2', float('nan')):.1e}")


def measure_convolution(options):
    """(table, factors of N log N in s) of the products by FFT, with its picture; None without the program that measures them."""
    if not options.convolution:
        return None
    rows = report.convolution_table(options.convolution, os.path.join(options.output, "tables", "convolution.csv"))
    return rows, diagrams.convolution(rows, os.path.join(options.output, "pictures", "convolution.png"))


def table_path(options, name):
    return os.path.join(options.output, "tables", name + ".csv")


def write_study(options, study, rows):
    """Table and picture of a study."""
    tables.write_csv(table_path(options, study.name), rows)
    diagrams.draw(study, rows, os.path.join(options.output, report.picture(study)))


def publish(options, done, convolution, runner, load, seconds):
    """The report of the studies so far, and of those of earlier calls."""
    ran = [run.result for run in runner.known.values() if not run.failure]
    surroundings = report.environment(options.program, ran[0] if ran else None)
    surroundings += [("load average", f"{load:.2f} at the start, {os.getloadavg()[0]:.2f} at the end, the benchmark's own included"),
                     ("duration of all this", f"{seconds / 60:.1f} min"), ("disturbed runs", disturbed(done))]
    tables.write_hdf5(os.path.join(options.output, "benchmark.h5"), done, convolution, dict(surroundings))
    report.write_report(options.output, "short" if options.short else "full", surroundings, done, convolution)


def disturbed(done):
    """How many rows are of runs with one thread that did not have their core for themselves."""
    shares = [row["own"] for _, rows in done for row in rows if row["threads"] == 1 and not row["failure"]]
    few = sum(share < UNDISTURBED for share in shares)
    return f"{few} of {len(shares)} with one thread had less than {UNDISTURBED} of their core: their times are too long"


def parse_command_line():
    parser = argparse.ArgumentParser(prog="scripts/benchmark", description="Run time against error: tables, diagrams, report.")
    parser.add_argument("--program", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--convolution", metavar="PROGRAM", help=argparse.SUPPRESS)
    parser.add_argument("--short", action="store_true", help="about two minutes, on the shipped coarse model")
    parser.add_argument("--studies", nargs="+", metavar="NAME", help="measure only these, and keep what the folder has of "
                        "the others: time_step modes grid mesh tolerance solvers scaling threads (default: all; mesh only "
                        "without --short)",
                        choices="time_step modes grid mesh tolerance solvers scaling threads".split())
    parser.add_argument("--output", metavar="DIR", help="default: benchmark_short or benchmark_full in the current folder")
    parser.add_argument("--time-limit", type=float, metavar="S", help="per run (default: 60 with --short, else 7200)")
    options = parser.parse_args()
    options.output = options.output or ("benchmark_short" if options.short else "benchmark_full")
    options.time_limit = options.time_limit or (60.0 if options.short else 7200.0)
    return options


if __name__ == "__main__":
    sys.exit(main())
