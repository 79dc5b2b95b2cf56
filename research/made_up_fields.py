"""Error fields for judging, fixed before any assessor met them.

Made up: sizes drawn from what bounds find hard, directions at random, no arm. And families of
synthetic arms: errors of their DH models at poses that were not fitted.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kinacc.kinematics import dh
from kinacc.kinematics import robot as robots
from kinacc.kinematics.model import JointState
from kinacc.study.fields import POINTS, ErrorField
from kinacc.synthetic import plan
from kinacc.synthetic.accepted import accepted_draw
from kinacc.synthetic.draw import physical_robot
from kinacc.synthetic.physical import PhysicalRobot, Visits, pose

_SEED = 1707
_RARE_SHARE, _RARE_MM = 0.01, (1.2, 1.9)
CALIBRATION_POSES = 400
_TRUNCATION = 1e-6  # DH directions that the calibration poses do not see are left alone
_DEFECT_SHARE = 0.02
_DEFECT_RAD = 6e-4  # jump of joint 2 where its teeth are worn: about 1 mm at the flange


@dataclass(frozen=True)
class MadeUp:
    """Sizes (n,) in mm from a generator; the first ``kept`` are candidates in every campaign."""

    meaning: str
    sizes_mm: Callable[[np.random.Generator, int], np.ndarray]
    kept: int = 0


def _ordinary(rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.uniform(0.1, 0.7, count)


def _above(special_mm: list[float]) -> Callable[[np.random.Generator, int], np.ndarray]:
    """The sizes given, then ordinary ones."""

    def sizes_mm(rng: np.random.Generator, count: int) -> np.ndarray:
        return np.append(special_mm, _ordinary(rng, count - len(special_mm)))

    return sizes_mm


def _clustered(rng: np.random.Generator, count: int) -> np.ndarray:
    """One pose in twenty near the largest, in a worn region."""
    high = rng.random(count) < 0.05
    return np.where(high, rng.uniform(0.85, 1.0, count), _ordinary(rng, count))


MADE_UP: dict[str, MadeUp] = {
    "lone": MadeUp("one pose of 1.5 mm, all others 0.1 to 0.7 mm", _above([1.5]), 1),
    "tied2": MadeUp("two poses of 1 mm, all others 0.1 to 0.7 mm", _above([1.0] * 2), 2),
    "tied20": MadeUp("twenty poses of 1 mm, all others 0.1 to 0.7 mm", _above([1.0] * 20), 20),
    "heavy": MadeUp(
        "heavy-tailed: Pareto of index 3, from 0.2 mm up",
        lambda rng, count: 0.2 * (1.0 + rng.pareto(3.0, count)),
    ),
    "cluster": MadeUp("one pose in twenty from 0.85 to 1 mm, all others 0.1 to 0.7 mm", _clustered),
    "flat": MadeUp("all of 0.5 mm", lambda rng, count: np.full(count, 0.5)),
    "even": MadeUp("evenly from 0 to 1 mm", lambda rng, count: rng.uniform(0.0, 1.0, count)),
    "maxwell": MadeUp(
        "normal in each axis, 0.3 mm",
        lambda rng, count: 0.3 * np.linalg.norm(rng.normal(size=(count, 3)), axis=1),
    ),
    "none": MadeUp("hardly any error: all of 0.01 mm", lambda rng, count: np.full(count, 0.01)),
}


def made_up(name: str) -> ErrorField:
    """The field of that name, one of :data:`MADE_UP`: always the same."""
    what = MADE_UP[name]
    rng = np.random.default_rng([_SEED, zlib.crc32(name.encode())])
    size = what.sizes_mm(rng, POINTS)
    turn = rng.normal(size=(POINTS, 3))
    error_mm = size[:, None] * turn / np.linalg.norm(turn, axis=1)[:, None]
    return ErrorField(name, error_mm)


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
    lever = arm.dh.joint_jacobian(JointState(q_rad))[:, :3, 1]
    return error_mm + np.where(worn[:, None], lever * _DEFECT_RAD, 0.0)


def _small(arm: PhysicalRobot) -> PhysicalRobot:
    return replace(only()(arm), smooth=replace(arm.smooth, amplitude=0.35 * arm.smooth.amplitude))


def _with_rare(
    error_mm: np.ndarray, q_rad: np.ndarray, arm: PhysicalRobot, rng: np.random.Generator
) -> np.ndarray:
    """Single poses far off, for no reason a model could know."""
    size = np.where(rng.random(len(q_rad)) < _RARE_SHARE, rng.uniform(*_RARE_MM, len(q_rad)), 0.0)
    turn = rng.normal(size=(len(q_rad), 3))
    return error_mm + size[:, None] * turn / np.linalg.norm(turn, axis=1)[:, None]


def synthetic(name: str, draw: int, family: Family) -> ErrorField:
    """Return errors of the DH model of a synthetic arm at poses that were not fitted.

    The calibration has no noise: the errors are deterministic. DH parameters and base are fitted
    to positions by least squares.

    Parameters
    ----------
    name : str
        Name of the field, without the draw.
    draw : int
        Number of the accepted draw of the arm.
    family : Family
        How the field differs from the draw.

    Returns
    -------
    ErrorField
        Errors in mm, robot base frame.
    """
    accepted = accepted_draw(draw)
    arm = family.arm(physical_robot(accepted.seed, accepted.scales, accepted.geometry))
    q_rad = plan.configurations(robots.load("mh180"), CALIBRATION_POSES + POINTS)
    # Visits without chance: in the plan's order and time.
    times = plan.time_h(len(q_rad))
    visits = Visits(q_rad, plan.directions(q_rad), times, np.zeros(q_rad.shape))
    error_mm = pose(arm, visits).position_mm - dh.forward(arm.dh, q_rad).position_mm
    rng = np.random.default_rng([accepted.seed, 4])
    error_mm = family.after(error_mm, q_rad, arm, rng)
    return ErrorField(f"{name}_{draw}", _beyond_dh(arm, q_rad, error_mm))


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


ARMS = {
    # errors that depend smoothly on single joints
    "smooth": Family(only()),
    # all effects of the physical arm
    "workshop": Family(only(compliance=1.0, ripple_rad=1.0, backlash_rad=1.0, drift=1.0)),
    # a worn spot of joint 2 that moves 2 % of the poses
    "defect": Family(only(compliance=1.0, ripple_rad=0.3), _with_defect),
    "gravity": Family(only(compliance=4.0)),
    "ripple": Family(only(ripple_rad=1.0)),
    "thermal": Family(only(drift=3.0)),
    "rare": Family(_small, _with_rare),
}
