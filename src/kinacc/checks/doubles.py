"""Rows that say the same as another row, and readings that were not taken anew."""

from __future__ import annotations

import numpy as np

from kinacc.checks.cells import Cells
from kinacc.checks.findings import Finding, finding
from kinacc.errors import first_few

_CHANCE = 0.01  # expected number of coincidences above which equal readings say nothing


def found(cells: Cells, noise_mm: float) -> list[Finding]:
    """Rows equal to an earlier one in every joint and reading.

    Readings are written to a limited number of digits: where repeats scatter by ``noise_mm`` per
    axis (NaN if unknown) so little that equal digits are no surprise, they raise no suspicion.
    """
    rows, reading = _by_line(cells)
    both = np.column_stack([cells.q[rows], np.nan_to_num(reading, nan=np.inf)])
    twice = _earlier_equal(both)
    again = np.flatnonzero(twice >= 0)
    if not again.size or not _unlikely(cells, noise_mm):
        return []
    line = cells.line[rows]
    first = int(line[twice[again[0]]])
    row = cells.row_names.one(first)
    return [
        finding("duplicate_rows", line[again], count=again.size, row=row, first_copied_line=first)
    ]


def stale(cells: Cells, equal: np.ndarray, noise_mm: float) -> list[Finding]:
    """Rows whose readings are those of an earlier row of other joints, to the last digit.

    ``equal`` (n,) as ``earlier`` gives it; ``noise_mm`` as for ``found``.
    """
    there = np.flatnonzero(equal > 0)
    again, at = np.unique(cells.line[there], return_index=True)
    if not again.size or not _unlikely(cells, noise_mm):
        return []
    first = equal[there[at]]
    called = cells.row_names
    pairs = zip(again.tolist(), first.tolist(), strict=True)
    told = [f"{called.one(line)} repeats {called.number(of)}" for line, of in pairs]
    return [finding("repeated_reading", again, pairs=first_few(told, 4))]


def earlier(cells: Cells) -> np.ndarray:
    """Line (n,) of an earlier row of other joints whose readings are equal in every digit, or 0."""
    rows, reading = _by_line(cells)
    same = _earlier_equal(np.nan_to_num(reading, nan=np.inf))
    joints = cells.q[rows]
    moved = ~np.isclose(joints, joints[np.maximum(same, 0)], rtol=0.0, atol=1e-6).all(axis=1)
    line = np.where((same >= 0) & moved, cells.line[rows][np.maximum(same, 0)], 0)
    number = np.unique(cells.line, return_inverse=True)[1].ravel()
    return line[number]


def _by_line(cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """First cell of every line, and all readings of the line side by side, NaN where none."""
    lines, first, inverse = np.unique(cells.line, return_index=True, return_inverse=True)
    targets = len(cells.target_names)
    reading = np.full((len(lines), targets, 12), np.nan)
    reading[inverse, cells.target, :3] = cells.position_mm
    reading[inverse, cells.target, 3:] = cells.rotation.reshape(-1, 9)
    return first, reading.reshape(len(lines), -1)


def _earlier_equal(values: np.ndarray) -> np.ndarray:
    """Index (n,) of the first equal row before each, -1 where there is none."""
    _, first, inverse = np.unique(values, axis=0, return_index=True, return_inverse=True)
    earlier = first[inverse.ravel()]
    return np.where(earlier < np.arange(len(values)), earlier, -1)


def _unlikely(cells: Cells, noise_mm: float) -> bool:
    """Whether equal digits by chance are to be expected less than ``_CHANCE`` times."""
    if not np.isfinite(noise_mm) or noise_mm <= 0.0:
        return True
    values = cells.position_mm
    digit = resolution(values)
    per_axis = min(digit / (2.0 * np.sqrt(np.pi) * noise_mm), 1.0)
    numbers = 3 * len(cells.target_names) + 3 * bool(cells.turned.any())
    _, counts = np.unique(cells.pose, return_counts=True)
    pairs = float(np.sum(counts * (counts - 1) / 2)) / max(len(cells.target_names), 1) ** 2
    return max(pairs, 1.0) * per_axis**numbers < _CHANCE


def resolution(values: np.ndarray) -> float:
    """Smallest step between different values: the last digit that was written."""
    steps = np.diff(np.unique(values[np.isfinite(values)].ravel()))
    steps = steps[steps > 1e-12 * np.max(np.abs(values), initial=1.0)]
    return float(steps.min()) if steps.size else 0.0
