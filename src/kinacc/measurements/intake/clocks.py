"""The offset between the clocks of two files: points are measured where the arm stands still."""

from __future__ import annotations

import numpy as np

from kinacc.measurements.joining import STILL_RAD

_FEWEST = 4
_SHARE = 0.6  # of the points, that must fall where the arm stood still
_RIVAL = 0.85  # of the most points: another offset explains as much
_SHORTEST_S = 0.3  # of a standstill in a record that runs on
_MOST = 4_000_000


def offsets(points_s: np.ndarray, stands: np.ndarray, within_s: float) -> list[float]:
    """Seconds to add to times of points (n,) so that most fall into standstills (m, 2).

    The best first; behind it others that give other joints to as many points. Empty for none.
    """
    points_s = points_s[np.isfinite(points_s)]
    if min(len(points_s), len(stands)) < _FEWEST or len(points_s) * len(stands) > _MOST:
        return []
    starts, ends = np.sort((stands.T[:, None, :] - points_s[:, None]).reshape(2, -1))
    edges = np.unique(np.append(starts, ends))
    middle = 0.5 * (edges[1:] + edges[:-1])
    count = np.searchsorted(starts, middle) - np.searchsorted(ends, middle)
    if count.max() < max(_FEWEST, _SHARE * len(points_s)):
        return []

    def stand(offset: float) -> np.ndarray:
        place = np.searchsorted(stands[:, 0], points_s + offset, side="right") - 1
        return np.where((place >= 0) & (points_s + offset <= stands[place, 1]), place, -1)

    order = np.lexsort((-np.diff(edges), -count))
    best = [float(middle[order[0]])]
    joints = stand(best[0])
    for offset in middle[order[count[order] >= _RIVAL * count.max()]].tolist():
        theirs = stand(offset)
        both = (joints >= 0) & (theirs >= 0)
        apart = min(abs(offset - rival) for rival in best) > 2.0 * within_s
        if apart and np.sum((joints != theirs) & both) > 0.2 * max(both.sum(), 1):
            best.append(offset)
    return [round(offset, 3) for offset in best]


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
    within = 0.25 * float(np.min(gaps[gaps > 0.0], initial=np.inf))  # single rows, far apart
    return np.stack([time - within, time + within], axis=1), within
