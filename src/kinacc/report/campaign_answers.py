"""What a campaign says of the largest error, in sentences for the first screen of a page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinacc.assess.conformity import decide
from kinacc.assess.statement import Statement
from kinacc.campaign import words
from kinacc.campaign.state import State


def answers(state: State) -> tuple[str, ...]:
    """What may be said of the largest error, the most important sentence first."""
    said, tolerance = words.distinct(state), state.plan.limits.tolerance_mm
    lead, lines = leading(state, said), against(state, said)
    if lines:
        by_noise = "The bounds of the campaign are what the readings give by the noise stated"
        return (*lines, f"{by_noise}; they are no statement on the arm.")
    lines.append(words.pledge(lead, state))
    if np.isfinite(lead.upper_mm):
        known = [f"estimated at {lead.value_mm:.3f} mm"] if np.isfinite(lead.value_mm) else []
        if np.isfinite(lead.lower_mm):
            known.append(f"at least {lead.lower_mm:.3f} mm, a bound that is right as often")
        if known:
            lines.append(f"The largest error among them is {', and '.join(known)}.")
    if tolerance is not None:
        found = decide(lead, tolerance)
        why = words.reason(found.reason)
        lines.append(sentence(f"tolerance {tolerance:g} mm: {found.verdict}, {why}"))
    return tuple(lines)


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
