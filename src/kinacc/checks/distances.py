"""Distances between targets of one pose: a target that moved, rows in which one stood elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy import ndarray

from kinacc.checks import tails
from kinacc.checks.findings import Finding, finding
from kinacc.checks.readings import Readings, grouped, parted

_MEDIAN_1D = 0.6744897501960817  # median of |x| of a standard normal number
_FEWEST_ROWS = 4  # on either side of a change of a distance


@dataclass(frozen=True)
class Distance:
    """Distance between the targets ``ends``, row by row in the order of the file.

    ``rows`` (m, 2) indices of the two readings, ``length_mm`` (m,); ``middle_mm`` and robust
    ``std_mm`` over all of them; from row ``place`` on it is longer by ``step_mm``, 0 where it does
    not change for good.
    """

    ends: tuple[int, int]
    rows: ndarray
    length_mm: ndarray
    middle_mm: float
    std_mm: float
    place: int
    step_mm: float


def distances(every: Readings) -> list[Distance]:
    """Distances of all pairs of targets that were seen together often enough to compare."""
    number = grouped(every.session, every.pose, every.repeat)
    place = np.full((number.max() + 1, len(every.target_names)), -1)
    place[number, every.target] = np.arange(len(every))
    results = []
    for ends in combinations(range(place.shape[1]), 2):
        rows = place[:, ends]
        rows = rows[(rows >= 0).all(axis=1)]
        if len(rows) >= 3:
            rows = rows[np.argsort(every.line[rows[:, 0]], kind="stable")]
            at_mm = every.position_mm[rows]
            length = np.linalg.norm(at_mm[:, 0] - at_mm[:, 1], axis=1)
            middle = float(np.median(length))
            std = float(np.median(np.abs(length - middle))) / _MEDIAN_1D
            results.append(Distance(ends, rows, length, middle, std, *_step(length)))
    return results


def _step(length: ndarray) -> tuple[int, float]:
    """Row at which a distance (n,) changes for good, and by how much; by 0 where it does not."""
    count, place = len(length), np.arange(_FEWEST_ROWS, len(length) - _FEWEST_ROWS + 1)
    if count < 2 * _FEWEST_ROWS + 2:
        return count, 0.0
    clipped = np.clip(length, *np.quantile(length, [0.02, 0.98]))
    before = np.cumsum(clipped)[place - 1]
    step = (clipped.sum() - before) / (count - place) - before / place
    row = int(place[np.argmax(step**2 * place * (count - place))])
    middles = [float(np.median(side)) for side in np.split(length, [row])]
    # A distance that only drifts is no move: it must leave what both sides scatter by far.
    rest = np.abs(length - np.repeat(middles, [row, count - row]))
    size = middles[1] - middles[0]
    return (row, size) if abs(size) > tails.limit(rest, 1) else (count, 0.0)


def compared(every: Readings, known: list[Distance]) -> tuple[list[Finding], Readings]:
    """Targets that moved against the others, and single rows in which one stood elsewhere.

    Findings, and the readings in which a target that moved counts as another from there on.
    """
    moved, line, names = every, every.line, every.target_names
    steps, findings = [item for item in known if item.step_mm], []
    while steps:
        # The target that most of the changed distances have in common.
        target = int(np.bincount([end for item in steps for end in item.ends]).argmax())
        mine = [item for item in steps if target in item.ends]
        steps = [item for item in steps if target not in item.ends]
        first = int(mine[0].rows[mine[0].place, mine[0].ends.index(target)])
        moved, rows = parted(moved, first, "target")
        changes = (f"{e.step_mm:+.3g} mm to {names[sum(e.ends) - target]}" for e in mine)
        findings.append(
            finding(
                "target_moved/distances",
                line[rows],
                target=names[target],
                sure="" if len(names) > 2 else " (or the other of the two)",
                row=every.row_names.one(int(line[first])),
                by=", ".join(changes),
                first_line=int(line[first]),
                largest_change_mm=max(abs(item.step_mm) for item in mine),
            )
        )
    off: list[int] = []
    largest = 0.0
    for item in known:
        length = item.length_mm - item.step_mm * (np.arange(len(item.rows)) >= item.place)
        away = np.abs(length - np.median(length))
        far = away > tails.limit(away, 1, len(away) * len(known))
        off += line[item.rows[far, 0]].tolist()
        largest = max(largest, float(away[far].max(initial=0.0)))
    if off:
        count = len({*off})
        findings.append(finding("outliers/distances", off, count=count, largest_mm=largest))
    return findings, moved
