"""Evaluation space: grid, fill, orientations, sequences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import qmc

from kinacc.geometry import rotation_x, rotation_y, rotation_z
from kinacc.kinematics import region

SPACE = region.Cylinder(1200.0, 900.0, -100.0, 500.0, 0.0, np.pi / 3)


@pytest.mark.parametrize("dimensions", range(1, 9))
def test_sequences_are_the_unscrambled_ones_of_scipy(dimensions):
    sobol = qmc.Sobol(dimensions, scramble=False, bits=30).random(1024)
    halton = qmc.Halton(dimensions, scramble=False).random(1000)
    assert np.array_equal(region.points("sobol", 1023, dimensions), sobol[1:])
    assert np.allclose(region.points("halton", 999, dimensions), halton[1:], atol=1e-14)


@given(st.integers(0, 5000), st.integers(1, 40), st.sampled_from(region.SEQUENCES))
def test_sequences_can_be_taken_in_pieces(first, count, sequence):
    whole = region.points(sequence, 2 * count, 5, first)
    pieces = [region.points(sequence, count, 5, first + shift) for shift in (0, count)]
    assert np.array_equal(whole, np.concatenate(pieces))


def test_grid_has_every_edge_and_is_nowhere_wider_than_asked():
    cells = region.grid(SPACE, np.deg2rad([0.0, 60.0]), 25.0)
    assert len(cells.radius_mm) == 2 * 37 * 21
    radii, heights = np.unique(cells.radius_mm), np.unique(cells.height_mm)
    assert (radii[0], radii[-1]) == (1200.0, 2100.0)
    assert (heights[0], heights[-1]) == (-100.0, 400.0)
    odd = region.levels_mm(0.0, 100.0, 30.0)
    assert np.allclose(odd, [0, 25, 50, 75, 100])
    assert np.allclose(region.levels_mm(0.0, 10.0, 30.0), [0, 10])


def test_fill_stays_inside_and_is_even_over_the_volume():
    cells = region.fill(SPACE, region.points("sobol", 4096, 3))
    poses = region.tool_poses(cells, np.eye(3), np.eye(3))
    assert region.contains(SPACE, poses.position_mm).all()
    middle_sq = (SPACE.inner_radius_mm**2 + SPACE.outer_radius_mm**2) / 2
    assert abs(np.mean(cells.radius_mm**2 < middle_sq) - 0.5) < 0.01


def test_contains_knows_every_face():
    def at(radius, angle_deg, height):
        angle = np.deg2rad(angle_deg)
        return np.array([radius * np.cos(angle), radius * np.sin(angle), height])

    for good in [(1200, 0, -100), (2100, 60, 400), (1500, 30, 0)]:
        assert region.contains(SPACE, at(*good))
    for bad in [(1199, 30, 0), (2101, 30, 0), (1500, -1, 0), (1500, 61, 0), (1500, 9, 401)]:
        assert not region.contains(SPACE, at(*bad))
    across = region.Cylinder(100.0, 100.0, 0.0, 10.0, np.deg2rad(170.0), np.deg2rad(190.0))
    assert region.contains(across, at(150, -175, 5))
    assert not region.contains(across, at(150, 0, 5))


def test_orientations_are_turns_about_the_flanges_own_axes():
    eight = region.orientations(np.pi / 4, "signs_and_zero")
    assert len(eight.names) == 9
    assert eight.names[0] == "X0 Y0 Z0"
    assert np.array_equal(eight.rotation[0], np.eye(3))
    number = eight.names.index("X+ Y- Z+")
    angle = np.pi / 4
    expected = rotation_x(angle) @ rotation_y(-angle) @ rotation_z(angle)
    assert np.allclose(eight.rotation[number], expected)
    everything = region.orientations(np.pi / 4, "all_27")
    assert len(set(everything.names)) == 27
    assert set(eight.names) <= set(everything.names)


def test_tool_points_down_in_every_slice():
    cells = region.grid(SPACE, np.deg2rad([0.0, 30.0]), 250.0)
    reference = region.reference_rotation(np.deg2rad([180.0, 0.0, 0.0]))
    poses = region.tool_poses(cells, reference, np.eye(3))
    assert np.allclose(poses.rotation[:, :, 2], [0, 0, -1])
    outward = np.stack([np.cos(cells.angle_rad), np.sin(cells.angle_rad), 0 * cells.angle_rad], 1)
    assert np.allclose(poses.rotation[:, :, 0], outward)
    assert np.allclose(np.hypot(*poses.position_mm[:, :2].T), cells.radius_mm)
