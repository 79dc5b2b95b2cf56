"""A calibration held to readings that it was not fitted to: later ones, or of another set-up.

The arm is taken as it was fitted. Base and tool are kept where they did not move, and fitted anew
where they did, for every model alike. Errors are compared among models, and those of the selected
model with its held-out errors by a permutation test.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple

import numpy as np
import pandas as pd

from kinacc.calibration.fitting import fit_frames
from kinacc.calibration.frames import (
    ANGLE_UNIT_RAD,
    MOTIONS,
    Frames,
    frame_terms,
    known,
    stacked,
)
from kinacc.calibration.models import Fit
from kinacc.calibration.observations import Observations, from_columns
from kinacc.calibration.residuals import errors
from kinacc.calibration.summary import LARGE_SHARE
from kinacc.calibration.tables import frames_of
from kinacc.config.error_models import ERROR_MODELS, MEASURED, NOMINAL, Comparison
from kinacc.deployment import folder
from kinacc.deployment.applicability import is_measured_there
from kinacc.deployment.permutation import LEVEL, Columns, Held, held_to, smallest_changes
from kinacc.deployment.shared_readings import known_rows
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, skew
from kinacc.kinematics.model import ErrorModel
from kinacc.kinematics.robot import Robot, carried
from kinacc.kinematics.tables import frame, models
from kinacc.measurements.folds import configurations

Tables = Mapping[str, Mapping[str, np.ndarray]]
BASE, TOOL = "base", "tool"
PASSES, FAILS, OPEN = "passes", "fails", "cannot be told"
KNOWN = "the calibration was fitted to all of these readings"
ELSEWHERE = "instrument or tool stands elsewhere"
FEW_HELD_OUT = "too few held-out configurations"
SEVERAL = "several sessions, each with a base of its own"
NOWHERE = "no configuration where it was measured"
TAKEN_UP = "base and tool take up all that these poses show"
FEW = "too few configurations where it was measured"
LEAST_HELD_OUT = 20  # configurations: fewer do not say how large errors are
DOUBLED = 2.0  # poses that would not show errors this many times as large pass nothing
_FAR_MM = 10.0
_SLACK = 1e-9  # rad and mm beyond the fitted range that are rounding


class Level(NamedTuple):
    """Position errors of a model: how many readings, of how many configurations, how large."""

    readings: int
    configurations: int
    mean_mm: float
    quantile_99_mm: float


@dataclass(frozen=True)
class Verification:
    """Whether new readings pass ``model``: PASSES, FAILS or OPEN, and why it cannot be told.

    ``known`` of the ``readings`` are those that it was fitted to, and left out; ``near`` of the
    others lie where it was measured, and count. ``errors``: a row for each model, at all readings
    and, where these differ, at those that every model covers. ``here`` are the errors that count,
    ``held_out`` those held out, ``held`` the test of both. ``smallest_factor`` on all errors and
    ``smallest_offsets`` (k,) of single joints (mrad or mm) are found in four of five cases; inf
    where none is, or base and tool take it up.
    """

    verdict: str
    reason: str
    model: str
    readings: int
    known: int
    near: int
    errors: pd.DataFrame
    held_out: Level | None = None
    here: Level | None = None
    held: Held | None = None
    smallest_factor: float = np.inf
    smallest_offsets: np.ndarray | None = None


def verify(
    tables: Tables,
    robot: Robot,
    columns: Mapping[str, np.ndarray],
    moved: Sequence[str],
    rotation_weight_mm_per_rad: float,
) -> Verification:
    """Hold the selected model of a results folder to the table ``measurements`` of new readings.

    ``moved``: what of BASE and TOOL is fitted to these anew; what they do not show of it stays as
    ``robot`` has it. The test goes by positions; of a configuration the first reading of every
    target counts. Raises InputError where a frame that is kept is not there, and FitError.
    """
    calibration = folder.calibration(tables, robot)
    kind, model = calibration.choice, calibration.model
    is_known = known_rows(columns, tables.get("measurements", {}))
    seen = from_columns(columns, robot).select(~is_known)
    point = next((each for each in seen.target_names if each in calibration.targets), None)
    near = is_measured_there(calibration, seen.at, point) if len(seen) else is_known[:0]
    table = model_errors(tables, robot, seen, moved, rotation_weight_mm_per_rad)
    told = Verification(OPEN, "", kind, len(is_known), int(is_known.sum()), int(near.sum()), table)
    held_out = _held_out(tables, kind, model, robot, seen, moved) if len(seen) else None
    told = replace(told, held_out=held_out and _level(held_out))
    rows = _whole_configurations(seen, near & says_there(model, seen.q_rad).all(axis=1))
    obstacles = {
        KNOWN: not len(seen),
        ELSEWHERE: not moved and table["mean_mm"].min() > _FAR_MM,
        FEW_HELD_OUT: held_out is None or len(held_out.columns) < LEAST_HELD_OUT,
        SEVERAL: BASE in moved and len(seen.session_names) > 1,
        NOWHERE: not len(rows),
    }
    if any(obstacles.values()):
        return replace(told, reason=next(each for each, there in obstacles.items() if there))
    new = seen.select(rows.ravel())
    new = replace(new, rotation=np.full_like(new.rotation, np.nan))
    frames = frames_at(tables, kind, model, new, robot, moved, rotation_weight_mm_per_rad)
    off = errors({kind: Fit(model, frames)}, new)[Comparison(MEASURED, kind).name].position_mm
    at = new.select(slice(None, None, rows.shape[1]))
    fresh = _columns(model, at, frames.targets, moved, off.reshape(*rows.shape, 3))
    told = replace(told, here=_level(fresh))
    if fresh.columns[..., -1].size <= fresh.rank:
        return replace(told, reason=TAKEN_UP)
    found, (factor, offsets) = held_to(held_out, fresh), smallest_changes(held_out, len(rows))
    verdict = FAILS if found.probability <= LEVEL else PASSES if factor <= DOUBLED else OPEN
    return replace(
        told,
        verdict=verdict,
        reason=FEW if verdict == OPEN else "",
        held=found,
        smallest_factor=factor,
        smallest_offsets=offsets,
    )


def model_errors(
    tables: Tables,
    robot: Robot,
    observations: Observations,
    moved: Sequence[str],
    rotation_weight_mm_per_rad: float,
) -> pd.DataFrame:
    """Statistics of the errors of every model, ``moved`` frames fitted to ``observations`` anew.

    First at the readings that all models cover, then, where these are not all, at all readings
    for the models that cover them. Raises InputError where a target or a session that is kept is
    another, or there are too few readings, and FitError.
    """
    if BASE not in moved:
        _require_sessions(tables, observations.session_names)
    made = models(tables, robot.dh)
    covered = {
        kind: says_there(each, observations.q_rad).all(axis=1) for kind, each in made.items()
    }
    common, everywhere = np.all([*covered.values()], axis=0), np.ones(len(observations), bool)
    parts = [("covered by all models", common)] * (not common.all()) + [
        ("all readings", everywhere)
    ]
    order = (NOMINAL, *ERROR_MODELS)
    rows = []
    for at, there in parts:
        for kind in sorted(made, key=order.index) if there.any() else ():
            if not covered[kind][there].all():
                continue
            part, own = observations.select(there), made[kind]
            frames = frames_at(tables, kind, own, part, robot, moved, rotation_weight_mm_per_rad)
            off = errors({kind: Fit(own, frames)}, part)[Comparison(MEASURED, kind).name]
            row = {"model": kind, "at": at, "readings": len(part)}
            for vectors, unit in ((off.position_mm, "mm"), (1e3 * off.rotation_rad, "mrad")):
                sizes = np.linalg.norm(vectors[np.isfinite(vectors).all(axis=1)], axis=1)
                sizes = sizes if len(sizes) else np.array([np.nan])
                row |= {
                    f"mean_{unit}": sizes.mean(),
                    f"quantile_99_{unit}": np.quantile(sizes, LARGE_SHARE),
                    f"largest_{unit}": sizes.max(),
                    f"rms_{unit}": np.sqrt(np.mean(sizes**2)),
                }
            rows.append(row)
    names = ("mean", "quantile_99", "largest", "rms")
    columns = [f"{name}_{unit}" for unit in ("mm", "mrad") for name in names]
    return pd.DataFrame(rows, columns=["model", "at", "readings", *columns])


def _whole_configurations(seen: Observations, counted: np.ndarray) -> np.ndarray:
    """Rows (m, K) of configurations with all K targets: the first of each where it is counted."""
    own, kinds = np.flatnonzero(counted), len(seen.target_names)
    part = seen.select(own)
    of = configurations(part.pose, part.q_rad)
    _, first = np.unique(of * kinds + part.target, return_index=True)
    number, count = np.unique(of[first], return_counts=True)
    whole = np.isin(of[first], number[count == kinds])
    return own[first[whole]].reshape(-1, kinds)


def _held_out(
    tables: Tables,
    kind: str,
    model: ErrorModel,
    robot: Robot,
    seen: Observations,
    moved: Sequence[str],
) -> Columns | None:
    """Held-out errors of configurations with as many targets as ``seen``; None where none are.

    At poses where every model was held out, as ``kinacc summary`` states them.
    """
    if not {"pose_errors", "measurements"} <= set(tables):
        return None
    measured, names = from_columns(tables["measurements"], robot), seen.target_names
    if TOOL in moved:
        names = measured.target_names[: len(names)]
    place = {name: number for number, name in enumerate(names)}
    target = np.array([place.get(each, -1) for each in measured.target_names])[measured.target]
    vectors = held_out_vectors(tables["pose_errors"], kind, len(measured))
    named = replace(measured, target=target, target_names=names)
    counted = np.isfinite(vectors).all(axis=1) & (target >= 0)
    rows = _whole_configurations(named, counted)
    if not len(rows):
        return None
    targets = frames_of(tables["frames"], kind, names, measured.session_names).targets
    return _columns(model, measured.select(rows[:, 0]), targets, moved, vectors[rows])


def held_out_vectors(pose_errors: Mapping[str, np.ndarray], kind: str, count: int) -> np.ndarray:
    """Held-out position errors (count, 3) of measured rows, mm; NaN where any model has none."""
    held = np.asarray(pose_errors["estimate"]) == "cross_validated"
    comparison, row = (np.asarray(pose_errors[each])[held] for each in ("comparison", "row"))
    tried = [row[comparison == each] for each in dict.fromkeys(comparison)]
    common = reduce(np.intersect1d, tried) if tried else row
    ours = (comparison == Comparison(MEASURED, kind).name) & np.isin(row, common)
    found = np.full((count, 3), np.nan)
    vectors = np.stack([np.asarray(pose_errors[f"e{axis}_mm"])[held] for axis in "xyz"], axis=1)
    found[row[ours]] = vectors[ours]
    return found


def _columns(
    model: ErrorModel, at: Observations, targets: Pose, moved: Sequence[str], off_mm: np.ndarray
) -> Columns:
    """Motions of what moved, offsets of the joints and errors ``off_mm`` (n, K, 3) in the base."""
    flange = model.pose(at.at)
    slopes = np.where(model.dh.prismatic, 1.0, ANGLE_UNIT_RAD) * model.joint_jacobian(at.at)
    count, kinds, parts = *off_mm.shape[:2], []
    turned = np.repeat(flange.rotation, kinds, axis=0)
    arm = (turned @ np.tile(targets.position_mm, (count, 1))[..., None])[..., 0]
    if BASE in moved:
        place = np.repeat(flange.position_mm, kinds, axis=0) + arm
        parts += [np.broadcast_to(np.eye(3), turned.shape), -ANGLE_UNIT_RAD * skew(place)]
    if TOOL in moved:
        own = np.tile(np.eye(kinds), (count, 1))
        parts.append(np.einsum("nij,nk->nikj", turned, own).reshape(len(own), 3, -1))
    fitted = sum(part.shape[2] for part in parts)
    slopes = np.repeat(slopes, kinds, axis=0)
    parts += [slopes[:, :3] - skew(arm) @ slopes[:, 3:], off_mm.reshape(-1, 3, 1)]
    return Columns(np.concatenate(parts, axis=2).reshape(count, 3 * kinds, -1), fitted)


def _level(of: Columns) -> Level:
    sizes = np.linalg.norm(of.columns[..., -1].reshape(-1, 3), axis=1)
    quantile = float(np.quantile(sizes, LARGE_SHARE))
    return Level(len(sizes), len(of.columns), float(sizes.mean()), quantile)


def _require_sessions(tables: Tables, sessions: Sequence[str | None]) -> None:
    bases = np.asarray(tables["frames"]["frame"]) == BASE
    named = np.asarray(tables["frames"].get("session", np.full(len(bases), None)))
    measured = {str(each) for each in named[bases]}
    if tuple(sessions) == (None,) and len(measured) > 1:
        what = "do not say in which session they were read, and each has a base of its own"
        raise InputError(Problem("the readings", what, f"one of {', '.join(sorted(measured))}"))


def frames_at(
    tables: Tables,
    kind: str,
    model: ErrorModel,
    seen: Observations,
    robot: Robot,
    moved: Sequence[str],
    rotation_weight_mm_per_rad: float,
) -> Frames:
    """Base and targets of ``seen``: as the table ``frames`` has them, fitted anew what ``moved``.

    The arm is held at ``model``, which the table calls ``kind``.
    """
    sessions, targets = seen.session_names, seen.target_names
    stated = known(robot.base, carried(robot), len(sessions), len(targets))
    if BASE not in moved:
        kept = [frame(tables["frames"], kind, BASE, each) for each in sessions]
        stated = replace(stated, bases=stacked(kept))
    if TOOL not in moved:
        kept = [frame(tables["frames"], kind, each) for each in targets]
        stated = replace(stated, targets=stacked(kept))
    if not moved:
        return stated
    terms = frame_terms(seen, stated)
    of_base = np.arange(len(terms.names)) < len(MOTIONS) * len(sessions)  # these stand first
    terms = replace(terms, free=np.where(of_base, BASE in moved, TOOL in moved))
    return fit_frames(
        seen,
        model,
        rotation_weight_mm_per_rad=rotation_weight_mm_per_rad,
        frame_terms=terms,
    )


def says_there(model: ErrorModel, q_rad: np.ndarray) -> np.ndarray:
    """True (n, k) where DH joints lie in the range a model says something about."""
    if model.domain is None:
        return np.ones(q_rad.shape, dtype=bool)
    low, high = model.domain
    return (q_rad >= low - _SLACK) & (q_rad <= high + _SLACK)
