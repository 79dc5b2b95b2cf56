"""Base and targets: the closed-form start where it is easy, and where half of it fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pose_checks import assert_same
from simulated import POINT, POSE, THREE, anywhere, measure

from kinacc.calibration.frames import base_from_targets, closed_form_start
from kinacc.calibration.observations import full_poses
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot

ARM = robot.load("ur10")


def exact(kind, count, sessions=1, seed=0):
    """Exact readings, flange poses and the frames they were made with."""
    rng = np.random.default_rng(seed)
    frames = anywhere(rng, 1500.0, sessions), anywhere(rng, 80.0, 3 if kind == THREE else 1)
    q = rng.uniform(-2.5, 2.5, (count, 6))
    seen = measure(ARM.dh, q, kind, rng, 0.0, sessions, frames, noise_rad=0.0)
    return seen, dh.forward(ARM.dh, seen.q_rad), *frames


def assert_close(pose, wanted):
    assert_same(pose, wanted, 1e-5, 1e-8)


@pytest.mark.parametrize("kind", [POSE, POINT])
def test_start_is_exact_on_exact_data(kind):
    seen, flange, bases, tools = exact(kind, 20)
    start = closed_form_start(seen, flange)
    assert_close(start.bases, bases)
    if kind == POINT:
        tools = Pose(np.eye(3)[None], tools.position_mm)
    assert_close(start.targets, tools)


def test_start_survives_a_tool_that_turns_about_one_axis_only():
    """Cube poses with one tool orientation but for turns about the vertical: hand-eye fails."""
    rng = np.random.default_rng(3)
    turns = np.outer(rng.choice([0.0, np.pi / 2, np.pi], 40), [0.0, 0.0, 1.0])
    flange = Pose(exp_so3(turns), rng.uniform(-400, 400, (40, 3)))
    seen = compose(anywhere(rng, 2000.0), compose(flange, anywhere(rng, 80.0)))
    start = closed_form_start(full_poses(np.zeros((40, 6)), seen), flange)
    assert_close(compose(start.base, compose(flange, start.tool)), seen)
    # Along the axis of the turns the tool cannot be told from the base: it is left at zero.
    assert abs(start.tool.position_mm[2]) < 1e-6


@pytest.mark.parametrize("count", [1, 2])
def test_orientations_place_a_base_where_points_are_too_few(count):
    """Two points lie on a line: only the measured orientations tell the turn about it."""
    seen, flange, bases, tools = exact(POSE, count)
    base = base_from_targets(seen, flange, tools)
    assert_close(Pose(base.rotation[None], base.position_mm[None]), bases)


@pytest.mark.parametrize("short", [0, 1])
def test_a_short_session_is_placed_by_the_long_one_whichever_comes_first(short):
    """Two positions say nothing of a base by themselves; a tool found elsewhere places it."""
    seen, flange, bases, tools = exact(POINT, 80, 2, 7)
    rows = np.flatnonzero((seen.session != short) | (seen.pose < 6))
    start = closed_form_start(seen.select(rows), Pose(*(part[rows] for part in flange)))
    assert_close(start.bases, bases)
    np.testing.assert_allclose(start.tool.position_mm, tools.position_mm[0], atol=1e-6)


def test_a_target_of_the_short_session_alone_is_placed_beside_one_of_both():
    seen, flange, bases, tools = exact(THREE, 40, 2)
    turned = bases.rotation[seen.session] @ flange.rotation @ tools.rotation[seen.target]
    here = np.where(seen.session == 0, seen.target < 2, (seen.target > 0) & (seen.pose < 20))
    part = replace(seen, rotation=turned).select(here)
    start = closed_form_start(part, Pose(*(values[here] for values in flange)))
    assert_close(start.bases, bases)
    assert_close(start.targets, tools)
