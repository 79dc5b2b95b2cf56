"""Which parameters of a fit the data determine, and which of them they cannot tell apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.calibration import blind_groups, blind_words
from kinacc.calibration.constrained import ConstrainedFrames
from kinacc.calibration.dh_fit import DHFit, unseen_anywhere
from kinacc.calibration.observations import Observations
from kinacc.calibration.truncated_svd import TOUCH_SQUARED
from kinacc.calibration.uncertainty import (
    Uncertainty,
    is_angle,
    named_directions,
)

IDENTIFIED, PRIOR, UNDETERMINED, FIXED = "identified", "prior", "undetermined", "fixed"
STRUCTURAL = 1e-6  # share of the largest singular value over poses all over the joints
_MOST_SAID = 3
_JOIN, _MORE = "; ", "and "


@dataclass(frozen=True)
class Parameter:
    """What is known of one parameter.

    ``share``: length of its part in the undetermined directions of unit length (mm and mrad), 0
    where it takes part in none. ``statement``: why it is not identified, empty where it is.
    """

    name: str
    status: str
    share: float
    statement: str


def parameters(fit: DHFit, known: Uncertainty, seen: Observations) -> list[Parameter]:
    """Every parameter of a DH fit, frames first.

    Undetermined are those of which directions below the truncation's share of the largest singular
    value (base and targets projected out) hold more than 1 % (``truncated.TOUCH_SQUARED``).
    ``seen``: what was fitted.
    """
    said = statements(fit, known, seen)
    share = np.sqrt(np.sum(known.undetermined**2, axis=0))
    priors, fixed = _priors(fit), _fixed(fit)
    found = []
    for number, name in enumerate(known.names):
        status, statement = IDENTIFIED, ""
        if share[number] ** 2 > TOUCH_SQUARED:
            status = UNDETERMINED
            statement = _first([text for text, members in said if members[number]])
        elif name in priors:
            unit, factor = ("mrad", 1e3) if is_angle(name) else ("mm", 1.0)
            status, statement = PRIOR, f"known beforehand to {factor * priors[name]:g} {unit}"
        elif name in fixed:
            status, statement = FIXED, "fixed by calibration.frames"
        found.append(Parameter(name, status, float(share[number]), statement))
    for name, free in zip(fit.model.parameter_names, fit.free.ravel(), strict=True):
        if not free:
            found.append(Parameter(name, FIXED, 0.0, "not fitted"))
    return found


def _first(texts: list[str]) -> str:
    """The first sentences about a parameter, and how many more there are."""
    more = len(texts) - _MOST_SAID
    return _JOIN.join([*texts[:_MOST_SAID], f"{_MORE}{more} more"] if more > 0 else texts)


def statements(fit: DHFit, known: Uncertainty, seen: Observations) -> list[tuple[str, np.ndarray]]:
    """What the data cannot tell apart: sentences, each with the mask (P,) of whom it speaks."""
    return blind_words.statements(groups(fit, known, seen), known.names, fit.frames)


def groups(fit: DHFit, known: Uncertainty, seen: Observations) -> list[tuple[np.ndarray, bool]]:
    """Undetermined directions of a fit in groups, as ``blind_groups.groups`` has them."""
    hidden = named_directions(fit, seen.target_names, unseen_anywhere(fit, seen, STRUCTURAL))
    return blind_groups.groups(hidden, known.undetermined, blind_words.of_arm(known.names))


def recorded(table: Mapping[str, Sequence]) -> list[str]:
    """The sentences of a ``dh_identified`` table, each once."""
    found: dict[str, None] = {}
    for status, statement in zip(table["status"], table["statement"], strict=True):
        if status == UNDETERMINED and statement:
            found |= dict.fromkeys(str(statement).split(_JOIN))
    return [text for text in found if not text.startswith(_MORE)]


def _priors(fit: DHFit) -> dict[str, float]:
    """Standard deviations of the priors by parameter, mm and rad."""
    found = _finite(fit.model.parameter_names, fit.prior_std.ravel())
    if isinstance(fit.coordinates, ConstrainedFrames):
        terms = fit.coordinates.terms
        found |= _finite(terms.names, terms.std)
    return found


def _finite(names: Sequence[str], std: np.ndarray) -> dict[str, float]:
    return {name: float(each) for name, each in zip(names, std, strict=True) if np.isfinite(each)}


def _fixed(fit: DHFit) -> set[str]:
    """Components of frames that were not estimated."""
    if not isinstance(fit.coordinates, ConstrainedFrames):
        return set()
    terms = fit.coordinates.terms
    return {name for name, free in zip(terms.names, terms.free, strict=True) if not free}
