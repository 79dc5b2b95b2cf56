"""Which parameters data determine, and the sentences about those they do not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from simulated import POINT, POSE, THREE, disturbed, fit, joints, measure

from kinacc.calibration import identifiability, uncertainty
from kinacc.calibration.dh_estimator import free_parameters, parallel_joints
from kinacc.calibration.frames import known
from kinacc.calibration.identifiability import LeftOpen
from kinacc.kinematics import robot


def asked(name, kind=POSE, sessions=1):
    """Table ``dh_identified`` by parameter, of a fit to simulated poses."""
    arm, rng = robot.load(name), np.random.default_rng(0)
    free = free_parameters(6, parallel_joints(arm.dh))
    true, q = disturbed(arm.dh, free, rng), joints(arm, 80, rng)
    data = measure(true, q, kind, rng, sessions=sessions)
    found = fit(data, arm.dh, free)
    known_of = uncertainty.of_fit(found)
    return pd.DataFrame(identifiability.identified(found, known_of, data)).set_index("parameter")


def test_what_every_serial_arm_hides():
    found = asked("mh180")
    expected = {
        "j1.theta_offset_rad": "theta of joint 1 +1 mrad, base rz -1 mrad",
        "j1.d_mm": "d of joint 1 +1 mm, base z -1 mm",
        "j2.d_mm": "d of joint 2 +1 mm, d of joint 3 +1 mm",
        "j3.d_mm": "d of joint 2 +1 mm, d of joint 3 +1 mm",
    }
    for name, parts in expected.items():
        assert found.status[name] == "undetermined"
        assert found.statement[name] == f"{parts}: no pose separates these"
    assert found.status["j4.d_mm"] == "identified"
    assert pd.isna(found.statement["j4.d_mm"])


@pytest.mark.parametrize(("kind", "sessions"), [(POINT, 1), (THREE, 2), (POSE, 2)])
def test_three_parallel_axes_show_one_sum(kind, sessions):
    found = asked("ur10", kind, sessions)
    for joint in (2, 3, 4):
        assert "d of joint" in found.statement[f"j{joint}.d_mm"]
    assert ("base2 z" in found.statement["j1.d_mm"]) == (sessions == 2)


NAMES = ("base.z_mm", "base.rz_rad", "j1.d_mm", "j1.a_mm", "j2.d_mm", "j3.d_mm", "j3.a_mm",
         "base.x_mm", "tool.x_mm")  # fmt: skip
STRUCTURAL = np.zeros((4, 9))
STRUCTURAL[range(4), [0, 1, 4, 7]], STRUCTURAL[range(4), [2, 3, 5, 8]] = 1.0, -1.0
WEAK = np.eye(9)[6:7]


@pytest.mark.parametrize("seed", range(5))
def test_directions_do_not_depend_on_the_basis_of_their_space(seed):
    rng = np.random.default_rng(seed)

    def rotated(rows):
        return np.linalg.qr(rng.normal(size=(len(rows), len(rows))))[0] @ rows

    lost = rotated(np.concatenate([STRUCTURAL, WEAK]) / np.sqrt(2.0))
    found = LeftOpen.of(rotated(STRUCTURAL), lost, NAMES, known())
    parts = {tuple(np.flatnonzero(np.abs(row) > 1e-9)) for row in found.directions}
    assert parts == {(0, 2), (1, 3), (4, 5), (6,), (7, 8)}
    assert found.structural.tolist() == [True] * 4 + [False]
    np.testing.assert_allclose(np.abs(found.directions).max(axis=1), 1.0)
    assert not len(LeftOpen.of(*np.zeros((2, 0, 9)), NAMES, known()).directions)


def test_of_many_parts_of_a_direction_the_six_largest_are_listed():
    names = tuple(f"j{joint}.{name}_mm" for joint in range(1, 5) for name in "da")
    direction = np.array([[0.05, 1.0, 0.3, 0.1, 0.9, 0.2, 0.8, 0.7]])
    (sentence,) = LeftOpen(direction, np.array([True]), names, known()).sentences
    listed = [f"{name[3]} of joint {name[1]}" in sentence for name in names]
    assert listed == (direction[0] > 0.1).tolist()
