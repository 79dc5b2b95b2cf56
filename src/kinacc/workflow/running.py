"""One run of the workflow at a time in a folder of results, and what it ends with."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

_held: list[tuple[TextIO, float]] = []  # until the process ends, however it ends; since when


def hold(results: str) -> None:
    """Hold the results for this process; leave with a line where another run holds them."""
    _held.append((_locked(results), time.time()))


@contextmanager
def held(results: str) -> Iterator[None]:
    """Hold the results as long as the context lasts."""
    with _locked(results):
        yield


def _locked(results: str) -> TextIO:
    Path(results).mkdir(parents=True, exist_ok=True)
    file = open(Path(results) / ".lock", "w")  # noqa: SIM115 held until the process ends
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise SystemExit(f"another run holds {results}: wait until it has ended") from None
    return file


def calibrated(results: str, datasets: Sequence[str]) -> list[Path]:
    """Results folders whose summary this run made."""
    tables = [Path(results, name, "summary.parquet") for name in datasets]
    began = _held[0][1]
    return [path.parent for path in tables if path.is_file() and path.stat().st_mtime >= began]
