"""How near the bounds of a campaign are to the largest error, and how near they could be.

The errors are not known: the sizes put into :mod:`kinacc.assess.attainable` are those of the mean
readings, corrected for their noise. No bound rests on what comes out.
"""

from __future__ import annotations

import math

import numpy as np

from kinacc.assess.attainable import NONE, WidthLimits, limits_of
from kinacc.assess.statement import Statement
from kinacc.campaign import words
from kinacc.campaign.state import State


def limits_now(said: Statement, state: State) -> WidthLimits:
    """Limits of a statement for the readings it was made of; NaN where it has none."""
    ledger = state.campaign.ledger
    if math.isnan(said.upper_mm):
        return NONE
    sizes_mm = _likely_sizes_mm(ledger.mean_mm, ledger.noise_mm)
    noise_mm = ledger.candidates.sigma_mm
    return limits_of(said, ledger.visited, sizes_mm, noise_mm, ledger.taken)


def told(state: State) -> list[tuple[str, tuple[str, ...]]]:
    """A heading and its lines for every statement that has an upper bound and could be nearer."""
    return [
        (_heading(said, state.campaign.ledger.taken), _lines(said, limits))
        for said in words.distinct(state)
        if math.isfinite((limits := limits_now(said, state)).attainable_mm)
    ]


def in_words(state: State) -> list[str]:
    """The same as lines of a screen."""
    return [
        each for head, lines in told(state) for each in (f"{head}:", *(f"  {one}" for one in lines))
    ]


def as_facts(state: State) -> list[dict[str, object]]:
    """The limits of every statement for a machine."""
    found = [(said, limits_now(said, state)) for said in state.statements()]
    return [
        {"target": said.target, "sizes": "estimated", **limits._asdict()} for said, limits in found
    ]


def _heading(said: Statement, readings: int) -> str:
    counted = "1 reading" if readings == 1 else f"{readings} readings"
    return f"how near the bounds are ({words.target(said)}, {counted})"


def _lines(said: Statement, limits: WidthLimits) -> tuple[str, ...]:
    """One comparison a line, above and below: now, with sizes known, and what no rule beats."""
    return (
        f"now: upper bound {_mm(said.upper_mm - said.value_mm)} above the estimate, lower bound "
        f"{_mm(said.value_mm - said.lower_mm)} below",
        f"with all sizes known beforehand: {_mm(limits.attainable_mm)} above, "
        f"{_mm(limits.lower_mm)} below on average (estimated)",
        f"no rule whose bounds hold gets nearer than: {_mm(limits.proven_mm)} above on average "
        "(estimated)",
    )


def _mm(size_mm: float) -> str:
    return f"{size_mm:.3f} mm" if math.isfinite(size_mm) else "an unknown size"


def _likely_sizes_mm(mean_mm: np.ndarray, noise_mm: np.ndarray) -> np.ndarray:
    """Sizes (m,) of mean readings (m, 3) without the part of their noise; unread: the median."""
    read = np.isfinite(noise_mm)
    square = np.sum(mean_mm[read] ** 2, axis=1) - 3.0 * noise_mm[read] ** 2
    sizes = np.full(len(mean_mm), math.nan)
    sizes[read] = np.sqrt(np.maximum(square, 0.0))
    return np.where(read, sizes, np.median(sizes[read]))
