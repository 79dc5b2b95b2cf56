"""Two calibrations of one arm: what moved, by how many standard deviations, and what that moves.

Parameters alone mislead: directions the poses do not determine differ without meaning, and base and
tool take up what joints share with them. So poses are compared as well, as they stand and after the
base and tool changes that bring them closest together.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import scipy

from kinacc.calibration.misfit import Misfit
from kinacc.calibration.uncertainty import scale_of, scaled_unit, unit_of
from kinacc.config.error_models import model_name
from kinacc.deployment.applicability import measured_by_all
from kinacc.deployment.predict import sensitivity
from kinacc.deployment.record import FLANGE, Calibration
from kinacc.deployment.shared_readings import NONE_SHARED, SharedReadings, counted_once
from kinacc.deployment.verify import covers
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose, compose, exp_so3, log_so3, skew
from kinacc.kinematics import robot as robots
from kinacc.kinematics.model import JointState

OTHER_ROBOT, SAME_READINGS, NOT_COMPARABLE = (
    "different robots",
    "same readings",
    "not comparable here",
)
UNPROVEN, IN_DOUBT, CHANGED, UNKNOWN = "no change proven", "change in doubt", "changed", "unknown"
_SPAN = 1e-3  # directions closer than this are one
_TOUCHED = 1e-4  # as in the fits: 1 % of a parameter in a direction nobody sees
_STEPS = 8
_ANOTHER = 0.005  # of the length of an arm; a calibration changes far less
ROUNDING = 1e-9  # mm and mrad
_FEWEST = 5  # poses: three would let base and tool take up nearly all
_UNLIKELY = 0.001
_ENOUGH = 0.5  # of the poses measured by both


@dataclass(frozen=True)
class Shift:
    """How poses moved: position (n,) mm and orientation (n,) rad, root mean squares, and the rms
    that is expected of two calibrations of an arm that did not change (NaN where unknown)."""

    position_mm: np.ndarray
    orientation_rad: np.ndarray
    rms_mm: float
    rms_rad: float
    chance_mm: float
    chance_rad: float


@dataclass(frozen=True)
class Difference:
    """Two calibrations side by side, of ``names`` and ``robots``, by their models ``model``.

    ``verdict`` is one of the words above; UNKNOWN where chance is not known. ``covered`` (n,) are
    the poses compared, of all given: a VEC model covers its own joint range alone. ``measured``:
    those of them that lie where both were measured. ``parameters``: None unless both are DH tables,
    else a row for each that was fitted or differs, in mm and mrad: name, unit, first, second,
    difference, its std and sigmas (NaN where either calibration does not determine it: undetermined
    is "", "first", "second" or "both"). ``statistic`` is the squared distance in the ``directions``
    both determine, in units of their covariances, ``probability`` that of one at least as large
    where nothing changed. Shifts are those of the flange in the base, ``apart_from_frames`` after
    the best base and tool; ``robots_apart_mm`` is the rms by which the arms differ before any
    calibration, after the best base and tool. ``shared`` readings are counted once.
    """

    names: tuple[str, str]
    robots: tuple[str, str]
    model: str
    verdict: str
    covered: np.ndarray
    measured: np.ndarray
    parameters: pd.DataFrame | None
    statistic: float
    directions: int
    probability: float
    as_they_stand: Shift
    apart_from_frames: Shift
    robots_apart_mm: float
    same_robot: bool
    shared: SharedReadings
    misfits: tuple[Misfit | None, Misfit | None]


def compare(
    first: Calibration,
    second: Calibration,
    q_rad: np.ndarray,
    rotation_weight_mm_per_rad: float,
    shared: SharedReadings = NONE_SHARED,
) -> Difference:
    """What moved from ``first`` to ``second``, over reported joints ``q_rad`` (n, k), rad and mm.

    ``shared``: readings that both were fitted to; without it they count as apart.
    Raises InputError where the two are of different kinds of arm, or both cover hardly any joints.
    """
    require_alike(first, second)
    covered = _covered(first, second, q_rad)
    q_rad = q_rad[covered]
    measured = measured_by_all((first, second), q_rad)
    names = (Path(first.name).name, Path(second.name).name)
    names = names if names[0] != names[1] else (first.name, second.name)
    first, second = both = counted_once(first, second, shared)
    parametric = first.model.comparable is not None and second.model.comparable is not None
    test = _test(first, second) if parametric else (np.nan, 0, np.nan)
    before, after = (
        each.pose(JointState(each.robot.dh_joints(q_rad)), "base", FLANGE) for each in both
    )
    weights = np.array([1.0, 1.0, 1.0, *[rotation_weight_mm_per_rad] * 3])
    scatter = None
    if first.known is not None and second.known is not None:
        scatter = np.concatenate([_scatter(each, q_rad) for each in both], axis=2)
    nominal = (robots.forward(each.robot, q_rad) for each in both)
    apart = np.linalg.norm(_aligned(*nominal, weights)[:, :3], axis=1)
    apart_mm = float(np.sqrt(np.mean(apart**2)))
    length_mm = float(np.hypot(first.robot.dh.a_mm, first.robot.dh.d_mm).sum())
    same_robot, enough = apart_mm <= _ANOTHER * length_mm, float(np.mean(measured)) >= _ENOUGH
    verdicts = {
        OTHER_ROBOT: not same_robot,
        SAME_READINGS: shared.all_of_both,
        NOT_COMPARABLE: not parametric and not enough,
        UNKNOWN: not np.isfinite(test[2]),
        UNPROVEN: not test[2] < _UNLIKELY,
        CHANGED: enough,
        IN_DOUBT: True,
    }
    return Difference(
        names,
        (first.robot.name, second.robot.name),
        first.choice,
        next(each for each, holds in verdicts.items() if holds),
        covered,
        measured,
        _parameters(first, second) if parametric else None,
        *test,
        _shift(_difference(before, after), scatter),
        _shift(_aligned(before, after, weights), _without_frames(scatter, before, weights)),
        apart_mm,
        same_robot,
        shared,
        (first.misfit, second.misfit),
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
    there = np.all([covers(each.model, each.robot.dh_joints(q_rad)) for each in both], axis=0)
    covered = there.all(axis=1)
    count, given = int(covered.sum()), len(covered)
    if count < min(_FEWEST, given):
        outside = np.sum(~there, axis=0)
        joint = int(np.argmax(outside))
        model = model_name(next(each for each in both if each.model.domain is not None).choice)
        what = (
            f"{f'only {count}' if count else 'none'} of the {given} poses to compare lie in the "
            f"joint range of the {model} models; joint {joint + 1} is outside in {outside[joint]}"
        )
        fix = "compare at poses measured by both (--joints FILE), or the DH models (--model dh)"
        place = f"{first.name} and {second.name}"
        raise InputError(Problem(place, what, f"{_FEWEST} or more", fix))
    return covered


def _parameters(first: Calibration, second: Calibration) -> pd.DataFrame:
    names = np.array(first.model.names)
    unit = np.array([scale_of(name) for name in names])
    values = [each.model.comparable / unit for each in (first, second)]
    fitted, variance, blind = [], [], []
    for known in (first.known, second.known):
        own = [] if known is None else [*known.names]
        place = pd.Index(own).get_indexer(names)
        fitted.append(place >= 0)
        missing = np.full(len(names), np.nan if known is None else 0.0)
        diagonal = np.append(np.diag(known.covariance) if own else [], 0.0)
        variance.append(np.where(place >= 0, diagonal[place] / unit**2, missing))
        length = np.linalg.norm(known.undetermined, axis=1, keepdims=True) if own else 1.0
        touched = np.append(np.sum((known.undetermined / length) ** 2, axis=0) if own else [], 0.0)
        blind.append((place >= 0) & (touched[place] > _TOUCHED))
    std = np.sqrt(np.sum(variance, axis=0))
    std[np.any(blind, axis=0)] = np.nan
    difference = values[1] - values[0]
    words = np.array(["", "first", "second", "both"], dtype=object)
    units = [unit_of(name) for name in names]
    table = pd.DataFrame({
        "name": [
            name.rpartition("_")[0] if of in ("rad", "mm") else name
            for name, of in zip(names, units, strict=True)
        ],
        "unit": [scaled_unit(name) for name in names],
        "first": values[0],
        "second": values[1],
        "difference": difference,
        "std": std,
        "sigmas": np.divide(difference, std, out=np.full(len(names), np.nan), where=std > 0.0),
        "undetermined": words[blind[0] + 2 * blind[1]],
    })  # fmt: skip
    return table[np.any(fitted, axis=0) | (np.abs(difference) > ROUNDING)].reset_index(drop=True)


def _test(first: Calibration, second: Calibration) -> tuple[float, int, float]:
    """Squared distance, number of directions and probability, over what both determine."""
    if first.known is None or second.known is None:
        return np.nan, 0, np.nan
    names = first.model.names
    units = np.array([scale_of(name) for name in names])
    difference = (second.model.comparable - first.model.comparable) / units
    total, blind = np.zeros((len(names), len(names))), []
    for known in (first.known, second.known):
        pick = (np.array(names)[:, None] == np.array(known.names)).astype(float)
        total += pick @ known.covariance @ pick.T / np.outer(units, units)
        blind.append(known.undetermined @ pick.T)
    held = np.eye(len(names))[np.diag(total) == 0.0]
    _, values, right = np.linalg.svd(np.concatenate([*blind, held]))
    kept = right[int(np.sum(values > _SPAN * max(1.0, values.max(initial=0.0)))) :]
    seen, vectors = np.linalg.eigh(kept @ total @ kept.T)
    good = seen > 1e-12 * seen.max(initial=0.0)
    along = (kept @ difference) @ vectors[:, good]
    statistic, directions = float(np.sum(along**2 / seen[good])), int(good.sum())
    probability = float(scipy.special.chdtrc(directions, statistic)) if directions else np.nan
    return statistic, directions, probability


def _difference(before: Pose, after: Pose) -> np.ndarray:
    """Movement (n, 6): position in mm and turn in rad, in the base."""
    turn = log_so3(after.rotation @ np.swapaxes(before.rotation, 1, 2))
    return np.concatenate([after.position_mm - before.position_mm, turn], axis=1)


def _frame_slopes(pose: Pose, weights: np.ndarray) -> np.ndarray:
    """Weighted movement (6n, 12) of poses by small motions of the base (6) and of the end frame."""
    slopes = np.zeros((len(pose.position_mm), 6, 12))
    slopes[:, :3, :3] = np.eye(3)
    slopes[:, :3, 3:6] = -skew(pose.position_mm)
    slopes[:, 3:, 3:6] = np.eye(3)
    slopes[:, :3, 6:9] = slopes[:, 3:, 9:12] = pose.rotation
    return (slopes * weights[:, None]).reshape(-1, 12)


def _aligned(before: Pose, after: Pose, weights: np.ndarray) -> np.ndarray:
    """Movement (n, 6) that no change of base and end frame explains, least squares."""
    moved = after
    for _ in range(_STEPS):
        left = (_difference(before, moved) * weights).ravel()
        step = np.linalg.lstsq(_frame_slopes(moved, weights), -left, rcond=1e-9)[0]
        base, end = Pose(exp_so3(step[3:6]), step[:3]), Pose(exp_so3(step[9:12]), step[6:9])
        moved = compose(base, compose(moved, end))
        if np.abs(step * np.tile([1.0, 1.0, 1.0, 1e3, 1e3, 1e3], 2)).max() < 1e-10:
            break
    return _difference(before, moved)


def _scatter(calibration: Calibration, q_rad: np.ndarray) -> np.ndarray:
    """Movement (n, 6, r) of the flange by one standard deviation of each direction of the fit."""
    at = JointState(calibration.robot.dh_joints(q_rad))
    return sensitivity(calibration, at, "base", FLANGE) @ calibration.root


def _without_frames(
    scatter: np.ndarray | None, pose: Pose, weights: np.ndarray
) -> np.ndarray | None:
    """``scatter`` (n, 6, r) less what base and end frame would take up."""
    if scatter is None:
        return None
    left, values, _ = np.linalg.svd(_frame_slopes(pose, weights), full_matrices=False)
    left = left[:, values > 1e-9 * values[0]]
    moved = (scatter * weights[:, None]).reshape(len(left), -1)
    return (moved - left @ (left.T @ moved)).reshape(scatter.shape) / weights[:, None]


def _shift(moved: np.ndarray, scatter: np.ndarray | None) -> Shift:
    sizes = [np.linalg.norm(part, axis=1) for part in (moved[:, :3], moved[:, 3:])]
    rms = [float(np.sqrt(np.mean(size**2))) for size in sizes]
    chance = [np.nan, np.nan]
    if scatter is not None:
        parts = (scatter[:, :3], scatter[:, 3:])
        chance = [float(np.sqrt(np.sum(part**2) / len(moved))) for part in parts]
    return Shift(sizes[0], sizes[1], rms[0], rms[1], chance[0], chance[1])
