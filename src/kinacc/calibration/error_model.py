"""Fit an error model of one kind to the training poses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.calibration import delivered, models, tables, uncertainty
from kinacc.config.error_models import ESTIMATORS, NOMINAL, PLAINEST
from kinacc.kinematics import robot
from kinacc.tables.columns import Columns


def run(inputs: Mapping, settings: Mapping, kind: str, progress=None) -> dict[str, Columns]:
    """Fit the model of one kind to the training rows.

    The plainest kind, which is fitted last, gathers the ``frames`` of all models.

    Parameters
    ----------
    inputs : mapping
        Tables ``measurements`` and those of models fitted before.
    settings : mapping
        Sections ``robot`` and ``calibration`` of the configuration.
    kind : str
        ``vec``, ``dh``, ``compliance`` or a registered one.
    progress : callable, optional
        Wraps an iterable to show how far a choice is, with a label.

    Returns
    -------
    dict
        ``<kind>_model``, its covariance, its frames and what else its estimator tells.

    Raises
    ------
    FitError
        The fit does not converge.
    InputError
        There are fewer residuals than parameters, or a rule speaks of a frame that is not there.
    """
    arm = robot.load(settings["robot"])
    every, train = delivered.observed(inputs, arm)
    estimator = models.estimators(settings["calibration"], arm, every)[kind]
    choices = estimator.choices(every, progress)
    estimator = estimator.chosen(choices, delivered.held_out_fold(every, train))
    observations = every.select(train)
    fitted = estimator.fit(observations, delivered.delivered_fits(inputs, arm, every))
    frames = {kind: fitted.frames}
    if kind == PLAINEST:
        frames[NOMINAL] = estimator.common.nominal_frames(observations)
    columns = tables.frames_columns(frames, every.target_names, every.session_names)
    name = f"{kind}_frames"
    if kind == PLAINEST:
        name, columns = "frames", _gathered(inputs, columns)
    known = uncertainty.of_fit(fitted)
    return {
        f"{kind}_model": fitted.model.to_columns(fitted.std.ravel()),
        name: columns,
        f"{kind}_covariance": tables.covariance_columns(known),
        **estimator.tables(fitted, known, observations),
        **choices,
    }


def _gathered(inputs: Mapping, new: Columns) -> Columns:
    """Frames of the models fitted before, then ``new``."""
    kinds = reversed(ESTIMATORS)
    others = [inputs[f"{kind}_frames"] for kind in kinds if f"{kind}_frames" in inputs]
    return {
        name: np.concatenate([*(np.asarray(columns[name]) for columns in others), values])
        for name, values in new.items()
    }
