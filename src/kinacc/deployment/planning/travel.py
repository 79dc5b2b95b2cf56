"""The order in which poses are driven to with least joint travel."""

from __future__ import annotations

import numpy as np

METRICS = {
    "largest": "largest movement of a joint between poses, which sets the time of a move",
    "sum": "sum of the movements of all joints",
}
_SHORTER = 1e-9


def distances(
    joints: np.ndarray, metric: str = "largest", speed: np.ndarray | None = None
) -> np.ndarray:
    """Distances (n, n) between joints (n, k); with ``speed`` (k,) movements become times."""
    apart = np.abs(joints[:, None] - joints[None])
    if speed is not None:
        apart = apart / speed
    return apart.max(axis=2) if metric == "largest" else apart.sum(axis=2)


def order(distance: np.ndarray, start: int = 0) -> np.ndarray:
    """A short open path (n,) through all points of ``distance`` (n, n), beginning at ``start``.

    Nearest neighbour, then 2-opt: stretches are reversed while the path gets shorter.
    Deterministic; not necessarily the shortest of all paths.
    """
    path = _nearest_neighbour(distance, start)
    while True:
        gain, first, last = _best_reversal(distance, path)
        if gain <= _SHORTER:
            return path
        path[first : last + 1] = path[first : last + 1][::-1]


def length(distance: np.ndarray, path: np.ndarray) -> float:
    """Length of an open path."""
    return float(distance[path[:-1], path[1:]].sum())


def _nearest_neighbour(distance: np.ndarray, start: int) -> np.ndarray:
    left = np.ones(len(distance), dtype=bool)
    path = [start]
    left[start] = False
    while left.any():
        path.append(int(np.argmin(np.where(left, distance[path[-1]], np.inf))))
        left[path[-1]] = False
    return np.array(path)


def _best_reversal(distance: np.ndarray, path: np.ndarray) -> tuple[float, int, int]:
    """Largest gain of reversing path[first..last], the beginning held, and its ends."""
    ordered = distance[np.ix_(path, path)]
    count = len(path)
    if count < 3:
        return 0.0, 0, 0
    step = np.append(ordered[np.arange(count - 1), np.arange(1, count)], 0.0)  # none after the last
    first, last = np.triu_indices(count, 1)
    held = first >= 1
    first, last = first[held], last[held]
    open_end = last == count - 1
    after = np.where(open_end, 0, last + 1)
    joined = ordered[first - 1, last] + np.where(open_end, 0.0, ordered[first, after])
    gain = step[first - 1] + step[last] - joined
    best = int(np.argmax(gain))
    return float(gain[best]), int(first[best]), int(last[best])
