"""Is the error within a tolerance? Decided with a guard band: accept, reject or undecided."""

from __future__ import annotations

import math
from dataclasses import dataclass

from kinacc.assess.statement import Reason, Statement
from kinacc.errors import InputError, Problem

ACCEPT, REJECT, UNDECIDED = "accept", "reject", "undecided"


@dataclass(frozen=True)
class Decision:
    """Verdict against a tolerance.

    ``guard_band_mm``: how far the value has to stay below the tolerance to be accepted (upper
    bound minus value); ``acceptance_limit_mm``: tolerance minus guard band. ``risk``: probability
    of accepting what is beyond the tolerance, and likewise of rejecting what is within.
    """

    verdict: str
    tolerance_mm: float
    guard_band_mm: float
    acceptance_limit_mm: float
    risk: float
    reason: Reason


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
        raise InputError(Problem("tolerance", f"{tolerance_mm}", "above 0, in mm"))
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
    risk = 1.0 - statement.confidence
    return Decision(verdict, tolerance_mm, band, tolerance_mm - band, risk, reason)
