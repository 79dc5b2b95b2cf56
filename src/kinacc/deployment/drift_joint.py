"""Which joint explains most of what moved between two series."""

from __future__ import annotations

import numpy as np
import scipy

from kinacc.deployment.drift_chance import UNITS, Moved
from kinacc.kinematics.vec import ERRORS

CLEAR = 0.95  # probability that it is this joint, if it is one and each is as likely before
MOST = 0.5  # of the squared movement beyond chance
_FIRM = 1e-12  # of the variance in all directions, which one may be without
_UNSEEN_MM = 1e-3  # by one mm or mrad: base or tool would take it up
# A joint's DH parameters as errors in front of joints: of which (itself, the next), and what.
_TURN, _SLIDE = (0, "eps_z"), (0, "delta_z")
_ITS_LINK = ((1, "delta_x"), (1, "eps_x"))


def joint_of(found: Moved, prismatic: np.ndarray) -> int | None:
    """The joint (1-based) that a change of explains most of the movement; None where unclear.

    Offsets first, as belts, encoders and collisions change these; then all parameters of a joint.
    Clear: it explains most beyond chance, and is it with the probability ``CLEAR``.
    """
    offsets = [[_SLIDE if slides else _TURN] for slides in prismatic]
    whole = [[_TURN, _SLIDE, *_ITS_LINK] for _ in prismatic]
    for parameters in (offsets, whole):
        ways = [found.along(_errors(j, each, len(prismatic))) for j, each in enumerate(parameters)]
        named = _named(found, [way[:, np.linalg.norm(way, axis=0) > _UNSEEN_MM] for way in ways])
        if named is not None:
            return named + 1
    return None


def _errors(joint: int, parameters: list[tuple[int, str]], joints: int) -> np.ndarray:
    """Joint errors (6k, p) by one mm or mrad of parameters; the last link is the tool's."""
    found = np.zeros((len(ERRORS) * joints, len(parameters)))
    for column, (after, error) in enumerate(parameters):
        if joint + after < joints:
            number = ERRORS.index(error)
            found[len(ERRORS) * (joint + after) + number, column] = UNITS[number]
    return found


def _named(found: Moved, ways: list[np.ndarray]) -> int | None:
    """Place of the ``ways`` (d, p) along which the change lies; None where unclear."""
    covariance = found.chance.T @ found.chance / len(found.chance)
    covariance[np.diag_indices(len(covariance))] += _FIRM * np.trace(covariance)
    white = scipy.linalg.cholesky(covariance, lower=True)
    seen = scipy.linalg.solve_triangular(white, found.change, lower=True)
    explained, left = np.zeros(len(ways)), np.zeros(len(ways))
    for number, way in enumerate(ways):
        if not way.shape[1]:
            continue
        basis, triangle = np.linalg.qr(scipy.linalg.solve_triangular(white, way, lower=True))
        along = basis.T @ seen
        explained[number] = along @ along
        beside = found.change - way @ np.linalg.lstsq(triangle, along, rcond=1e-9)[0]
        left[number] = beside @ beside
    best = int(np.argmax(explained))
    chance = np.trace(covariance)
    most = left[best] - chance <= (1.0 - MOST) * (found.moved_mm**2 - chance)
    clear = np.sum(np.exp(0.5 * (explained - explained[best]))) <= 1.0 / CLEAR
    return best if most and clear and explained[best] > 0.0 else None
