"""Measure and write docs/benchmarks.md: ``make bench`` or ``python benchmarks/run.py [TOPIC ..]``.

A topic is a file of benchmarks/works: its docstring is the text of its section, ``works(smoke)``
what is measured. Rows are kept in benchmarks/results/<topic>.csv; topics that are not named keep
theirs. Ends with an error where outputs do not agree.
"""

from __future__ import annotations

import ast
import os
import platform
import re
import subprocess
import sys
from datetime import date
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd
from harness import ROOT, measure

HERE = Path(__file__).resolve().parent
TOPICS = ("kinematics", "fits", "held_out", "processes")
PAGE = """\
# Benchmarks

Times of kinacc beside those of what one would have used otherwise. `make bench` measures them
anew, with the other libraries in environments of their own, and writes this page: do not edit
it. What models reach on measured arms is [another page](../benchmarks/README.md).

{sections}
## How it is measured

Contenders take turns. A ratio is the median of the rounds' own ratios, with quartiles in
brackets; times are medians of CPU time, of wall-clock time where threads or two cores are the
question. Before anything is timed all outputs are compared, to a tolerance that stands in the
topic's file. BLAS has one thread.
"""


def page(tables: dict[str, pd.DataFrame]) -> str:
    """The page of these topics."""
    sections = []
    for topic, rows in tables.items():
        told = ast.get_docstring(ast.parse((HERE / "works" / f"{topic}.py").read_text()))
        title, _, text = (told or "").replace("``", "`").partition("\n\n")
        own = rows.drop_duplicates("work").set_index("work")
        others = rows[rows.groupby("work").cumcount() > 0]
        lines = ["| work | beside | its time | kinacc's | kinacc is | wanted |", "|---" * 6 + "|"]
        lines += [_line(row, own.loc[row.work]) for row in others.itertuples()]
        sections.append("\n".join([f"## {title}", "", text, "", *lines, "", rows.attrs["on"], ""]))
    return PAGE.format(sections="\n".join(sections))


def _line(row, own) -> str:
    low, high = sorted([max(each, 1.0 / each) for each in (row.ratio_low, row.ratio_high)])
    wanted = _times(row.wanted)
    if wanted and row.ratio < row.wanted:
        wanted = f"**{wanted}: not met**"
    faster = f"{_times(row.ratio)} ({low:.3g} to {high:.3g})"
    return (
        f"| {row.work} | {row.beside} {row.version} | {duration(row.ns)} a {row.unit}{_error(row)} "
        f"| {duration(own.ns)}{_error(own)} | {faster} | {wanted} |"
    )


def _error(row) -> str:
    error_mm = getattr(row, "error_mm", np.nan)
    return "" if pd.isna(error_mm) else f", {error_mm:.4f} mm"


def _times(ratio: float) -> str:
    return (
        ""
        if pd.isna(ratio)
        else f"{max(ratio, 1.0 / ratio):.3g} x {'faster' if ratio >= 1 else 'slower'}"
    )


def duration(ns: float) -> str:
    """A time with three digits, in the unit that reads best."""
    sizes = ((1e9, "s"), (1e6, "ms"), (1e3, "µs"), (0.0, "ns"))
    size, unit = next(each for each in sizes if ns >= each[0])
    return f"{ns / (size or 1.0):.3g} {unit}"


def _facts() -> str:
    """What the figures were measured on: one line."""
    info = Path("/proc/cpuinfo")
    found = re.search("model name.*: (.*)", info.read_text()) if info.exists() else None
    cpu = found[1] if found else platform.machine()
    command = ["git", "rev-parse", "--short=7", "HEAD"]
    commit = subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout.strip()
    return (
        f"Measured on {cpu}, {os.cpu_count()} cores, Python {platform.python_version()}; "
        f"kinacc at {commit or 'no commit'}, {date.today()}."
    )


def read() -> dict[str, pd.DataFrame]:
    """Rows of every topic that has been measured; ``attrs["on"]`` says on what."""
    tables = {}
    for topic in TOPICS:
        path = HERE / "results" / f"{topic}.csv"
        if path.exists():
            with path.open(encoding="utf-8") as file:
                on = file.readline().removeprefix("# ").strip()
                tables[topic] = pd.read_csv(file)
            tables[topic].attrs["on"] = on
    return tables


def main(topics: list[str]) -> None:
    """Measure the topics, then write the page of all."""
    for topic in topics or TOPICS:
        rows = []
        for work in import_module(f"works.{topic}").works(smoke=False):
            rows += (found := measure(work))
            print(pd.DataFrame(found)[["work", "beside", "ns", "ratio"]].to_string(header=False))
        (HERE / "results").mkdir(exist_ok=True)
        with (HERE / "results" / f"{topic}.csv").open("w", encoding="utf-8") as file:
            file.write(f"# {_facts()}\n")
            pd.DataFrame(rows).to_csv(file, index=False, float_format="%.5g")
    (ROOT / "docs" / "benchmarks.md").write_text(page(read()), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
