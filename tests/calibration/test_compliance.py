"""Joints that bend under gravity, as the estimator gets them back from what was measured.

The arms are bent here by plain products of matrices, which share nothing with the model.
"""

from __future__ import annotations

import copy

import numpy as np
import pytest

from kinacc.calibration import models, tables, uncertainty
from kinacc.calibration.observations import Observations
from kinacc.config.schema import defaults
from kinacc.kinematics import robot

ARM = robot.load("mh180")
MASSES = np.array([200.0, 150.0, 120.0, 40.0, 20.0, 5.0])
CENTRES = np.array(
    [[50, 0, -100], [-600, 0, 0], [-20, 0, 60], [0, 0, -300], [0, 0, 10], [0, 0, -40]]
).astype(float)
STIFF, NOISE_MM = np.zeros(6), 0.03
SOFT = np.array([0.0, 0.8e-6, 1.1e-6, 0.0, 0.0, 0.0])  # rad per N m


def motion(axis, angle, shift=(0.0, 0.0, 0.0)):
    made, (i, j) = np.eye(4), {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    made[i, i] = made[j, j] = np.cos(angle)
    made[j, i], made[i, j] = np.sin(angle), -np.sin(angle)
    made[:3, 3] = shift
    return made


def chain(model, q):
    frames = [np.eye(4)]
    for i in range(6):
        at = motion("z", q[i] + model.theta_offset_rad[i], (0.0, 0.0, model.d_mm[i]))
        at = at @ motion("x", 0.0, (model.a_mm[i], 0.0, 0.0)) @ motion("x", model.alpha_rad[i])
        frames.append(frames[-1] @ at @ motion("y", model.beta_rad[i]))
    return frames


def bent(model, q, compliance, payload, gravity=(0.0, 0.0, -1.0)):
    """Flange of an arm whose joints turn by compliance times moment, N m."""
    frames, turns = chain(model, q), np.zeros(6)
    for joint in range(6):
        force = [
            (m * 9.80665 * np.array(gravity), (frames[i + 1] @ [*c, 1.0])[:3])
            for i, (m, c) in enumerate(zip(MASSES, CENTRES, strict=True))
            if i >= joint
        ]
        force.append(
            (payload[0] * 9.80665 * np.array(gravity), (frames[6] @ [*payload[1:], 1])[:3])
        )
        z, o = frames[joint][:3, 2], frames[joint][:3, 3]
        turns[joint] = compliance[joint] * sum(
            z @ np.cross((place - o) / 1e3, weight) for weight, place in force
        )
    return chain(model, q + turns)[6]


def measured(compliance, payload=None, count=150, seed=0):
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.2, 1.2, (count, 6))
    off = np.array([1e-3, 0.4, 0.4, 1e-3, 0.0]) * rng.normal(size=(6, 5))
    true = ARM.dh.with_parameters(ARM.dh.start + off.ravel())
    carried = np.zeros((count, 4)) if payload is None else payload
    seen = np.array([bent(true, q[i], compliance, carried[i]) for i in range(count)])
    zeros = np.zeros(count, dtype=int)
    return Observations(
        q, np.zeros((count, 6), np.int8), seen[:, :3, 3] + NOISE_MM * rng.normal(size=(count, 3)),
        np.full((count, 3, 3), np.nan), np.arange(count), zeros, zeros, np.arange(count) % 3,
        payload=payload,
    )  # fmt: skip


def settings(joints=(2, 3), links=True, **changes):
    made = copy.deepcopy(defaults()["calibration"])
    made["dh"]["fit_to"] = "measurements"
    stated = [{"mass_kg": m, "centre_mm": list(c)} for m, c in zip(MASSES, CENTRES, strict=True)]
    made["compliance"] |= {"joints": list(joints), "links": stated if links else []} | changes
    return made


def fitted(seen, **given):
    return models.estimators(settings(**given), ARM, seen)["compliance"].fit(seen, {})


def test_stated_masses_give_the_compliance_of_each_joint():
    found = fitted(measured(SOFT))
    std = found.std[-2:]
    assert np.all(np.abs(found.model.compliance_rad_per_nm[1:3] - SOFT[1:3]) < 4.0 * std)
    assert np.all(std < 0.1 * SOFT[1:3])
    assert np.isnan(found.model.lever_coefficient_rad_per_mm).all()
    assert np.sqrt(found.solution.variance) == pytest.approx(NOISE_MM, rel=0.15)


def test_a_joint_that_gravity_does_not_turn_is_undetermined_and_stays_stiff():
    seen = measured(SOFT)
    found = fitted(seen, joints=(1, 2, 3))  # axis 1 is upright
    known_of = uncertainty.of_fit(found, seen.target_names)
    place = known_of.names.index("j1.compliance_rad_per_nm")
    assert not known_of.determined[place]
    assert found.model.compliance_rad_per_nm[0] == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(found.model.to_columns(found.std)["std_compliance_rad_per_nm"][0])
    columns = tables.fit_columns("compliance_fit", found, known_of)
    assert "j1.compliance_rad_per_nm" in set(columns["parameter"])
