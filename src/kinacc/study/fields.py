"""Error fields: true errors of many poses, synthetic and measured.

A field holds the deterministic error of the model at each of many configurations. Simulated
campaigns draw their candidates from it at random.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from kinacc.assess.world import checked_errors, error_vectors
from kinacc.config.error_models import MEASURED, PLAINEST, Comparison, model_name
from kinacc.errors import InputError, Problem
from kinacc.kinematics import dh
from kinacc.kinematics import robot as robots
from kinacc.kinematics.model import JointState
from kinacc.study.operating_points import measured_errors
from kinacc.synthetic import plan
from kinacc.synthetic.accepted import accepted_draw
from kinacc.synthetic.draw import physical_robot
from kinacc.synthetic.physical import PhysicalRobot, Visits, pose
from kinacc.tables.columns import Columns

CALIBRATION_POSES = 400
POINTS = 1000
_TRUNCATION = 1e-6  # DH directions that the calibration poses do not see are left alone
_DEFECT_SHARE = 0.02
_DEFECT_RAD = 6e-4  # jump of joint 2 where its teeth are worn: about 1 mm at the flange


@dataclass(frozen=True)
class ErrorField:
    """True errors ``error_mm`` (n, 3) of a model, robot base frame."""

    name: str
    error_mm: np.ndarray

    def __post_init__(self) -> None:
        checked_errors(self.error_mm)

    @property
    def points(self) -> int:
        """Number of configurations."""
        return len(self.error_mm)

    @cached_property
    def size_mm(self) -> np.ndarray:
        """Sizes of the errors (n,)."""
        return np.linalg.norm(self.error_mm, axis=1)


def of_points(name: str, points: Columns) -> ErrorField:
    """The paper's field: ``assessment_points`` of a modelled space."""
    return ErrorField(name, error_vectors(points))


def of_measurements(
    name: str, errors: Columns, model: str = PLAINEST, target: str | None = None
) -> ErrorField:
    """Return held-out errors of a model at measured configurations, readings averaged.

    The errors include the noise of the instrument, which counts as truth here.

    Parameters
    ----------
    name : str
        Name of the field.
    errors : mapping
        Columns of the table ``pose_errors``.
    model : str
        Model whose errors are taken.
    target : str, optional
        Target, all of them by default.

    Returns
    -------
    ErrorField
        Errors in mm, robot base frame.

    Raises
    ------
    InputError
        Where no errors are held out.
    """
    wanted = (np.asarray(errors["comparison"]) == Comparison(MEASURED, model).name) & (
        np.asarray(errors["estimate"]) == "cross_validated"
    )
    if target is not None:
        wanted &= np.asarray(errors["target"]).astype(str) == target
    if not wanted.any():
        message = f"pose_errors holds no held-out errors of the {model_name(model)} model"
        raise InputError(Problem(f"field {name}", message, fix="set measurements.folds"))
    return ErrorField(name, measured_errors(errors, wanted)[1])


def synthetic(name: str, draw: int, family: Family | None = None) -> ErrorField:
    """Return errors of the DH model of a synthetic arm at poses that were not fitted.

    The calibration has no noise: the errors are deterministic. DH parameters and base are fitted
    to positions by least squares.

    Parameters
    ----------
    name : str
        One of :data:`FAMILIES`, unless a ``family`` is passed.
    draw : int
        Number of the accepted draw of the arm.
    family : Family, optional
        How the field differs from the draw.

    Returns
    -------
    ErrorField
        Errors in mm, robot base frame.
    """
    accepted, family = accepted_draw(draw), family or FAMILIES[name]
    arm = family.arm(physical_robot(accepted.seed, accepted.scales, accepted.geometry))
    q_rad = plan.configurations(robots.load("mh180"), CALIBRATION_POSES + POINTS)
    # Visits without chance: in the plan's order and time.
    times = plan.time_h(len(q_rad))
    visits = Visits(q_rad, plan.directions(q_rad), times, np.zeros(q_rad.shape))
    error_mm = pose(arm, visits).position_mm - dh.forward(arm.dh, q_rad).position_mm
    rng = np.random.default_rng([accepted.seed, 4])
    error_mm = family.after(error_mm, q_rad, arm, rng)
    return ErrorField(f"{name}_{draw}", _beyond_dh(arm, q_rad, error_mm))


class Family(NamedTuple):
    """How a synthetic field differs from the accepted draw."""

    arm: Callable[[PhysicalRobot], PhysicalRobot]
    after: Callable[..., np.ndarray] = lambda error_mm, *_: error_mm


def only(**factors: float) -> Callable[[PhysicalRobot], PhysicalRobot]:
    """The arm with the effects named times their factors, the other effects beyond a VEC none."""

    def change(arm: PhysicalRobot) -> PhysicalRobot:
        parts = ("compliance", "ripple_rad", "backlash_rad", "drift", "repeatability_rad")
        parts_of = {part: getattr(arm.beyond, part) * factors.get(part, 0.0) for part in parts}
        return replace(arm, beyond=replace(arm.beyond, **parts_of))

    return change


def _with_defect(
    error_mm: np.ndarray, q_rad: np.ndarray, arm: PhysicalRobot, rng: np.random.Generator
) -> np.ndarray:
    """A worn spot of joint 2: it jumps over a few degrees that hold 2 % of the poses."""
    angle = q_rad[:, 1]
    start = rng.uniform(0.3, 0.7)
    low, high = np.quantile(angle, [start, start + _DEFECT_SHARE])
    worn = (angle >= low) & (angle < high)
    lever = dh.joint_jacobian(arm.dh, q_rad)[:, :3, 1]
    return error_mm + np.where(worn[:, None], lever * _DEFECT_RAD, 0.0)


FAMILIES = {
    # errors that depend smoothly on single joints
    "smooth": Family(only()),
    # all effects of the physical arm
    "workshop": Family(only(compliance=1.0, ripple_rad=1.0, backlash_rad=1.0, drift=1.0)),
    # a worn spot of joint 2 that moves 2 % of the poses
    "defect": Family(only(compliance=1.0, ripple_rad=0.3), _with_defect),
}


def _beyond_dh(arm: PhysicalRobot, q_rad: np.ndarray, error_mm: np.ndarray) -> np.ndarray:
    """What DH parameters and base, fitted by linear least squares, leave at poses not fitted."""
    count = len(q_rad)
    derivatives = arm.dh.linearised(JointState(q_rad))[1].reshape(count, 6, -1, 5)
    parameters = derivatives[:, :3, :, :4].reshape(count, 3, -1)
    tip_mm = dh.forward(arm.dh, q_rad).position_mm
    turns = np.stack([np.cross(axis, tip_mm) for axis in np.eye(3)], axis=2)
    shifts = np.broadcast_to(np.eye(3), (count, 3, 3))
    matrix = np.concatenate([parameters, turns, shifts], axis=2)
    size = np.linalg.norm(matrix.reshape(3 * count, -1), axis=0)
    matrix = matrix / np.where(size > 1e-9 * size.max(), size, 1.0)  # some move no position
    known = matrix[:CALIBRATION_POSES].reshape(-1, matrix.shape[2])
    wanted = error_mm[:CALIBRATION_POSES].ravel()
    solved, *_ = np.linalg.lstsq(known, wanted, rcond=_TRUNCATION)
    return (error_mm - matrix @ solved)[CALIBRATION_POSES:]
