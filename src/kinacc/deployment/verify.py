"""Verification of a calibration at readings that it was not fitted to: later ones, or a new set-up.

The joint models stay as they were fitted. Base and tool stay too, or are fitted to the new
readings where they were moved, for every model alike. A permutation test compares the position
errors of the selected model with its held-out errors.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from kinacc.calibration.fitting import Fit, fit_frames
from kinacc.calibration.frames import ANGLE_UNIT_RAD, Frames, frame_terms, stacked
from kinacc.calibration.observations import Observations, from_columns
from kinacc.calibration.residuals import errors
from kinacc.calibration.summary import LARGE_SHARE, held_out_errors
from kinacc.calibration.tables import frames_of
from kinacc.checks import tails
from kinacc.config.error_models import ERROR_MODELS, MEASURED, NOMINAL, Comparison
from kinacc.deployment import folder
from kinacc.deployment.applicability import frame_motions, is_measured_there
from kinacc.deployment.permutation import (
    LEVEL,
    ErrorColumns,
    PermutationTest,
    compare,
    smallest_changes,
)
from kinacc.deployment.record import Calibration
from kinacc.deployment.shared_readings import known_rows
from kinacc.errors import input_error
from kinacc.geometry import Pose, skew
from kinacc.kinematics.inverse.limits import outside
from kinacc.kinematics.model import ErrorModel
from kinacc.kinematics.robot import Robot, carried
from kinacc.kinematics.tables import models
from kinacc.measurements.folds import configurations
from kinacc.measurements.row_names import RowNames
from kinacc.tables.columns import Columns, Tables

BASE, TOOL = "base", "tool"
PASS, FAIL, UNDECIDED = "pass", "fail", "undecided"
SET_UP_MOVED = "the instrument or the tool was moved"
FEW_HELD_OUT = "too few held-out configurations"
LEAST_HELD_OUT = 20  # configurations: fewer do not tell the size of errors
DOUBLED = 2.0  # readings that would not show errors this many times as large decide nothing
STATISTICS = ("mean", "quantile_99", "largest", "rms")
_FAR_MM = 10.0


@dataclass(frozen=True)
class Verification:
    """Result of a verification.

    Attributes
    ----------
    verdict
        PASS, FAIL or UNDECIDED; ``reason`` says why it is undecided.
    model
        The selected model.
    readings, known, near
        Number of readings; of those the calibration was fitted to, which are left out; of the
        remaining ones near measured poses, which alone count.
    errors
        A row for each model at the readings that all models cover.
    rows
        A row for each reading but the known ones: whether it is near measured poses (``near``),
        its position error, the limit of held-out errors, and whether the error exceeds it
        (``far_off``). NaN where not near.
    configurations, held_out
        Number of configurations that count, and of held-out ones.
    test
        The permutation test of both; None where it was not possible.
    smallest_factor, smallest_offsets
        Factor on all errors, and offsets (k,) of single joints (mrad; mm where a joint slides),
        detected in 80 % of cases; inf where none is.
    """

    verdict: str
    reason: str
    model: str
    readings: int
    known: int
    near: int
    errors: pd.DataFrame
    rows: pd.DataFrame
    configurations: int = 0
    held_out: int = 0
    test: PermutationTest | None = None
    smallest_factor: float = np.inf
    smallest_offsets: np.ndarray | None = None

    @property
    def hidden_joints(self) -> list[int]:
        """Joints, from 1, of which no offset is detected."""
        offsets = np.zeros(0) if self.smallest_offsets is None else self.smallest_offsets
        return [int(joint) + 1 for joint in np.flatnonzero(np.isinf(offsets))]

    @property
    def least_visible_joint(self) -> int:
        """The other joint, from 1, with the largest offset that is just detected."""
        offsets = np.zeros(1) if self.smallest_offsets is None else self.smallest_offsets
        return int(np.argmax(np.where(np.isfinite(offsets), offsets, -1.0))) + 1


def verify(
    tables: Tables,
    columns: Columns,
    moved: Sequence[str],
    rotation_weight_mm_per_rad: float,
) -> Verification:
    """Verify the selected model of a results folder at new readings.

    Parameters
    ----------
    tables
        Tables of the results folder (``folder.read_tables`` with ``pose_errors``).
    columns
        The table ``measurements`` of the new readings.
    moved
        Which of BASE and TOOL are fitted to the new readings. Where these do not determine a
        frame, it stays as in the robot.

    Raises
    ------
    InputError
        Where a frame that did not move is not in the tables.
    FitError
    """
    calibration = folder.calibration(tables)
    kind, model, robot = calibration.choice, calibration.model, calibration.robot
    is_known = known_rows(columns, tables.get("measurements", {}))
    observed = from_columns(columns, robot).select(~is_known)
    if len(observed.session_names) > 1:
        message = "are of several sessions, each with its own base"
        raise input_error("the readings", message, "readings of one session")
    table = model_errors(tables, observed, moved, rotation_weight_mm_per_rad)
    fitted = "the calibration was fitted to all of these readings"
    labels = [name for name in ("row", "pose_name", "target") if name in columns]
    each = pd.DataFrame({name: columns[name][~is_known] for name in labels})
    each = each.assign(near=False, error_mm=np.nan, limit_mm=np.nan, far_off=False)
    counts = len(is_known), int(is_known.sum()), 0
    result = Verification(UNDECIDED, fitted, kind, *counts, table, each)
    if not len(observed):
        return result
    point = next((name for name in observed.target_names if name in calibration.targets), None)
    near = is_measured_there(calibration, observed.at, point)
    held_out = _held_out(tables, calibration, observed, moved)
    rows = _whole_configurations(observed, near)
    near_count, held_out_count = int(near.sum()), len(held_out.columns)
    each["near"] = near
    result = replace(result, near=near_count, configurations=len(rows), held_out=held_out_count)
    obstacles = {
        SET_UP_MOVED: not moved and table["mean_mm"].min() > _FAR_MM,
        FEW_HELD_OUT: held_out_count < LEAST_HELD_OUT,
        "no reading near a measured pose": not len(rows),
    }
    obstacle = next((text for text, holds in obstacles.items() if holds), "")
    if obstacle:
        return replace(result, reason=obstacle)
    new = observed.select(rows.ravel())
    new = replace(new, rotation=np.full_like(new.rotation, np.nan))
    calibration = _at_session(tables, kind, new, moved)
    frames = frames_at(calibration, new, moved, rotation_weight_mm_per_rad)
    off_mm = errors_of(calibration, frames, new)[:, :3]
    near_mm = errors_of(calibration, frames, observed.select(near))[:, :3]
    known_mm = np.linalg.norm(held_out.columns[..., -1].reshape(-1, 3), axis=1)
    each.loc[near, "error_mm"] = np.linalg.norm(near_mm, axis=1)
    each["limit_mm"] = tails.limit(known_mm, 3, near_count)
    each["far_off"] = each["error_mm"] > each["limit_mm"]
    fresh = error_columns(model, robot, new, frames.targets, moved, off_mm)
    if fresh.columns[..., -1].size <= fresh.rank:
        return replace(result, reason="base and tool explain all that these poses show")
    test, (factor, offsets) = compare(held_out, fresh), smallest_changes(held_out, len(rows))
    verdict = FAIL if test.probability <= LEVEL else PASS
    reason = _far_off(each, columns)
    if not reason and factor > DOUBLED:
        reason = f"{len(rows)} configurations near measured poses are too few to show errors "
        reason += f"{DOUBLED:g} times as large; measure more"
    if verdict == FAIL:
        reason = ""
    elif reason:
        verdict = UNDECIDED
    return replace(
        result,
        verdict=verdict,
        reason=reason,
        test=test,
        smallest_factor=factor,
        smallest_offsets=offsets,
    )


def _far_off(rows: pd.DataFrame, columns: Columns) -> str:
    """Readings whose errors exceed the limit of held-out errors, in words; empty if none do.

    The permutation test does not detect one wrong reading among sound ones: its random samples
    contain that reading too.
    """
    far = rows[rows["far_off"]].sort_values("error_mm")
    if far.empty:
        return ""
    *_, worst = far.itertuples()
    return (
        f"errors of {len(far)} of {rows['near'].sum()} readings exceed the limit of held-out "
        f"errors, {worst.limit_mm:.3g} mm; largest: {RowNames.of_columns(columns).one(worst.row)}, "
        f"{worst.error_mm:.3g} mm; measure again"
    )


def model_errors(
    tables: Tables,
    observations: Observations,
    moved: Sequence[str],
    rotation_weight_mm_per_rad: float,
) -> pd.DataFrame:
    """Errors of every model at the readings that all cover, ``moved`` frames fitted to these.

    Columns: model, readings, and mean, 99 %, largest and rms in mm and mrad. Raises InputError
    for a target or session without a frame, and FitError.
    """
    fitted = models(tables, folder.robot_of(tables).dh)
    beyond = [outside(observations.q_rad, model.domain) for model in fitted.values()]
    part = observations.select(~np.any(beyond, axis=(0, 2)))
    rows = []
    for kind in sorted(fitted, key=(NOMINAL, *ERROR_MODELS).index) if len(part) else ():
        calibration = _at_session(tables, kind, part, moved)
        frames = frames_at(calibration, part, moved, rotation_weight_mm_per_rad)
        off = errors_of(calibration, frames, part)
        row: list[object] = [kind, len(part)]
        for vectors in np.hsplit(off, 2):
            row += statistics(np.linalg.norm(vectors, axis=1))
        rows.append(row)
    columns = [f"{name}_{unit}" for unit in ("mm", "mrad") for name in STATISTICS]
    return pd.DataFrame(rows, columns=["model", "readings", *columns])


def _whole_configurations(readings: Observations, counted: np.ndarray) -> np.ndarray:
    """Rows (m, K) of configurations with all K targets: the first counted reading of each."""
    rows, targets = np.flatnonzero(counted), range(len(readings.target_names))
    part = readings.select(rows)
    table = pd.DataFrame({
        "configuration": configurations(part.pose, part.q_rad), "target": part.target, "row": rows,
    })  # fmt: skip
    first = table.drop_duplicates(["configuration", "target"])
    first = first.pivot(index="configuration", columns="target", values="row")
    return first.reindex(columns=targets).dropna().to_numpy(int)


def _held_out(
    tables: Tables, calibration: Calibration, readings: Observations, moved: Sequence[str]
) -> ErrorColumns:
    """Held-out errors of configurations with the targets of ``readings``."""
    if not {"pose_errors", "measurements"} <= set(tables):
        return ErrorColumns(np.zeros((0, 3, 1)), 0)
    kind, model, robot = calibration.choice, calibration.model, calibration.robot
    measured, names = from_columns(tables["measurements"], robot), readings.target_names
    if TOOL in moved:
        names = measured.target_names[: len(names)]
    target = pd.Index(names).get_indexer(list(measured.target_names))[measured.target]
    held_out = held_out_errors(tables["pose_errors"], kind)
    vectors = np.full((len(measured), 3), np.nan)
    vectors[held_out["row"].to_numpy(int)] = held_out[["ex_mm", "ey_mm", "ez_mm"]]
    named = replace(measured, target=target, target_names=names)
    rows = _whole_configurations(named, np.isfinite(vectors).all(axis=1) & (target >= 0))
    targets = frames_of(tables["frames"], kind, names, measured.session_names).targets
    every = rows.ravel()
    return error_columns(model, robot, named.select(every), targets, moved, vectors[every])


def error_columns(
    model: ErrorModel,
    robot: Robot,
    readings: Observations,
    targets: Pose,
    moved: Sequence[str],
    off_mm: np.ndarray,
) -> ErrorColumns:
    """Motions of what moved, offsets of reported joints, errors ``off_mm`` (n K, 3) in the base.

    ``readings`` are those of all K ``targets``, configuration by configuration. A joint stands at
    the reported position plus its offset.
    """
    flange = model.pose(readings.at)
    arm = (flange.rotation @ targets.position_mm[readings.target][..., None])[..., 0]
    units = np.where(model.dh.prismatic, 1.0, ANGLE_UNIT_RAD)
    slopes = model.joint_jacobian(readings.at) @ robot.joint_map * units
    motions = [np.zeros((len(arm), 3, 0))]
    if BASE in moved:
        scale = np.repeat([1.0, ANGLE_UNIT_RAD], 3)
        motions.append(frame_motions(np.eye(3), flange.position_mm + arm)[:, :3] * scale)
    kinds = np.eye(len(targets.position_mm))
    if TOOL in moved:
        shifts = np.einsum("nij,nk->nikj", flange.rotation, kinds[readings.target])
        motions.append(shifts.reshape(len(arm), 3, -1))
    fitted = np.concatenate(motions, axis=2)
    parts = [fitted, slopes[:, :3] - skew(arm) @ slopes[:, 3:], off_mm[:, :, None]]
    columns = np.concatenate(parts, axis=2)
    return ErrorColumns(columns.reshape(-1, 3 * len(kinds), columns.shape[2]), fitted.shape[2])


def statistics(errors: np.ndarray) -> list[float]:
    """``STATISTICS`` of errors (n,) that are no NaN; NaN of none."""
    sizes = pd.Series(errors, dtype=float)
    values = sizes.mean(), sizes.quantile(LARGE_SHARE), sizes.max(), np.sqrt((sizes**2).mean())
    return [float(value) for value in values]


def _at_session(
    tables: Tables, kind: str, readings: Observations, moved: Sequence[str]
) -> Calibration:
    """The calibration with the base of the readings' session; InputError where it is not clear."""
    if BASE in moved:
        return folder.calibration(tables, kind)
    (session,) = readings.session_names
    frames = pd.DataFrame(dict(tables["frames"]))
    measured = frames.loc[frames["frame"] == BASE].get("session", pd.Series()).unique()
    if session is None and len(measured) > 1:
        message, allowed = "have no session, and each has its own base", ", ".join(measured)
        raise input_error("the readings", message, f"one of {allowed}")
    return folder.calibration(tables, kind, session=session)


