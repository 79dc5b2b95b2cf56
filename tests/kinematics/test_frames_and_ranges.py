"""Frames of a table and ranges of joints against values worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinacc.geometry import Pose
from kinacc.kinematics import tables
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.robot import Robot

FRAMES = {
    **dict.fromkeys(["qx", "qy", "qz", "y_mm", "z_mm"], [0.0] * 3),
    "model": ["dh", "vec", "vec"],
    "frame": ["base"] * 3,
    "session": ["late", "late", "early"],
    "qw": [1.0] * 3,
    "x_mm": [1.0, 100.0, 2.0],
}


def test_the_first_row_is_the_frame_where_no_session_is_named():
    for session, x_mm in [(None, 100.0), ("early", 2.0)]:
        assert tables.frame(FRAMES, "vec", "base", session).position_mm[0] == x_mm


def test_a_tool_is_fitted_where_place_or_turn_is_another_than_the_robots():
    turn = np.pi / 8.0
    rows = {"model": ["dh"], "frame": ["tool"], "x_mm": [1.0], "y_mm": [2.0], "z_mm": [3.0]}
    rows |= {"qw": [np.cos(turn)], "qx": [np.sin(turn)], "qy": [0.0], "qz": [0.0]}
    columns = {name: np.array(values) for name, values in rows.items()}
    tool = tables.frame(columns, "dh", "tool")
    same = Pose(tool.rotation + 1e-12, tool.position_mm)
    moved, turned = Pose(tool.rotation, tool.position_mm + 0.1), Pose(np.eye(3), tool.position_mm)
    assert tables.fitted_tool(columns, "dh", same) is None
    for own in (moved, turned):
        assert tables.fitted_tool(columns, "dh", own) is not None


def test_limits_of_a_turned_joint_change_places_and_coupled_joints_keep_their_own():
    turned = np.diag([-1.0, 1, 1, 1, 1, 1])
    turned[2, 1] = -1.0
    low, high = np.full(6, -1.0), np.full(6, 3.0)
    arm = replace(Robot.from_name("ur10"), joint_map=turned, q_min_rad=low, q_max_rad=high)
    np.testing.assert_array_equal(arm.dh_box(low, high)[0][:3], [-3, -1, -4])
    np.testing.assert_array_equal(arm.dh_box(low, high)[1][:3], [1, 3, 4])
    found = np.array(limits.dh_limits(arm))
    np.testing.assert_array_equal(found[:, :2], [[-3, -np.inf], [1, np.inf]])
    cut = np.array(limits.cut_to_range(arm, low, high, (low - 1, high - 2.5)))
    np.testing.assert_array_equal(cut[:, :2], [[-0.5, -1], [2, 3]])
