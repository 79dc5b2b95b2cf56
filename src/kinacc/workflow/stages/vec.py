"""Fit the VEC model to the training poses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.calibration import models, tables, uncertainty
from kinacc.kinematics import robot
from kinacc.workflow import calibration_settings as shared


def run(inputs: Mapping, settings: Mapping, progress=None) -> dict[str, dict[str, np.ndarray]]:
    """``vec_model``, its covariance, ``vec_frames`` and ``vec_fit`` of the rows that train.

    ``vec_orders`` says how order and prior were chosen, where they were not stated.
    """
    arm, calibration = robot.load(settings["robot"]), settings["calibration"]
    options = shared.options(calibration, arm)
    every, train = shared.observed(inputs, arm)
    joint_range = shared.joint_range_rad(calibration["vec"], arm, every.q_rad)
    choices = []
    if options.grid is not None:
        choices = models.choose_vec(every, arm.dh, joint_range, options, progress)
    orders = tables.vec_orders_columns(choices, (options.order, options.prior))
    options = shared.chosen(options, orders, shared.held_out_fold(every, train))
    observations = every.select(train)
    fitted = models.fit_vec(observations, arm.dh, joint_range, options)
    gauge = models.vec_gauge(observations, fitted, options)
    frames = {"vec": fitted.frames}
    known = uncertainty.of_fit(fitted, every.target_names)
    return {
        "vec_model": fitted.model.to_columns(fitted.std),
        "vec_frames": tables.frames_columns(frames, every.target_names, every.session_names),
        "vec_fit": tables.vec_fit_columns(fitted, gauge),
        "vec_covariance": tables.covariance_columns(known),
        "vec_orders": orders,
    }
