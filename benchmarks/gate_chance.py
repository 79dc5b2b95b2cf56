"""How often a gate against the accepted run fails where the arm is at the limit of what is allowed.

    python benchmarks/gate_chance.py [RUNS]

Two runs are drawn whose true difference in a statistic is what the gate allows, to the last digit:
it should fail in at most 1 of 100 (``beyond_chance: 0.99``). Errors are of three kinds: vectors
with a normal distribution whose spread differs from pose to pose, at the same poses in both runs
(every error a tenth larger, and noise) or at others; and, harder than arms are, an accepted run
of which a few poses carry most of the error while the new one is even.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np

from kinacc.gate.chance import STATISTICS, Sample, change

CONFIDENCE = 0.99
_MANY = 2_000_000
_SIZES = {
    "mean": (20, 60, 400),
    "rms": (20, 60, 400),
    "p99_gamma": (20, 60, 400),
    "p99": (200, 400),
}
Drawn = tuple[np.ndarray, np.ndarray]


def _vectors(draw: np.random.Generator, count: int) -> np.ndarray:
    return draw.normal(size=(count, 3)) * draw.gamma(4.0, 0.25, size=(count, 1))


def same_poses(draw: np.random.Generator, count: int) -> Drawn:
    """Sizes (n,) before and now, at the same poses."""
    before = _vectors(draw, count)
    now = 1.1 * before + 0.2 * draw.normal(size=(count, 3))
    return np.linalg.norm(before, axis=1), np.linalg.norm(now, axis=1)


def other_poses(draw: np.random.Generator, count: int) -> Drawn:
    """Sizes (n,) before and now, each at poses of its own."""
    before, now = _vectors(draw, count), 1.1 * _vectors(draw, count)
    return np.linalg.norm(before, axis=1), np.linalg.norm(now, axis=1)


def few_large(draw: np.random.Generator, count: int) -> Drawn:
    """The same where the largest errors of the accepted run are few and far out."""
    before = draw.normal(size=(count, 3)) * draw.lognormal(0.0, 0.6, size=(count, 1))
    now = draw.normal(size=(count, 3))
    return np.linalg.norm(before, axis=1), np.linalg.norm(now, axis=1)


WORLDS: dict[str, tuple[Callable[[np.random.Generator, int], Drawn], bool]] = {
    "same poses": (same_poses, True),
    "other poses": (other_poses, False),
    "few large errors before, other poses": (few_large, False),
}


def share_failed(world: str, statistic: str, count: int, runs: int, seed: int) -> float:
    """Share of ``runs`` in which the gate fails, of ``count`` poses."""
    of, paired = WORLDS[world]
    draw = np.random.default_rng(seed)
    truth = [STATISTICS[statistic][0](each) for each in of(draw, _MANY)]
    allowed, poses, failed = truth[1] - truth[0], np.arange(count), 0
    for _ in range(runs):
        before, now = (Sample(each, poses) for each in of(draw, count))
        failed += change(statistic, now, before, paired, CONFIDENCE).least > allowed
    return failed / runs


def main(runs: int) -> None:
    """Print the table, one row for each kind of errors and statistic."""
    print("| errors | statistic | poses: share that fails |\n|---|---|---|")
    for world in WORLDS:
        for statistic, sizes in _SIZES.items():
            found = [f"{n}: {share_failed(world, statistic, n, runs, n):.1%}" for n in sizes]
            print(f"| {world} | {statistic} | {', '.join(found)} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
