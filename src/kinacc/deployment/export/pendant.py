"""What is entered into a robot's controller: a model fitted with the parameters it can take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from kinacc.calibration import delivered, fitting, models, residuals
from kinacc.calibration.dh_estimator import DHEstimator
from kinacc.calibration.fitting import ModelFit
from kinacc.calibration.frames import Frames
from kinacc.calibration.identifiability import listed
from kinacc.calibration.models import Fit
from kinacc.calibration.observations import Observations
from kinacc.config.error_models import NOMINAL, PLAINEST, model_name
from kinacc.deployment.export.controllers import CONTROLLERS, Controller, Numbers
from kinacc.deployment.folder import Tables, selected_model
from kinacc.deployment.record import POSES
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.robot import Robot

_STEMS = {name: name.rpartition("_")[0] for name in PARAMETERS}


@dataclass(frozen=True)
class Value:
    """A number of the controller with its value before and after the calibration."""

    group: str
    name: str
    unit: str
    old: float
    new: float


@dataclass(frozen=True)
class MeanError:
    """Mean errors of a model at ``points`` points of ``poses``; NaN where nothing was measured."""

    model: str
    position_mm: float
    orientation_mrad: float
    points: int
    poses: str


@dataclass(frozen=True)
class Pendant:
    """Numbers to enter into a controller, and how well the arm is known with them.

    ``values``: joint zeros (angle of the axis where the pendant shows 0) or the numbers of the arm;
    TOOL in the flange for every target; BASE, the instrument's frame in the robot's base, for every
    session. Old values: the nominal arm, with base and tool fitted to the same poses. ``errors``:
    the model of these numbers first, then the calibrated and the nominal one. ``left_out``: fitted
    parameters that the controller does not take. ``undetermined``: what the poses do not
    determine, a sentence each. ``text``: a file of ``ending``, where the controller reads one.
    """

    controller: str
    robot: str
    data_set: str
    values: tuple[Value, ...]
    errors: tuple[MeanError, ...]
    left_out: tuple[str, ...]
    undetermined: tuple[str, ...]
    enter: str
    remark: str
    text: str
    ending: str


def fit_pendant(
    tables: Tables, robot: Robot, settings: Mapping, controller: str, name: str = ""
) -> Pendant:
    """The numbers for a controller (a key of ``CONTROLLERS``), fitted to measured poses.

    Parameters
    ----------
    tables
        Of a results folder: measurements, residuals and models.
    robot
        The robot of these results.
    settings
        The section ``calibration`` of the settings.

    Raises
    ------
    FitError
        A fit does not converge.
    InputError
        The controller cannot take this robot, or there are too few measurements.
    """
    maker = CONTROLLERS[controller]
    if robot.dh.prismatic.any():
        message = "has joints that slide: their zeros are lengths, which no export writes"
        raise InputError(Problem(f"robot {robot.name}", message))
    every, train = delivered.observed(tables, robot)
    estimator = DHEstimator.of(settings, robot, every)
    terms, common = estimator.arm, estimator.common
    free = terms.free & np.isin(PARAMETERS, maker.takes)

    def fit(observations: Observations) -> ModelFit:
        frames, known = common.frames(observations)
        return fitting.fit(
            observations,
            terms.nominal,
            free=free,
            std=terms.std,
            rotation_weight_mm_per_rad=common.rotation_weight_mm_per_rad,
            threshold=estimator.threshold,
            frames=frames,
            frame_terms=known,
            loss=estimator.loss,
            name=f"fit for {maker.name}",
        )

    def refit(observations: Observations, fold: int) -> dict[str, Fit]:
        result = fit(observations)
        return {PLAINEST: Fit(result.model, result.frames)}

    used = every.select(train)
    # Joint 1 moves as the base does, the last joint as the tool: where these are fitted, it stays.
    ends = np.isin(np.arange(robot.dh.joints), (0, robot.dh.joints - 1))[:, None]
    free = free & ~(ends & np.isnan(fit(used).std))
    result = fit(used)
    before = models.nominal_frames(used, common)
    folds = [int(fold) for fold in np.unique(every.fold) if fold >= 0]
    comparison = f"{PLAINEST}_vs_measured"
    if folds:
        errors, subset = residuals.cross_validated(every, refit, folds, [PLAINEST])[0], "validation"
    else:
        errors, subset = residuals.errors(refit(used, -1), used), "train"
    old = _numbers(maker, robot, robot.dh, before, every)
    new = _numbers(maker, robot, result.model, result.frames, every)
    taken, selected = free.any(axis=0), selected_model(tables)
    return Pendant(
        maker.name,
        robot.name,
        name,
        tuple(
            Value(
                group, key, unit, *(round(float(x), 12) + 0.0 for x in (old[group][key][0], value))
            )
            for group, numbers in new.items()
            for key, (value, unit) in numbers.items()
        ),
        (
            _mean_error(f"{maker.name} controller", errors[comparison], subset),
            _recorded(tables, selected, f"calibrated ({model_name(selected)})"),
            _recorded(tables, NOMINAL, "nominal, base and tool fitted"),
        ),
        tuple(
            _STEMS[item]
            for item, is_taken in zip(PARAMETERS, taken, strict=True)
            if terms.free[:, PARAMETERS.index(item)].any() and not is_taken
        ),
        tuple(listed(tables["dh_identified"])),
        maker.enter,
        maker.remark,
        maker.text(new[maker.group]),
        maker.ending,
    )


def _numbers(
    maker: Controller, robot: Robot, model: DHModel, frames: Frames, every: Observations
) -> dict[str, Numbers]:
    """All numbers by group: the arm, TOOL of every target, BASE of every session."""
    result = {maker.group: maker.arm(robot, model)}
    for name, turn, place in zip(every.target_names, *frames.targets, strict=True):
        result[f"TOOL {name}"] = maker.frame(compose(invert(robot.flange), Pose(turn, place)))
    for name, turn, place in zip(every.session_names, *frames.bases, strict=True):
        base = compose(robot.base, invert(Pose(turn, place)))
        result[f"BASE {name or ''}".strip()] = maker.frame(base)
    return result


def _mean_error(model: str, errors: residuals.Errors, subset: str) -> MeanError:
    position = residuals.statistics(errors.position_mm)
    turned = residuals.statistics(1e3 * errors.rotation_rad)
    mean, count = (position.mean, position.n) if position else (np.nan, 0)
    return MeanError(model, mean, turned.mean if turned else np.nan, count, POSES[subset])


def _recorded(tables: Tables, kind: str, model: str) -> MeanError:
    """The error of a model as the table of residuals has it, held out where it was."""
    table = pd.DataFrame(tables["residuals"])
    table = table[(table["comparison"] == f"{kind}_vs_measured") & table["fold"].isna()]
    subset = max(table["subset"])  # validation, where there is one
    rows = table[table["subset"] == subset].set_index("quantity")
    turned = rows["mean"].get("orientation", np.nan)
    place = rows.loc["position"]
    return MeanError(model, float(place["mean"]), float(turned), int(place["n"]), POSES[subset])
