"""Time kinacc beside what one would have used otherwise, in one run and after all have agreed.

Contenders take turns, one sample each a round, and begin one place further on each round. A
ratio is the median of the rounds' own ratios, so that what slows the machine slows all alike.
Outputs are compared before anything is timed; that run, and those that find how many make a
sample, are the warm-up. Python's garbage collector is off during a sample, BLAS has one thread.
"""

from __future__ import annotations

import gc
import resource
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SAMPLE_S = 0.02  # a sample repeats its run until it takes about this long
ROUNDS = (3, 25)  # fewest and most


@dataclass(frozen=True)
class Contender:
    """One way to do a work; all of a work give the same outputs.

    ``taken_s``: seconds of a run by its output, where another process measures them.
    """

    name: str
    version: str
    run: Callable[[], object]
    taken_s: Callable | None = None


@dataclass(frozen=True)
class Work:
    """A work and those who do it; ``contenders[0]`` is kinacc.

    ``count`` is the number of ``unit`` (poses, fits) in one run. ``agree`` gets the outputs of
    all contenders in order and raises where they differ. ``wanted`` says by the name of a
    contender how many times faster than it kinacc has to be: 1/3 for at most three times its
    time.
    """

    name: str
    unit: str
    count: int
    contenders: Sequence[Contender]
    agree: Callable[[Sequence], None]
    wanted: Mapping[str, float] = field(default_factory=dict)
    wall: bool = False  # wall-clock instead of CPU time
    error_mm: Callable | None = None  # of an output, where errors are compared as well
    seconds: float = 6.0  # rounds go on for about this long


def sample_s(contender: Contender, times: int, wall: bool) -> float:
    """Seconds of a run, of this process and of those it waits for; mean of ``times`` in a row."""
    gc.collect()
    gc.disable()
    try:
        begin = _now_s(wall)
        for _ in range(times):
            output = contender.run()
        each_s = (_now_s(wall) - begin) / times
        return contender.taken_s(output) if contender.taken_s else each_s
    finally:
        gc.enable()


def _now_s(wall: bool) -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter() if wall else time.process_time() + children[0] + children[1]


def measure(work: Work, smoke: bool = False) -> list[dict]:
    """A row a contender, kinacc's first, in nanoseconds a unit; raises what ``agree`` raises.

    ``ratio`` is the time over kinacc's, with quartiles. Smoke size is run once, to compare.
    """
    outputs = [each.run() for each in work.contenders]
    work.agree(outputs)
    taken_s = np.ones((1, len(outputs))) if smoke else _in_turns(work)
    ratios = taken_s / taken_s[:, :1]
    rows = []
    for contender, output, own, ratio in zip(
        work.contenders, outputs, taken_s.T, ratios.T, strict=True
    ):
        low, middle, high = np.quantile(ratio, (0.25, 0.5, 0.75))
        rows.append({
            "work": work.name, "unit": work.unit, "beside": contender.name,
            "version": contender.version, "ns": 1e9 * np.median(own) / work.count,
            "ratio": middle, "ratio_low": low, "ratio_high": high,
            "wanted": work.wanted.get(contender.name),
            "error_mm": work.error_mm(output) if work.error_mm else np.nan,
        })  # fmt: skip
    return rows


def _in_turns(work: Work) -> np.ndarray:
    """Seconds (rounds, contenders) of a run."""
    once_s = [sample_s(each, 1, work.wall) for each in work.contenders]
    times = [max(1, round(SAMPLE_S / max(each, 1e-7))) for each in once_s]
    a_round_s = sum(each * many for each, many in zip(once_s, times, strict=True))
    count = int(np.clip(work.seconds / a_round_s, *ROUNDS))
    taken_s = np.empty((count, len(times)))
    for number in range(count):
        for place in np.roll(np.arange(len(times)), -number):
            taken_s[number, place] = sample_s(work.contenders[place], times[place], work.wall)
    return taken_s
