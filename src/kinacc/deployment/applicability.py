"""How sure predicted poses are, and whether a pose lies where the calibration was measured.

Measured there means: the pose is known as well as fitted poses are.

Ranges of single joints do not tell: where the flange always pointed the same way, nearly all of
the box they span was never measured. The covariance of the fit tells. Seen on UR10, UR5 and FANUC
data, DH and VEC models fitted without a part of the poses: the rms of the rest is 0.9 to 1.2 times
the usual held-out one inside (1.7 for the 24 poses of the FANUC), 1.0 to 7.7 times outside.
Distances to measured poses alone call FANUC poses inside that are off by 4.7 times that.

Gaps between clusters of poses need no measure of their own. On a made-up UR10 measured in two
clusters no pose between them counts as measured. Measured at both ends of joint 2 alone, the rms in
the gap is 1.2 to 1.3 times the usual one of a DH model, which takes it for measured; of VEC models,
which take none of it so (with order 2 three quarters of a narrow gap), it is 1.5 to 7 times. By the
distance to the nearest measured pose 65 to 83 % of those gaps are as near as others. Of held-out
UR10 and UR5 poses the 1 to 2 % that it calls far are off by 0.9 to 1.2 times as much as the rest,
those that the covariance does by 1.0 to 1.6 times.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from kinacc.calibration.frames import MOTIONS
from kinacc.deployment.record import Calibration
from kinacc.geometry import compose, skew
from kinacc.kinematics.model import JointState
from kinacc.kinematics.region import points

BLOCK = 512  # poses in a pass: bounds the memory
LIKE_FITTED = 0.99  # of the fitted poses are known as well as the limit
_MOST_FITTED = 500  # that the limit is taken from
_DRAWN = 1000  # poses that a share is counted of


def deviations(
    calibration: Calibration, at: JointState, frame: str = "base", point: str | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviations of predicted poses, and their undetermined movement.

    Parameters
    ----------
    at
        n configurations in DH joints.
    frame
        ``base`` of the robot, or ``instrument``.
    point
        A target by name or ``flange``; the tool where not given.

    Returns
    -------
    tuple of numpy.ndarray
        Standard deviations (n, 6): x, y, z (mm) and small turns (rad). Movement (n, 2), mm and rad,
        by 1 mm or 1 mrad of each undetermined direction, root of the summed squares, by the DH
        model, which other models follow along these. NaN without a covariance.
    """
    std, undetermined = np.full((len(at), 6), np.nan), np.full((len(at), 2), np.nan)
    plainest = calibration.plainest
    if calibration.known is None or plainest.known is None:
        return std, undetermined
    directions = (plainest.known.undetermined * plainest.units).T
    for first in range(0, len(at), BLOCK):
        block = slice(first, first + BLOCK)
        part = at.select(block)
        slopes = sensitivity(calibration, part, frame, point)
        std[block] = np.sqrt(np.sum((slopes @ calibration.root) ** 2, axis=2))
        if plainest is not calibration:
            slopes = sensitivity(plainest, part, frame, point)
        moved = np.sum((slopes @ directions) ** 2, axis=2)
        undetermined[block] = np.sqrt(moved.reshape(-1, 2, 3).sum(axis=2))
    return std, undetermined


def sensitivity(
    calibration: Calibration, at: JointState, frame: str = "base", point: str | None = None
) -> np.ndarray:
    """Jacobian (n, 6, P) of the pose in ``calibration.parameters``.

    Rows: position (mm) and small turn (rad) in ``frame``.
    """
    name, names = point or calibration.default_point, list(calibration.parameters)
    target, origin = calibration.point(name), calibration.origin(frame)
    end, of_model = calibration.model.linearised(at)
    slopes = np.zeros((len(at), 6, len(names)))
    numbers = pd.Index(calibration.model.names).get_indexer(names)
    of_arm = numbers >= 0
    slopes[:, :, of_arm] = calibration.of_point(of_model[:, :, numbers[of_arm]], end, frame, name)
    moved = {name: frame_motions(origin.rotation @ end.rotation, np.zeros_like(end.position_mm))}
    if frame == "instrument" or calibration.anchor is not None:
        # Motions of the base are about the instrument's axes, as in ``frame``.
        turn = origin.rotation @ calibration.base.rotation.T
        arm_mm = compose(origin, compose(end, target)).position_mm - origin.position_mm
        moved[calibration.base_name] = frame_motions(turn, arm_mm)
    for item, motions in moved.items():
        for motion, column in zip(MOTIONS, np.moveaxis(motions, 2, 0), strict=True):
            if f"{item}.{motion}" in names:
                slopes[:, :, names.index(f"{item}.{motion}")] = column
    return slopes


def frame_motions(axes: np.ndarray, lever_mm: np.ndarray) -> np.ndarray:
    """Movement (n, 6, 6) of points by shifts (mm) along ``axes`` (n, 3, 3) and turns about them.

    ``lever_mm`` (n, 3): from the origin of the frame that moves to the points.
    """
    motions = np.zeros((len(lever_mm), 6, 6))
    motions[:, :3, :3] = motions[:, 3:, 3:] = axes
    motions[:, :3, 3:] = -skew(lever_mm) @ axes
    return motions


def position_std_mm(
    calibration: Calibration, at: JointState, point: str | None = None
) -> np.ndarray:
    """Standard deviations (n,) of predicted positions in the instrument's frame, axes together.

    Undetermined directions count with one unit each: 1 mm or 1 mrad.
    """
    std, undetermined = deviations(calibration, at, "instrument", point)
    return np.sqrt(np.sum(std[:, :3] ** 2, axis=1) + undetermined[:, 0] ** 2)


def limit_mm(calibration: Calibration, point: str | None = None) -> float:
    """Standard deviation that 99 % of the fitted poses keep; inf where nothing is known of them."""
    if calibration.known is None or calibration.fitted is None:
        return np.inf
    rows = np.linspace(0, len(calibration.fitted) - 1, _MOST_FITTED).astype(int)
    fitted = calibration.fitted.select(np.unique(rows))
    return float(np.quantile(position_std_mm(calibration, fitted, point), LIKE_FITTED))


def is_measured_there(
    calibration: Calibration, at: JointState, point: str | None = None
) -> np.ndarray:
    """Whether configurations are near measured ones.

    Parameters
    ----------
    at
        n configurations in DH joints.
    point
        A target by name or ``flange``; the tool where not given.

    Returns
    -------
    numpy.ndarray
        True (n,) where every joint is in its fitted range, and the position within ``limit_mm``.
        Without a covariance the ranges decide alone.
    """
    inside = np.all(~calibration.outside_range(at.q_rad), axis=1)
    most_mm = limit_mm(calibration, point)
    if np.isfinite(most_mm) and inside.any():
        rows = np.flatnonzero(inside)
        inside[rows] = position_std_mm(calibration, at.select(rows), point) <= most_mm
    return inside


def share_of_box(calibration: Calibration, low: np.ndarray, high: np.ndarray) -> float:
    """Share of the box of reported joints (k,), (k,) where the calibration was measured."""
    drawn = low + points("sobol", _DRAWN, len(low)) * (high - low)
    state = JointState(calibration.robot.dh_joints(drawn))
    return float(np.mean(is_measured_there(calibration, state)))
