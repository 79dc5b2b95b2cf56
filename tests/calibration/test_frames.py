"""Base and targets: the closed-form start where it is easy, and where half of it fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinacc.calibration.hand_eye import closed_form_start
from kinacc.calibration.observations import full_poses
from kinacc.geometry import Pose, compose, exp_so3, log_so3
from kinacc.kinematics import dh, robot

ARM = robot.load("ur10")
BASE = Pose(exp_so3(np.array([0.4, -2.0, 1.1])), np.array([2300.0, -900.0, 450.0]))
TOOL = Pose(exp_so3(np.array([1.5, 0.3, -0.7])), np.array([12.0, -40.0, 93.0]))


def measured(q, tool=TOOL) -> Pose:
    return compose(BASE, compose(dh.forward(ARM.dh, q), tool))


def turned_by(a, b) -> float:
    return float(np.linalg.norm(log_so3(a @ b.T)))


def some_joints(count, seed=0):
    return np.random.default_rng(seed).uniform(-2.5, 2.5, (count, 6))


@pytest.mark.parametrize("orientations", [True, False])
def test_start_is_exact_on_exact_data(orientations):
    q = some_joints(20)
    seen = measured(q)
    if not orientations:
        seen = Pose(np.full_like(seen.rotation, np.nan), seen.position_mm)
    start = closed_form_start(full_poses(q, seen), dh.forward(ARM.dh, q))
    assert turned_by(start.base.rotation, BASE.rotation) < 1e-9
    np.testing.assert_allclose(start.base.position_mm, BASE.position_mm, atol=1e-6)
    np.testing.assert_allclose(start.tool.position_mm, TOOL.position_mm, atol=1e-6)
    wanted = TOOL.rotation if orientations else np.eye(3)
    assert turned_by(start.tool.rotation, wanted) < 1e-9


def test_start_survives_a_tool_that_turns_about_one_axis_only():
    """Cube poses with one tool orientation but for turns about the vertical: hand-eye fails."""
    rng = np.random.default_rng(3)
    count = 40
    flange = Pose(
        exp_so3(np.outer(rng.choice([0.0, np.pi / 2, np.pi], count), [0.0, 0.0, 1.0])),
        rng.uniform(-400, 400, (count, 3)),
    )
    seen = compose(BASE, compose(flange, TOOL))
    start = closed_form_start(full_poses(np.zeros((count, 6)), seen), flange)
    again = compose(start.base, compose(flange, start.tool))
    np.testing.assert_allclose(again.position_mm, seen.position_mm, atol=1e-6)
    assert max(turned_by(a, b) for a, b in zip(again.rotation, seen.rotation, strict=True)) < 1e-9
    # Along the axis of the turns the tool cannot be told from the base: it is left at zero.
    assert abs(start.tool.position_mm[2]) < 1e-6


def test_a_short_session_is_placed_by_the_long_one_whichever_comes_first():
    """Two positions say nothing of a base by themselves; a tool found elsewhere places it."""
    q = some_joints(40, 7)
    flange = dh.forward(ARM.dh, q)
    other = Pose(exp_so3(np.array([-0.2, 0.9, 2.0])), np.array([-700.0, 1500.0, 80.0]))
    seen = compose(BASE, compose(flange, TOOL))
    moved = compose(other, compose(flange, TOOL))
    few = np.arange(40) < 3
    whole = full_poses(q, Pose(np.full((40, 3, 3), np.nan), seen.position_mm))
    position = np.where(few[:, None], moved.position_mm, seen.position_mm)
    for short, names in ((0, ("morning", "evening")), (1, ("evening", "morning"))):
        session = np.where(few, short, 1 - short)
        both = replace(whole, position_mm=position, session=session, session_names=names)
        start = closed_form_start(both, flange)
        np.testing.assert_allclose(start.tool.position_mm, TOOL.position_mm, atol=1e-6)
        np.testing.assert_allclose(start.bases.position_mm[1 - short], BASE.position_mm, atol=1e-5)
        np.testing.assert_allclose(start.bases.position_mm[short], other.position_mm, atol=1e-5)
        assert turned_by(start.bases.rotation[short], other.rotation) < 1e-8
