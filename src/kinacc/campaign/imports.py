"""Rows of a file held against the readings there are: known, missing, or new."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.campaign.reading import Reading
from kinacc.campaign.state import State, Told


@dataclass(frozen=True)
class Compared:
    """Rows of a file, by index, that are readings already, by number; readings ``missing`` in it.

    A reading is missing where it was taken of a file of the same path that no longer holds it.
    """

    known: Mapping[int, int]
    missing: tuple[int, ...]


def digits(reading: Reading) -> tuple:
    """Point, instrument and position of a reading, to the last digit."""
    return reading.point, reading.instrument, *reading.position_mm.tolist()


def compare(rows: Mapping[int, Reading], state: State, path: str, again: bool) -> Compared:
    """Hold the rows of the file at ``path`` against all readings, each of which is one row.

    A file without any row of its earlier state was written over, unless it goes through the same
    points in the same order: none is missing then. ``again``: only readings of the same file are
    known, and none is missing.
    """
    own = {number for each in state.imports if each.path == path for number in each.numbers}
    there = sorted((*state.told, *state.in_hand), key=lambda each: each.number)
    struck = [each for each, _ in state.struck]
    waiting: dict[tuple, deque[int]] = {}
    for each in (*there, *struck):
        if each.number in own or not again:
            waiting.setdefault(digits(each.reading), deque()).append(each.number)
    known = {}
    for index, row in rows.items():
        if queue := waiting.get(digits(row)):
            known[index] = queue.popleft()
    missing = own.intersection(each.number for each in there).difference(known.values())
    if again or not (own.intersection(known.values()) or _rewritten(rows, own, there)):
        missing = set()
    return Compared(known, tuple(sorted(missing)))


def _rewritten(rows: Mapping[int, Reading], own: set[int], there: Sequence[Told]) -> bool:
    """Whether a file without any row of its earlier state is that state with every row changed.

    It goes through the same points in the same order, and is not a single reading of one point:
    that may be new, unless two of its three coordinates are the old ones.
    """
    before = [each.reading for each in there if each.number in own]
    now = list(rows.values())[: len(before)]
    if not before or [each.point for each in now] != [each.point for each in before]:
        return False
    return len(before) > 1 or int(np.sum(now[0].position_mm == before[0].position_mm)) == 2
