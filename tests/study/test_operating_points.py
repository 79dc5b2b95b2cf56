"""Operating points, where they lie and what is refused; the map beyond the fitted range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from two_models import two_models

from kinacc.errors import InputError
from kinacc.geometry import Pose
from kinacc.kinematics import region, robot, vec
from kinacc.kinematics.inverse import limits
from kinacc.study import accuracy_map as maps
from kinacc.study import operating_points
from kinacc.synthetic.draw import TABLE_II

ARM = robot.load("mh180")
SPACE = region.Cylinder(1200.0, 900.0, 0.0, 500.0, 0.0, np.pi / 3)
DOWN = region.reference_rotation(np.deg2rad([180.0, 0.0, 0.0]))
NINE = region.orientations(np.pi / 4, "signs_and_zero")
WANTED = maps.PosesWanted(SPACE, DOWN, NINE, "dh")
RANGE = np.deg2rad([-20, -40, -90, -190, -130, -190]), np.deg2rad([80, 70, 30, 190, 130, 190])


def wavy(fitted=RANGE) -> vec.VECModel:
    empty = vec.without_errors(TABLE_II, *fitted, 5)
    noise = np.random.default_rng(3).normal(size=empty.coefficients.shape)
    scale = np.array([0.05] * 3 + [1e-4] * 3)[:, None]
    offsets = np.full((6, 2), [-5e-5, 5e-5])
    return replace(empty, coefficients=noise * scale, direction_offsets_rad=offsets)


MODELS = two_models(wavy(), TABLE_II)


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


def test_a_region_of_joint_draws_is_in_the_base_frame_of_the_arm():
    box = np.deg2rad([-10.0, 0, -30, 5, -10, -10]), np.deg2rad([60.0, 40, 0, 20, 10, 10])
    lifted = replace(ARM, base=Pose(np.eye(3), np.array([0.0, 0.0, 2000.0])))
    higher = replace(SPACE, bottom_mm=SPACE.bottom_mm + 2000.0)
    q = operating_points.in_joints(ARM, MODELS, box, "sobol", 60, SPACE)
    assert np.array_equal(operating_points.in_joints(lifted, MODELS, box, "sobol", 60, higher), q)


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


def test_errors_of_repeats_are_averaged_for_every_target_by_itself():
    errors = {"pose": [0, 0, 0, 0, 1], "target": ["a", "b", "a", "b", "a"], "row": [5, 6, 7, 8, 9]}
    errors |= {"ex_mm": [1.0, -4.0, 3.0, -6.0, 9.0], "ey_mm": [0.0] * 5, "ez_mm": [2.0] * 5}
    columns = {name: np.array(values) for name, values in errors.items()}
    rows, mean_mm = operating_points.measured_errors(
        columns, np.array([True, True, True, True, False])
    )
    assert rows.tolist() == [5, 6]
    assert mean_mm.tolist() == [[2.0, 0.0, 2.0], [-5.0, 0.0, 2.0]]


def test_poses_beyond_the_fitted_range_are_counted_and_left_out():
    lower, upper = (np.array(bound) for bound in RANGE)
    upper[4] = np.deg2rad(10.0)  # leaves only one wrist
    cells = region.grid(SPACE, np.array([0.2]), 300.0)
    found = maps.accuracy_map(ARM, two_models(wavy((lower, upper)), TABLE_II), cells, WANTED)
    assert (found.solutions == 9).all()
    assert (found.extrapolating == 9).all()
    assert all(name.endswith("front-up-flip") for name in found.worst_branch)
