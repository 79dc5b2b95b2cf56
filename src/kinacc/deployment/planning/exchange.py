"""A set of poses by greedy exchange: add the best one after another, then swap while it helps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from kinacc.deployment.planning import observability
from kinacc.errors import Problem, refuse

_REGULAR = 1e-9  # of the largest eigenvalue: makes the first few poses comparable
_BETTER = 1e-9  # relative gain below which a swap is rounding
_LOST = 1e-13  # of the largest eigenvalue: what rounding leaves of a direction nothing shows
_MOST_SWEEPS = 100


class ChosenPoses(NamedTuple):
    """Candidates chosen (N,), the index of the set, and the number of swaps that led to it;
    ``path`` (N,) is the index after each addition, before any swap."""

    chosen: np.ndarray
    value: float
    swaps: int
    path: np.ndarray


def choose(
    rows: np.ndarray,
    count: int,
    index: str = "O1",
    progress: Callable[[Iterable[int], str], Iterable[int]] | None = None,
) -> ChosenPoses:
    """``count`` of n candidates with ``rows`` (n, m, r) that maximise an observability index.

    Poses are added one by one, each the best there is; then every chosen pose in turn is swapped
    for the candidate that is best in its place, until a whole round finds nothing better. O2 to O5
    have many such ends: their swaps start from the set of O1 as well, and the better end is taken.
    No pose is taken twice. Deterministic: the lowest number wins a tie. The result cannot be
    improved by one swap; it need not be the best of all sets.
    Raises InputError for an unknown index, too few candidates, and where ``count`` poses cannot
    determine r directions.
    """
    _require(rows, count, index)
    chosen, path = _added(rows, count, index, progress)
    swaps = _exchange(rows, chosen, index, progress)
    if index != "O1":
        other, _ = _added(rows, count, "O1", progress)
        more = _exchange(rows, other, index, progress)
        if _value(index, rows, other) > _value(index, rows, chosen) * (1.0 + _BETTER):
            chosen, swaps = other, more
    return ChosenPoses(np.array(chosen), _value(index, rows, chosen), swaps, path)


def _added(rows: np.ndarray, count: int, index: str, progress) -> tuple[list[int], np.ndarray]:
    """Poses added one by one, and the index (count,) after each."""
    total = np.zeros(rows.shape[2:] * 2)
    for each in rows:
        total += each.T @ each
    floor = _REGULAR * np.linalg.eigvalsh(total)[-1] / len(rows) * np.eye(len(total))
    chosen: list[int] = []
    normal, path = np.zeros_like(total), np.zeros(count)
    steps = range(count)
    for number in progress(steps, "poses added") if progress else steps:
        free = np.setdiff1d(np.arange(len(rows)), chosen)
        # Until the set has full rank every index is zero: growth of the volume is what counts.
        ranked = len(chosen) * rows.shape[1] >= len(normal) and path[number - 1] > 0.0
        by, start = (index, normal) if ranked else ("O1", normal + floor)
        best, _ = observability.best_addition(by, start, rows, free, number + 1)
        chosen.append(best)
        normal = normal + rows[best].T @ rows[best]
        path[number] = _value(index, rows, chosen)
    return chosen, path


def _value(index: str, rows: np.ndarray, chosen: list[int]) -> float:
    return observability.of_poses(index, rows, np.array(chosen))


def _exchange(rows: np.ndarray, chosen: list[int], index: str, progress) -> int:
    """Swap poses of ``chosen`` in place until no single swap helps; how many were swapped."""
    value, swaps = _value(index, rows, chosen), 0
    everyone, count = np.arange(len(rows)), len(chosen)
    rounds = range(_MOST_SWEEPS)
    for _ in progress(rounds, "rounds of swaps at most") if progress else rounds:
        before = swaps
        for place in range(count):
            others = chosen[:place] + chosen[place + 1 :]
            flat = rows[others].reshape(-1, rows.shape[2])
            rest = flat.T @ flat
            values = np.linalg.eigvalsh(rest)
            if values[0] <= _LOST * values[-1]:
                continue  # without this pose a direction is lost: it stays
            free = np.setdiff1d(everyone, others)
            best, _ = observability.best_addition(index, rest, rows, free, count)
            if best == chosen[place]:
                continue
            found = _value(index, rows, [*others, best])
            if found > value * (1.0 + _BETTER):
                chosen[place], value, swaps = best, found, swaps + 1
        if swaps == before:
            break
    return swaps


def random_sets(
    rows: np.ndarray, counts: np.ndarray, index: str, draws: int, seed: int
) -> np.ndarray:
    """Index (draws, len(counts)) of poses taken at random, for comparison."""
    found = np.zeros((draws, len(counts)))
    for draw in range(draws):
        order = np.random.default_rng([seed, draw]).permutation(len(rows))
        for column, count in enumerate(counts):
            found[draw, column] = observability.of_poses(index, rows, order[:count])
    return found


def _require(rows: np.ndarray, count: int, index: str) -> None:
    problems = []
    if index not in observability.INDICES:
        problems.append(Problem("index", repr(index), ", ".join(observability.INDICES)))
    if count > len(rows):
        what = f"{count} of {len(rows)} candidates are wanted"
        problems.append(Problem("poses", what, "at most as many as there are candidates"))
    least = -(-rows.shape[2] // rows.shape[1])
    if count < least:
        what = f"{count} poses of {rows.shape[1]} components cannot tell {rows.shape[2]} directions"
        problems.append(Problem("poses", what, f"at least {least}"))
    refuse(problems, "Poses cannot be chosen")
