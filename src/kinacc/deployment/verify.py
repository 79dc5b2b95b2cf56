"""A calibration held to readings that it was not fitted to: later ones, or of another set-up.

The arm is taken as it was fitted. Base and tool are kept where nothing of the set-up changed, or
fitted anew, for every model alike, and judged at readings held out of that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import numpy as np

from kinacc.artifacts.error_models import MEASURED, Comparison
from kinacc.calibration import dh_fit, robust
from kinacc.calibration.constraints import frame_terms
from kinacc.calibration.frames import Frames, known
from kinacc.calibration.models import Fit
from kinacc.calibration.observations import Observations
from kinacc.calibration.residuals import Errors, cross_validated, errors
from kinacc.calibration.summary import LARGE_SHARE
from kinacc.calibration.system import FlangeModel
from kinacc.calibration.tables import frames_of
from kinacc.errors import InputError, Problem
from kinacc.kinematics.model import ErrorModel
from kinacc.kinematics.robot import Robot, carried
from kinacc.kinematics.tables import models
from kinacc.measurements.folds import configurations, configurations_of

Tables = Mapping[str, Mapping[str, np.ndarray]]
LEAST = 20  # configurations that two means are compared of
ENOUGH = 60  # of as many an arm that did not change is found as good in five cases of six
AS_GOOD = 0.25  # of the held-out mean: a calibration that is off by less more holds
CONFIDENCE = 0.99  # of the interval of the difference of the means
GOOD, WORSE, OPEN = "as good", "worse", "cannot be told"
_SLACK = 1e-9  # rad and mm beyond the fitted range that are rounding


@dataclass(frozen=True)
class Trial:
    """Errors (m, 3) of models by name, all at the m readings that ``rows`` (n,) marks."""

    rows: np.ndarray
    errors: dict[str, Errors]


class Level(NamedTuple):
    """Position errors of a model at readings: how many, of how many configurations, how large."""

    readings: int
    configurations: int
    mean_mm: float
    quantile_99_mm: float


@dataclass(frozen=True)
class Verdict:
    """Whether a model is as good ``here`` as at its ``held_out`` poses: GOOD, WORSE or OPEN.

    ``reason`` says why it cannot be told. The mean here less that held out lies between ``low_mm``
    and ``high_mm`` with ``CONFIDENCE``; NaN where that was not compared.
    """

    says: str
    reason: str
    here: Level | None
    held_out: Level | None
    difference_mm: float = np.nan
    low_mm: float = np.nan
    high_mm: float = np.nan


def verdict(
    tables: Tables,
    model: str,
    trials: Sequence[Trial],
    observations: Observations,
    there: np.ndarray,
) -> Verdict:
    """Hold the mean position error of ``model`` where it was measured, ``there`` (n,), to its own.

    Of the largest of ``trials``. Its own is that at held-out poses which every model was tried on,
    as ``kinacc fitted`` states it. Readings of one configuration are taken to err together.
    """
    sizes = np.full(len(observations), np.nan)
    for trial in trials:  # the largest is the last
        if model in trial.errors:
            sizes[trial.rows] = np.linalg.norm(trial.errors[model].position_mm, axis=1)
    rows = there & np.isfinite(sizes)
    now, new = sizes[rows], configurations(observations.pose, observations.q_rad)[rows]
    then, old = _held_out(tables, model)
    here, held_out = _level(now, new), _level(then, old)
    if held_out is None or held_out.configurations < LEAST:
        return Verdict(OPEN, "too few held-out poses", here, held_out)
    if here is None or here.configurations < LEAST:
        return Verdict(OPEN, "too few readings where it was measured", here, held_out)
    difference = here.mean_mm - held_out.mean_mm
    margin = _margin(_variance_of_mean(now, new), _variance_of_mean(then, old))
    low, high = difference - margin, difference + margin
    says = GOOD if high <= AS_GOOD * held_out.mean_mm else OPEN
    says = WORSE if low > 0.0 else says
    reason = "the difference of the means is too uncertain" if says == OPEN else ""
    return Verdict(says, reason, here, held_out, difference, low, high)


def _held_out(tables: Tables, model: str) -> tuple[np.ndarray, np.ndarray]:
    """Sizes (m,) and configurations (m,) of the held-out position errors of a model."""
    errors = tables.get("pose_errors")
    if errors is None or "measurements" not in tables:
        return np.zeros(0), np.zeros(0, dtype=int)
    held = np.asarray(errors["estimate"]) == "cross_validated"
    kind, row = np.asarray(errors["comparison"])[held], np.asarray(errors["row"])[held]
    tried = [row[kind == each] for each in dict.fromkeys(kind)]
    common = reduce(np.intersect1d, tried) if tried else row
    ours = (kind == Comparison(MEASURED, model).name) & np.isin(row, common)
    sizes = np.linalg.norm([np.asarray(errors[f"e{axis}_mm"])[held] for axis in "xyz"], axis=0)
    return sizes[ours], configurations_of(tables["measurements"])[row[ours]]


def _level(sizes: np.ndarray, configuration: np.ndarray) -> Level | None:
    if not len(sizes):
        return None
    count = len(np.unique(configuration))
    return Level(len(sizes), count, float(sizes.mean()), float(np.quantile(sizes, LARGE_SHARE)))


def _variance_of_mean(sizes: np.ndarray, configuration: np.ndarray) -> tuple[float, int]:
    """Variance of the mean of sizes that agree within a configuration; degrees of freedom."""
    _, group = np.unique(configuration, return_inverse=True)
    sums = np.bincount(group, sizes - sizes.mean())
    free = len(sums) - 1
    return float(np.sum(sums**2)) * len(sums) / free / len(sizes) ** 2, free


def _margin(*parts: tuple[float, int]) -> float:
    """Half the width of Welch's interval, of variances and their degrees of freedom."""
    from scipy.special import stdtrit

    variance = sum(each for each, _ in parts)
    if variance == 0.0:
        return 0.0
    free = variance**2 / sum(each**2 / count for each, count in parts)
    return float(stdtrit(free, 0.5 + 0.5 * CONFIDENCE) * np.sqrt(variance))


