"""Measure, write benchmarks/results: ``make bench`` or ``python benchmarks/run.py [TOPIC ...]``.

``--today COMMIT`` names the kinacc to compare with, ``--smoke`` takes tiny sizes and writes
nothing. Without topics all files of benchmarks/works are measured. Exits with 1 where outputs
do not agree.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import harness

TODAY = "f4528a6"
WORKS = Path(__file__).resolve().parent / "works"


def topics() -> list[str]:
    """All topics, by name."""
    return sorted(path.stem for path in WORKS.glob("*.py") if path.stem != "__init__")


def measure(topic: str, smoke: bool, today: tuple[str, Path | None]) -> tuple[list, list[str]]:
    """Rows of a topic, and what went wrong in words.

    A topic has ``works``, or ``measure(smoke)`` with rows of its own where times are not the
    question.
    """
    module = importlib.import_module(f"works.{topic}")
    if not hasattr(module, "works"):
        return list(module.measure(smoke)), []
    rows, wrong = [], []
    works = module.works(smoke)
    processes = _processes(works, today)
    try:
        for work in works:
            try:
                rows += harness.measure(work, processes, smoke)
            except Exception as error:
                wrong.append(f"{topic}, {work.name}: {type(error).__name__}: {error}")
            else:
                print("\n".join(map(told, rows_of(rows, work.name))), flush=True)
    finally:
        for process in processes:
            process.close()
    return rows, wrong


def _processes(
    works: Sequence[harness.Work], today: tuple[str, Path | None]
) -> list[harness.Elsewhere]:
    """kinacc's process and today's; none where no work asks for them or that commit is not here."""
    commit, tree = today
    asking = [work for work in works if work.today is not None]
    if not asking or tree is None:
        return []
    kinacc = asking[0].contenders[0]
    return [
        harness.Elsewhere(kinacc.name, kinacc.version, harness.ROOT),
        harness.Elsewhere(harness.TODAY, commit, tree),
    ]


def rows_of(rows: Sequence[harness.Result], work: str) -> list[harness.Result]:
    """The rows of one work."""
    return [row for row in rows if row.work == work]


def told(row: harness.Result) -> str:
    """A row as a line on the screen."""
    who = f"  {row.work}: {row.contender} {row.version}".rstrip()
    if row.left_out:
        return f"{who}: left out, {row.left_out}"
    wanted = (
        "" if row.wanted is None else f", wanted {row.wanted:.3g}{'' if row.met else ' (not met)'}"
    )
    return f"{who}: {row.ns:,.4g} ns a {row.unit}, {row.ratio:.3g} x kinacc's time{wanted}"


def main() -> int:
    """Measure the topics asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("topics", nargs="*", metavar="TOPIC", help=", ".join(topics()))
    parser.add_argument("--today", default=TODAY, metavar="COMMIT")
    parser.add_argument("--smoke", action="store_true")
    given = parser.parse_args()
    unknown = sorted(set(given.topics) - set(topics()))
    if unknown:
        parser.error(f"no such topic: {', '.join(unknown)}; there are {', '.join(topics())}")

    os.environ.update(harness.ONE_THREAD)  # before numpy is imported
    import machine
    import measured

    wrong: list[str] = []
    with tempfile.TemporaryDirectory(prefix="kinacc-bench-") as folder:
        tree = None if given.smoke else machine.sources_of(given.today, Path(folder))
        for topic in given.topics or topics():
            begin = time.perf_counter()
            print(topic, flush=True)
            rows, problems = measure(topic, given.smoke, (given.today, tree))
            wrong += problems
            if rows and not given.smoke:
                measured.write(measured.table(rows, machine.facts()), topic)
            print(f"  {time.perf_counter() - begin:.0f} s", flush=True)
    print("\n".join(wrong), file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
