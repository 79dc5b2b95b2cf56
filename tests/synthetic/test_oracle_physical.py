"""The synthetic arm's chain and its gravity torques against plain 4x4 algebra and virtual work."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import kinematics as oracle
from pose_checks import assert_same, of_matrices
from scipy.spatial.transform import Rotation

from kinacc.kinematics.dh import DHModel
from kinacc.synthetic import physical

LOW, HIGH = np.radians(oracle.MH180_LIMITS_DEG).T


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_errors_stand_in_front_of_their_joints_as_true_rotations(seed):
    rng = np.random.default_rng(seed)
    table = np.array(oracle.MH180) + rng.normal(size=(6, 5)) * [1e-3, 1, 1, 1e-3, 0]
    q = rng.uniform(LOW, HIGH, (2, 6))
    errors = rng.normal(size=(2, 6, 6)) * [1, 1, 1, 5e-3, 5e-3, 5e-3]
    pose = physical.chain(DHModel(*table.T), q, errors)
    frames = np.tile(np.eye(4), (2, 1, 1))
    for n, i in np.ndindex(2, 6):
        error = oracle.frame(*errors[n, i, :3], Rotation.from_rotvec(errors[n, i, 3:]))
        frames[n] = frames[n] @ error @ oracle.dh_forward(table[[i]], q[n, [i]])
    assert_same(pose, of_matrices(frames), 1e-9, 1e-12)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_gravity_torque_is_the_slope_of_the_potential_energy(seed):
    q = np.random.default_rng(seed).uniform(LOW, HIGH)
    step = 1e-30  # of a complex number: exact to rounding
    frames = np.broadcast_arrays(*oracle.dh_frames(oracle.MH180, q + 1j * step * np.eye(6)))
    energy = np.zeros(6, dtype=complex)
    for frame, share, mass in physical._MASSES:
        start, end = (frames[i][:, 2, 3] for i in (4 if frame == 6 else frame - 1, frame))
        energy += mass * 9.81 * 1e-3 * (start + share * (end - start))
    torque = physical.gravity_torque_knm(DHModel(*np.array(oracle.MH180).T), q[None])[0]
    np.testing.assert_allclose(torque, -1e-3 * energy.imag / step, rtol=0, atol=1e-7)
    assert abs(torque[0]) < 1e-9  # axis 1 is vertical
