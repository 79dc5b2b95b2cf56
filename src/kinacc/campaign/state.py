"""Where a campaign stands: its plan, and its readings told to the assessor again.

Readings are told in the order in which the assessor asks for them, whatever the order in which
they were taken. One that it has not asked for yet stays in hand. What it asks never depends on
readings in hand, so measuring ahead, or importing a whole file, does not bias anything.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from kinacc.assess.adaptive import Campaign
from kinacc.assess.statement import MEASURED, Reason, Statement
from kinacc.campaign.plan import Plan
from kinacc.campaign.reading import Reading, entry_faults, error_mm, unplanned_mm2
from kinacc.errors import Problem, refuse

_UNREADABLE = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
_UNKNOWN = "0001-01-01T00:00:00+00:00"  # of entries of earlier versions

READINGS, LEAVE_OUT, STRIKE = "readings", "leave_out", "strike"


@dataclass(frozen=True)
class Told:
    """A reading the assessor was told: its number in the journal (from 1) and its error (3,)."""

    number: int
    reading: Reading
    error_mm: np.ndarray


@dataclass(frozen=True)
class Import:
    """Readings that were taken of a file, and others that rows of it were, by their ``numbers``.

    ``path`` leads from the campaign's folder to the file; None in campaigns of earlier versions.
    """

    path: str | None
    numbers: frozenset[int]


@dataclass
class State:
    """A campaign with its readings.

    ``rows`` are points in the order in which the assessor numbers them. ``asked`` is the point it
    wants next, None where it wants none. ``in_hand`` are readings it has not asked for. ``struck``
    are readings declared void, and why; ``imports`` the files that readings were taken of.
    """

    plan: Plan
    campaign: Campaign
    rows: np.ndarray
    told: list[Told]
    in_hand: list[Told]
    asked: int | None
    left_out: Mapping[int, str]
    struck: list[tuple[Told, str]] = field(default_factory=list)
    imports: tuple[Import, ...] = ()

    @property
    def taken(self) -> int:
        """Number of readings taken, without those struck."""
        return len(self.told) + len(self.in_hand)

    @property
    def numbered(self) -> int:
        """Number of the last reading in the journal."""
        return self.taken + len(self.struck)

    def statements(self) -> tuple[Statement, ...]:
        """What may be said now."""
        return sayable(self.plan, self.campaign)

    def ahead(self) -> list[int]:
        """Points still to be read whatever is read, in order, planned revisits in their places."""
        have = Counter(each.reading.point for each in (*self.told, *self.in_hand))
        wanted = []
        for point in self.rows[list(self.campaign.visit())].tolist():
            if have[point]:
                have[point] -= 1
            else:
                wanted.append(point)
        return wanted


def sayable(plan: Plan, campaign: Campaign) -> tuple[Statement, ...]:
    """The statements of a campaign, without those that its visit does not support yet.

    Part of a visit made in order of travel is no random sample: until it is complete, nothing is
    said of points that were not measured. Readings that all equal the prediction to the last digit
    are none: whatever the errors, noise keeps them apart.
    """
    said = campaign.statements()
    if campaign.ledger.taken and not campaign.ledger.sizes_mm().any():
        reason = Reason("predicted", {"read": campaign.ledger.taken})
        return tuple(Statement(each.target, share=each.share, withheld=reason) for each in said)
    left = campaign.first - len(campaign.ledger.visited)
    if left <= 0 or not plan.by_travel:
        return said
    reason = Reason("first_visit_by_travel", {"left": left})
    return tuple(
        each
        if each.target == MEASURED or each.withheld
        else Statement(each.target, share=each.share, withheld=reason)
        for each in said
    )


def restore(
    plan: Plan,
    entries: Iterable[Mapping],
    watch: Callable[[Campaign, Told], None] | None = None,
) -> State:
    """The state after the entries of a journal; ``watch`` sees every reading once it is told."""
    readings, left_out, void, imports = [], {}, {}, []
    for entry in entries:
        if entry["kind"] == READINGS:
            before = len(readings)
            readings += [Reading.of_entry(each) for each in entry["readings"]]
            if entry.get("file"):
                numbers = frozenset([*range(before + 1, len(readings) + 1), *entry.get("was", ())])
                imports.append(Import(entry.get("path"), numbers))
        elif entry["kind"] == LEAVE_OUT:
            left_out[int(entry["point"])] = str(entry["reason"])
        elif entry["kind"] == STRIKE:
            void[int(entry["reading"])] = str(entry["reason"])
    rows = plan.visiting(frozenset(left_out))
    waiting: dict[int, deque[Told]] = {}
    struck = []
    for number, each in enumerate(readings, start=1):
        known = Told(number, each, error_mm(plan, each))
        if number in void:
            struck.append((known, void[number]))
            continue
        waiting.setdefault(each.point, deque()).append(known)
    campaign = plan.assessor.begin(plan.candidates(rows))
    told: list[Told] = []
    asked = None
    # The assessor is asked before every reading, as it was then: some remember when they were.
    while (row := campaign.next()) is not None:
        asked = int(rows[row])
        if not waiting.get(asked):
            break
        known = waiting[asked].popleft()
        campaign.record(row, known.error_mm, unplanned_mm2(plan, known.reading))
        told.append(known)
        asked = None
        if watch is not None:
            watch(campaign, known)
    in_hand = sorted((each for queue in waiting.values() for each in queue), key=_number)
    return State(plan, campaign, rows, told, in_hand, asked, left_out, struck, tuple(imports))


def readings_in(entries: Iterable[Mapping]) -> int:
    """How many readings were taken in entries of a journal."""
    return sum(len(each["readings"]) for each in entries if each["kind"] == READINGS)


def require_readable(plan: Plan, entries: Iterable[Mapping], where: str) -> None:
    """Raise InputError naming every entry of a journal that says nothing about this campaign."""
    problems, readings = [], 0
    for number, entry in enumerate(entries, start=1):
        try:
            readings = _read_on(plan, entry, readings)
        except _UNREADABLE as error:
            what = f"is no entry of this campaign: {type(error).__name__}: {error}"
            fix = "bring the file back from a copy"
            problems.append(Problem(f"{where}, line {number}", what, fix=fix))
    refuse(problems)


def _read_on(plan: Plan, entry: Mapping, readings: int) -> int:
    """Number of readings after an entry; an error of Python where it cannot be read."""
    if datetime.fromisoformat(entry.get("at", _UNKNOWN)).tzinfo is None:
        raise ValueError(f"time {entry['at']} without a time zone")
    points, kind = range(len(plan.points)), entry["kind"]
    if kind == READINGS:
        for each in map(Reading.of_entry, entry["readings"]):
            faults = entry_faults(plan, each)
            if faults:
                raise ValueError("; ".join(faults))
        taken = readings + len(entry["readings"])
        known, path = range(1, taken + 1), entry.get("path")
        if not (path is None or isinstance(path, str)) or set(entry.get("was", ())) - set(known):
            raise ValueError("its file is no path, or its rows are no readings")
        return taken
    place, allowed = {
        LEAVE_OUT: ("point", points),
        STRIKE: ("reading", range(1, readings + 1)),
    }[kind]
    if entry[place] not in allowed or not isinstance(entry["reason"], str):
        raise ValueError(f"{place} {entry[place]!r}")
    return readings


def _number(each: Told) -> int:
    return each.number
