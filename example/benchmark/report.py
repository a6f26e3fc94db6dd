"""The report: what machine and program, every study's table and picture."""
import csv
import os
import platform
import re
import subprocess

import h5py

from tables import markdown


def environment(program, results):
    """[(what, value)] of the machine and the program; `results` is any result file."""
    with open("/proc/cpuinfo") as file:
        model = re.search(r"model name\s*:\s*(.*)", file.read())
    rows = [("processor", model.group(1) if model else platform.machine()),
            ("cores", str(os.cpu_count())),
            ("memory", f"{os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') / 2**30:.0f} GiB"),
            ("system", f"{system_name()}, Linux {platform.release()}"),
            ("BLAS", blas(program))]
    if results:
        with h5py.File(results, "r") as file:
            rows += [(name, text(file.attrs[name])) for name in ("version", "commit") if name in file.attrs]
            rows.append(("compiler", compiler(text(file.attrs["compiler"]))))
    return rows


def compiler(words):
    """Its version and options, each once, without folders and what -march=native stands for."""
    kept = [word for word in dict.fromkeys(words.split()) if not re.match(r"-I|-J|\.|build/|--param|-m(?!arch)|-fpre-include", word)]
    return " ".join(kept)


def system_name():
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except OSError:
        return platform.system()


def blas(program):
    """Name of the BLAS that the program loads."""
    libraries = subprocess.run(["ldd", program], capture_output=True, text=True).stdout
    found = re.search(r"=> (\S*(?:blas|mkl)\S*)", libraries)
    core = os.environ.get("OPENBLAS_CORETYPE")
    return (os.path.basename(os.path.realpath(found.group(1))) if found else "unknown") + (f", OPENBLAS_CORETYPE={core}" if core else "")


def text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


def picture(study):
    """Where the study's picture lies, from the report."""
    return f"pictures/{study.name}.png"


def write_report(folder, kind, surroundings, tables, convolution):
    """`tables`: [(study, rows)]; `convolution`: (rows, factors) or None."""
    lines = [f"# Benchmark, {kind} version", "",
             "Run time against error. What is measured and how errors are defined: doc/benchmark.md. Errors are relative to the "
             "reference of each study. One thread unless said otherwise. All tables with all columns: `tables/*.csv`, and "
             "together `benchmark.h5`.", "",
             "| | |", "| --- | --- |", *[f"| {name} | {value} |" for name, value in surroundings], ""]
    for study, rows in tables:
        lines += [f"## {study.title}", "", study.text, "", measured(rows), ""]
        if os.path.exists(os.path.join(folder, picture(study))):
            lines += [f"![{study.title}]({picture(study)})", ""]
        lines += [markdown(study, rows), ""]
        lines += [f"Not run: {what}" for what in study.missing] + ([""] if study.missing else [])
    lines += convolution_section(convolution)
    with open(os.path.join(folder, "report.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines).rstrip() + "\n")


def measured(rows):
    """When, and with which program: studies may be from different days."""
    days, commits = ([value for value in dict.fromkeys(row.get(name) for row in rows) if value] for name in ("day", "commit"))
    return f"Measured {', '.join(days) or 'on a day not recorded'}, commit {', '.join(commits) or 'not recorded'}."


def convolution_section(convolution):
    if convolution is None:
        return []
    rows, factors = convolution
    names = list(rows[0])
    fits = " and ".join(f"{1e9 * factor:.3g} ns x N log2 N with {name} materials" for name, factor in factors.items())
    return ["## Product by FFT", "", f"One product of the half-space compliance with forces at N points, by FFT: {fits}.", "",
            "![Product by FFT](pictures/convolution.png)", "", "| " + " | ".join(names) + " |", "| --- " * len(names) + "|",
            *["| " + " | ".join(row[name] for name in names) + " |" for row in rows], ""]


def convolution_table(program, path):
    """Run the example that measures the products, with one thread; keep its CSV, return its rows."""
    with open(path, "w", encoding="utf-8") as file:
        subprocess.run([program], stdout=file, check=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
