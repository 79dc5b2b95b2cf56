"""Fit the VEC model to the training poses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc import robot
from kinacc.calibration import models, tables, uncertainty
from kinacc.stages import calibration_settings as shared


def run(inputs: Mapping, settings: Mapping) -> dict[str, dict[str, np.ndarray]]:
    """``vec_model``, its covariance, ``vec_frames`` and ``vec_fit`` of the rows that train."""
    arm, calibration = robot.load(settings["robot"]), settings["calibration"]
    options = shared.options(calibration)
    every, train = shared.observed(inputs, arm)
    joint_range = shared.joint_range_rad(calibration["vec"], arm, every.q_rad)
    observations = every.select(train)
    fitted = models.fit_vec(observations, arm.dh, joint_range, options)
    gauge = models.vec_gauge(observations, fitted, options)
    return {
        "vec_model": tables.vec_model_columns(fitted),
        "vec_frames": tables.frames_columns(
            {"vec": fitted.frames}, every.target_names, every.session_names
        ),
        "vec_fit": tables.vec_fit_columns(fitted, gauge),
        "vec_covariance": tables.covariance_columns(uncertainty.of_vec(fitted, every.target_names)),
    }
