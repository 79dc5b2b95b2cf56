"""Two calibrations of one arm: what moved, by how many standard deviations, and what that moves.

Parameters alone mislead: directions the poses do not determine differ without meaning, and base and
tool take up what joints share with them. So poses are compared as well, as they stand and after the
base and tool changes that bring them closest together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from kinacc.calibration.uncertainty import scale_of
from kinacc.config.error_models import model_name
from kinacc.deployment.predict import sensitivity
from kinacc.deployment.record import FLANGE, Calibration
from kinacc.deployment.shared_readings import NONE_SHARED, SharedReadings, counted_once
from kinacc.deployment.verify import says_there
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose, compose, exp_so3, log_so3, skew
from kinacc.kinematics import robot as robots
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.model import JointState

_SPAN = 1e-3  # directions closer than this are one
_TOUCHED = 1e-4  # as in the fits: 1 % of a parameter in a direction nobody sees
_STEPS = 8
_ANOTHER = 0.005  # of the length of an arm; a calibration changes far less
ROUNDING = 1e-9  # mm and mrad
_FEWEST = 5  # poses: three would let base and tool take up nearly all


class Parameters(NamedTuple):
    """DH parameters of both (P,), in mm and rad, and their difference second minus first.

    ``std`` is that of the difference and ``sigmas`` their ratio, NaN where either calibration does
    not determine the parameter (``undetermined_in``: "", "first", "second" or "both") or knows no
    deviation.
    """

    names: tuple[str, ...]
    first: np.ndarray
    second: np.ndarray
    difference: np.ndarray
    std: np.ndarray
    sigmas: np.ndarray
    undetermined_in: tuple[str, ...]


class Shift(NamedTuple):
    """How poses moved: position (n,) mm and orientation (n,) rad, root mean squares, and the rms
    that would be expected of two calibrations of an arm that did not change (NaN where unknown)."""

    position_mm: np.ndarray
    orientation_rad: np.ndarray
    rms_mm: float
    rms_rad: float
    chance_mm: float
    chance_rad: float


@dataclass(frozen=True)
class Difference:
    """Two calibrations side by side.

    ``parameters`` is None unless both are DH tables. ``statistic`` is the squared distance in the
    ``directions`` both determine, in units of their covariances, and ``probability`` that of one at
    least as large where nothing changed; NaN where not both know their covariance.
    ``covered`` (n,) are the poses compared, of all given: a VEC model says nothing outside the
    joint range it was fitted in. ``as_they_stand`` are shifts of the flange in the base at these,
    ``apart_from_frames`` after the best base and tool. ``robots_apart_mm`` is the rms by which the
    arms they were calibrated from differ after the best base and tool, and ``same_robot`` whether
    that is no more than calibrations do. ``shared`` are readings that both were fitted to,
    which are counted once.
    """

    covered: np.ndarray
    parameters: Parameters | None
    statistic: float
    directions: int
    probability: float
    as_they_stand: Shift
    apart_from_frames: Shift
    robots_apart_mm: float
    same_robot: bool
    shared: SharedReadings = NONE_SHARED


def compare(
    first: Calibration,
    second: Calibration,
    q_rad: np.ndarray,
    rotation_weight_mm_per_rad: float,
    shared: SharedReadings = NONE_SHARED,
) -> Difference:
    """What moved from ``first`` to ``second``, over reported joints ``q_rad`` (n, k), rad and mm.

    ``shared``: readings that both were fitted to; without it they count as apart.
    Raises InputError where the two are of different kinds of arm, or both say something at hardly
    any of the joints.
    """
    require_alike(first, second)
    covered = _covered(first, second, q_rad)
    q_rad = q_rad[covered]
    first, second = counted_once(first, second, shared)
    parameters, test = None, (np.nan, 0, np.nan)
    if first.model.comparable is not None and second.model.comparable is not None:
        parameters = _parameters(first, second)
        test = _test(first, second)
    before, after = (
        each.pose(JointState(each.robot.dh_joints(q_rad)), "base", FLANGE)
        for each in (first, second)
    )
    plain = _difference(before, after)
    slopes = _frame_slopes(before)
    weights = np.array([1.0, 1.0, 1.0, *[rotation_weight_mm_per_rad] * 3])
    aligned = _aligned(before, after, weights)
    chance = [_scatter(calibration, q_rad) for calibration in (first, second)]
    known = all(each is not None for each in chance)
    scatter = np.concatenate(chance, axis=2) if known else None
    left = None if scatter is None else _without_frames(scatter, slopes, weights)
    apart_mm = _robots_apart(first, second, q_rad, weights)
    return Difference(
        covered,
        parameters,
        *test,
        _shift(plain, scatter),
        _shift(aligned, left),
        apart_mm,
        apart_mm <= _ANOTHER * _length(first.robot.dh),
        shared,
    )


def require_alike(first: Calibration, second: Calibration) -> None:
    """InputError where the joints of two arms do not mean the same, so that nothing compares."""
    one, two = first.robot.dh, second.robot.dh
    problems = []
    if one.joints != two.joints:
        allowed = f"{one.joints}, as {first.name} has"
        problems.append(Problem(second.name, f"has {two.joints} joints", allowed))
    elif not np.array_equal(one.prismatic, two.prismatic):
        problems.append(Problem(second.name, "other joints slide", "the same kind of arm"))
    elif not np.array_equal(first.robot.joint_map, second.robot.joint_map):
        problems.append(Problem(second.name, "another joint_map", "the same reported joints"))
    refuse(problems, f"{first.name} and {second.name} are not the same kind of robot")


def _covered(first: Calibration, second: Calibration, q_rad: np.ndarray) -> np.ndarray:
    """True (n,) where both models say something. InputError where they do at hardly any joints."""
    both = (first, second)
    said = [says_there(each.model, each.robot.dh_joints(q_rad)) for each in both]
    covered = np.all(said, axis=(0, 2))
    count, given = int(covered.sum()), len(covered)
    if count < min(_FEWEST, given):
        outside = np.sum(~np.all(said, axis=0), axis=0)
        joint = int(np.argmax(outside))
        model = model_name(next(each for each in both if each.model.domain is not None).choice)
        raise InputError(
            Problem(
                f"{first.name} and {second.name}",
                f"{f'only {count}' if count else 'none'} of the {given} poses to compare lie in "
                f"the joint range in which the {model} models were fitted; joint {joint + 1} is "
                f"outside in {outside[joint]}",
                f"{_FEWEST} or more, for a {model} model says nothing elsewhere",
                "compare at poses measured by both (--joints FILE), or the DH models (--model dh)",
            )
        )
    return covered


def _robots_apart(
    first: Calibration, second: Calibration, q_rad: np.ndarray, weights: np.ndarray
) -> float:
    """Rms distance (mm) of the arms before calibration, after the best base and tool."""
    before, after = (robots.forward(calibration.robot, q_rad) for calibration in (first, second))
    return _rms(np.linalg.norm(_aligned(before, after, weights)[:, :3], axis=1))


def _length(model: DHModel) -> float:
    """Length of the arm along its links, mm."""
    return float(np.hypot(model.a_mm, model.d_mm).sum())


def _parameters(first: Calibration, second: Calibration) -> Parameters:
    names = first.model.parameter_names
    values = [calibration.model.comparable for calibration in (first, second)]
    free = [_free(calibration) for calibration in (first, second)]
    units = np.array([scale_of(name) for name in names])
    differ = np.abs(values[1] - values[0]) > ROUNDING * units
    shown = [
        number
        for number, name in enumerate(names)
        if any(name in each for each in free) or differ[number]
    ]
    variance, blind = np.zeros((2, len(names))), np.zeros((2, len(names)), dtype=bool)
    for row, calibration in enumerate((first, second)):
        variance[row], blind[row] = _deviations(calibration, names)
    difference = values[1] - values[0]
    std = np.sqrt(variance.sum(axis=0))
    std[blind.any(axis=0)] = np.nan
    with np.errstate(divide="ignore", invalid="ignore"):
        sigmas = np.where(std > 0.0, difference / std, np.nan)
    words = {(False, False): "", (True, False): "first", (False, True): "second"}
    where = tuple(words.get((bool(blind[0, i]), bool(blind[1, i])), "both") for i in shown)
    columns = (column[shown] for column in (*values, difference, std, sigmas))
    return Parameters(tuple(names[i] for i in shown), *columns, where)


def _free(calibration: Calibration) -> set[str]:
    return set(calibration.known.names) if calibration.known else set()


def _deviations(calibration: Calibration, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Variances (P,), NaN without a covariance and 0 where held, and which are undetermined."""
    if calibration.known is None:
        return np.full(len(names), np.nan), np.zeros(len(names), dtype=bool)
    place = {name: number for number, name in enumerate(calibration.known.names)}
    touched = np.sum(_unit(calibration) ** 2, axis=0) > _TOUCHED
    diagonal = np.diag(calibration.known.covariance)
    chosen = [place.get(name) for name in names]
    variance = np.array([0.0 if i is None else diagonal[i] for i in chosen])
    return variance, np.array([i is not None and bool(touched[i]) for i in chosen])


