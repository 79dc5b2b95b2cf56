"""Which joint explains most of what moved between two series."""

from __future__ import annotations

import numpy as np
import scipy

from kinacc.deployment.drift_chance import UNITS, Moved
from kinacc.kinematics.vec import ERRORS

CLEAR = 0.95  # of the resamples name the same joint
MOST = 0.5  # of the squared movement beyond chance
_UNSEEN_MM = 1e-3  # by one mm or mrad: base or tool would take it up
# A joint's DH parameters as errors in front of joints: of which (itself, the next), and what.
_TURN, _SLIDE = (0, "eps_z"), (0, "delta_z")
_ITS_LINK = ((1, "delta_x"), (1, "eps_x"))


def joint_of(found: Moved, prismatic: np.ndarray) -> int | None:
    """The joint (1-based) that a change of explains most of the movement; None where unclear.

    Offsets first, as belts, encoders and collisions change these; then all parameters of a joint.
    Clear: it explains most beyond chance, and ``CLEAR`` of changes resampled about it name it too.
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
    white = scipy.linalg.cholesky(covariance, lower=True)
    # The change first, then changes as they might have been seen.
    changes = np.concatenate([found.change[None], found.change + found.chance])
    seen = scipy.linalg.solve_triangular(white, changes.T, lower=True)
    explained, size = np.zeros((len(ways), len(changes))), np.zeros(len(ways))
    for number, way in enumerate(ways):
        if not way.shape[1]:
            continue
        basis, triangle = np.linalg.qr(scipy.linalg.solve_triangular(white, way, lower=True))
        along = basis.T @ seen
        explained[number] = np.sum(along**2, axis=0)
        left = found.change - way @ np.linalg.lstsq(triangle, along[:, 0], rcond=1e-9)[0]
        size[number] = left @ left
    best = np.argmax(explained, axis=0)
    chance = np.trace(covariance)
    most = size[best[0]] - chance <= (1.0 - MOST) * (found.moved_mm**2 - chance)
    clear = np.mean(best[1:] == best[0]) >= CLEAR
    return int(best[0]) if most and clear and explained[best[0], 0] > 0.0 else None
