"""Error fields: true errors of many poses, synthetic and measured.

A field holds configurations with the deterministic error of the model at each. Simulated campaigns
draw their candidates from it at random.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kinacc.assess.world import error_vectors
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
_RARE_SHARE, _RARE_MM = 0.01, (1.2, 1.9)


@dataclass(frozen=True)
class ErrorField:
    """True errors ``error_mm`` (n, 3) of a model, robot base frame.

    Where the joints are known: ``q_rad`` (n, k) as reported. ``kind`` is
    ``paper``, ``synthetic``, ``made_up`` or ``measured``, empty for errors of a file. The first
    ``kept`` configurations are among any candidates drawn.
    """

    name: str
    error_mm: np.ndarray
    q_rad: np.ndarray | None = None
    kind: str = ""
    meaning: str = ""
    kept: int = 0

    def __post_init__(self) -> None:
        count = len(self.error_mm)
        joints = self.q_rad is None or (self.q_rad.ndim == 2 and len(self.q_rad) == count)
        if self.error_mm.shape != (count, 3) or not count or not joints:
            shapes = f"errors {self.error_mm.shape}, joints {getattr(self.q_rad, 'shape', ())}"
            raise InputError(
                Problem(f"field {self.name}", shapes, "(n, 3) and (n, k), n at least 1")
            )
        if not np.all(np.isfinite(self.error_mm)):
            message = "holds errors that are not finite"
            raise InputError(Problem(f"field {self.name}", message, "numbers in mm"))

    @property
    def points(self) -> int:
        """Number of configurations."""
        return len(self.error_mm)

    @cached_property
    def size_mm(self) -> np.ndarray:
        """Sizes of the errors (n,)."""
        return np.linalg.norm(self.error_mm, axis=1)

    def candidates(self, count: int, entropy: tuple[int, ...]) -> np.ndarray:
        """Rows of ``count`` configurations drawn without replacement, in random order."""
        rng = np.random.default_rng([*entropy, 0])
        if not self.kept:
            return rng.permutation(self.points)[:count]
        others = self.kept + rng.permutation(self.points - self.kept)
        return rng.permutation(np.append(np.arange(self.kept), others)[:count])


def of_points(name: str, points: Columns) -> ErrorField:
    """The paper's field: ``assessment_points`` of a modelled space."""
    meaning = "errors of the DH model at the operating points of the study"
    return ErrorField(name, error_vectors(points), _stacked(points, "q"), "paper", meaning)


def of_measurements(
    name: str,
    errors: Columns,
    measurements: Columns,
    model: str = PLAINEST,
    target: str | None = None,
) -> ErrorField:
    """Return held-out errors of a model at measured configurations, readings averaged.

    The errors include the noise of the instrument, which counts as truth here.

    Parameters
    ----------
    name : str
        Name of the field.
    errors, measurements : mapping
        Columns of the tables ``pose_errors`` and ``measurements``.
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
    rows, error_mm = measured_errors(errors, wanted)
    meaning = f"held-out errors of the {model_name(model)} model at measured configurations"
    meaning += f", target {target}" if target else ""
    return ErrorField(name, error_mm, _stacked(measurements, "q")[rows], "measured", meaning)


def synthetic(name: str, draw: int) -> ErrorField:
    """Return errors of the DH model of a synthetic arm at poses that were not fitted.

    The calibration has no noise: the errors are deterministic. DH parameters and base are fitted
    to positions by least squares.

    Parameters
    ----------
    name : str
        One of :data:`FAMILIES`.
    draw : int
        Number of the accepted draw of the arm.

    Returns
    -------
    ErrorField
        Errors in mm, robot base frame, with joints in rad.
    """
    accepted = accepted_draw(draw)
    arm = physical_robot(accepted.seed, accepted.scales, accepted.geometry)
    change = FAMILIES[name]
    nominal = robots.load("mh180")
    q_rad = plan.configurations(nominal, CALIBRATION_POSES + POINTS)
    arm = change.arm(arm)
    true_mm = pose(arm, _quiet_visits(q_rad)).position_mm
    error_mm = true_mm - dh.forward(arm.dh, q_rad).position_mm
    rng = np.random.default_rng([accepted.seed, 4])
    error_mm = change.after(error_mm, q_rad, arm, rng)
    beyond_mm, q_rad = _beyond_dh(arm, q_rad, error_mm), q_rad[CALIBRATION_POSES:]
    return ErrorField(f"{name}_{draw}", beyond_mm, q_rad, "synthetic", change.meaning)


@dataclass(frozen=True)
class Family:
    """How a synthetic field differs from the accepted draw; ``meaning`` in words."""

    meaning: str
    arm: Callable[[PhysicalRobot], PhysicalRobot]
    after: Callable[..., np.ndarray] = lambda error_mm, *_: error_mm


def _only(**factors: float) -> Callable[[PhysicalRobot], PhysicalRobot]:
    """The arm with the effects named times their factors, the other effects beyond a VEC none."""

    def change(arm: PhysicalRobot) -> PhysicalRobot:
        parts = ("compliance", "ripple_rad", "backlash_rad", "drift", "repeatability_rad")
        parts_of = {part: getattr(arm.beyond, part) * factors.get(part, 0.0) for part in parts}
        return replace(arm, beyond=replace(arm.beyond, **parts_of))

    return change


def _small(arm: PhysicalRobot) -> PhysicalRobot:
    return replace(_only()(arm), smooth=replace(arm.smooth, amplitude=0.35 * arm.smooth.amplitude))


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


def _with_rare(
    error_mm: np.ndarray, q_rad: np.ndarray, arm: PhysicalRobot, rng: np.random.Generator
) -> np.ndarray:
    """Single poses far off, for no reason a model could know."""
    size = np.where(rng.random(len(q_rad)) < _RARE_SHARE, rng.uniform(*_RARE_MM, len(q_rad)), 0.0)
    turn = rng.normal(size=(len(q_rad), 3))
    return error_mm + size[:, None] * turn / np.linalg.norm(turn, axis=1)[:, None]


FAMILIES: dict[str, Family] = {
    "smooth": Family("errors that depend smoothly on single joints", _only()),
    "gravity": Family("compliance under gravity, four times as large", _only(compliance=4.0)),
    "ripple": Family("ripple of the gears alone, on smooth errors", _only(ripple_rad=1.0)),
    "thermal": Family("warming up, three times as large", _only(drift=3.0)),
    "workshop": Family(
        "all effects of the physical arm",
        _only(compliance=1.0, ripple_rad=1.0, backlash_rad=1.0, drift=1.0),
    ),
    "defect": Family(
        "a worn spot of joint 2 that moves 2 % of the poses",
        _only(compliance=1.0, ripple_rad=0.3),
        _with_defect,
    ),
    "rare": Family("small smooth errors and 1 % of single poses far off", _small, _with_rare),
}


def _quiet_visits(q_rad: np.ndarray) -> Visits:
    """Visits without chance: in the plan's order and time."""
    count = len(q_rad)
    return Visits(q_rad, plan.directions(q_rad), plan.time_h(count), np.zeros(q_rad.shape))


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


def _stacked(columns: Columns, letter: str) -> np.ndarray:
    names = [name for name in columns if name[:1] == letter and name[1:].isdigit()]
    return np.stack([np.asarray(columns[name], dtype=float) for name in names], axis=1)
