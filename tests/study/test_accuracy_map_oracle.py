"""Cells of the accuracy map, and the study's operating points, against brute force."""

from __future__ import annotations

import math

import numpy as np
import pytest
from oracles import kinematics as oracle
from oracles import maps
from two_models import two_models

from kinacc import geometry
from kinacc.kinematics import dh, region, robot, vec
from kinacc.study import accuracy_map, operating_points

REFERENCE = np.diag([1.0, -1.0, -1.0])
TURN = math.radians(45)
CYLINDER = region.Cylinder(1200.0, 900.0, 0.0, 500.0, 0.0, math.radians(60))
LOW, HIGH = np.radians([(-12, 72), (-30, 54), (-74, 18), (-180, 180), (-122, 122), (-180, 180)]).T
LIMITS = np.radians(oracle.MH180_LIMITS_DEG).T


@pytest.fixture(scope="module")
def arms() -> maps.Arms:
    rng = np.random.default_rng(8)
    nominal = np.array(oracle.MH180)
    tool = oracle.pose_matrix(40.0, -25.0, 130.0, [0.8, 0.6, 0.0, 0.0])
    return maps.Arms(
        dh=nominal + rng.normal(size=(6, 5)) * [5e-4, 0.5, 0.5, 5e-4, 0],
        nominal=nominal,
        series=rng.normal(size=(6, 6, 5)) * np.array([[0.15]] * 3 + [[1.5e-4]] * 3),
        low=LOW,
        high=HIGH,
        dh_tool=tool,
        true_tool=tool @ oracle.pose_matrix(0.1, -0.05, 0.08, [1.0, 0.0, 0.0, 0.0]),
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
    rotations = region.orientations(TURN, "signs_and_zero")
    attitude = in_slice = REFERENCE
    if frame == "base":
        attitude, in_slice = TILTED, oracle.rot_z(-angle)[:3, :3] @ TILTED
    wanted = accuracy_map.PosesWanted(CYLINDER, attitude, rotations, "dh", frame)
    found = accuracy_map.accuracy_map(robot.load("mh180"), models, cells, wanted)
    position, turn, name, count = maps.cell(arms, LIMITS, angle, radius, height, in_slice, TURN)
    assert (found.wanted[0], found.solutions[0]) == (18, count)
    largest = found.position_max_mm[0], found.orientation_max_mrad[0]
    if count == 0:
        assert np.isnan([*largest, *found.worst_q_rad[0]]).all()
        assert (found.worst_branch[0], found.orientation_worst_branch[0]) == (None, None)
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


@pytest.mark.parametrize("sequence", ["sobol", "halton"])
def test_operating_points_stand_in_the_space_with_a_wanted_orientation(arms, models, sequence):
    rotations = region.orientations(TURN, "signs_and_zero")
    wanted = accuracy_map.PosesWanted(CYLINDER, REFERENCE, rotations, "dh")
    q = operating_points.in_space(robot.load("mh180"), models, wanted, sequence, 40)
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
        gaps = [np.abs(relative - other).max() for other in rotations.rotation]
        assert min(gaps) < 1e-8
        seen.add((int(np.argmin(gaps)), maps.branch_of(arms.dh, row)))
    assert {branch for _, branch in seen} == set(maps.BRANCHES)
    assert len({orientation for orientation, _ in seen}) >= 7
