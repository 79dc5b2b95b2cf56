"""Rotations and frames against scipy's Rotation and plain 4x4 algebra, hard angles included."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import kinematics as oracle
from scipy.spatial.transform import Rotation

from kinacc import geometry

ANGLES = [0.0, 1e-12, 1e-8, 1e-4, 0.3, 2.0, 3.1, math.pi - 1e-4, math.pi - 1e-8, math.pi]


def direction(seed: int) -> np.ndarray:
    vector = np.random.default_rng(seed).normal(size=3)
    return vector / np.linalg.norm(vector)


unit = st.integers(0, 2**32 - 1).map(direction)


@pytest.mark.parametrize("angle", ANGLES)
@given(axis=unit)
def test_exponential_and_logarithm(angle, axis):
    rotation = geometry.exp_so3(axis * angle)
    np.testing.assert_allclose(
        rotation, Rotation.from_rotvec(axis * angle).as_matrix(), rtol=0, atol=1e-14
    )
    log = geometry.log_so3(rotation)
    assert np.linalg.norm(log) <= math.pi + 1e-12
    error = min(np.abs(log - axis * angle).max(), np.abs(log - axis * (angle - 2 * math.pi)).max())
    assert error <= 1e-9


@given(axis=unit, seed=st.integers(0, 2**32 - 1))
def test_projection_is_the_nearest_rotation(axis, seed):
    rng = np.random.default_rng(seed)
    matrix = Rotation.from_rotvec(axis * rng.uniform(0, math.pi)).as_matrix()
    matrix = matrix + rng.normal(size=(3, 3)) * 0.05
    np.testing.assert_allclose(
        geometry.project_so3(matrix), oracle.nearest_rotation(matrix), rtol=0, atol=1e-13
    )


@pytest.mark.parametrize("angle", ANGLES)
@given(axis=unit)
def test_quaternions(angle, axis):
    rotation = Rotation.from_rotvec(axis * angle)
    wxyz = geometry.quaternion_from_rotation(rotation.as_matrix())
    assert wxyz[0] >= 0
    assert abs(np.linalg.norm(wxyz) - 1) <= 1e-14
    expected = rotation.as_quat(scalar_first=True)
    assert min(np.abs(wxyz - expected).max(), np.abs(wxyz + expected).max()) <= 1e-14
    np.testing.assert_allclose(
        geometry.rotation_from_quaternion(wxyz), rotation.as_matrix(), rtol=0, atol=1e-14
    )


@given(seed=st.integers(0, 2**32 - 1))
def test_compose_and_invert_are_matrix_algebra(seed):
    rng = np.random.default_rng(seed)
    frames = [
        oracle.pose_matrix(
            *rng.normal(size=3) * 500, Rotation.random(rng=rng).as_quat()[[3, 0, 1, 2]]
        )
        for _ in range(2)
    ]
    poses = [geometry.Pose(frame[:3, :3], frame[:3, 3]) for frame in frames]
    both = geometry.compose(*poses)
    product = frames[0] @ frames[1]
    np.testing.assert_allclose(both.position_mm, product[:3, 3], rtol=0, atol=1e-11)
    np.testing.assert_allclose(both.rotation, product[:3, :3], rtol=0, atol=1e-14)
    back = geometry.invert(poses[0])
    inverse = np.linalg.inv(frames[0])
    np.testing.assert_allclose(back.position_mm, inverse[:3, 3], rtol=0, atol=1e-10)
    np.testing.assert_allclose(back.rotation, inverse[:3, :3], rtol=0, atol=1e-13)
