"""Evaluation space and point sequences against scipy's quasi-random engines and rotations."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from pose_checks import assert_same
from scipy.spatial.transform import Rotation

from kinacc.geometry import Pose
from kinacc.kinematics import region

CYLINDER = region.Cylinder(1200.0, 900.0, 0.0, 500.0, 0.0, math.radians(60))


@pytest.mark.parametrize(
    ("name", "signs"),
    [
        ("signs_and_zero", [*itertools.product((-1, 1), repeat=3), (0, 0, 0)]),
        ("all_27", [*itertools.product((-1, 0, 1), repeat=3)]),
    ],
)
def test_orientations_are_flange_rotations_about_x_then_y_then_z(name, signs):
    angle = math.radians(45)
    found = region.orientations(angle, name).rotation
    assert found.shape == (len(signs), 3, 3)
    wanted = Rotation.from_euler("XYZ", np.array(signs) * angle).as_matrix()
    assert np.abs(wanted[:, None] - found).max(axis=(2, 3)).min(axis=1).max() < 1e-14


def test_grid_covers_every_slice_edges_included_and_no_wider_than_asked():
    slices = np.radians([0, 15, 30, 45, 60])
    cells = region.grid(CYLINDER, slices, 25.0)
    assert len(cells.radius_mm) == 5 * 37 * 21
    for angle in slices:
        here = np.isclose(cells.angle_rad, angle)
        radii = np.unique(cells.radius_mm[here].round(9))
        heights = np.unique(cells.height_mm[here].round(9))
        assert (radii[0], radii[-1]) == (1200, 2100)
        assert (heights[0], heights[-1]) == (0, 500)
        assert np.diff(radii).max() <= 25 + 1e-9
        assert np.diff(heights).max() <= 25 + 1e-9
    odd = region.grid(CYLINDER, slices[:1], 70.0)
    assert np.diff(np.unique(odd.radius_mm)).max() <= 70 + 1e-9
    assert odd.radius_mm.max() == 2100


def test_points_fill_the_volume_evenly():
    cells = region.fill(CYLINDER, region.points("sobol", 4096, 3))
    # Even in volume: the share inside a radius grows with its square.
    for radius in (1400, 1650, 1900):
        share = (radius**2 - 1200**2) / (2100**2 - 1200**2)
        assert np.mean(cells.radius_mm <= radius) == pytest.approx(share, abs=0.01)
    assert np.mean(cells.angle_rad) == pytest.approx(math.radians(30), rel=0.01)
    assert np.mean(cells.height_mm) == pytest.approx(250, rel=0.01)
    flat = np.column_stack(
        [
            cells.radius_mm * np.cos(cells.angle_rad),
            cells.radius_mm * np.sin(cells.angle_rad),
            cells.height_mm,
        ]
    )
    assert region.contains(CYLINDER, flat).all()


def test_tool_poses_turn_with_the_slice():
    cells = region.Cells(np.array([0.0, 0.7]), np.array([1500.0, 1800.0]), np.array([10.0, 400.0]))
    reference = Rotation.from_euler("XYZ", [180, 20, 5], degrees=True)
    relative = Rotation.from_euler("XYZ", [45, -45, 45], degrees=True)
    turned = region.reference_rotation(np.radians([180, 20, 5]))
    poses = region.tool_poses(cells, turned, relative.as_matrix())
    turn = Rotation.from_euler("z", cells.angle_rad[:, None])
    place = turn.apply(np.column_stack([cells.radius_mm, np.zeros(2), cells.height_mm]))
    assert_same(poses, Pose((turn * reference * relative).as_matrix(), place), 1e-10, 1e-14)


def test_sequences_start_at_one_and_can_be_taken_in_pieces():
    for sequence in ("sobol", "halton"):
        whole = region.points(sequence, 40, 5)
        np.testing.assert_array_equal(whole[7:], region.points(sequence, 33, 5, first=8))
        np.testing.assert_array_equal(region.points(sequence, 41, 5, first=0)[1:], whole)
        assert whole.min() > 0.0


def test_a_space_has_its_faces_and_may_cross_half_a_turn():
    def at(radius, angle_deg, height):
        angle = math.radians(angle_deg)
        return np.array([radius * math.cos(angle), radius * math.sin(angle), height])

    raised = region.Cylinder(1200.0, 900.0, 700.0, 500.0, 0.0, math.radians(60))
    for good in [(1200, 0, 700), (2100, 60, 1200)]:
        assert region.contains(raised, at(*good))
    for bad in [(1199, 30, 700), (2101, 30, 700), (1500, -1, 700), (1500, 61, 700),
                (1500, 9, 699), (1500, 9, 1201)]:  # fmt: skip
        assert not region.contains(raised, at(*bad))
    across = region.Cylinder(100.0, 100.0, 0.0, 10.0, math.radians(170), math.radians(190))
    assert region.contains(across, at(150, -175, 5))
    assert not region.contains(across, at(150, 0, 5))
