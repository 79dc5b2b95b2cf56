"""The shipped draws of the synthetic arm: numbered, repeatable, and for this arm alone."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.errors import InputError
from kinacc.geometry import quaternion_from_rotation
from kinacc.kinematics import dh, robot
from kinacc.synthetic import accepted, measure

SETTINGS = {"draw": 1, "poses": 10, "tracker_noise_mm": 0.0}


def test_further_draws_leave_the_own_one_out():
    assert accepted.further_draws(0, 3) == [1, 2, 3]
    assert accepted.further_draws(2, 3) == [0, 1, 3]
    with pytest.raises(InputError, match="searches for more"):
        accepted.further_draws(0, len(accepted.rows()))


def test_an_accepted_draw_is_measured_near_its_geometry():
    seen, drawn = measure(robot.load("mh180"), SETTINGS), accepted.accepted_draw(1)
    q_rad = np.column_stack([seen[f"q{joint}"] for joint in range(1, 7)])
    plain = dh.forward(drawn.geometry, q_rad)
    off = np.column_stack([seen[name] for name in ("x_mm", "y_mm", "z_mm")]) - plain.position_mm
    assert 0.05 < np.linalg.norm(off, axis=1).max() < 5.0  # of errors of a calibrated arm
    quaternion = np.column_stack([seen[name] for name in ("qw", "qx", "qy", "qz")])
    assert np.abs(quaternion - quaternion_from_rotation(plain.rotation)).max() < 5e-3
    again = measure(robot.load("mh180"), SETTINGS | {"ripple": 0.0})
    assert 0.01 < np.abs(again["x_mm"] - seen["x_mm"]).max() < 1.0  # another roughness, another arm


def test_another_arm_is_refused():
    with pytest.raises(InputError, match="ur10"):
        measure(robot.load("ur10"), SETTINGS)
