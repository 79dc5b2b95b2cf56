"""Verdicts on a tolerance: by held-out errors, or by the bound of a campaign."""

from __future__ import annotations

from collections.abc import Mapping

from kinacc.assess.statement import ACCEPT, REJECT, UNDECIDED, Statement, decide
from kinacc.calibration.summary import LARGE_SHARE, Tolerance
from kinacc.campaign.status import reason

BOUND, MEAN = "bound", "mean"
OF_CONFIGURATION, OF_CAMPAIGN = "the configuration's", "the campaign's"
_FEWEST = round(1.0 / (1.0 - LARGE_SHARE))  # rows of which that share is less than all


def by_held_out(tolerance: Tolerance, held_out: Mapping[str, float]) -> tuple[str, str]:
    """Verdict and why, by errors held out: ``n``, ``mean`` and ``quantile_99``, mm; maybe empty."""
    if not held_out:
        return UNDECIDED, "no error is held out"
    if tolerance.of == MEAN:
        says = ACCEPT if held_out["mean"] <= tolerance.mm else REJECT
        return says, f"the mean error held out is {held_out['mean']:.3f} mm"
    if held_out["quantile_99"] > tolerance.mm:
        return REJECT, "more than 1 % of the errors held out are beyond the tolerance"
    if held_out["n"] < _FEWEST:
        few = f"{held_out['n']:.0f} errors are held out, too few to tell of 1 % of them"
        return UNDECIDED, few
    return ACCEPT, "99 % of the errors held out are within the tolerance"


def by_bound(tolerance_mm: float, statement: Statement | None, in_doubt: bool) -> tuple[str, str]:
    """Verdict and why, by what a campaign says; None without a campaign.

    ``in_doubt``: something speaks against its bounds.
    """
    if in_doubt:
        return UNDECIDED, "its bound cannot be relied on"
    if statement is None:
        return UNDECIDED, "no campaign bounds it"
    decided = decide(statement, tolerance_mm)
    return decided.verdict, reason(decided.reason)
