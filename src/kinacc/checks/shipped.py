"""Which of the shipped robots fit measured readings."""

from __future__ import annotations

import numpy as np

from kinacc.calibration.frames import stacked
from kinacc.checks.meanings import base_and_target, largest_session
from kinacc.checks.readings import Readings, thinned
from kinacc.kinematics import dh
from kinacc.kinematics import robot as robots

_ROWS = 240
SURE = 0.01  # of the points' spread: what an arm that is the one leaves, uncalibrated
_NEXT = 0.2  # of what the next best leaves
_SAME_ARM = 1e-6  # of the misfit: two names of one geometry


def misfits(merged: Readings) -> list[tuple[float, str]]:
    """What shipped robots leave, as a share of the points' spread, and their names, best first.

    The arms are taken as described: corrected, an arm of similar build would fit as well.
    """
    part = largest_session(merged, np.arange(len(merged)))
    few = part.select(thinned(np.arange(len(part)), _ROWS))
    arms = [arm for arm in map(robots.load, robots.shipped()) if arm.dh.joints == few.joints]
    if not arms:
        return []
    by_arm = stacked([dh.forward(arm.dh, arm.dh_joints(few.q)) for arm in arms])
    _, shares = base_and_target(few, by_arm, np.stack([few.position_mm] * len(arms)))
    return sorted(zip(shares.tolist(), [arm.name for arm in arms], strict=True))


def fitting(merged: Readings) -> list[str]:
    """Names of the shipped robots that fit: one, or those of equal geometry; or none."""
    shares = misfits(merged)
    least = shares[0][0] if shares else np.inf
    same = [name for share, name in shares if share <= (1.0 + _SAME_ARM) * least]
    others = shares[len(same) :]
    return [] if least > SURE or (others and least > _NEXT * others[0][0]) else same