def with_kept_frames(tables: Tables, robot: Robot, observations: Observations) -> list[Trial]:
    """Every model of a results folder at ``observations``, with the base and tool it has there.

    First at the readings where all models say something, then, where these are not all, of the
    models that do so everywhere. Raises InputError where a target or a session is another.
    """
    sessions = observations.session_names
    bases = np.asarray(tables["frames"]["frame"]) == "base"
    named = np.asarray(tables["frames"].get("session", np.full(len(bases), None)))
    measured = {str(each) for each in named[bases]}
    if sessions == (None,) and len(measured) > 1:
        what = "do not say in which session they were read, and each has a base of its own"
        raise InputError(Problem("the readings", what, f"one of {', '.join(sorted(measured))}"))

    def judged(rows: Observations, own: Mapping[str, ErrorModel]) -> dict[str, Errors]:
        names = rows.target_names, sessions
        fits = {kind: Fit(own[kind], frames_of(tables["frames"], kind, *names)) for kind in own}
        return errors(fits, rows)

    return _trials(models(tables, robot.dh), observations, judged)


def with_frames_fitted(
    tables: Tables, robot: Robot, observations: Observations, rotation_weight_mm_per_rad: float
) -> list[Trial]:
    """As :func:`with_kept_frames`, with base and targets fitted to the readings outside each fold.

    Every model has its own, and is judged at the readings of the fold. What poses do not show of
    base and tool stays as ``robot`` has it. Raises InputError without folds, or with too few
    readings, and FitError.
    """
    if not (observations.fold >= 0).any():
        what = "nothing is held out to judge base and tool by"
        raise InputError(Problem("measurements.folds", what, "2 or more"))

    def judged(rows: Observations, own: Mapping[str, ErrorModel]) -> dict[str, Errors]:
        def refit(train: Observations, fold: int) -> dict[str, Fit]:
            found = (frames_under(each, train, robot, rotation_weight_mm_per_rad) for each in fixed)
            return {kind: Fit(own[kind], frames) for kind, frames in zip(own, found, strict=True)}

        fixed = list(own.values())
        folds = [int(fold) for fold in np.unique(rows.fold) if fold >= 0]
        return cross_validated(rows, refit, folds, own)[0]

    return _trials(models(tables, robot.dh), observations, judged)


def frames_under(
    model: ErrorModel, observations: Observations, robot: Robot, rotation_weight_mm_per_rad: float
) -> Frames:
    """Base and targets of ``observations`` alone, the arm held at ``model``, of whatever kind."""
    nothing, stated = np.zeros(0), known(robot.base, carried(robot), *_counts(observations))
    held = FlangeModel(0, lambda x, at: model.pose(at))
    unknowns = dh_fit.Unknowns("fit of base and tool", held, nothing, nothing, nothing, nothing)
    coordinates, solution, _ = dh_fit.solved(
        observations,
        unknowns,
        model.dh,
        rotation_weight_mm_per_rad=rotation_weight_mm_per_rad,
        threshold=0.0,
        frames=None,
        frame_terms=frame_terms(observations, stated),
        loss=robust.SQUARES,
    )
    return coordinates.frames(solution.x)


def says_there(model: ErrorModel, q_rad: np.ndarray) -> np.ndarray:
    """True (n, k) where DH joints lie in the range a model says something about."""
    if model.domain is None:
        return np.ones(q_rad.shape, dtype=bool)
    low, high = model.domain
    return (q_rad >= low - _SLACK) & (q_rad <= high + _SLACK)


def _counts(observations: Observations) -> tuple[int, int]:
    return len(observations.session_names), len(observations.target_names)


def _trials(
    own: Mapping[str, ErrorModel],
    observations: Observations,
    judged: Callable[[Observations, Mapping[str, ErrorModel]], Mapping[str, Errors]],
) -> list[Trial]:
    said = {kind: says_there(each, observations.q_rad).all(axis=1) for kind, each in own.items()}
    everywhere = [kind for kind, rows in said.items() if rows.all()]
    parts: list[tuple[np.ndarray, Sequence[str]]] = [(np.all([*said.values()], axis=0), [*own])]
    if len(everywhere) < len(own):
        parts.append((np.ones(len(observations), dtype=bool), everywhere))
    found = []
    for rows, kinds in parts:
        if rows.any():
            of = judged(observations.select(rows), {kind: own[kind] for kind in kinds})
            by_kind = {kind: of[Comparison(MEASURED, kind).name] for kind in kinds}
            found.append(Trial(rows, by_kind))
    return found
