"""Frames of a table and ranges of joints against values worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from kinacc.kinematics import tables
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.robot import Robot
from kinacc.study import evaluation

HALF = np.sqrt(0.5)
FRAMES = {
    "model": ["dh", "dh", "vec", "vec"],
    "frame": ["base"] * 4,
    "session": ["late", "early", "late", "early"],
    "qw": [HALF, 1.0, HALF, 1.0],
    "qx": [0.0, 0.0, HALF, 0.0],
    "qy": [0.0] * 4,
    "qz": [HALF, 0.0, 0.0, 0.0],
    "x_mm": [100.0, 1.0, 100.0, 2.0],
    "y_mm": [0.0, 0.0, 7.0, 0.0],
    "z_mm": [0.0, 0.0, 5.0, 0.0],
}


def test_the_first_row_is_the_frame_where_no_session_is_named():
    for session, x_mm in [(None, 100.0), ("early", 2.0)]:
        assert tables.frame(FRAMES, "vec", "base", session).position_mm[0] == x_mm


def test_a_base_of_vec_is_given_in_that_of_dh(monkeypatch):
    model = SimpleNamespace(kind="vec", table=None)
    monkeypatch.setattr(tables, "models", lambda *_: {"vec": model})
    wanted = {"travel_direction": 0, "tool_mm": [0.0, 0.0, 0.0]}
    found = evaluation.equipped({"frames": FRAMES}, wanted, Robot.from_name("ur10"))
    base = found.by_name["vec"].base
    # A quarter turn about z takes the y axis of the instrument to x of the base.
    np.testing.assert_allclose(base.position_mm, [7.0, 0.0, 5.0], atol=1e-12)


def test_limits_of_a_turned_joint_change_places_and_coupled_joints_keep_their_own():
    turned = np.diag([-1.0, 1, 1, 1, 1, 1])
    turned[2, 1] = 1.0
    low, high = np.full(6, -1.0), np.full(6, 3.0)
    arm = replace(Robot.from_name("ur10"), joint_map=turned, q_min_rad=low, q_max_rad=high)
    found = np.array(limits.dh_limits(arm))
    np.testing.assert_array_equal(found[:, :2], [[-3, -np.inf], [1, np.inf]])
    cut = np.array(limits.cut_to_range(arm, low, high, (low - 1, high - 2.5)))
    np.testing.assert_array_equal(cut[:, :2], [[-0.5, -1], [2, 3]])
