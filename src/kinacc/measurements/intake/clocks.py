"""The constant offset between the clocks of two files, from when the arm stood still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.measurements.joining import STILL_RAD

_FEWEST = 4
_SHARE = 0.6  # of the points, that must fall where the arm stood still
_RIVAL = 0.85  # of the best: another offset that explains as much, with other joints
_SHORTEST_S = 0.3  # of a standstill in a record that runs on
_MOST = 4_000_000


@dataclass(frozen=True)
class Offset:
    """Seconds to add to a point's time; ``residual_s`` how far it may be off or scatters.

    ``matched`` points of all; ``rivals`` other offsets that give other joints to as many points.
    """

    offset_s: float
    within_s: float
    residual_s: float
    matched: int
    rivals: tuple[float, ...]


def offset(points_s: np.ndarray, joints_s: np.ndarray, q_rad: np.ndarray) -> Offset | None:
    """The offset of points (n,) to joints (m,) and (m, k); None where no offset explains them."""
    stands, within = _standstills(joints_s, q_rad)
    points_s = points_s[np.isfinite(points_s)]
    if len(points_s) < _FEWEST or len(stands) < _FEWEST or len(points_s) * len(stands) > _MOST:
        return None
    low = (stands[None, :, 0] - points_s[:, None]).ravel()
    high = (stands[None, :, 1] - points_s[:, None]).ravel()
    edges = np.concatenate([low, high])
    step = np.repeat([1, -1], len(low))
    order = np.lexsort((-step, edges))
    edges, count = edges[order], np.cumsum(step[order])
    best = int(count.max())
    if best < max(_FEWEST, _SHARE * len(points_s)):
        return None
    widths = np.append(np.diff(edges), 0.0)
    top = np.flatnonzero(count == best)
    chosen = top[np.argmax(widths[top])]
    shift = float(edges[chosen] + 0.5 * widths[chosen])
    own = _stand_of(points_s + shift, stands)
    rivals: list[float] = []
    for place in np.flatnonzero((count >= _RIVAL * best) & (widths > 0.0)):
        other = float(edges[place] + 0.5 * widths[place])
        theirs = _stand_of(points_s + other, stands)
        both = (own >= 0) & (theirs >= 0)
        differs = np.sum(own[both] != theirs[both]) > 0.2 * max(both.sum(), 1)
        if differs and all(abs(other - each) > 2 * within for each in rivals):
            rivals.append(other)
    middle = stands.mean(axis=1)
    if np.ptp(stands, axis=1).max() <= 2.0 * within * (1 + 1e-9):  # a row for every pose
        apart = middle[own[own >= 0]] - points_s[own >= 0]
        shift, residual = float(np.median(apart)), float(np.std(apart - np.median(apart)))
    else:
        residual = float(0.5 * widths[chosen])
    return Offset(round(shift, 3), within, residual, best, tuple(rivals))


def _standstills(time_s: np.ndarray, q_rad: np.ndarray) -> tuple[np.ndarray, float]:
    """Begin and end (m, 2) of every standstill, and how near in time joints belong to a point."""
    order = np.argsort(time_s, kind="stable")
    time, q = time_s[order], q_rad[order]
    moved = np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0) > 0.5 * STILL_RAD
    starts = np.concatenate([[0], np.flatnonzero(moved) + 1])
    ends = np.concatenate([np.flatnonzero(moved), [len(time) - 1]])
    runs = ends - starts + 1
    if np.sum(runs >= 3) >= 0.5 * np.sum(runs > 0) or np.sum(runs[runs >= 3]) > 0.3 * len(time):
        long = (time[ends] - time[starts] >= _SHORTEST_S) & (runs >= 3)
        period = float(np.median(np.diff(time)))
        return np.stack([time[starts[long]], time[ends[long]]], axis=1), max(2.0 * period, 0.05)
    gaps = np.diff(time)
    within = 0.25 * float(np.min(gaps[gaps > 0.0], initial=np.inf))
    return np.stack([time - within, time + within], axis=1), within


def _stand_of(times: np.ndarray, stands: np.ndarray) -> np.ndarray:
    """Number (n,) of the standstill at each time, -1 for none."""
    place = np.searchsorted(stands[:, 0], times, side="right") - 1
    inside = (place >= 0) & (times <= stands[np.maximum(place, 0), 1])
    return np.where(inside, place, -1)


def nearness(time_s: np.ndarray, q_rad: np.ndarray) -> float:
    """How near in time joints belong to a point."""
    return _standstills(time_s, q_rad)[1]
