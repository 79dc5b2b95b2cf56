"""A robot calibrated again and again: what its history says when the arm changed, and when not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shared_data

from kinacc.calibration import fitting
from kinacc.calibration.constraints import free_parameters, parallel_joints
from kinacc.calibration.frames import frame_terms, known
from kinacc.calibration.observations import Observations, full_poses
from kinacc.deployment import history as histories
from kinacc.deployment.history import LEVEL, Session
from kinacc.deployment.history_model import Setup
from kinacc.deployment.record import Calibration
from kinacc.geometry import Pose, compose, exp_so3, invert
from kinacc.kinematics import robot as robots
from kinacc.kinematics.dh import DHModel
from kinacc.measurements.folds import assign
from kinacc.measurements.orientation import euler
from kinacc.synthetic import plan, tracker
from kinacc.synthetic.accepted import accepted_draw
from kinacc.synthetic.draw import physical_robot
from kinacc.synthetic.physical import Visits
from kinacc.tables.allowed import MOVED, SAME
from kinacc.tables.columns import Columns

WEIGHT = 500.0
POSES = 60
ANEW = Pose(exp_so3(np.array([0.2, -0.5, 1.7])), np.array([3200.0, -700.0, 150.0]))


@cache
def pool() -> np.ndarray:
    return plan.configurations(robots.load("mh180"), 2000)


def measured(month: int, offset_mrad: np.ndarray | float = 0.0, other: bool = False):
    """A month's readings of one physical arm, its joint offsets changed by ``offset_mrad``."""
    draw, rng = accepted_draw(0), np.random.default_rng([7, month])
    begin = POSES * month if other else 0
    q_rad = pool()[begin : begin + POSES]
    visits = Visits(
        q_rad + 1e-3 * np.broadcast_to(offset_mrad, 6),
        plan.directions(q_rad),
        plan.time_h(POSES) + rng.uniform(0.0, 6.0),
        rng.standard_normal((POSES, 6)),
    )
    run = tracker.Run(visits, *rng.standard_normal((2, POSES, 3)))
    arm = physical_robot(1, draw.scales, draw.geometry)
    return full_poses(q_rad, tracker.measured(arm, run, 0.02), plan.directions(q_rad))


def with_tracker_anew(seen: Observations) -> Observations:
    """The same readings by a tracker that stands elsewhere."""
    anew = compose(invert(ANEW), seen.measured)
    return replace(seen, position_mm=anew.position_mm, rotation=anew.rotation)


def session(seen: Observations, date: str, base: str = SAME, name: str = "mh180") -> Session:
    """A line of a series with its DH calibration."""
    arm = robots.load(name)
    seen = replace(seen, fold=assign(seen.pose, 5, 0))
    free = free_parameters(arm.dh.joints, parallel_joints(arm.dh))
    terms = frame_terms(seen, known(arm.base, robots.carried(arm)))
    fit = fitting.fit(
        seen,
        arm.dh,
        free=free,
        rotation_weight_mm_per_rad=WEIGHT,
        threshold=1e-4,
        frame_terms=terms,
    )
    model: DHModel = fit.model
    calibration = Calibration(date, arm, "dh", model, fit.frames.base, {"tool": fit.frames.tool})
    at = compose(fit.frames.base, compose(model.pose(seen.at), fit.frames.tool))
    held_out_mm = np.linalg.norm(seen.position_mm - at.position_mm, axis=1)
    return Session(
        f"arm-{date}", date, "", base, SAME, calibration, seen, held_out_mm, *[np.nan] * 3
    )


def history(*sessions: Session) -> Columns:
    return histories.history(sessions, WEIGHT, seed=0)


def test_a_knocked_joint_is_named_and_the_new_calibration_is_in_force_from_then_on():
    # 0.7 mrad is named on each of the first 12 accepted arms, 0.5 mrad on 9 of them.
    knocked = [0.0, 0.0, 0.7, 0.0, 0.0, 0.0]
    months = [
        session(measured(1), "2026-01-01"),
        session(measured(2, knocked), "2026-02-01"),
        session(measured(3, knocked), "2026-03-01"),
    ]

    found = history(*months)

    assert list(found["verdict"]) == ["first", "recalibrate", "holds"]
    assert found["in_force"][2] == "arm-2026-02-01"
    assert found["joint"][1] == 3
    assert found["beyond_mm"][1] > 0.1
    assert found["probability"][1] < LEVEL


