"""Which parameters of a fit the data determine, and which of them they cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, solve_triangular

from kinacc.calibration import blind_words
from kinacc.calibration.blind_words import LEAST
from kinacc.calibration.constrained import ConstrainedFrames
from kinacc.calibration.dh_fit import DHFit, unseen_anywhere
from kinacc.calibration.observations import Observations
from kinacc.calibration.truncated import TOUCH_SQUARED
from kinacc.calibration.uncertainty import (
    Uncertainty,
    dh_parameter_names,
    is_angle,
    named_directions,
)

IDENTIFIED, PRIOR, UNDETERMINED, FIXED = "identified", "prior", "undetermined", "fixed"
STATUSES = (IDENTIFIED, PRIOR, UNDETERMINED, FIXED)
STRUCTURAL = 1e-6  # share of the largest singular value over poses all over the joints
_RANK = 1e-6
_MOST_SAID = 3
_OWN = 0.5  # part of a unit direction beside the structural ones that makes it one of its own


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
    for name, free in zip(dh_parameter_names(len(fit.free)), fit.free.ravel(), strict=True):
        if not free:
            found.append(Parameter(name, FIXED, 0.0, "not fitted"))
    return found


def _first(texts: list[str]) -> str:
    """The first sentences about a parameter, and how many more there are."""
    more = len(texts) - _MOST_SAID
    return "; ".join([*texts[:_MOST_SAID], f"and {more} more"] if more > 0 else texts)


def statements(fit: DHFit, known: Uncertainty, seen: Observations) -> list[tuple[str, np.ndarray]]:
    """What the data cannot tell apart: sentences, each with the mask (P,) of whom it speaks."""
    found, frames = [], len(known.names) - int(fit.free.sum())
    for directions, structural in groups(fit, known, seen):
        members = (np.abs(directions) >= LEAST).any(axis=0)
        words = blind_words.sentence(directions, known.names, fit.frames)
        if any(words == text for text, _ in found):
            continue  # parts too small for words told them apart
        found.append((words if structural else f"{words} {blind_words.WEAK}", members))
    # Joint by joint, what concerns frames alone at the end.
    return sorted(found, key=lambda each: [*np.flatnonzero(each[1][frames:]), len(known.names)][0])


def groups(fit: DHFit, known: Uncertainty, seen: Observations) -> list[tuple[np.ndarray, bool]]:
    """Undetermined directions (m, P) by what they share, and whether no pose at all shows them.

    Any mixture of directions no pose shows is one too: they are mixed to involve few parameters
    each, scaled to a largest part of 1 (mm and mrad), those of the arm alone gathered where they
    have parameters in common. Directions that some pose would show come last, free of the others.
    """
    frames = len(known.names) - int(fit.free.sum())
    arm = np.arange(len(known.names)) >= frames
    exact = unseen_anywhere(fit, seen, STRUCTURAL)
    exact = named_directions(fit, seen.target_names, exact)
    of_arm = np.abs(exact[:, arm]).max(axis=1, initial=0.0) > 0.0
    simple = _simple(exact[of_arm], arm)
    found = [(each[None], True) for each in _simple(exact[~of_arm], ~arm)]
    found += [(each, True) for each in _gathered(simple, ~arm)]
    rows = known.undetermined
    moving = np.abs(rows[:, arm]).max(axis=1, initial=0.0) > 0.0
    weak = _beside(rows[~moving], exact[~of_arm], ~arm)
    found += [(each[None], False) for each in _simple(weak, ~arm)]
    weak = _beside(rows[moving], exact[of_arm], arm)
    return found + [(each[None], False) for each in _simple(weak, arm)]


def _beside(rows: np.ndarray, exact: np.ndarray, among: np.ndarray) -> np.ndarray:
    """The directions in the span of ``rows`` that ``exact`` do not explain, by parts ``among``."""
    if not len(rows) or not len(exact):
        return rows
    _, values, right = np.linalg.svd(exact[:, among], full_matrices=False)
    basis = right[values > _RANK * values[0]]
    of_each = rows[:, among] / np.linalg.norm(rows[:, among], axis=1, keepdims=True)
    left, values, _ = np.linalg.svd(of_each - of_each @ basis.T @ basis, full_matrices=False)
    rest = left[:, values > _OWN].T @ rows
    return rest - rest[:, among] @ np.linalg.pinv(exact[:, among], rcond=_RANK) @ exact


def _simple(rows: np.ndarray, among: np.ndarray) -> np.ndarray:
    """The same space by directions that share no pivot ``among`` (P,), to a largest part of 1."""
    if not len(rows):
        return rows
    left, upper, _ = qr(rows[:, among], mode="economic", pivoting=True)
    mixed = solve_triangular(upper[:, : len(rows)], left.T @ rows)
    return mixed / np.abs(mixed).max(axis=1, keepdims=True)


def _gathered(rows: np.ndarray, frames: np.ndarray) -> list[np.ndarray]:
    """Directions by what they share; one that moves a frame stays alone."""
    found: list[np.ndarray] = []
    for row in rows:
        moves = np.abs(row) >= LEAST
        shared = [
            number
            for number, group in enumerate(found)
            if not (moves | (np.abs(group) >= LEAST).any(axis=0))[frames].any()
            and (moves & (np.abs(group) >= LEAST).any(axis=0)).any()
        ]
        joined = np.concatenate([*(found[number] for number in shared), row[None]])
        found = [group for number, group in enumerate(found) if number not in shared]
        found.append(joined)
    return found


def _priors(fit: DHFit) -> dict[str, float]:
    """Standard deviations of the priors by parameter, mm and rad."""
    found = _finite(dh_parameter_names(len(fit.free)), fit.prior_std.ravel())
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
