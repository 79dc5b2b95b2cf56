"""What the distances between the targets of a pose tell: which moved, which were exchanged."""

from __future__ import annotations

import numpy as np

from kinacc.checks import tails
from kinacc.checks.cells import Cells
from kinacc.checks.findings import Finding, finding
from kinacc.checks.noise import Distance

_FEWEST = 4  # rows on either side of a move


def found(cells: Cells, distances: list[Distance]) -> tuple[list[Finding], np.ndarray]:
    """Suspicions, and how each cell's target is numbered when a moved one counts as another."""
    numbers = cells.target.copy()
    moves = [(distance, *_move(distance)) for distance in distances]
    steps = [(d, place, size) for d, place, size in moves if place is not None]
    suspicions = []
    while steps:
        target = _culprit(steps, len(cells.target_names))
        mine = [step for step in steps if target in (step[0].one, step[0].other)]
        first = int(mine[0][0].rows[mine[0][1]][0])
        line = int(cells.line[first])
        rows = (cells.target == target) & (cells.line >= line)
        numbers[rows] = numbers.max() + 1
        name = cells.target_names[target]
        sizes = ", ".join(
            f"{size:+.3g} mm to {cells.target_names[d.other if d.one == target else d.one]}"
            for d, _, size in mine
        )
        suspicions.append(
            finding(
                "target_moved/distances",
                cells.line[rows],
                target=name,
                sure="" if len(cells.target_names) > 2 else " (or the other of the two)",
                row=cells.row_names.one(line),
                by=sizes,
                first_line=line,
                largest_change_mm=max(abs(size) for _, _, size in mine),
            )
        )
        steps = [step for step in steps if step not in mine]
    return suspicions + _singles(cells, distances, moves), numbers


def _move(distance: Distance) -> tuple[int | None, float]:
    """Row at which a distance changes for good, and by how much; None where it does not."""
    length = distance.length_mm
    if len(length) < 2 * _FEWEST + 2:
        return None, 0.0
    best, place = 0.0, None
    clipped = np.clip(length, *np.quantile(length, [0.02, 0.98]))
    count = len(length)
    total, running = clipped.sum(), np.cumsum(clipped)
    for row in range(_FEWEST, count - _FEWEST + 1):
        before, after = running[row - 1] / row, (total - running[row - 1]) / (count - row)
        gain = (after - before) ** 2 * row * (count - row) / count
        if gain > best:
            best, place = gain, row
    if place is None:
        return None, 0.0
    size = float(np.median(length[place:]) - np.median(length[:place]))
    rest = np.concatenate(
        [
            length[:place] - np.median(length[:place]),
            length[place:] - np.median(length[place:]),
        ]
    )
    # A distance that only drifts is no move: it must leave what both sides scatter by far.
    limit = tails.limit(np.abs(rest), 1)
    return (place, size) if abs(size) > limit else (None, 0.0)


def _culprit(steps, targets: int) -> int:
    """The target that most of the changed distances have in common."""
    counts = np.zeros(targets)
    for distance, _, size in steps:
        counts[[distance.one, distance.other]] += 1.0 + 1e-3 * min(abs(size), 100.0)
    return int(np.argmax(counts))


def _singles(cells: Cells, distances: list[Distance], moves) -> list[Finding]:
    """Readings in which a target is not where the other targets have it."""
    off: dict[int, set[int]] = {}
    largest = 0.0
    for distance, place, size in moves:
        length = distance.length_mm.copy()
        if place is not None:
            length[place:] -= size
        away = np.abs(length - np.median(length))
        limit = tails.limit(away, 1, len(away) * len(moves))
        for row in np.flatnonzero(away > limit):
            line = int(cells.line[distance.rows[row, 0]])
            off.setdefault(line, set()).update((distance.one, distance.other))
            largest = max(largest, float(away[row]))
    if not off:
        return []
    return [finding("outliers/distances", off, count=len(off), largest_mm=largest)]
