"""A flange that points one way in every pose: its tool's length is seen by none, whatever model."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from simulated import POSE, disturbed, measure

from kinacc.calibration import constraints, identified, uncertainty
from kinacc.calibration.models import estimators
from kinacc.geometry import Pose
from kinacc.kinematics import robot
from kinacc.workflow.data_sets import read_data_sets

ROOT = Path(__file__).resolve().parents[2]
STATED_MM = 140.0


@cache
def settings():
    paths = [str(ROOT / "config.yaml"), str(ROOT / "examples/ur10.yaml")]
    return read_data_sets(paths).settings["ur10_d"]


def stated_arm():
    return replace(robot.load("ur10"), tool=Pose(np.eye(3), np.array([0.0, 0.0, STATED_MM])))


@cache
def pointing_one_way(kind=POSE, sessions=1):
    """Poses of an arm with axes off by a mrad; the last one as described never tilts."""
    arm, rng = stated_arm(), np.random.default_rng(1)
    q = np.zeros((120, 6))
    q[:, 1:3] = rng.uniform([-1.5, 0.5], [-0.5, 1.5], (120, 2))
    q[:, 0] = rng.uniform(-1.0, 1.0, 120)
    q[:, 4] = q[:, 0] + rng.normal(0.0, 2e-4, 120)  # to what a controller reports
    q[:, 3] = -q[:, 1] - q[:, 2]
    q[:, 5] = rng.uniform(-1.0, 1.0, 120)
    free = constraints.free_parameters(6, (2, 3))
    return measure(disturbed(arm.dh, free, rng), q, kind, rng, sessions=sessions)


@cache
def fitted(kind=POSE, sessions=1, **tool_z):
    """Every model of the same poses by kind, with ``tool_z`` for the rule of that name."""
    seen = pointing_one_way(kind, sessions)
    calibration = deepcopy(settings()["calibration"])
    calibration["vec"] |= {"order": 2}
    calibration["compliance"] = {
        "joints": [2, 3],
        "gravity": [0.0, 0.0, -1.0],
        "payload": {"mass_kg": 0.0, "centre_mm": [0.0, 0.0, 0.0]},
        "links": [],
    }
    calibration["frames"] = {"t0 z": tool_z} if tool_z else {}
    found = {}
    for each in estimators(calibration, stated_arm(), seen).values():
        found[each.kind] = each.fit(seen, found)
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
        known = uncertainty.of_fit(fit, ("t0",))
        left_open = known.undetermined[:, known.names.index("t0.z_mm")]
        assert np.abs(left_open).max(initial=0.0) < 0.1, kind
    known = uncertainty.of_fit(found["dh"], ("t0",))
    table = identified.table(found["dh"], known, pointing_one_way())
    assert dict(zip(table["parameter"], table["status"], strict=True))["t0.z_mm"] == "prior"
