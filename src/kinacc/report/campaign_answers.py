"""What a campaign says of the largest error, in sentences for the first screen of a page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinacc.assess.statement import Statement
from kinacc.calibration.summary import Tolerance
from kinacc.campaign import tolerance, words
from kinacc.campaign.state import State


def answers(state: State) -> tuple[str, ...]:
    """What may be said of the largest error, the most important sentence first."""
    said = words.distinct(state)
    lead, lines = leading(state, said), against(state, said)
    kept = _kept(state, lead, bool(lines))
    if lines and np.isnan(lead.upper_mm):
        return (*lines, "So no bound is stated.", *kept)
    if lines:
        by_noise = "The bounds of the campaign are what the readings give by the noise stated"
        return (*lines, f"{by_noise}; they are no statement on the arm.", *kept)
    lines.append(words.pledge(lead, state))
    if np.isfinite(lead.upper_mm):
        known = [f"estimated at {lead.value_mm:.3f} mm"] if np.isfinite(lead.value_mm) else []
        if np.isfinite(lead.lower_mm):
            known.append(f"at least {lead.lower_mm:.3f} mm, a bound that is right as often")
        if known:
            lines.append(f"The largest error among them is {', and '.join(known)}.")
            lines += filter(None, [words.of_the_estimate(lead, state)])
    return (*lines, *kept)


def _kept(state: State, lead: Statement, in_doubt: bool) -> list[str]:
    """Whether the campaign's tolerance is kept."""
    mm = state.plan.limits.tolerance_mm
    if mm is None:
        return []
    judged = tolerance.by_bound(mm, lead, in_doubt)
    return [tolerance.in_words(Tolerance(mm, tolerance.BOUND), tolerance.OF_CAMPAIGN, judged)]


def leading(state: State, said: Sequence[Statement]) -> Statement:
    """The statement a reader came for: with a bound, and on the target the campaign is for."""
    return min(
        said,
        key=lambda each: (np.isnan(each.upper_mm), each.target != state.plan.limits.target),
    )


def against(state: State, said: Sequence[Statement]) -> list[str]:
    """Why the bounds cannot be relied on, a sentence each."""
    return [sentence(text) for text in words.against(said, state)]


def sentence(line: str) -> str:
    """A line with a capital at its begin and a stop at its end."""
    end = "" if line.endswith((".", ":", "?")) else "."
    return f"{line[:1].upper()}{line[1:]}{end}"
