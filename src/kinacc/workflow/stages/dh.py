"""Fit the DH model by least squares, to the VEC model or to the measurements."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.calibration import identified, models, tables, uncertainty
from kinacc.kinematics import robot
from kinacc.kinematics.vec import VECModel
from kinacc.workflow import calibration_settings as shared


def run(inputs: Mapping, settings: Mapping) -> dict[str, dict[str, np.ndarray]]:
    """``dh_model``, its covariance, ``frames`` of all models and ``dh_fit``, from training rows.

    ``dh_identified`` says which parameters these rows determine.
    """
    arm = robot.load(settings["robot"])
    options = shared.options(settings["calibration"], arm)
    every, train = shared.observed(inputs, arm)
    observations = every.select(train)
    followed = models.Fit(
        VECModel.from_columns(inputs["vec_model"], arm.dh.prismatic),
        tables.frames_of(inputs["vec_frames"], "vec", every.target_names, every.session_names),
    )
    fitted = models.fit_dh(observations, arm.dh, options, followed)
    nominal = models.fit_nominal(observations, arm.dh, options)
    frames = {"dh": fitted.frames, "nominal": nominal.frames}
    others = tables.frames_columns(frames, every.target_names, every.session_names)
    kept = inputs["vec_frames"]
    known = uncertainty.of_fit(fitted, every.target_names)
    told = identified.parameters(fitted, known)
    left_open = identified.left_open(fitted, known, observations)
    return {
        "dh_model": fitted.model.to_columns(fitted.std.ravel()),
        "frames": {
            name: np.concatenate([np.asarray(kept[name]), values])
            for name, values in others.items()
        },
        "dh_fit": tables.dh_fit_columns(fitted, known),
        "dh_covariance": tables.covariance_columns(known),
        "dh_identified": tables.identified_columns(told, left_open, known),
    }
