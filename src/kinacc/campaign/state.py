"""Where a campaign stands: its plan, and its readings given to the assessor again.

The assessor gets readings in the order in which it requests them, whatever the order in which they
were taken. One that it has not requested stays in hand. What it requests never depends on readings
in hand, so measuring ahead, or importing a whole file, does not bias anything.
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
from kinacc.campaign.reading import Reading, error_mm, unplanned_mm2
from kinacc.errors import InputError, Problem

READINGS, LEAVE_OUT, STRIKE = "readings", "leave_out", "strike"
_UNREADABLE = (
    *(ArithmeticError, AttributeError, InputError, LookupError, RecursionError, TypeError),
    ValueError,
)


@dataclass(frozen=True)
class Told:
    """A reading: its number in the journal (from 1) and its error (3,)."""

    number: int
    reading: Reading
    error_mm: np.ndarray


@dataclass
class State:
    """A campaign with its readings.

    ``rows`` are points in the order in which the assessor numbers them. ``asked`` is the point it
    requests next, None for none. ``told`` are the readings it used, ``in_hand`` those it has not
    requested, ``struck`` those declared void, with the reason. ``imports``: numbers of readings by
    the path of their file, from the folder of the campaign.
    """

    plan: Plan
    campaign: Campaign
    rows: np.ndarray
    told: list[Told]
    in_hand: list[Told]
    asked: int | None
    left_out: Mapping[int, str]
    struck: list[tuple[Told, str]] = field(default_factory=list)
    imports: Mapping[str | None, set[int]] = field(default_factory=dict)

    @property
    def taken(self) -> int:
        """Number of readings taken, without those struck."""
        return len(self.told) + len(self.in_hand)

    @property
    def numbered(self) -> int:
        """Number of the last reading in the journal."""
        return self.taken + len(self.struck)

    def statements(self) -> tuple[Statement, ...]:
        """Return the statements that the readings support."""
        return sayable(self.plan, self.campaign)

    def ahead(self) -> list[int]:
        """Return points to be read whatever is read, in order, planned revisits in their places."""
        have = Counter(each.reading.point for each in (*self.told, *self.in_hand))
        wanted = []
        for point in self.rows[list(self.campaign.visit())].tolist():
            if have[point]:
                have[point] -= 1
            else:
                wanted.append(point)
        return wanted


def sayable(plan: Plan, campaign: Campaign) -> tuple[Statement, ...]:
    """Return the statements of a campaign, without those that its visit does not support yet.

    Part of a visit made in order of travel is no random sample: until it is complete, nothing is
    stated about points that were not measured. Readings that all equal the prediction to the last
    digit are none: whatever the errors, noise keeps them apart.
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
    where: str = "journal",
) -> State:
    """Return the state after the entries of a journal; ``watch`` sees every reading once used.

    Raises InputError naming the line of an entry that cannot be read.
    """
    readings: list[Reading] = []
    left_out: dict[int, str] = {}
    void: dict[int, str] = {}
    imports: dict[str | None, set[int]] = {}
    for line, entry in enumerate(entries, start=1):
        try:
            if "at" in entry and datetime.fromisoformat(entry["at"]).tzinfo is None:
                raise ValueError("a time without a time zone")
            if entry["kind"] == READINGS:
                before = len(readings)
                readings += [Reading.of_entry(each, plan) for each in entry["readings"]]
                if entry.get("file"):
                    numbers = {*range(before + 1, len(readings) + 1), *entry.get("was", ())}
                    imports.setdefault(entry.get("path"), set()).update(numbers)
                continue
            known, place, most = {
                LEAVE_OUT: (left_out, "point", range(len(plan.points))),
                STRIKE: (void, "reading", range(1, len(readings) + 1)),
            }[entry["kind"]]
            if entry[place] not in most:
                raise ValueError(f"{place} {entry[place]}")
            known[int(entry[place])] = str(entry["reason"])
        except _UNREADABLE as error:
            what = f"is no entry of this campaign: {type(error).__name__}: {error}"
            problem = Problem(f"{where}, line {line}", what, fix="bring the file back from a copy")
            raise InputError(problem) from None
    return _replayed(plan, readings, left_out, void, imports, watch)


def _replayed(plan, readings, left_out, void, imports, watch) -> State:
    """The state of readings that the assessor gets in the order of its requests."""
    rows = plan.visiting(frozenset(left_out))
    waiting: dict[int, deque[Told]] = {}
    struck = []
    for number, each in enumerate(readings, start=1):
        known = Told(number, each, error_mm(plan, each))
        if number in void:
            struck.append((known, void[number]))
        else:
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
    in_hand = sorted(
        (each for queue in waiting.values() for each in queue), key=lambda each: each.number
    )
    return State(plan, campaign, rows, told, in_hand, asked, left_out, struck, imports)


def readings_in(entries: Iterable[Mapping]) -> int:
    """Return the number of readings in entries of a journal."""
    return sum(len(each["readings"]) for each in entries if each["kind"] == READINGS)
