"""Rotations and frames against half angles, polar factors and 4x4 algebra, hard angles too."""

from __future__ import annotations

import math

import numpy as np
from oracles import kinematics as oracle
from pose_checks import assert_same, of_matrices

from kinacc import geometry

ANGLES = np.array([0.0, 1e-12, 1e-8, 1e-4, 0.3, 2.0, 3.1, math.pi - 1e-4, math.pi - 1e-8, math.pi])
RNG = np.random.default_rng(0)
AXES = RNG.normal(size=(100, 3))
AXES /= np.linalg.norm(AXES, axis=1, keepdims=True)


def test_rotations_vectors_and_quaternions_are_those_of_half_the_angle():
    vector = ANGLES[:, None, None] * AXES
    rotation, half = (
        geometry.exp_so3(vector),
        np.broadcast_to(ANGLES[:, None, None] / 2, (10, 100, 1)),
    )
    wanted = np.concatenate([np.cos(half), np.sin(half) * AXES], axis=2)
    quaternion = geometry.quaternion_from_rotation(rotation)
    assert (quaternion[..., 0] >= 0).all()
    either = np.minimum(*(np.abs(quaternion + way * wanted).max(axis=2) for way in (-1, 1)))
    assert either.max() <= 1e-14
    back = geometry.rotation_from_quaternion(wanted)
    np.testing.assert_allclose(back, rotation, rtol=0, atol=2e-15)
    np.testing.assert_allclose(
        rotation @ AXES[..., None], np.broadcast_to(AXES[..., None], (10, 100, 3, 1)), atol=1e-14
    )
    trace = np.trace(rotation, axis1=2, axis2=3)
    np.testing.assert_allclose(trace.T, np.tile(1 + 2 * np.cos(ANGLES), (100, 1)), atol=1e-14)
    log = geometry.log_so3(rotation)
    other = (ANGLES - 2 * math.pi)[:, None, None] * AXES  # half a turn is one either way
    error = np.minimum(*(np.abs(log - way).max(axis=2) for way in (vector, other)))
    assert error.max() <= 1e-9


def test_an_orientation_that_was_not_measured_stays_unknown():
    quaternion = np.array([[1.0, 0.0, 0.0, 0.0], [np.nan] * 4])
    rotation = geometry.rotation_from_quaternion(quaternion)
    np.testing.assert_array_equal(rotation[0], np.eye(3))
    assert np.isnan(rotation[1]).all()
    again = geometry.quaternion_from_rotation(rotation)
    np.testing.assert_array_equal(again, quaternion)


def test_projection_is_the_nearest_rotation():
    turned = geometry.exp_so3(AXES * RNG.uniform(0, math.pi, (100, 1)))
    matrix = turned + 0.05 * RNG.normal(size=(100, 3, 3))
    wanted = oracle.nearest_rotation(matrix)
    np.testing.assert_allclose(geometry.project_so3(matrix), wanted, rtol=0, atol=1e-13)


def test_compose_and_invert_are_matrix_algebra():
    frames = np.tile(np.eye(4), (2, 50, 1, 1))
    frames[..., :3, :3] = geometry.exp_so3(AXES.reshape(2, 50, 3))
    frames[..., :3, 3] = 500 * RNG.normal(size=(2, 50, 3))
    first, second = map(of_matrices, frames)
    both = of_matrices(frames[0] @ frames[1])
    assert_same(geometry.compose(first, second), both, 1e-10, 1e-13)
    assert_same(geometry.invert(first), of_matrices(np.linalg.inv(frames[0])), 1e-10, 1e-13)
