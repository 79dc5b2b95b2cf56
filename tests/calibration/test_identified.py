"""Which parameters data determine, and the sentences about those they do not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from simulated import POINT, POSE, THREE, disturbed, joints, measure

from kinacc.calibration import constraints, fitting, identified, uncertainty
from kinacc.calibration.frames import known
from kinacc.calibration.identifiability import LeftOpen
from kinacc.config import parameter_rules
from kinacc.kinematics import robot


def asked(name, kind=POSE, sessions=1, instead=False, rules=None, moving=None, poses=80):
    """Parameters of a fit to simulated poses by name; joints not in ``moving`` stand still."""
    arm, rng = robot.load(name), np.random.default_rng(0)
    hayati = constraints.parallel_joints(arm.dh)
    free = constraints.free_parameters(arm.dh.joints, hayati, instead)
    q = joints(arm, poses, rng)
    for joint in range(arm.dh.joints) if moving else ():
        if joint + 1 not in moving:
            q[:, joint] = 0.3
    data = measure(disturbed(arm.dh, free, rng), q, kind, rng, sessions=sessions)
    terms = constraints.arm_terms(arm.dh, free, parameter_rules.rules(rules or {}))
    fit = fitting.fit(
        data,
        terms.nominal,
        free=terms.free,
        std=terms.std,
        rotation_weight_mm_per_rad=500.0,
        threshold=1e-3,
    )
    known = uncertainty.of_fit(fit, data.target_names)
    return by_name(identified.table(fit, known, data)), fit


def by_name(table):
    """Rows of ``dh_identified`` by parameter."""
    return pd.DataFrame(dict(table)).set_index("parameter")


def test_what_every_serial_arm_hides():
    found, _ = asked("mh180")
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
    found, _ = asked("ur10", kind, sessions)
    for joint in (2, 3, 4):
        assert "d of joint" in found.statement[f"j{joint}.d_mm"]
    assert ("base2 z" in found.statement["j1.d_mm"]) == (sessions == 2)


OF_ARM = ("base.z_mm", "base.rz_rad", "j1.d_mm", "j1.a_mm", "j2.d_mm", "j3.d_mm", "j3.a_mm")
STRUCTURAL = np.array(
    [[1, 0, -1, 0, 0, 0, 0], [0, 1, 0, -1, 0, 0, 0], [0, 0, 0, 0, 1, -1, 0]], dtype=float
)
WEAK = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])


@pytest.mark.parametrize("seed", range(5))
def test_directions_do_not_depend_on_the_basis_of_their_space(seed):
    rng = np.random.default_rng(seed)

    def rotated(rows):
        return np.linalg.qr(rng.normal(size=(len(rows), len(rows))))[0] @ rows

    lost = rotated(np.concatenate([STRUCTURAL, WEAK]) / np.sqrt(2.0))
    found = LeftOpen.of(rotated(STRUCTURAL), lost, OF_ARM, known())
    parts = {tuple(np.flatnonzero(np.abs(row) > 1e-9)) for row in found.directions}
    assert parts == {(0, 2), (1, 3), (4, 5), (6,)}
    assert found.structural.tolist() == [True, True, True, False]
    np.testing.assert_allclose(np.abs(found.directions).max(axis=1), 1.0)
    assert not len(LeftOpen.of(np.zeros((0, 7)), np.zeros((0, 7)), OF_ARM, known()).directions)
