"""Comparison of two calibrations of one arm: what moved, beside what moves by chance.

Parameters alone mislead: directions that the poses do not determine differ without meaning, and
base and tool absorb a part of the joint parameters. So predicted poses are compared too, as fitted
and after the base and tool changes that bring them closest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import scipy

from kinacc.calibration.uncertainty import Uncertainty, scale_of, scaled_unit, unit_of
from kinacc.deployment.applicability import frame_motions, is_measured_there, sensitivity
from kinacc.deployment.record import FLANGE, Calibration
from kinacc.deployment.shared_readings import NONE_SHARED, SharedReadings, counted_once
from kinacc.errors import input_error
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import robot as robots
from kinacc.kinematics.inverse.limits import outside
from kinacc.kinematics.inverse.newton import pose_error
from kinacc.kinematics.model import JointState

OTHER_ROBOT, SAME_READINGS = "different robots", "same readings"
NOT_COMPARABLE, UNKNOWN = "not comparable here", "unknown"
UNPROVEN, IN_DOUBT, CHANGED = "change not proven", "change in doubt", "changed"
ROUNDING = 1e-9  # mm and mrad
_SPAN = 1e-3  # directions closer than this are one
_TOUCHED = 1e-4  # 1 % of a parameter in an undetermined direction
_STEPS = 8
_ANOTHER = 0.005  # of the length of an arm; a calibration changes far less
_FEWEST = 5  # poses: base and tool absorb nearly all of three
_UNLIKELY = 0.001
_BY_PARAMETERS = {"dh", "compliance"}  # kinds of models whose parameters are compared
_ENOUGH = 0.5  # of the poses near measured poses of both


@dataclass(frozen=True)
class Difference:
    """Result of a comparison of two calibrations.

    Attributes
    ----------
    names, robots
        Of the two calibrations.
    model
        The error model compared.
    verdict
        CHANGED; IN_DOUBT where most poses are not near measured poses of both; UNPROVEN; UNKNOWN
        without covariances or parameters; NOT_COMPARABLE (a model without parameters, at such
        poses); SAME_READINGS; OTHER_ROBOT.
    statistic, directions, probability
        Squared distance in the directions that both determine, in units of their covariances, and
        the probability of at least this distance where nothing changed.
    shifts
        Rows "as fitted" and "best base and tool": rms and largest change of flange poses in the
        base, and the rms by chance (NaN where unknown, as of VEC models).
    parameters
        Rows of fitted or different DH parameters, mm and mrad; ``sigmas`` is NaN where a
        calibration does not determine one (``undetermined``: first, second, both); or None.
    poses
        A row for each pose compared: its number, whether it is near measured poses of both, and
        the change of the flange's position, as fitted and (``arm_``) after the best base and tool.
    poses_given
        Number of poses given; the others lie outside the range of a model.
    robots_apart_mm
        Rms difference of the nominal arms after the best base and tool.
    shared
        Readings that both were fitted to, counted once.
    held_out_over_noise
        Of both; NaN where the noise is unknown.
    """

    names: tuple[str, str]
    robots: tuple[str, str]
    model: str
    verdict: str
    statistic: float
    directions: int
    probability: float
    shifts: pd.DataFrame
    parameters: pd.DataFrame | None
    poses: pd.DataFrame
    poses_given: int
    robots_apart_mm: float
    shared: SharedReadings
    held_out_over_noise: tuple[float, float]


def compare(
    first: Calibration,
    second: Calibration,
    q_rad: np.ndarray,
    rotation_weight_mm_per_rad: float,
    shared: SharedReadings = NONE_SHARED,
) -> Difference:
    """Compare a second calibration of an arm with a first one.

    Parameters
    ----------
    q_rad
        (n, k) reported joints at which poses are compared, rad (mm where a joint slides).
    rotation_weight_mm_per_rad
        Weight of a turn where base and tool are aligned.
    shared
        Readings that both were fitted to.

    Returns
    -------
    Difference

    Raises
    ------
    InputError
        For different kinds of arm, and where a model covers hardly any of the joints.
    """
    require_alike(first, second)
    both = (first, second)
    beyond = [outside(item.robot.dh_joints(q_rad), item.model.domain) for item in both]
    covered = ~np.any(beyond, axis=(0, 2))
    if covered.sum() < min(_FEWEST, len(q_rad)):
        message = f"{covered.sum()} of {len(q_rad)} poses lie in the joint ranges of both models"
        fix = "give poses measured by both (--joints FILE), or compare DH models (--model dh)"
        raise input_error(f"{first.name}, {second.name}", message, f"{_FEWEST} or more", fix)
    q_rad = q_rad[covered]
    states = [JointState(item.robot.dh_joints(q_rad)) for item in both]
    measured = np.all([*map(is_measured_there, both, states)], axis=0)
    first, second = both = counted_once(first, second, shared)
    # Coefficients of two series depend on their ranges and orders.
    parametric = {first.model.kind, second.model.kind} <= _BY_PARAMETERS
    test, parameters = (np.nan, 0, np.nan), None
    if parametric:
        scale = np.array([scale_of(name) for name in first.model.names])
        before_, after_ = (item.model.start / scale for item in both)
        known = [_of_model(item, scale) for item in both]
        test = _test(after_ - before_, known)
        parameters = _parameters(first.model.names, before_, after_, known)
    before, after = (item.pose(at, "base", FLANGE) for item, at in zip(both, states, strict=True))
    weights = np.array([1.0, 1.0, 1.0, *[rotation_weight_mm_per_rad] * 3])
    moved = [pose_error(after, before), _aligned(before, after, weights)]
    scatter = _scatter(both, states, before, weights)
    nominal = [robots.forward(item.robot, q_rad) for item in both]
    apart_mm = _rms(_aligned(nominal[0], nominal[1], weights)[:, :3])
    length_mm = float(np.hypot(first.robot.dh.a_mm, first.robot.dh.d_mm).sum())
    enough = float(np.mean(measured)) >= _ENOUGH
    verdicts = {
        OTHER_ROBOT: apart_mm > _ANOTHER * length_mm,
        SAME_READINGS: shared.all_of_both,
        NOT_COMPARABLE: not parametric and not enough,
        UNKNOWN: not np.isfinite(test[2]),
        UNPROVEN: not test[2] < _UNLIKELY,
        CHANGED: enough,
        IN_DOUBT: True,
    }
    sizes_mm = [np.linalg.norm(change[:, :3], axis=1) for change in moved]
    poses = {
        "pose": 1 + np.flatnonzero(covered),
        "measured_by_both": measured,
        "moved_mm": sizes_mm[0],
        "arm_moved_mm": sizes_mm[1],
    }
    shifts = [
        {
            "frames": frames,
            "rms_mm": _rms(change[:, :3]),
            "chance_mm": _rms(chance[:, :3]),
            "largest_mm": size_mm.max(),
            "rms_mrad": 1e3 * _rms(change[:, 3:]),
            "chance_mrad": 1e3 * _rms(chance[:, 3:]),
        }
        for frames, change, chance, size_mm in zip(
            ("as fitted", "best base and tool"), moved, scatter, sizes_mm, strict=True
        )
    ]
    return Difference(
        (first.name, second.name),
        (first.robot.name, second.robot.name),
        first.choice,
        next(verdict for verdict, holds in verdicts.items() if holds),
        *test,
        pd.DataFrame(shifts),
        parameters,
        pd.DataFrame(poses),
        len(covered),
        apart_mm,
        shared,
        (first.misfit.ratio, second.misfit.ratio),
    )


def require_alike(first: Calibration, second: Calibration) -> None:
    """InputError where the joints of two arms do not mean the same."""
    before, after = first.robot, second.robot
    alike = np.array_equal(before.dh.prismatic, after.dh.prismatic)
    if not alike or not np.array_equal(before.joint_map, after.joint_map):
        message = f"has other joints than {first.name} (number, sliding joints or joint_map)"
        raise input_error(second.name, message, "the same kind of robot")


def _of_model(calibration: Calibration, scale: np.ndarray) -> Uncertainty:
    """What a fit knows of all P parameters of its model, mm and mrad; covariance NaN if nothing."""
    known, names = calibration.known, calibration.model.names
    if known is None:
        unknown = np.full((len(names), len(names)), np.nan)
        return Uncertainty(names, unknown, unknown[:0])
    pick = (np.array(names)[:, None] == np.array(known.names)).astype(float)
    covariance = pick @ known.covariance @ pick.T / np.outer(scale, scale)
    unit = known.undetermined / np.linalg.norm(known.undetermined, axis=1, keepdims=True)
    return Uncertainty(names, covariance, unit @ pick.T)


def _parameters(
    names: tuple[str, ...], first: np.ndarray, second: np.ndarray, known: list[Uncertainty]
) -> pd.DataFrame:
    """Parameters ``first`` and ``second`` (P,) in mm and mrad, and what is known of them."""
    hidden = [np.sum(item.undetermined**2, axis=0) > _TOUCHED for item in known]
    std = np.sqrt(sum(np.diag(item.covariance) for item in known))
    std[np.any(hidden, axis=0)] = np.nan
    table = pd.DataFrame({
        "name": [
            name.rpartition("_")[0] if unit_of(name) in ("rad", "mm") else name for name in names
        ],
        "unit": [scaled_unit(name) for name in names],
        "first": first,
        "second": second,
        "difference": second - first,
        "std": std,
        "sigmas": np.divide(second - first, std, out=np.full(len(std), np.nan), where=std > 0.0),
        "undetermined": np.array(["", "first", "second", "both"])[hidden[0] + 2 * hidden[1]],
    })  # fmt: skip
    fitted = np.any([*hidden, *(np.diag(item.covariance) > 0.0 for item in known)], axis=0)
    return table[fitted | (np.abs(second - first) > ROUNDING)].reset_index(drop=True)


def _test(difference: np.ndarray, known: list[Uncertainty]) -> tuple[float, int, float]:
    """Squared distance, number of directions and probability, over what both determine."""
    total = known[0].covariance + known[1].covariance
    if not np.isfinite(total).all():
        return np.nan, 0, np.nan
    held = np.eye(len(difference))[np.diag(total) == 0.0]
    hidden = np.concatenate([known[0].undetermined, known[1].undetermined, held])
    _, values, right = np.linalg.svd(hidden)
    determined = right[int(np.sum(values > _SPAN * max(1.0, values.max(initial=0.0)))) :]
    variance, vectors = np.linalg.eigh(determined @ total @ determined.T)
    good = variance > 1e-12 * variance.max(initial=0.0)
    along = (determined @ difference) @ vectors[:, good]
    statistic, directions = float(np.sum(along**2 / variance[good])), int(good.sum())
    probability = float(scipy.special.chdtrc(directions, statistic)) if directions else np.nan
    return statistic, directions, probability


def _frame_slopes(pose: Pose, weights: np.ndarray) -> np.ndarray:
    """Weighted movement (6n, 12) of poses by small motions of the base (6) and of the end frame."""
    of_base = frame_motions(np.eye(3), pose.position_mm)
    of_end = frame_motions(pose.rotation, np.zeros_like(pose.position_mm))
    slopes = np.concatenate([of_base, of_end], axis=2)
    return (slopes * weights[:, None]).reshape(-1, 12)


def _aligned(before: Pose, after: Pose, weights: np.ndarray) -> np.ndarray:
    """Movement (n, 6) that no change of base and end frame explains, least squares."""
    for _ in range(_STEPS):
        remaining = (pose_error(after, before) * weights).ravel()
        step = np.linalg.lstsq(_frame_slopes(after, weights), -remaining, rcond=1e-9)[0]
        base, end = Pose(exp_so3(step[3:6]), step[:3]), Pose(exp_so3(step[9:12]), step[6:9])
        after = compose(base, compose(after, end))
    return pose_error(after, before)


def _scatter(
    both: Sequence[Calibration], states: Sequence[JointState], pose: Pose, weights: np.ndarray
) -> list[np.ndarray]:
    """Movement (n, 6, r) of the flange by one standard deviation of each direction of the fits.

    As fitted, and less what base and end frame absorb; NaN without covariances or parameters.
    """
    # The covariance of a series contains directions that move the flange and no measured pose.
    if any(item.known is None or item.model.kind not in _BY_PARAMETERS for item in both):
        return [np.full((len(pose.position_mm), 6, 1), np.nan)] * 2
    pairs = zip(both, states, strict=True)
    slopes = [sensitivity(item, state, "base", FLANGE) @ item.root for item, state in pairs]
    moved = np.concatenate(slopes, axis=2)
    absorbed = scipy.linalg.orth(_frame_slopes(pose, weights), 1e-9)
    flat = (moved * weights[:, None]).reshape(len(absorbed), -1)
    apart = (flat - absorbed @ (absorbed.T @ flat)).reshape(moved.shape) / weights[:, None]
    return [moved, apart]


def _rms(moved: np.ndarray) -> float:
    """Root of the mean over poses (n, ...) of summed squares."""
    return float(np.sqrt(np.sum(moved**2) / len(moved)))
