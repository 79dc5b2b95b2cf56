"""The map against a loop that does one cell, one pose and one search at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from two_models import two_models

from kinacc.kinematics import region, robot, vec
from kinacc.study import accuracy_map as maps
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


def test_unreachable_cells_are_marked_and_the_others_not_touched():
    cells = region.Cells(np.zeros(3), np.array([1500.0, 2600.0, 4000.0]), np.zeros(3))
    found = maps.accuracy_map(ARM, two_models(wavy(), TABLE_II), cells, WANTED)
    assert found.solutions[0] == 18
    assert 0 < found.solutions[1] < 18
    assert np.isfinite(found.position_max_mm[1])
    assert found.solutions[2] == 0
    assert np.isnan(found.position_max_mm[2])
    assert np.isnan(found.orientation_max_mrad[2])
    assert found.worst_branch[2] is None
    assert found.orientation_worst_branch[2] is None
    assert np.isnan(found.worst_q_rad[2]).all()
    assert np.isfinite(found.worst_q_rad[:2]).all()
    alone = region.Cells(*(axis[:1] for axis in cells))
    first = maps.accuracy_map(ARM, two_models(wavy(), TABLE_II), alone, WANTED)
    assert first.position_max_mm[0] == found.position_max_mm[0]


def test_poses_beyond_the_fitted_range_are_counted_and_left_out():
    lower, upper = (np.array(bound) for bound in RANGE)
    upper[4] = np.deg2rad(10.0)  # leaves only one wrist
    cells = region.grid(SPACE, np.array([0.2]), 300.0)
    found = maps.accuracy_map(ARM, two_models(wavy((lower, upper)), TABLE_II), cells, WANTED)
    assert (found.solutions == 9).all()
    assert (found.extrapolating == 9).all()
    assert all(name.endswith("front-up-flip") for name in found.worst_branch)
