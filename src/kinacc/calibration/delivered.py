"""What the calibration stages share: tables as records, and whether there is enough to fit to."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.calibration.models import Fit, estimators
from kinacc.calibration.observations import Observations, from_columns
from kinacc.calibration.system import require_enough
from kinacc.calibration.tables import frames_of
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.tables import models

TRAIN = "train"


def observed(inputs: Mapping, robot: Robot) -> tuple[Observations, np.ndarray]:
    """All observations of ``measurements`` and the mask (n,) of the rows that train."""
    columns = inputs["measurements"]
    return from_columns(columns, robot), np.asarray(columns["subset"]) == TRAIN


def held_out_fold(every: Observations, train: np.ndarray) -> int | None:
    """The fold the delivered models have not seen; None where they have seen all."""
    folds = np.unique(every.fold[~train])
    return int(folds[0]) if len(folds) else None


def delivered_fits(inputs: Mapping, robot: Robot, every: Observations) -> dict[str, Fit]:
    """The models ``inputs`` have with their frames, for targets and sessions of ``every``."""
    names, fits = (every.target_names, every.session_names), {}
    for kind, model in models(inputs, robot.dh).items():
        frames = inputs.get("frames", inputs.get(f"{kind}_frames"))
        if frames is not None:
            fits[kind] = Fit(model, frames_of(frames, kind, *names))
    return fits


def require_enough_rows(inputs: Mapping, robot: Robot, calibration: Mapping) -> None:
    """Raise InputError where the training rows have fewer residuals than a fit has parameters.

    The fits ask themselves as well; asked beforehand, nothing is remade from data that cannot do.
    """
    every, train = observed(inputs, robot)
    training = every.select(train)
    for estimator in estimators(calibration, robot, every).values():
        frames, common = 0, estimator.common
        if common.frames_estimated and len(training):
            frames = int(common.terms(training).free.sum())
        require_enough(training, estimator.required + frames, estimator.name, estimator.fix)
