"""How much memory does a stage of the workflow need at the paper's size?

Peak resident memory of the process of every stage of ``snakemake -c1`` from nothing, as the
system keeps it (``VmHWM``), read every 5 ms while the process lives; what rises within the last
5 ms is missed. At most 200 MB. Limit: Python with numpy and pyarrow.parquet has 26 and 70 MB of
that; matplotlib and numba have about 40 MB each. What memory adds with poses and repetitions is
in ``growth``.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import project

WANTED_MB = 200.0
EVERY_S = 0.005


def measure(smoke: bool) -> list[dict[str, str | float | bool]]:
    """A row for each stage that ran: its peak memory, and what it may be."""
    cwd = project.folder()
    targets = ["results/mh180/measurements.parquet"] if smoke else []
    where = ("--snakefile", project.tree() / "Snakefile", "--cores", 1, "--no-hooks")
    with (cwd / "said").open("w") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "snakemake", *map(str, where), "--", *targets],
            cwd=cwd, env=project.environment(), stdout=said, stderr=said,
        )  # fmt: skip
        peaks: dict[str, float] = {}
        while process.poll() is None:
            for pid in _below(process.pid):
                stage, peak = _stage(pid), _peak_mb(pid)
                if stage and peak:
                    peaks[stage] = max(peaks.get(stage, 0.0), peak)
            time.sleep(EVERY_S)
    if process.returncode:
        raise RuntimeError((cwd / "said").read_text())
    return [
        {"stage": stage, "peak_mb": peak, "wanted_mb": WANTED_MB, "met": peak <= WANTED_MB}
        for stage, peak in sorted(peaks.items(), key=lambda each: -each[1])
    ]


def _below(pid: int) -> Iterator[int]:
    """All processes a process has started, and theirs."""
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in _text(path).split():
            yield int(child)
            yield from _below(int(child))


def _stage(pid: int) -> str | None:
    """The stage a process runs, by the log it is given."""
    words = _text(Path(f"/proc/{pid}/cmdline")).split("\0")
    if "--job" not in words or "--log" not in words:
        return None
    return Path(words[words.index("--log") + 1]).name.partition(".")[0]


def _peak_mb(pid: int) -> float | None:
    found = re.search(r"^VmHWM:\s+(\d+) kB", _text(Path(f"/proc/{pid}/status")), re.MULTILINE)
    return int(found[1]) * 1024 / 1e6 if found else None


def _text(path: Path) -> str:
    """Of a file of the system; nothing where its process has ended."""
    try:
        return path.read_text()
    except (FileNotFoundError, ProcessLookupError):
        return ""
