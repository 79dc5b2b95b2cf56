"""What is entered into a robot's controller: a model fitted with the parameters it can take."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from kinacc.calibration import residuals, stages, uncertainty
from kinacc.calibration.dh_estimator import DHEstimator
from kinacc.calibration.fitting import Fit
from kinacc.calibration.identifiability import identified, listed
from kinacc.calibration.observations import Observations
from kinacc.config.error_models import NOMINAL, PLAINEST, model_name
from kinacc.config.records import Settings
from kinacc.deployment.export.controllers import CONTROLLERS, ZEROS, Controller, Numbers
from kinacc.deployment.folder import robot_of, selected_model
from kinacc.deployment.record import POSES
from kinacc.errors import input_error
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics.dh import PARAMETERS
from kinacc.kinematics.robot import Robot
from kinacc.tables.columns import Tables


@dataclass(frozen=True)
class Pendant:
    """Numbers to enter into a controller, and how well the arm is known with them.

    Attributes
    ----------
    values
        Columns group, name, unit, old and new: joint zeros (angle of the axis where the pendant
        shows 0) or the numbers of the arm; TOOL in the flange for every target; BASE, the
        instrument's frame in the robot's base, for every session. Old values: the nominal arm, with
        base and tool fitted to the same poses.
    errors
        Mean errors (position_mm, orientation_mrad) at a number of points of held-out or training
        poses: the model of these numbers first, then the calibrated and the nominal one.
    left_out
        Fitted parameters that the controller does not take.
    undetermined
        What the poses do not determine, a sentence each.
    text
        A file of ``ending``, where the controller reads one.
    """

    controller: str
    robot: str
    data_set: str
    values: pd.DataFrame
    errors: pd.DataFrame
    left_out: tuple[str, ...]
    undetermined: tuple[str, ...]
    enter: str
    remark: str
    text: str
    ending: str


def fit_pendant(tables: Tables, settings: Settings, controller: str, name: str = "") -> Pendant:
    """The numbers for a controller (a key of ``CONTROLLERS``), fitted to measured poses.

    Parameters
    ----------
    tables
        Of a results folder: robot, measurements, residuals and models.
    settings
        The section ``calibration`` of the settings.

    Raises
    ------
    FitError
        A fit does not converge.
    InputError
        The controller cannot take this robot, or there are too few measurements.
    """
    maker, robot = CONTROLLERS[controller], robot_of(tables)
    _require_fitting(robot, maker)
    every, train = stages.observed(tables, robot)
    used = every.select(train)
    estimator = replace(DHEstimator.of(settings, robot, every), follows_vec=False)
    fitted = estimator.free
    taken = fitted & np.isin(PARAMETERS, maker.takes)
    taken_fit = replace(estimator, free=taken).fit(used, {})
    # Joint 1 moves as the base does, the last joint as the tool: where these are fitted, it stays.
    ends = np.isin(np.arange(robot.dh.joints), (0, robot.dh.joints - 1))[:, None]
    free = taken & ~(ends & np.isnan(taken_fit.std))
    estimator = replace(estimator, free=free)
    final = estimator.fit(used, {})
    nominal = Fit(robot.dh, estimator.common.nominal_frames(used))
    models: dict[str, Fit] = {NOMINAL: nominal, PLAINEST: final}

    def refit(observations: Observations, _fold: int) -> dict[str, Fit]:
        return {PLAINEST: estimator.fit(observations, {})}

    folds = np.unique(every.fold[every.fold >= 0])
    if len(folds):
        errors = residuals.cross_validated(every, refit, folds, [PLAINEST])[0]
    else:
        errors = residuals.errors({PLAINEST: final}, used)
    old, new = (_numbers(maker, robot, models[kind], every) for kind in (NOMINAL, PLAINEST))
    values = [
        (group, key, unit, *(round(float(x), 12) + 0.0 for x in (old[group][key][0], value)))
        for group, numbers in new.items()
        for key, (value, unit) in numbers.items()
    ]
    left_out = fitted.any(axis=0) & ~free.any(axis=0)
    return Pendant(
        maker.name,
        robot.name,
        name,
        pd.DataFrame(values, columns=["group", "name", "unit", "old", "new"]),
        _mean_errors(tables, maker, errors[f"{PLAINEST}_vs_measured"]),
        tuple(item.rpartition("_")[0] for item in np.array(PARAMETERS)[left_out]),
        tuple(listed(identified(final, uncertainty.of_fit(final), used))),
        maker.enter,
        maker.remark,
        maker.text(new[maker.group]),
        maker.ending,
    )


def _require_fitting(robot: Robot, maker: Controller) -> None:
    """InputError where the controller cannot take this robot."""
    if robot.dh.prismatic.any():
        message = "has joints that slide: their zeros are lengths, which no export writes"
        raise input_error(f"robot {robot.name}", message)
    if maker.takes != ZEROS and not np.array_equal(robot.joint_map, np.eye(robot.dh.joints)):
        message = (
            f"reports joints with signs or couplings; {maker.name} counts those of its DH table"
        )
        raise input_error(f"robot {robot.name}", message, fix="use --format urdf")


def _mean_errors(tables: Tables, maker: Controller, off: np.ndarray) -> pd.DataFrame:
    """Mean errors of the controller's model, the calibrated and the nominal one."""
    recorded, selected = pd.DataFrame(tables["residuals"]), selected_model(tables)
    recorded = recorded[recorded["fold"].isna()]
    subset = max(recorded["subset"])  # validation, where there is one
    means = recorded[recorded["subset"] == subset].pivot(
        index="comparison", columns="quantity", values="mean"
    )
    models = {
        "controller": f"{maker.name} controller",
        f"{selected}_vs_measured": f"calibrated ({model_name(selected)})",
        f"{NOMINAL}_vs_measured": "nominal, base and tool fitted",
    }
    means = means.reindex(index=[*models], columns=["position", "orientation"])
    position_mm, turn_mrad = (np.linalg.norm(part, axis=1) for part in np.hsplit(off, 2))
    means.loc["controller"] = pd.Series(position_mm).mean(), pd.Series(turn_mrad).mean()
    return pd.DataFrame({
        "model": [*models.values()],
        "position_mm": means["position"].to_numpy(),
        "orientation_mrad": means["orientation"].to_numpy(),
        "points": int(np.isfinite(position_mm).sum()),
        "poses": POSES[subset],
    })  # fmt: skip


def _numbers(maker: Controller, robot: Robot, fit: Fit, every: Observations) -> dict[str, Numbers]:
    """All numbers by group: the arm, TOOL of every target, BASE of every session."""
    result = {maker.group: maker.arm(robot, fit.model.dh)}
    for name, turn, place in zip(every.target_names, *fit.frames.targets, strict=True):
        result[f"TOOL {name}"] = maker.frame(compose(invert(robot.flange), Pose(turn, place)))
    for session, turn, place in zip(every.session_names, *fit.frames.bases, strict=True):
        base = compose(robot.base, invert(Pose(turn, place)))
        result[f"BASE {session or ''}".strip()] = maker.frame(base)
    return result
