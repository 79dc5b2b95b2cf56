"""Poses a calibrated arm is predicted to take, each with how sure that is."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from kinacc.calibration.frames import MOTIONS
from kinacc.deployment.record import FLANGE, Calibration
from kinacc.geometry import Pose, compose, skew
from kinacc.kinematics.model import JointState

BLOCK = 512  # poses per pass: bounds the memory of the sensitivities


class Prediction(NamedTuple):
    """Predicted poses (n, ...) and what is known of them.

    ``std`` (n, 6): standard deviations by the parameter covariance of x, y, z (mm) and of small
    turns about x, y, z (rad), in the frame of the pose; NaN where the model has no covariance.
    ``std_position_mm`` and ``std_orientation_rad`` (n,): roots of the summed variances.
    ``blind_mm`` and ``blind_rad`` (n,): how far the pose moves when the parameters move by one unit
    (1 mm or 1 mrad) along the directions the calibration could not see, root of the summed squares;
    by the DH model, which other models follow along these.
    ``residual_mm`` and ``residual_rad`` (n,): rms of what the model left unexplained.
    ``outside`` (n, k): joints outside the range the data cover; where the model
    has a domain it says nothing there, and all else is NaN.
    """

    pose: Pose
    std: np.ndarray
    std_position_mm: np.ndarray
    std_orientation_rad: np.ndarray
    blind_mm: np.ndarray
    blind_rad: np.ndarray
    residual_mm: np.ndarray
    residual_rad: np.ndarray
    outside: np.ndarray


def predict(
    calibration: Calibration,
    q_rad: np.ndarray,
    s: np.ndarray | None = None,
    frame: str = "base",
    point: str | None = None,
    progress: Callable[[Iterable[int], str], Iterable[int]] | None = None,
    payload: np.ndarray | None = None,
) -> Prediction:
    """Poses of ``point`` in ``frame`` (base, instrument) at reported joints (n, k), rad and mm.

    ``s`` (n, k): travel directions, unknown where not given; ``payload`` (n, 4) as in a
    ``JointState``. ``point``: a target by name or ``flange``; the tool where not given. Raises
    InputError for an unknown frame or point.
    """
    q_rad = calibration.robot.dh_joints(np.atleast_2d(q_rad))
    at = JointState(q_rad, None if s is None else np.asarray(s), payload)
    count, outside = len(at), calibration.outside_range(at.q_rad)
    silent = outside.any(axis=1) & (calibration.model.domain is not None)
    said = np.flatnonzero(~silent)
    pose = Pose(np.full((count, 3, 3), np.nan), np.full((count, 3), np.nan))
    std, blind = np.full((count, 6), np.nan), np.full((count, 2), np.nan)
    starts = range(0, len(said), BLOCK)
    for begin in progress(starts, f"blocks of {BLOCK} poses") if progress else starts:
        rows = said[begin : begin + BLOCK]
        part = at.select(rows)
        pose.rotation[rows], pose.position_mm[rows] = calibration.pose(part, frame, point)
        if calibration.known is not None:
            std[rows], blind[rows] = deviations(calibration, part, frame, point)
    left = calibration.residual
    return Prediction(
        pose,
        std,
        np.sqrt(np.sum(std[:, :3] ** 2, axis=1)),
        np.sqrt(np.sum(std[:, 3:] ** 2, axis=1)),
        blind[:, 0],
        blind[:, 1],
        np.where(silent, np.nan, left.position_mm if left else np.nan),
        np.where(silent, np.nan, left.orientation_rad if left else np.nan),
        outside,
    )


def open_movement(
    calibration: Calibration, at: JointState, frame: str = "base", point: str | None = None
) -> np.ndarray:
    """Movement (n, 2), mm and rad, of poses along what the calibration could not see."""
    plainest = calibration.plainest
    undetermined = (plainest.known.undetermined * plainest.units).T
    moved = (sensitivity(plainest, at, frame, point) @ undetermined) ** 2
    return np.sqrt(np.stack([moved[:, :3].sum(axis=(1, 2)), moved[:, 3:].sum(axis=(1, 2))], 1))


def deviations(
    calibration: Calibration, at: JointState, frame: str = "base", point: str | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviations (n, 6) and movement along what is undetermined (n, 2), mm and rad."""
    slopes = sensitivity(calibration, at, frame, point)
    std = np.sqrt(np.sum((slopes @ calibration.root) ** 2, axis=2))
    return std, open_movement(calibration, at, frame, point)


def sensitivity(
    calibration: Calibration, at: JointState, frame: str = "base", point: str | None = None
) -> np.ndarray:
    """Jacobian (n, 6, P) of the pose in the parameters of ``calibration.known``.

    Rows: position (mm) and small turn (rad) in ``frame``.
    """
    name = point or calibration.default_point
    carried, origin = calibration.point(name), calibration.origin(frame)
    end = calibration.model.pose(at)
    slopes = np.zeros((len(at), 6, len(calibration.known.names)))
    place = {each: number for number, each in enumerate(calibration.known.names)}
    names = enumerate(calibration.model.names)
    chosen = [(place[each], number) for number, each in names if each in place]
    columns, numbers = np.array(chosen, dtype=int).reshape(-1, 2).T
    slopes[:, :, columns] = calibration.model.linearised(at)[1][:, :, numbers]
    # A turn of the last frame swings the point: w x arm = -[arm] w.
    lever_mm = (end.rotation @ carried.position_mm[:, None])[..., 0]
    slopes[:, :3] -= skew(lever_mm) @ slopes[:, 3:]
    if name != FLANGE:
        _fill(slopes, place, name, end.rotation, np.zeros_like(lever_mm))
    slopes[:, :3] = origin.rotation @ slopes[:, :3]
    slopes[:, 3:] = origin.rotation @ slopes[:, 3:]
    if frame == "instrument" or calibration.anchor is not None:
        # Motions of the base are about the instrument's axes, seen here in ``frame``.
        turn = origin.rotation @ calibration.base.rotation.T
        seen = compose(origin, compose(end, carried)).position_mm - origin.position_mm
        _fill(slopes, place, calibration.base_name, np.broadcast_to(turn, end.rotation.shape), seen)
    return slopes


def _fill(
    slopes: np.ndarray,
    place: dict[str, int],
    name: str,
    turned: np.ndarray,
    lever_mm: np.ndarray,
) -> None:
    """Columns of the motions of a frame: shifts (n, 3) ``turned``, turns swinging ``arm``."""
    for axis, motion in enumerate(MOTIONS):
        column = place.get(f"{name}.{motion}")
        if column is None:
            continue
        along = turned[:, :, axis % 3]
        if axis < 3:
            slopes[:, :3, column] = along
        else:
            slopes[:, :3, column] = np.cross(along, lever_mm)
            slopes[:, 3:, column] = along
