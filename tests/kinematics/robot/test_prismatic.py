"""Arms with sliding joints: forward kinematics and slopes against a plain 4x4 product."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinacc.geometry import Pose, log_so3
from kinacc.kinematics import dh, vec
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.model import JointState

# The Stanford arm, and a six-axis arm on a track.
STANFORD = DHModel(
    np.zeros(6),
    [412.0, 154.0, 0.0, 0.0, 0.0, 263.0],
    np.zeros(6),
    np.deg2rad([-90, 90, 0, -90, 90, 0]),
    np.zeros(6),
    [False, False, True, False, False, False],
)
ON_A_TRACK = DHModel(
    np.deg2rad([0, 20, -90, 0, 5, 0, 30]),
    [100.0, 290, 10, 0, 302, 0, 72],
    [50.0, 0, 270, 70, 0, 5, 0],
    np.deg2rad([90.0, -90, 0.5, -90, 90, -90, 10]),
    np.array([0, 0, 0.01, 0, 0, 0, 0.2]),
    [True] + [False] * 6,
)
ARMS = [STANFORD, ON_A_TRACK]


def one_by_one(model: DHModel, q: np.ndarray) -> np.ndarray:
    """Product of elementary 4x4 matrices, joint by joint."""
    total = np.eye(4)
    for i in range(model.joints):
        slides = model.prismatic[i]
        theta = model.theta_offset_rad[i] + (0.0 if slides else q[i])
        d = model.d_mm[i] + (q[i] if slides else 0.0)
        c, s = np.cos(theta), np.sin(theta)
        ca, sa = np.cos(model.alpha_rad[i]), np.sin(model.alpha_rad[i])
        cb, sb = np.cos(model.beta_rad[i]), np.sin(model.beta_rad[i])
        total = total @ np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, d], [0, 0, 0, 1]])
        total = total @ np.array(
            [[1, 0, 0, model.a_mm[i]], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]]
        )
        total = total @ np.array([[cb, 0, sb, 0], [0, 1, 0, 0], [-sb, 0, cb, 0], [0, 0, 0, 1]])
    return total


def joints(model: DHModel, seed: int, count: int) -> np.ndarray:
    q = np.random.default_rng(seed).uniform(-2.5, 2.5, (count, model.joints))
    q[:, model.prismatic] *= 200.0
    return q


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(ARMS))
def test_poses_are_those_of_the_product_of_matrices(seed, model):
    q = joints(model, seed, 3)
    pose = dh.forward(model, q)
    frames = dh.chain(model, q)
    for row in range(3):
        wanted = one_by_one(model, q[row])
        assert np.abs(pose.position_mm[row] - wanted[:3, 3]).max() < 1e-9
        assert np.abs(pose.rotation[row] - wanted[:3, :3]).max() < 1e-12
        assert np.array_equal(frames.position_mm[row, -1], pose.position_mm[row])


def slope(pose, q: np.ndarray, joint: int, step: float) -> np.ndarray:
    """Central difference (n, 6) of a pose in one joint."""
    ahead, behind = q.copy(), q.copy()
    ahead[:, joint] += step
    behind[:, joint] -= step
    after, before = pose(ahead), pose(behind)
    turn = log_so3(after.rotation @ np.swapaxes(before.rotation, 1, 2))
    return np.hstack([after.position_mm - before.position_mm, turn]) / (2 * step)


@pytest.mark.parametrize("model", ARMS)
def test_joint_slopes_are_those_of_finite_differences(model):
    q = joints(model, 1, 5)
    jacobian = dh.joint_jacobian(model, q)
    for joint in range(model.joints):
        step = 1e-2 if model.prismatic[joint] else 1e-5
        expected = slope(lambda x: dh.forward(model, x), q, joint, step)
        assert np.abs(jacobian[:, :, joint] - expected).max() < 1e-5


@pytest.mark.parametrize("model", ARMS)
def test_parameter_slopes_are_those_of_finite_differences(model):
    q = joints(model, 2, 4)
    jacobian = dh.parameter_jacobian(model, q).reshape(4, 6, -1)
    vector = dh.to_vector(model)
    for number in range(vector.size):
        step = np.zeros(vector.size)
        step[number] = 1e-5
        pose: list[Pose] = [
            dh.forward(dh.with_vector(model, vector + sign * step), q) for sign in (1, -1)
        ]
        moved = (pose[0].position_mm - pose[1].position_mm) / 2e-5
        assert np.abs(jacobian[:, :3, number] - moved).max() < 1e-5
    assert np.array_equal(dh.with_vector(model, vector).prismatic, model.prismatic)


@pytest.mark.parametrize("model", ARMS)
def test_vec_errors_over_a_travel_in_mm_have_exact_slopes(model):
    low = np.where(model.prismatic, -600.0, -3.0)
    plain = vec.without_errors(model, low, -low, 3)
    noise = np.random.default_rng(3).normal(size=plain.coefficients.shape)
    arm = replace(plain, coefficients=noise * np.array([0.3] * 3 + [1e-3] * 3)[:, None])
    q = joints(model, 4, 5)
    jacobian = arm.joint_jacobian(JointState(q))
    for joint in range(model.joints):
        step = 1e-2 if model.prismatic[joint] else 1e-5
        expected = slope(lambda x: vec.pose(arm, x), q, joint, step)
        assert np.abs(jacobian[:, :, joint] - expected).max() < 1e-5
    parameters = arm.linearised(JointState(q))[1]
    direction = np.random.default_rng(5).normal(size=parameters.shape[2])
    ahead = vec.pose(vec.with_vector(arm, vec.to_vector(arm) + 1e-6 * direction), q)
    behind = vec.pose(vec.with_vector(arm, vec.to_vector(arm) - 1e-6 * direction), q)
    moved = (ahead.position_mm - behind.position_mm) / 2e-6
    assert np.abs(parameters[:, :3] @ direction - moved).max() < 1e-2