def errors_of(calibration: Calibration, frames: Frames, readings: Observations) -> np.ndarray:
    """Errors (n, 6), mm and mrad, of a calibrated model, bases and targets at ``readings``."""
    fit = Fit(calibration.model, frames)
    comparison = Comparison(MEASURED, calibration.choice)
    return errors({calibration.choice: fit}, readings)[comparison.name]


def frames_at(
    calibration: Calibration,
    readings: Observations,
    moved: Collection[str],
    rotation_weight_mm_per_rad: float,
) -> Frames:
    """Bases and targets of ``readings``: those of the calibration, or fitted to it where ``moved``.

    The joint model stays as fitted.
    """
    names, sessions = readings.target_names, len(readings.session_names)
    tool = carried(calibration.robot)
    targets = [
        calibration.targets.get(name, tool) if TOOL in moved else calibration.point(name)
        for name in names
    ]
    frames = Frames(stacked([calibration.base] * sessions + targets), sessions)
    if not moved:
        return frames
    terms = frame_terms(readings, frames)
    of_base = terms.places[0] < sessions
    terms = replace(terms, free=np.where(of_base, BASE in moved, TOOL in moved))
    weight = rotation_weight_mm_per_rad
    return fit_frames(readings, calibration.model, rotation_weight_mm_per_rad=weight, frames=terms)
