"""Joints that bend under gravity, as the estimator gets them back from what was measured.

The arms are bent here by plain products of matrices, which share nothing with the model.
"""

from __future__ import annotations

import copy

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinacc.calibration import models, tables, uncertainty
from kinacc.calibration.observations import full_poses
from kinacc.config.schema import defaults
from kinacc.geometry import Pose
from kinacc.kinematics import robot

ARM = robot.load("mh180")
MASSES = np.array([200.0, 150.0, 120.0, 40.0, 20.0, 5.0])
CENTRES = np.array(
    [[50, 0, -100], [-600, 0, 0], [-20, 0, 60], [0, 0, -300], [0, 0, 10], [0, 0, -40]]
).astype(float)
NOISE_MM = 0.03
SOFT = np.array([0.0, 0.8e-6, 1.1e-6, 0.0, 0.0, 0.0])  # rad per N m


def chain(model, q):
    """Frames before and after every joint."""
    frames = [np.eye(4)]
    for i in range(6):
        step = np.eye(4)
        turn_x = Rotation.from_rotvec([model.alpha_rad[i], 0, 0])
        turn = Rotation.from_rotvec([0, 0, q[i] + model.theta_offset_rad[i]])
        step[:3, :3] = (turn * turn_x * Rotation.from_rotvec([0, model.beta_rad[i], 0])).as_matrix()
        step[:3, 3] = turn.apply([model.a_mm[i], 0.0, model.d_mm[i]])
        frames.append(frames[-1] @ step)
    return frames


def bent(model, q, compliance):
    """Flange of an arm whose joints turn by compliance times moment, N m; gravity along -z."""
    frames, turns = chain(model, q), np.zeros(6)
    places = [(frames[i + 1] @ [*CENTRES[i], 1.0])[:3] for i in range(6)]
    for joint in range(6):
        z, o = frames[joint][:3, 2], frames[joint][:3, 3]
        moments = [
            z @ np.cross((places[i] - o) / 1e3, [0.0, 0.0, -9.80665 * MASSES[i]])
            for i in range(joint, 6)
        ]
        turns[joint] = compliance[joint] * sum(moments)
    return chain(model, q + turns)[6]


def measured(count=150):
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.2, 1.2, (count, 6))
    off = np.array([1e-3, 0.4, 0.4, 1e-3, 0.0]) * rng.normal(size=(6, 5))
    true = ARM.dh.with_parameters(ARM.dh.start + off.ravel())
    place = np.array([bent(true, row, SOFT)[:3, 3] for row in q])
    place += NOISE_MM * rng.normal(size=(count, 3))
    return full_poses(q, Pose(np.full((count, 3, 3), np.nan), place))


def fitted(seen, joints, gravity=(0.0, 0.0, -1.0)):
    settings = copy.deepcopy(defaults()["calibration"])
    settings["dh"]["fit_to"] = "measurements"
    links = [{"mass_kg": m, "centre_mm": list(c)} for m, c in zip(MASSES, CENTRES, strict=True)]
    settings["compliance"] |= {"joints": joints, "links": links, "gravity": gravity}
    return models.estimators(settings, ARM, seen)["compliance"].fit(seen, {})


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -1.0), (0.0, 0.0, -9.81)])
def test_stated_masses_give_the_compliance_of_each_joint(gravity):
    """Only the direction of gravity counts."""
    found = fitted(measured(), [2, 3], gravity)
    std = found.std[-2:]
    assert np.all(np.abs(found.model.coefficients[1:3, 0] - SOFT[1:3]) < 4.0 * std)
    assert np.all(std < 0.1 * SOFT[1:3])
    assert np.isnan(found.model.coefficients[:, 1]).all()
    assert np.sqrt(found.solution.variance) == pytest.approx(NOISE_MM, rel=0.15)


def test_a_joint_that_gravity_does_not_turn_is_undetermined_and_stays_stiff():
    seen = measured()
    found = fitted(seen, [1, 2, 3])  # axis 1 is upright
    known_of = uncertainty.of_fit(found)
    place = known_of.names.index("j1.compliance_rad_per_nm")
    assert not known_of.determined[place]
    assert found.model.coefficients[0, 0] == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(found.model.to_columns(found.std)["std_compliance_rad_per_nm"][0])
    columns = tables.fit_columns("compliance_fit", found, known_of)
    assert "j1.compliance_rad_per_nm" in set(columns["parameter"])
