"""Rows of a file held against the readings there are: known, changed since, gone, or new.

An engineer adds rows to one file all day and records it again and again. A row is known by its
point and the digits of its position. Each reading stands for one row: a file that holds a row
twice, and was recorded with one of them, has one that is new. Where a reading of an earlier state
of the file is missing and a new row stands in its place, that row was changed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.campaign.instrument import covariance_of
from kinacc.campaign.reading import Reading
from kinacc.campaign.state import Import, State

Numbers = set[int]


@dataclass(frozen=True)
class Compared:
    """What is to be said of the rows of a file, by their index: the number of a reading.

    ``known`` rows were recorded before; ``changed`` stand where a reading was that is missing;
    ``gone`` readings are missing, and nothing stands in their place. ``grown``: the file holds
    rows that were taken of it before; ``adopted`` readings, that were taken otherwise.
    """

    known: Mapping[int, int]
    changed: Mapping[int, int]
    gone: tuple[int, ...]
    grown: bool
    adopted: tuple[int, ...]


def digits(reading: Reading) -> tuple:
    """By what a reading is known: its point and position, to the last digit."""
    return reading.point, *reading.position_mm.tolist()


def compare(rows: Mapping[int, Reading], state: State, path: str, again: bool) -> Compared:
    """Hold the rows of a file, from the campaign's folder at ``path``, against all readings.

    ``again``: rows are new readings where they do not come from an earlier state of the file.
    """
    there = {each.number: each.reading for each in (*state.told, *state.in_hand)}
    struck = {each.number: each.reading for each, _ in state.struck}
    every = {**there, **struck}
    own, others = _earlier_states(state.imports, path, rows, every, again)
    first = own | others
    left = [] if again else sorted(every.keys() - first)
    known = _matched(rows, [*sorted(first), *left], every, struck, state.plan.slides)
    grown = not own.isdisjoint(known.values())
    if not grown and not _rewritten(rows, [every[each] for each in sorted(own)]):
        first = others
    missing = (first & there.keys()).difference(known.values())
    if again:
        changed = {}
    elif list(known.values()) == sorted(known.values()):
        changed = _in_place_of(missing, list(rows), first, known)
    else:
        changed = _at_points_of(missing, rows, every, known)
    gone = sorted((missing & own).difference(changed.values())) if grown else []
    adopted = sorted(set(known.values()) - own)
    return Compared(known, changed, tuple(gone), grown, tuple(adopted))


def unlike(one: Reading, other: Reading, slides: np.ndarray) -> str:
    """What differs between a row and the reading it is known by, besides its position."""
    if one.instrument != other.instrument:
        return "instrument"
    stds = [each.std and covariance_of(each.std, "", []).tolist() for each in (one, other)]
    if stds[0] != stds[1]:
        return "standard deviation"
    if one.joints is not None and other.joints is not None:
        rounded = np.where(slides, 1e-3, 1e-6)
        if (np.abs(one.joints - other.joints) > rounded).any():
            return "joints"
    return ""


def _earlier_states(
    imports: Sequence[Import], path: str, rows: Mapping[int, Reading], every, again: bool
) -> tuple[Numbers, Numbers]:
    """Numbers of the readings that were taken of the file, and of files of which it is a copy.

    A file that was overwritten begins anew. One of another name, or of none known, is the same if
    it holds half of the other's rows; with ``again`` a file of another name is another file.
    """
    groups: list[tuple[str | None, Numbers]] = []
    for each in imports:
        same = [numbers for name, numbers in groups if name is not None and name == each.path]
        if each.grown and same:
            same[-1].update(each.numbers)
        else:
            groups.append((each.path, set(each.numbers)))
    here = {digits(row) for row in rows.values()}
    latest = [place for place, (name, _) in enumerate(groups) if name == path][-1:]
    own, others = set(), set()
    for place, (name, numbers) in enumerate(groups):
        found = sum(digits(every[each]) in here for each in numbers)
        if place in latest:
            own = numbers
        elif 2 * found >= len(numbers) and (not again or name in (None, path)):
            others |= numbers
    return own, others


def _matched(rows, numbers, every, struck, slides) -> dict[int, int]:
    """The reading of each row that is known, every reading once."""
    waiting: dict[tuple, deque[int]] = {}
    for number in numbers:
        waiting.setdefault(digits(every[number]), deque()).append(number)
    known = {}
    for index, row in rows.items():
        queue = waiting.get(digits(row), deque())
        # A reading that was struck for its instrument or joints is none of the corrected row.
        while queue and queue[0] in struck and unlike(row, every[queue[0]], slides):
            queue.popleft()
        if queue:
            known[index] = queue.popleft()
    return known


def _rewritten(rows: Mapping[int, Reading], before: Sequence[Reading]) -> bool:
    """Whether a file without any row of its earlier state is that state with every row changed.

    It goes through the same points in the same order, and is not a single reading of one point:
    that may be new, unless two of its three coordinates are the old ones.
    """
    now = list(rows.values())[: len(before)]
    if not before or [each.point for each in now] != [each.point for each in before]:
        return False
    if len(before) > 1:
        return True
    return int(np.sum(now[0].position_mm == before[0].position_mm)) == 2


def _at_points_of(missing: Numbers, rows, every, known) -> dict[int, int]:
    """New rows at the points of missing readings, with these: of a file that was sorted anew."""
    lost: dict[int, list[int]] = {}
    for number in sorted(missing, reverse=True):
        lost.setdefault(every[number].point, []).append(number)
    new = (index for index in rows if index not in known and lost.get(rows[index].point))
    return {index: lost[rows[index].point].pop() for index in new}


def _in_place_of(
    missing: Numbers, rows: Sequence[int], earlier: Numbers, known: Mapping[int, int]
) -> dict[int, int]:
    """New rows that stand between the same known ones as missing readings, with these."""
    matched = earlier.intersection(known.values())
    gaps: dict[int | None, tuple[list[int], list[int]]] = {}
    before = None
    for number in sorted(earlier):
        if number in matched:
            before = number
        elif number in missing:
            gaps.setdefault(before, ([], []))[0].append(number)
    before, followed = None, set()
    for index in rows:
        if known.get(index) in matched:
            followed.add(before)
            before = known[index]
        elif index not in known:
            gaps.setdefault(before, ([], []))[1].append(index)
    found = {}
    for gap, (lost, new) in gaps.items():
        count = min(len(lost), len(new))
        # A file is added to at its end: there the first new rows are in place of those missing.
        ends = slice(-count, None) if gap in followed and count else slice(count)
        found |= dict(zip(new[ends], lost[ends], strict=True))
    return found
