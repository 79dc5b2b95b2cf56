"""What an assessor says: about which errors, how large, between which bounds, how surely.

Three targets, each with a truth of its own. ``measured``: the largest error of the points measured.
``candidates``: the largest error of all candidate points, measured or not. ``region``: the size
that the errors of a stated share of the region do not exceed. A statement is held to a tolerance
with a guard band: accept, reject or undecided.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np

from kinacc.assess.limits import visit_mm
from kinacc.errors import input_error

MEASURED = "measured"
CANDIDATES = "candidates"
REGION = "region"
MEAN: Final = "mean"  # what of a pose's error is meant
VISIT: Final = "visit"
CONFIDENCE = 0.95  # of each bound, where no other is asked for


@dataclass(frozen=True)
class Reason:
    """Why a bound is stated or not: a code and its numbers; ``campaign.status`` has the texts."""

    code: str
    numbers: Mapping[str, float] = field(default_factory=dict)


class Suspicious(NamedTuple):
    """A reading that noise does not explain: its number, from 1; its row; standard deviations."""

    number: int
    row: int
    deviations: float


@dataclass(frozen=True)
class Statement:
    """One statement on the size of the errors, mm; NaN where nothing is said.

    ``lower_mm`` and ``upper_mm`` each hold with ``confidence`` by themselves. ``share`` is the part
    of the region the statement is about (1 for the other targets). ``assumption`` is what the
    bounds rest on beyond normal readings of known covariance; None if nothing. ``withheld`` is why
    no bound is stated; None if one is. ``excepted``: so many points may lie above the upper bound,
    which is of all but these; no confidence is lost by saying which. ``error_of``: ``mean``, what
    stays when a pose is measured again, or ``visit``, what 95 % of visits to the worst pose keep.
    ``noise``: how large the bounds take the noise; None where it is as stated.
    """

    target: str
    value_mm: float = math.nan
    lower_mm: float = math.nan
    upper_mm: float = math.nan
    confidence: float = math.nan
    share: float = 1.0
    assumption: Reason | None = None
    withheld: Reason | None = None
    excepted: int = 0
    error_of: str = MEAN
    noise: Reason | None = None

    def of_future_visits(self, arms_mm: tuple[float, float, float]) -> Statement:
        """This statement on mean errors as one on future visits.

        arms_mm: standard deviation of a visit per axis, for lower bound, value and upper bound.
        """
        sizes = self.lower_mm, self.value_mm, self.upper_mm
        lower, value, upper = visit_mm(np.array(sizes), np.array(arms_mm)).tolist()
        return replace(self, lower_mm=lower, value_mm=value, upper_mm=upper, error_of=VISIT)


ACCEPT, REJECT, UNDECIDED = "accept", "reject", "undecided"


@dataclass(frozen=True)
class Decision:
    """Verdict against a tolerance, with its reason.

    ``guard_band_mm``: how far the value has to stay below the tolerance to be accepted (upper
    bound minus value).
    """

    verdict: str
    reason: Reason | None
    guard_band_mm: float


def decide(statement: Statement, tolerance_mm: float) -> Decision:
    """Hold a statement to a tolerance.

    Accept where the upper bound is at most the tolerance, reject where the lower bound exceeds it,
    otherwise undecided. Guarded acceptance and guarded rejection of JCGM 106:2012 (8.3.2 and
    8.3.3), guard band by the bounds; as each bound holds with the statement's confidence by itself,
    each wrong decision has at most the remaining probability. Undecided without bounds, and where
    the value or the lower bound is above the upper bound: such readings decide nothing.
    An upper bound that leaves candidates out accepts nothing. Raises InputError for a tolerance
    that is not positive.
    """
    if not (tolerance_mm > 0.0 and math.isfinite(tolerance_mm)):
        raise input_error("tolerance", f"{tolerance_mm}", "above 0, in mm")
    band = statement.upper_mm - statement.value_mm
    verdict, reason = UNDECIDED, Reason("between")
    if statement.upper_mm < statement.lower_mm or band < 0.0:
        reason = Reason("contradict")
    elif statement.lower_mm > tolerance_mm:
        verdict, reason = REJECT, Reason("beyond")
    elif statement.upper_mm <= tolerance_mm and statement.excepted:
        # The largest error may be among those the bound leaves out.
        reason = Reason("some_excepted", {"excepted": statement.excepted})
    elif statement.upper_mm <= tolerance_mm:
        verdict, reason = ACCEPT, Reason("within")
    elif math.isnan(statement.upper_mm):
        reason = statement.withheld or Reason("no_upper")
    return Decision(verdict, reason, band)
