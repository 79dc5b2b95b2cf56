"""Which parameters of a fit the data determine, and which of them they cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kinacc.calibration.blind_groups import LeftOpen, groups, of_arm
from kinacc.calibration.uncertainty import Uncertainty, named_directions

if TYPE_CHECKING:
    from kinacc.calibration.dh_fit import DHFit
    from kinacc.calibration.observations import Observations

IDENTIFIED, PRIOR, UNDETERMINED, FIXED = "identified", "prior", "undetermined", "fixed"
STRUCTURAL = 1e-6  # share of the largest singular value over poses all over the joints


@dataclass(frozen=True)
class Parameter:
    """What is known of one parameter.

    ``share``: length of its part in the undetermined directions of unit length (mm and mrad), 0
    where it takes part in none. ``prior_std``: to how much it was known beforehand, mm or rad,
    where that is what determines it.
    """

    name: str
    status: str
    share: float = 0.0
    prior_std: float | None = None


def parameters(fit: DHFit, known: Uncertainty) -> list[Parameter]:
    """Every parameter of a DH fit, frames first.

    Undetermined are those of which directions below the truncation's share of the largest singular
    value (base and targets projected out) hold more than 1 % (``truncated.TOUCH_SQUARED``), or half
    of them where it has a prior (``truncated.MOVES_SQUARED``).
    """
    from kinacc.calibration.truncated_svd import MOVES_SQUARED, TOUCH_SQUARED

    priors, fixed = _priors(fit), _fixed(fit)
    found = []
    for name, share in zip(
        known.names, np.sqrt(np.sum(known.undetermined**2, axis=0)), strict=True
    ):
        status = FIXED if name in fixed else IDENTIFIED
        status = PRIOR if name in priors else status
        most = MOVES_SQUARED if status == PRIOR else TOUCH_SQUARED
        status = UNDETERMINED if share**2 > most else status
        prior = priors[name] if status == PRIOR else None
        found.append(Parameter(name, status, float(share), prior))
    free = zip(fit.model.parameter_names, fit.free.ravel(), strict=True)
    return found + [Parameter(name, FIXED) for name, is_free in free if not is_free]


def left_open(fit: DHFit, known: Uncertainty, seen: Observations) -> LeftOpen:
    """What the data cannot tell apart. ``seen``: what was fitted."""
    from kinacc.calibration.dh_fit import unseen_anywhere

    hidden = named_directions(fit, seen.target_names, unseen_anywhere(fit, seen, STRUCTURAL))
    found = groups(hidden, known.undetermined, of_arm(known.names))
    return LeftOpen(found, known.names, fit.frames)


def _priors(fit: DHFit) -> dict[str, float]:
    """Standard deviations of the priors by parameter, mm and rad."""
    found = _finite(fit.model.parameter_names, fit.prior_std.ravel())
    from kinacc.calibration.constrained import ConstrainedFrames

    if isinstance(fit.coordinates, ConstrainedFrames):
        terms = fit.coordinates.terms
        found |= _finite(terms.names, terms.std)
    return found


def _finite(names: Sequence[str], std: np.ndarray) -> dict[str, float]:
    return {name: float(each) for name, each in zip(names, std, strict=True) if np.isfinite(each)}


def _fixed(fit: DHFit) -> set[str]:
    """Components of frames that were not estimated."""
    from kinacc.calibration.constrained import ConstrainedFrames

    if not isinstance(fit.coordinates, ConstrainedFrames):
        return set()
    terms = fit.coordinates.terms
    return {name for name, free in zip(terms.names, terms.free, strict=True) if not free}
