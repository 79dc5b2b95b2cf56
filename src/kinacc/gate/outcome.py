"""Results of a check: one record for each thing that was checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

# "undecided": the data do not suffice; the setting `undecided` of a gate decides what follows.
PASSED, WARNED, FAILED, UNDECIDED = "passed", "warned", "failed", "undecided"


@dataclass(frozen=True)
class Outcome:
    """One check of one data set.

    ``kind``: files, accepted, or that of a gate. ``figures`` are
    numbers and words by name with unit (``mean_mm``).
    """

    dataset: str
    name: str
    kind: str
    verdict: str
    says: str
    fix: str = ""
    figures: Mapping[str, float | int | str | None] = field(default_factory=dict)


@dataclass(frozen=True)
class CheckReport:
    """All outcomes of a check of results; ``against`` is the accepted run, empty without one."""

    results: str
    against: str
    outcomes: tuple[Outcome, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing failed."""
        return all(item.verdict != FAILED for item in self.outcomes)