def _unit(calibration: Calibration) -> np.ndarray:
    """Undetermined directions (m, P) of unit length in mm and mrad."""
    directions = calibration.known.undetermined
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _test(first: Calibration, second: Calibration) -> tuple[float, int, float]:
    """Squared distance, number of directions and probability, over what both determine."""
    if first.known is None or second.known is None:
        return np.nan, 0, np.nan
    names = first.model.parameter_names
    units = np.array([scale_of(name) for name in names])
    difference = (second.model.comparable - first.model.comparable) / units
    total, blind = np.zeros((len(names), len(names))), []
    for calibration in (first, second):
        pick = np.zeros((len(names), len(calibration.known.names)))
        place = {name: number for number, name in enumerate(calibration.known.names)}
        for row, name in enumerate(names):
            if name in place:
                pick[row, place[name]] = 1.0
        total += pick @ calibration.known.covariance @ pick.T / np.outer(units, units)
        blind.append(calibration.known.undetermined @ pick.T)
    held = np.eye(len(names))[np.diag(total) == 0.0]
    _, values, right = np.linalg.svd(np.concatenate([*blind, held]))
    lost = int(np.sum(values > _SPAN * max(1.0, values.max(initial=0.0))))
    kept = right[lost:]
    seen, vectors = np.linalg.eigh(kept @ total @ kept.T)
    good = seen > 1e-12 * seen.max(initial=0.0)
    along = (kept @ difference) @ vectors[:, good]
    statistic = float(np.sum(along**2 / seen[good]))
    directions = int(good.sum())
    return (
        statistic,
        directions,
        float(scipy.special.chdtrc(directions, statistic)) if directions else np.nan,
    )


