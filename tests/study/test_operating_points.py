"""Operating points: where they lie, in which order, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_accuracy_map import ARM, RANGE, SPACE, TABLE_II, WANTED, wavy
from two_models import two_models

from kinacc.errors import InputError
from kinacc.kinematics.inverse import limits
from kinacc.study import operating_points

TRUE = wavy()
MODELS = two_models(TRUE, TABLE_II)


def test_points_of_one_wrist_have_joint_5_on_one_side():
    side = {
        wrist: set(
            np.sign(operating_points.in_space(ARM, MODELS, WANTED, "sobol", 60, wrist)[:, 4])
        )
        for wrist in ("both", "noflip", "flip")
    }
    assert sorted(map(len, side.values())) == [1, 1, 2]
    assert side["noflip"] | side["flip"] == side["both"]


def test_a_box_of_coupled_joints_is_in_reported_angles():
    coupling = np.diag([1.0, 1, 1, -1, 1, 1])
    coupling[2, 1] = -1.0
    arm = replace(ARM, joint_map=coupling)
    box = np.deg2rad([-10.0, 0, -30, 5, -10, -10]), np.deg2rad([10.0, 40, 0, 20, 10, 10])
    q = operating_points.in_joints(arm, MODELS, box, "sobol", 60)
    assert limits.within(limits.reported_joints(arm, q), *box).all()
    assert limits.within(q, *RANGE).all()
    assert (q[:, 3] < 0).all()


def test_boxes_without_anything_to_assess_name_every_joint():
    box = np.deg2rad([100.0, -10, -10, -10, -10, 200]), np.deg2rad([110.0, 10, 10, 10, 10, 210])
    with pytest.raises(InputError) as refusal:
        operating_points.in_joints(ARM, MODELS, box, "sobol", 10)
    assert [problem.where for problem in refusal.value.problems] == ["joint 1", "joint 6"]


def test_a_space_out_of_reach_is_refused_with_the_reasons_counted():
    far = WANTED._replace(cylinder=replace(SPACE, inner_radius_mm=4000.0))
    with pytest.raises(InputError, match="out of reach"):
        operating_points.in_space(ARM, MODELS, far, "sobol", 2)


def test_rows_are_spread_over_the_measured_ones_each_once():
    assert sorted(operating_points.spread_rows(39, 39)) == list(range(39))
    assert sorted(operating_points.spread_rows(1, 5)) == [0]
    rows = operating_points.spread_rows(632, 200)
    assert len(set(rows.tolist())) == 200
    assert np.diff(np.sort(rows)).max() <= 8
    assert np.array_equal(rows[:50], operating_points.spread_rows(632, 50))
