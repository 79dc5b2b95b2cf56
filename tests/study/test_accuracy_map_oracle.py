"""Cells of the map against brute force; operating points, where they lie, what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from oracles import kinematics as oracle
from oracles import maps, tables
from scipy.spatial.transform import Rotation
from shared_data import RESULTS
from stages_by_hand import tables_in

from kinacc import geometry
from kinacc.config.schema import defaults
from kinacc.errors import InputError
from kinacc.kinematics import dh, inverse, region, robot, vec
from kinacc.kinematics.inverse import limits
from kinacc.study import accuracy_map, evaluation, operating_points
from kinacc.synthetic.draw import TABLE_II

REFERENCE = np.diag([1.0, -1.0, -1.0])
TURN = math.radians(45)
BOX_LOW = np.deg2rad([-10.0, 0, -30, 5, -10, -10])
CYLINDER = region.Cylinder(1200.0, 900.0, 0.0, 500.0, 0.0, math.radians(60))
LOW, HIGH = oracle.MEASURED_RAD
ARM = robot.load("mh180")
NINE = region.orientations(TURN, "signs_and_zero")
WANTED = accuracy_map.PosesWanted(CYLINDER, REFERENCE, NINE, "dh")
LIMITS = np.radians(oracle.MH180_LIMITS_DEG).T


def two_models(vec, dh, vec_tool=geometry.IDENTITY, dh_tool=geometry.IDENTITY, travel=None):
    """A VEC model as the true arm and a DH model under assessment."""
    by_name = {"vec": (vec, vec_tool), "dh": (dh, dh_tool)}
    return {name: accuracy_map.Equipped(*each, travel=travel) for name, each in by_name.items()}


@pytest.fixture(scope="module")
def arms() -> maps.Arms:
    rng = np.random.default_rng(8)
    nominal = np.array(oracle.MH180)
    tool = oracle.frame(40.0, -25.0, 130.0, Rotation.from_quat([0.6, 0.0, 0.0, 0.8]))
    return maps.Arms(
        dh=nominal + rng.normal(size=(6, 5)) * [5e-4, 0.5, 0.5, 5e-4, 0],
        nominal=nominal,
        series=rng.normal(size=(6, 6, 5)) * np.array([[0.15]] * 3 + [[1.5e-4]] * 3),
        low=LOW,
        high=HIGH,
        dh_tool=tool,
        true_tool=tool @ oracle.frame(0.1, -0.05, 0.08),
        s=(1, -1, 0, 1, 1, -1),
        offsets=rng.normal(size=(6, 2)) * 1e-4,
    )


@pytest.fixture(scope="module")
def models(arms) -> accuracy_map.Models:
    return two_models(
        vec=vec.VECModel(
            dh.DHModel(*arms.nominal.T), arms.low, arms.high, arms.series, arms.offsets
        ),
        dh=dh.DHModel(*arms.dh.T),
        vec_tool=geometry.Pose(arms.true_tool[:3, :3], arms.true_tool[:3, 3]),
        dh_tool=geometry.Pose(arms.dh_tool[:3, :3], arms.dh_tool[:3, 3]),
        travel=np.array(arms.s),
    )


TILTED = oracle.rot_z(0.3)[:3, :3] @ REFERENCE @ oracle.rot_z(-0.2)[:3, :3]


@pytest.mark.parametrize(
    ("angle_deg", "radius", "height", "frame"),
    [(15, 1500.0, 200.0, "slice"), (60, 1950.0, 0.0, "slice"), (30, 1200.0, 0.0, "slice"),
     (0, 2600.0, 500.0, "slice"), (40, 1700.0, 300.0, "base")],
    ids=["inside", "outer", "inner", "beyond_reach", "held to a workpiece"],
)  # fmt: skip
def test_cell_equals_brute_force(arms, models, angle_deg, radius, height, frame):
    angle = math.radians(angle_deg)
    cells = region.Cells(np.array([angle]), np.array([radius]), np.array([height]))
    attitude = in_slice = REFERENCE
    if frame == "base":
        attitude, in_slice = TILTED, oracle.rot_z(-angle)[:3, :3] @ TILTED
    wanted = WANTED._replace(reference=attitude, frame=frame)
    found = accuracy_map.accuracy_map(ARM, models, cells, wanted)
    position, turn, name, count = maps.cell(arms, LIMITS, angle, radius, height, in_slice, TURN)
    assert (found.wanted[0], found.solutions[0]) == (18, count)
    largest = found.position_max_mm[0], found.orientation_max_mrad[0]
    if count == 0:
        counts = ["solutions", "wanted", "extrapolating"]
        assert found.drop(columns=counts).isna().all(axis=None)
        return
    assert largest == pytest.approx((position, turn), abs=1e-7)
    assert found.worst_branch[0] == name


def test_errors_at_joints_are_true_minus_model_tool(arms, models):
    q = np.random.default_rng(0).uniform(LOW, HIGH, (30, 6))
    errors = accuracy_map.errors_at(models, q)
    for i, row in enumerate(q):
        true, model = arms.true_at(row), arms.model_at(row)
        gap = true[:3, 3] - model[:3, 3]
        spin = oracle.rotation_vector(true[:3, :3] @ model[:3, :3].T)
        np.testing.assert_allclose(errors[i], [*gap, *spin], rtol=0, atol=1e-9)


def test_joints_of_a_model_in_a_base_of_its_own_reach_the_wanted_poses(models):
    turn = Rotation.from_rotvec([0.02, -0.01, 0.03]).as_matrix()
    base = geometry.Pose(turn, np.array([5.0, -3.0, 8.0]))
    placed = models["dh"]._replace(base=base)
    wanted = placed.tool_poses(np.random.default_rng(4).uniform(0.6 * LOW, 0.6 * HIGH, (5, 6)))
    moved = models | {"dh": placed}
    found = accuracy_map.joints_of(ARM, moved, wanted, "dh")
    usable = found.status == inverse.Status.FOUND
    assert usable.any(axis=1).all()
    again = placed.tool_poses(found.q_rad[usable])
    rows = np.nonzero(usable)[0]
    np.testing.assert_allclose(again.position_mm, wanted.position_mm[rows], atol=1e-6)


@pytest.mark.parametrize("sequence", ["sobol", "halton"])
def test_operating_points_stand_in_the_space_with_a_wanted_orientation(arms, models, sequence):
    q = operating_points.in_space(ARM, models, WANTED, sequence, 40)
    assert q.shape == (40, 6)
    seen = set()
    for row in q:
        assert ((row >= np.maximum(LOW, LIMITS[0])) & (row <= np.minimum(HIGH, LIMITS[1]))).all()
        tool = arms.model_at(row)
        x, y, z = tool[:3, 3]
        angle = math.atan2(y, x)
        assert 1200 - 1e-6 <= math.hypot(x, y) <= 2100 + 1e-6
        assert -1e-9 <= angle <= math.radians(60) + 1e-9
        assert -1e-6 <= z <= 500 + 1e-6
        relative = (oracle.rot_z(angle)[:3, :3] @ REFERENCE).T @ tool[:3, :3]
        gaps = [np.abs(relative - other).max() for other in NINE.rotation]
        assert min(gaps) < 1e-8
        seen.add((int(np.argmin(gaps)), maps.branch_of(arms.dh, row)))
    assert {branch for _, branch in seen} == set(maps.BRANCHES)
    assert len({orientation for orientation, _ in seen}) >= 7


def test_points_of_one_wrist_have_joint_5_on_one_side(models):
    side = {
        wrist: set(
            np.sign(operating_points.in_space(ARM, models, WANTED, "sobol", 60, wrist)[:, 4])
        )
        for wrist in ("both", "noflip", "flip")
    }
    assert sorted(map(len, side.values())) == [1, 1, 2]
    assert side["noflip"] | side["flip"] == side["both"]


def test_a_box_of_coupled_joints_is_in_reported_angles(models):
    coupling = np.diag([1.0, 1, 1, -1, 1, 1])
    coupling[2, 1] = -1.0
    box = BOX_LOW, np.deg2rad([10.0, 40, 0, 20, 10, 10])
    arm = replace(ARM, joint_map=coupling, q_min_rad=box[0], q_max_rad=box[1])
    everywhere = region.Cylinder(0.0, 1e5, -1e5, 2e5, -np.pi, np.pi)
    q = operating_points.in_joints(arm, models, "sobol", 60, everywhere)
    assert limits.within(limits.reported_joints(arm, q), *box).all()
    assert limits.within(q, LOW, HIGH).all()
    assert (q[:, 3] < 0).all()


def test_a_region_of_joint_draws_is_in_the_base_frame_of_the_arm(models):
    box = BOX_LOW, np.deg2rad([60.0, 40, 0, 20, 10, 10])
    arm = replace(ARM, q_min_rad=box[0], q_max_rad=box[1])
    lifted = replace(arm, base=geometry.Pose(np.eye(3), np.array([0.0, 0.0, 2000.0])))
    higher = replace(CYLINDER, bottom_mm=CYLINDER.bottom_mm + 2000.0)
    q = operating_points.in_joints(arm, models, "sobol", 60, CYLINDER)
    assert np.array_equal(operating_points.in_joints(lifted, models, "sobol", 60, higher), q)


def test_limits_without_anything_to_assess_are_refused(models):
    low, high = ([100.0, -10, -10, -10, -10, 200], [110.0, 10, 10, 10, 10, 210])
    arm = replace(ARM, q_min_rad=np.deg2rad(low), q_max_rad=np.deg2rad(high))
    with pytest.raises(InputError, match=r"only 0 of .* can be assessed"):
        operating_points.in_joints(arm, models, "sobol", 2, CYLINDER)


def test_a_space_out_of_reach_is_refused(models):
    far = WANTED._replace(cylinder=replace(CYLINDER, inner_radius_mm=4000.0))
    with pytest.raises(InputError, match=r"only 0 of .* can be assessed"):
        operating_points.in_space(ARM, models, far, "sobol", 2)


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
    # Joint 5 to 10 degrees leaves only one wrist.
    lower, upper = np.deg2rad(
        [(-20, 80), (-40, 70), (-90, 30), (-190, 190), (-130, 10), (-190, 190)]
    ).T
    fitted = vec.without_errors(TABLE_II, lower, upper, 5)
    cells = region.grid(CYLINDER, np.array([0.2]), 300.0)
    found = accuracy_map.accuracy_map(ARM, two_models(fitted, TABLE_II), cells, WANTED)
    assert (found.solutions == 9).all()
    assert (found.extrapolating == 9).all()
    assert all(name.endswith("front-up-flip") for name in found.worst_branch)


def test_a_configured_tool_stands_on_the_flange_as_that_is_turned():
    flange = geometry.Pose(TILTED, np.array([10.0, 20.0, 30.0]))
    settings = defaults()["evaluation"] | {"tool_mm": [40.0, -25.0, 130.0], "travel_direction": -1}
    models = evaluation.equipped({}, settings, replace(ARM, flange=flange))
    wanted = TILTED @ settings["tool_mm"] + flange.position_mm
    np.testing.assert_allclose(models["nominal"].tool.position_mm, wanted, atol=1e-9)
    assert models["nominal"].travel.tolist() == [-1.0] * 6


def test_the_base_of_a_fitted_vec_model_stands_in_that_of_the_dh_model():
    """A reading is at one place of the instrument's frame, whichever model predicts it."""
    results = RESULTS / "ur10_d"
    models = evaluation.equipped(tables_in(results), defaults()["evaluation"], robot.load("ur10"))
    frames, base = tables.models(results).frames, models["vec"].base
    point_mm = np.array([700.0, -300.0, 500.0])  # in the first frame of the VEC model
    found = frames["dh", "base"] @ [*(base.rotation @ point_mm + base.position_mm), 1.0]
    np.testing.assert_allclose(found, frames["vec", "base"] @ [*point_mm, 1.0], atol=1e-9)
    assert models["dh"].base is None
