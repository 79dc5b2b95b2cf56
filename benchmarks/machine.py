"""What the figures were measured on."""

from __future__ import annotations

import functools
import os
import platform
import subprocess
import time
from datetime import date
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("src", "workflow", "profiles", "Snakefile", "config.yaml")  # what a run needs


def facts() -> dict[str, str | int | float]:
    """The machine, the packages under all contenders, the commit of kinacc, the day."""
    return {
        "cpu": cpu(),
        "cores": len(os.sched_getaffinity(0)),
        "write_gb_per_s": round(write_bandwidth_bytes_per_s() / 1e9, 2),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "commit": commit(),
        "measured_on": date.today().isoformat(),
    }


def cpu() -> str:
    """The processor's name, with what tells its generation where the name does not."""
    told = Path("/proc/cpuinfo")
    if not told.exists():
        return platform.processor() or platform.machine()
    lines = [line.partition(":") for line in told.read_text().split("\n\n")[0].splitlines()]
    known = {key.strip(): value.strip() for key, _, value in lines}
    name = known.get("model name", platform.machine())
    return (
        f"{name}, family {known['cpu family']} model {known['model']}" if "model" in known else name
    )


@functools.cache
def write_bandwidth_bytes_per_s(size_bytes: int = 1 << 28) -> float:
    """What one thread writes into memory that is there already, by CPU time, best of seven."""
    array = np.zeros(size_bytes // 8)
    best = float("inf")
    for value in range(7):
        begin = time.process_time()
        array.fill(value)
        best = min(best, time.process_time() - begin)
    return array.nbytes / best


def commit(of: str = "HEAD") -> str:
    """The short name of a commit; with "+" where sources differ from it; "" outside git."""
    try:
        name = _git("rev-parse", "--short=7", of)
        changed = of == "HEAD" and _git(
            "status", "--porcelain", "src", "workflow", "benchmarks/works"
        )
    except (OSError, subprocess.CalledProcessError):
        return ""
    return f"{name}+" if changed else name


def sources_of(of: str, folder: Path) -> Path | None:
    """What of a commit is run, in ``folder``; None without it. Leaves the repository alone."""
    try:
        packed = folder / "tree.tar"
        _git("archive", "--output", str(packed), of, "--", *SOURCES)
        subprocess.run(["tar", "-xf", packed.name], cwd=folder, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    packed.unlink()
    return folder


def _git(*words: str) -> str:
    return subprocess.run(
        ["git", *words], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.strip()