def _difference(before: Pose, after: Pose) -> np.ndarray:
    """Movement (n, 6): position in mm and turn in rad, in the base."""
    turn = log_so3(after.rotation @ np.swapaxes(before.rotation, 1, 2))
    return np.concatenate([after.position_mm - before.position_mm, turn], axis=1)


def _frame_slopes(pose: Pose) -> np.ndarray:
    """Movement (n, 6, 12) of poses by small motions of the base (6) and of the end frame (6)."""
    count = len(pose.position_mm)
    slopes = np.zeros((count, 6, 12))
    slopes[:, :3, :3] = np.eye(3)
    slopes[:, :3, 3:6] = -skew(pose.position_mm)
    slopes[:, 3:, 3:6] = np.eye(3)
    slopes[:, :3, 6:9] = pose.rotation
    slopes[:, 3:, 9:12] = pose.rotation
    return slopes


def _aligned(before: Pose, after: Pose, weights: np.ndarray) -> np.ndarray:
    """Movement (n, 6) that no change of base and end frame explains, least squares."""
    moved = after
    for _ in range(_STEPS):
        left = _difference(before, moved)
        slopes = _frame_slopes(moved) * weights[:, None]
        step = np.linalg.lstsq(slopes.reshape(-1, 12), -(left * weights).ravel(), rcond=1e-9)[0]
        base = Pose(exp_so3(step[3:6]), step[:3])
        end = Pose(exp_so3(step[9:12]), step[6:9])
        moved = compose(base, compose(moved, end))
        if np.abs(step * np.tile([1.0, 1.0, 1.0, 1e3, 1e3, 1e3], 2)).max() < 1e-10:
            break
    return _difference(before, moved)


def _scatter(calibration: Calibration, q_rad: np.ndarray) -> np.ndarray | None:
    """Movement (n, 6, r) of the flange by one standard deviation of each direction of the fit."""
    if calibration.known is None:
        return None
    at = JointState(calibration.robot.dh_joints(q_rad))
    return sensitivity(calibration, at, "base", FLANGE) @ calibration.root


def _without_frames(scatter: np.ndarray, slopes: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """``scatter`` (n, 6, r) less what base and end frame would take up."""
    flat = (slopes * weights[:, None]).reshape(-1, 12)
    left, values, _ = np.linalg.svd(flat, full_matrices=False)
    left = left[:, values > 1e-9 * values[0]]
    moved = (scatter * weights[:, None]).reshape(len(flat), -1)
    moved = moved - left @ (left.T @ moved)
    return moved.reshape(scatter.shape) / weights[:, None]


def _shift(moved: np.ndarray, scatter: np.ndarray | None) -> Shift:
    position, turn = (np.linalg.norm(part, axis=1) for part in (moved[:, :3], moved[:, 3:]))
    chance = np.full(2, np.nan)
    if scatter is not None:
        squares = scatter**2
        chance = [float(np.sqrt(squares[:, rows].sum() / len(moved))) for rows in _ROWS]
    return Shift(position, turn, _rms(position), _rms(turn), *map(float, chance))


_ROWS = (slice(0, 3), slice(3, 6))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
