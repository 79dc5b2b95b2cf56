"""Movement of predicted poses by the parameters of a fit, and the standard deviations of poses."""

from __future__ import annotations

import numpy as np

from kinacc.calibration.frames import MOTIONS
from kinacc.deployment.record import FLANGE, Calibration
from kinacc.geometry import compose, skew
from kinacc.kinematics.model import JointState

BLOCK = 512  # poses in a pass: bounds the memory


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
    name = point or calibration.default_point
    target, origin = calibration.point(name), calibration.origin(frame)
    end = calibration.model.pose(at)
    slopes = np.zeros((len(at), 6, len(calibration.parameters)))
    place = {name: column for column, name in enumerate(calibration.parameters)}
    chosen = [
        (place[parameter], number)
        for number, parameter in enumerate(calibration.model.names)
        if parameter in place
    ]
    columns, numbers = np.array(chosen, dtype=int).reshape(-1, 2).T
    slopes[:, :, columns] = calibration.model.linearised(at)[1][:, :, numbers]
    # A turn of the last frame moves the point: w x arm = -[arm] w.
    lever_mm = (end.rotation @ target.position_mm[:, None])[..., 0]
    slopes[:, :3] -= skew(lever_mm) @ slopes[:, 3:]
    if name != FLANGE:
        _fill(slopes, place, name, end.rotation, np.zeros_like(lever_mm))
    slopes[:, :3] = origin.rotation @ slopes[:, :3]
    slopes[:, 3:] = origin.rotation @ slopes[:, 3:]
    if frame == "instrument" or calibration.anchor is not None:
        # Motions of the base are about the instrument's axes, as in ``frame``.
        turn = origin.rotation @ calibration.base.rotation.T
        arm_mm = compose(origin, compose(end, target)).position_mm - origin.position_mm
        turned = np.broadcast_to(turn, end.rotation.shape)
        _fill(slopes, place, calibration.base_name, turned, arm_mm)
    return slopes


def _fill(
    slopes: np.ndarray,
    place: dict[str, int],
    name: str,
    turned: np.ndarray,
    lever_mm: np.ndarray,
) -> None:
    """Columns of the motions of a frame: shifts along axes of ``turned`` (n, 3, 3), and turns."""
    for number, motion in enumerate(MOTIONS):
        column = place.get(f"{name}.{motion}")
        if column is None:
            continue
        axis = turned[:, :, number % 3]
        if number < 3:
            slopes[:, :3, column] = axis
        else:
            slopes[:, :3, column] = np.cross(axis, lever_mm)
            slopes[:, 3:, column] = axis