def test_another_place_of_the_tracker_and_other_poses_are_no_change_of_the_arm():
    first = session(measured(1), "2026-01-01")
    moved = session(with_tracker_anew(measured(2)), "2026-02-01", MOVED)
    others = session(with_tracker_anew(measured(3, other=True)), "2026-03-01", SAME)

    found = history(first, moved, others)

    assert list(found["verdict"]) == ["first", "holds", "holds"]
    assert (found["in_force_mean_mm"][1:] < 1.0).all()


def test_a_tracker_that_was_moved_and_is_said_to_stand_still_is_seen():
    first = session(measured(1), "2026-01-01")
    shifted = measured(2)
    shifted = replace(shifted, position_mm=shifted.position_mm + np.array([0.0, 0.0, 1.0]))

    found = history(first, session(shifted, "2026-02-01"))

    assert found["verdict"][1] == "recalibrate"
    assert found["moved_mm"][1] == pytest.approx(1.0, abs=0.2)


def test_the_history_is_the_same_in_whatever_order_lines_were_added():
    one, two, three = (
        session(measured(month, other=month == 3), f"2026-0{month}-01") for month in (1, 2, 3)
    )

    forward, backward, shorter = (
        history(one, two, three),
        history(three, one, two),
        history(one, two),
    )

    for name, column in forward.items():
        np.testing.assert_array_equal(column, backward[name])
        np.testing.assert_array_equal(column[:2], shorter[name])


def test_too_few_poses_are_said_to_tell_nothing():
    first, few = measured(1), measured(2)

    found = history(session(first, "2026-01-01"), session(few.select(np.arange(12)), "2026-02-01"))

    assert found["verdict"][1] == "cannot be told"
    assert "fewer than 20 configurations in arm-2026-02-01" in found["reason"][1]


def test_readings_of_the_line_in_force_are_not_compared_with_themselves():
    old, new = measured(1), measured(2, [0.0, 0.0, 0.7, 0.0, 0.0, 0.0])
    both = histories.joined(new, old, Setup(True, True))
    first = session(old, "2026-01-01")
    alone, grown = (
        history(first, replace(session(new, "2026-02-01"), observations=each))
        for each in (new, both)
    )
    assert grown["verdict"][1] == "recalibrate"
    for name in ("moved_mm", "chance_mm", "in_force_mean_mm"):
        assert grown[name][1] == pytest.approx(alone[name][1], rel=1e-3)


def ur10_series(name: str, date: str) -> Session:
    """A third of a series of one UR10, tracker and tool set up anew for each."""
    arm = robots.load("ur10")
    path = shared_data.path_of(f"ur10_tmac/series_{name}.csv")
    table = np.genfromtxt(path, delimiter=",", names=True)[::3]
    q, turns = (
        np.deg2rad(np.stack([table[each] for each in names], axis=1))
        for names in ([f"q{i}_deg" for i in range(1, 7)], [f"r{i}_deg" for i in "xyz"])
    )
    at = np.stack([table[f"{axis}_mm"] for axis in "xyz"], axis=1)
    seen = full_poses(arm.dh_joints(q), Pose(euler(turns, "XYZ"), at))
    return replace(session(seen, date, MOVED, "ur10"), tool=MOVED)


def test_series_of_one_ur10_measured_in_other_poses_raise_no_alarm():
    """By the covariance of the fits B and D differ with a probability of 1e-67."""
    found = history(ur10_series("D", "2026-01-01"), ur10_series("B", "2026-02-01"))

    assert found["verdict"][1] != "recalibrate"
    assert found["moved_mm"][1] < found["chance_mm"][1]
    assert found["probability"][1] > 0.05


def test_series_measured_in_different_parts_of_the_joints_are_said_to_tell_nothing():
    found = history(ur10_series("C", "2026-01-01"), ur10_series("B", "2026-02-01"))

    assert found["verdict"][1] == "cannot be told"
    assert "joint ranges of arm-2026-01-01" in found["reason"][1]
