"""Joints that bend under gravity, as the estimator gets them back from what was measured."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
from oracles import compliant_arm as oracle

from kinacc.calibration import models, tables, uncertainty
from kinacc.calibration.compliance_fit import ComplianceEstimator
from kinacc.calibration.observations import full_poses
from kinacc.config.schema import defaults
from kinacc.geometry import Pose
from kinacc.kinematics import robot

ARM = robot.load("mh180")
LINKS = [
    oracle.Body(200.0, (50.0, 0.0, -100.0)),
    oracle.Body(150.0, (-600.0, 0.0, 0.0)),
    oracle.Body(120.0, (-20.0, 0.0, 60.0)),
    oracle.Body(40.0, (0.0, 0.0, -300.0)),
    oracle.Body(20.0, (0.0, 0.0, 10.0)),
    oracle.Body(5.0, (0.0, 0.0, -40.0)),
]
NOISE_MM = 0.03
SOFT = {2: 0.8e-6, 3: 1.1e-6}  # rad per N m


def measured(count=150):
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.2, 1.2, (count, 6))
    off = np.array([1e-3, 0.4, 0.4, 1e-3, 0.0]) * rng.normal(size=(6, 5))
    true = oracle.Arm(ARM.dh.start.reshape(6, 5) + off, LINKS, SOFT)
    place = np.array([oracle.flange(true, row)[:3, 3] for row in q])
    place += NOISE_MM * rng.normal(size=(count, 3))
    return full_poses(q, Pose(np.full((count, 3, 3), np.nan), place))


def fitted(seen, joints):
    """A fit of stated masses; only the direction of gravity counts."""
    settings = defaults()["calibration"]
    settings["dh"]["fit_to"] = "measurements"
    links = [asdict(body) for body in LINKS]
    settings["compliance"] |= {"joints": joints, "links": links, "gravity": (0.0, 0.0, -9.81)}
    return models.estimators(settings, ARM, seen)["compliance"].fit(seen, {})


def test_a_load_that_is_stated_in_some_rows_only_does_not_change():
    """Where masses are unknown, loads that change show the compliance by itself."""
    settings, seen = defaults()["calibration"], measured(2)
    settings["compliance"] |= {"joints": [2], "payload": {"mass_kg": 5.0, "centre_mm": [0, 0, 9]}}
    for mass_kg, z_mm, changes in ((5.0, 9.0, False), (6.0, 9.0, True), (5.0, 80.0, True)):
        seen.payload[0] = [mass_kg, 0.0, 0.0, z_mm]
        model = ComplianceEstimator.of(settings, ARM, seen).stiff
        assert np.isfinite(model.coefficients[1]).tolist() == [changes, True]


def test_a_joint_that_gravity_does_not_turn_is_undetermined_and_stays_stiff():
    seen = measured()
    found = fitted(seen, [1, 2, 3])  # axis 1 is upright
    known_of = uncertainty.of_fit(found)
    place = known_of.names.index("j1.compliance_rad_per_nm")
    assert not known_of.determined[place]
    assert found.model.coefficients[0, 0] == pytest.approx(0.0, abs=1e-12)
    std = found.std[-2:]
    assert np.all(np.abs(found.model.coefficients[1:3, 0] - [*SOFT.values()]) < 4.0 * std)
    assert np.all(std < 0.1 * np.array([*SOFT.values()]))
    assert np.isnan(found.model.to_columns(found.std)["std_compliance_rad_per_nm"][0])
    columns = tables.fit_columns("compliance_fit", found, known_of)
    assert "j1.compliance_rad_per_nm" in set(columns["parameter"])


@pytest.mark.parametrize(
    ("asked", "wrong"),
    [
        ({"joints": [1, 6]}, []),
        ({"joints": [2, 4]}, ["joints"]),  # joint 4 slides
        ({"joints": [7, 8]}, ["joints", "joints"]),
        ({"joints": [3], "links": LINKS[:5]}, ["links"]),
        ({"joints": [3], "gravity": (0.0, 0.0, 0.0)}, ["gravity"]),
        ({"joints": [3], "gravity": (0.0, 0.0, -9.81)}, []),
    ],
)
def test_bending_of_joints_that_are_not_there_or_slide_is_refused(asked, wrong):
    slides = np.arange(6) == 3
    arm = replace(ARM, dh=replace(ARM.dh, prismatic=slides))
    section = {"links": [], "gravity": (0.0, 0.0, -1.0), **asked}
    contradictions = ComplianceEstimator.contradictions({"compliance": section}, arm)
    assert [keys[0] for keys, *_ in contradictions] == wrong
