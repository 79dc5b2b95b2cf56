"""What a gate says: one record for each, from which every output is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

# "undecided": the data do not tell; the gate's own words say whether that is a failure.
PASSED, WARNED, FAILED, UNDECIDED = "passed", "warned", "failed", "undecided"
VERDICTS = (PASSED, WARNED, FAILED, UNDECIDED)
# What may explain that a result is another; UNEXPLAINED: nothing that it was made from has changed.
CONFIGURATION, CODE, VERSION, INPUT, SEED, UNEXPLAINED = (
    "configuration",
    "code",
    "version",
    "input",
    "seed",
    "unexplained",
)


@dataclass(frozen=True)
class Cause:
    """What changed between the accepted run and this one.

    ``kind`` as above; ``where`` names the key, the module, the library or the file; ``before`` and
    ``after`` are what stood there, empty where that is not known.
    """

    kind: str
    where: str
    before: str = ""
    after: str = ""


@dataclass(frozen=True)
class Difference:
    """One column of an artefact, or an artefact as a whole (``column`` empty), that is another.

    ``rows`` of ``of`` rows differ, the first of them called ``first`` by the key of its table;
    ``largest`` is the largest difference in ``unit``, None of words, and ``allowed`` what would
    have passed. ``what`` says it in words; ``causes`` are none where nothing was made otherwise.
    """

    dataset: str
    artefact: str
    column: str
    what: str
    rows: int = 0
    of: int = 0
    first: str = ""
    largest: float | None = None
    unit: str = ""
    allowed: float | None = None
    causes: tuple[Cause, ...] = ()

    @property
    def explained(self) -> bool:
        """Whether something that the artefact was made from has changed."""
        return bool(self.causes) and all(cause.kind != UNEXPLAINED for cause in self.causes)


@dataclass(frozen=True)
class Outcome:
    """What one gate found of one data set.

    ``kind`` is the kind of gate (value, change, campaign, claims, suspicions, history, results,
    accepted); ``says`` one sentence with the figures, ``fix`` what to do or look at where it did
    not pass. ``figures`` are the numbers by name with unit (``mean_mm``), ``differences`` those
    from the accepted run. ``file`` is the one to open: the configuration that states the gate, or
    the artefact that did not hold; empty where there is none.
    """

    dataset: str
    name: str
    kind: str
    verdict: str
    says: str
    fix: str = ""
    figures: Mapping[str, float | int | str | None] = field(default_factory=dict)
    differences: tuple[Difference, ...] = ()
    file: str = ""


@dataclass(frozen=True)
class Verdicts:
    """All outcomes of a run of the gate.

    ``results`` and ``accepted`` are the folders as they were named (empty without an accepted run),
    ``digest`` that of all records of the results, ``first_screens`` the first screen of every data
    set's report in plain text by data set.
    """

    results: str
    accepted: str
    digest: str
    outcomes: tuple[Outcome, ...]
    first_screens: Mapping[str, str]

    @property
    def passed(self) -> bool:
        """Whether nothing failed."""
        return all(each.verdict != FAILED for each in self.outcomes)
