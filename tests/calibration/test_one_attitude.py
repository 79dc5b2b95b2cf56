"""A flange that points one way in every pose: its tool's length is seen by none, whatever model."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from simulated import POSE, disturbed, measure
from test_few_poses import settings

from kinacc.calibration import uncertainty
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.calibration.models import estimators
from kinacc.geometry import Pose
from kinacc.kinematics import robot

STATED_MM = 140.0
ARM = replace(robot.load("ur10"), tool=Pose(np.eye(3), np.array([0.0, 0.0, STATED_MM])))


@cache
def pointing_one_way():
    """Poses of an arm with axes off by a mrad; the last one as described never tilts."""
    rng, q = np.random.default_rng(1), np.zeros((120, 6))
    q[:, 1:3] = rng.uniform([-1.5, 0.5], [-0.5, 1.5], (120, 2))
    q[:, 0] = rng.uniform(-1.0, 1.0, 120)
    q[:, 4] = q[:, 0] + rng.normal(0.0, 2e-4, 120)  # to what a controller reports
    q[:, 3] = -q[:, 1] - q[:, 2]
    q[:, 5] = rng.uniform(-1.0, 1.0, 120)
    return measure(disturbed(ARM.dh, free_parameters(6, (2, 3)), rng), q, POSE, rng)


@cache
def fitted(**tool_z):
    """Every model of the same poses by kind, with ``tool_z`` for the rule of that name."""
    calibration = settings()
    calibration["vec"] |= {"order": 2, "prior": "stated"}
    calibration["compliance"] |= {"joints": [2, 3]}
    calibration["frames"] = {"t0 z": tool_z} if tool_z else {}
    found = {}
    for kind, estimator in estimators(calibration, ARM, pointing_one_way()).items():
        found[kind] = estimator.fit(pointing_one_way(), found)
    return found


def test_every_model_leaves_the_tool_where_the_robot_file_has_it():
    found = fitted()
    assert set(found) == {"vec", "dh", "compliance"}
    for fit in found.values():
        assert fit.frames.tool.position_mm[2] == pytest.approx(STATED_MM, abs=1e-9)
    places = np.array([fit.frames.base.position_mm for fit in found.values()])
    assert np.ptp(places, axis=0).max() < 5.0  # gauges of base and joint 1 differ by mm


@pytest.mark.parametrize("std_mm", [0.5, 2.0])
def test_a_stated_length_of_the_tool_holds_every_model(std_mm):
    found = fitted(value_mm=230.0, prior_std_mm=std_mm)
    for kind, fit in found.items():
        assert fit.frames.tool.position_mm[2] == pytest.approx(230.0, abs=3 * std_mm), kind
        known = uncertainty.of_fit(fit)
        left_open = known.undetermined[:, known.names.index("t0.z_mm")]
        assert np.abs(left_open).max(initial=0.0) < 0.1, kind
