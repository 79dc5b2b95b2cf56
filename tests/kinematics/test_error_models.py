"""Every kind of error model keeps what the protocol promises; a new kind needs an example here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibration.simulated import wavy
from kinematics.inverse.arms import STANFORD
from pose_checks import assert_same, movement

from kinacc.calibration.uncertainty import scale_of
from kinacc.config.error_models import ERROR_MODELS
from kinacc.geometry import Pose
from kinacc.kinematics import compliance, dh, robot, vec
from kinacc.kinematics.model import JointState
from kinacc.kinematics.tables import of_kind

ARM = robot.load("mh180")
COUNT = 8


def dh_example(arm=ARM.dh):
    rng = np.random.default_rng(0)
    return replace(arm, d_mm=arm.d_mm + rng.normal(size=6), beta_rad=1e-3 * rng.normal(size=6))


def vec_example(arm=ARM.dh):
    span = np.where(arm.prismatic, 600.0, 2.0)
    return wavy(vec.without_errors(arm, -span, span, 3), np.random.default_rng(1))


def compliance_example(arm=ARM.dh):
    """Joints of both kinds, of none and of one, below known links and a payload, on a slope."""
    rng, nothing = np.random.default_rng(4), np.nan
    links = np.hstack([rng.uniform(5.0, 300.0, (6, 1)), rng.uniform(-300.0, 300.0, (6, 3))])
    return compliance.ComplianceModel(
        dh_example(arm),
        np.column_stack(
            [
                [1e-6, 2e-6, 3e-6, nothing, nothing, 2e-5],
                [nothing, 1e-6, nothing, 2e-6, nothing, nothing],
            ]
        ),
        np.array([0.6, 0.0, -0.8]),
        links,
        np.array([30.0, 10.0, -20.0, 150.0]),
    )


EXAMPLES = {"dh": dh_example, "vec": vec_example, "compliance": compliance_example}


@pytest.fixture(params=[(kind, arm) for kind in ERROR_MODELS for arm in (ARM.dh, STANFORD.dh)])
def model(request):
    kind, arm = request.param
    return EXAMPLES[kind](arm)


@pytest.fixture
def at(model):
    """Postures that travel in all directions and carry different loads, or what is stated."""
    rng = np.random.default_rng(2)
    payload = np.array([20.0, 100.0, 100.0, 100.0]) * rng.uniform(0.0, 1.0, (COUNT, 4))
    payload[0] = np.nan
    q = rng.uniform(-1.0, 1.0, (COUNT, 6)) * np.where(model.dh.prismatic, 500.0, 1.0)
    return JointState(q, rng.integers(-1, 2, (COUNT, 6)), payload)


def test_slopes_in_the_joints_are_those_of_the_pose(model, at):
    slopes = model.joint_jacobian(at)
    for joint, step in enumerate(np.where(model.dh.prismatic, 1e-3, 1e-6)):
        shift = step * np.eye(6)[joint]
        ends = (model.pose(at.moved(at.q_rad + way * shift)) for way in (-1, 1))
        np.testing.assert_allclose(
            slopes[:, :, joint], movement(*ends) / (2.0 * step), rtol=1e-6, atol=1e-4
        )


def test_every_parameter_has_a_name_a_slope_and_a_place_in_the_table(model, at):
    names, slopes, step = model.names, model.linearised(at)[1], 1e-5
    assert len(set(names)) == len(names)
    assert slopes.shape == (COUNT, 6, len(names))
    assert len(model.units) == len(model.prior_std) == len(names)
    x, unit = model.start, np.array([scale_of(name) for name in names])
    unit = np.where(unit < 1e-3, unit, 1.0)
    for direction in np.random.default_rng(3).normal(size=(3, len(names))) * unit:
        ends = (model.with_parameters(x + way * direction).pose(at) for way in (-step, step))
        moved = movement(*ends) / (2.0 * step)
        np.testing.assert_allclose(slopes @ direction, moved, rtol=1e-5, atol=1e-3)


def test_a_model_comes_back_from_its_table_bit_by_bit(model, at):
    columns = model.to_columns(np.ones(len(model.names)))
    again = of_kind(model.kind).from_columns(columns, model.dh)
    for one, other in zip(model.pose(at), again.pose(at), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(model.domain, again.domain)


def test_a_model_that_is_a_table_of_parameters_says_so_truly(model, at):
    plain = model.dh if model.table is None else model.table
    apart = np.abs(movement(plain.pose(at), model.pose(at))).max()
    assert apart > 1e-3 if model.table is None else apart == 0.0


def test_a_pose_does_not_depend_on_the_batch_it_is_in():
    q = np.random.default_rng(5).uniform(-7.0, 7.0, (9000, 6))
    q[17] = np.nan
    model, rows = dh_example(), [0, 18, 4095, 4096, 8999]
    rotation, position_mm = dh.forward(model, q)
    for row in rows:
        alone = dh.forward(model, q[row])
        assert_same(Pose(rotation[[row]], position_mm[[row]]), alone, 1e-9, 1e-14)
