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
    stands, within = standstills(joints_s, q_rad)
    points_s = points_s[np.isfinite(points_s)]
    if min(len(points_s), len(stands)) < _FEWEST or len(points_s) * len(stands) > _MOST:
        return None
    # Every point at every standstill is an interval of offsets; they are counted at its ends.
    ends = (stands[None, :, :] - points_s[:, None, None]).reshape(-1, 2)
    edges, step = ends.T.ravel(), np.repeat([1, -1], len(ends))
    order = np.lexsort((-step, edges))
    edges, count = edges[order], np.cumsum(step[order])
    widths = np.append(np.diff(edges), 0.0)
    best = int(count.max())
    if best < max(_FEWEST, _SHARE * len(points_s)):
        return None
    chosen = max(np.flatnonzero(count == best), key=lambda place: widths[place])
    middles = edges + 0.5 * widths
    shift, residual = float(middles[chosen]), float(0.5 * widths[chosen])
    own = _stand_of(points_s + shift, stands)
    rivals: list[float] = []
    for other in middles[(count >= _RIVAL * best) & (widths > 0.0)].tolist():
        theirs = _stand_of(points_s + other, stands)
        both = (own >= 0) & (theirs >= 0)
        differs = np.sum(own[both] != theirs[both]) > 0.2 * max(both.sum(), 1)
        if differs and all(abs(other - each) > 2 * within for each in rivals):
            rivals.append(other)
    if np.ptp(stands, axis=1).max() <= 2.0 * within * (1 + 1e-9):  # a row for every pose
        apart = stands.mean(axis=1)[own[own >= 0]] - points_s[own >= 0]
        shift, residual = float(np.median(apart)), float(np.std(apart))
    return Offset(round(shift, 3), within, residual, best, tuple(rivals))


def standstills(time_s: np.ndarray, q_rad: np.ndarray) -> tuple[np.ndarray, float]:
    """Begin and end (m, 2) of every standstill, and how near in time joints belong to a point."""
    order = np.argsort(time_s, kind="stable")
    time, q = time_s[order], q_rad[order]
    moved = np.flatnonzero(np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0) > 0.5 * STILL_RAD)
    starts, ends = np.append(0, moved + 1), np.append(moved, len(time) - 1)
    runs, gaps = ends - starts + 1, np.diff(time)
    long = runs >= 3
    if 2 * long.sum() >= len(runs) or runs[long].sum() > 0.3 * len(time):
        long &= time[ends] - time[starts] >= _SHORTEST_S
        stands = np.stack([time[starts[long]], time[ends[long]]], axis=1)
        return stands, max(2.0 * float(np.median(gaps)), 0.05)
    within = 0.25 * float(np.min(gaps[gaps > 0.0], initial=np.inf))
    return np.stack([time - within, time + within], axis=1), within


def _stand_of(times: np.ndarray, stands: np.ndarray) -> np.ndarray:
    """Number (n,) of the standstill at each time, -1 for none."""
    place = np.searchsorted(stands[:, 0], times, side="right") - 1
    inside = (place >= 0) & (times <= stands[np.maximum(place, 0), 1])
    return np.where(inside, place, -1)
