"""A robot calibrated again and again: what its history tells of changes, and of none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
import scipy.stats
import shared_data
from calibration.simulated import columns_of
from read_columns import Q_DEG, XYZ_MM
from scipy.spatial.transform import Rotation
from simulated_months import month, session
from small_arms import results_of

from kinacc.calibration.observations import full_poses
from kinacc.deployment import history as histories
from kinacc.deployment.history import LEVEL, session_of
from kinacc.deployment.history_model import DRAWS, Moved, misfit_factor
from kinacc.geometry import Pose
from kinacc.kinematics import robot as robots
from kinacc.tables.allowed import MOVED, SAME

FAR_RAD = (0.02, -0.02, 0.02, -0.02, 0.02, -0.02)
KNOCK_RAD = (0.0, 0.0, 2e-3, 0.0, 0.0, 0.0)


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    """A tenth of them, which changes what chance shows by a percent or two."""
    monkeypatch.setattr(histories.history_model, "DRAWS", 10_000)


def history(*sessions):
    return histories.history(sessions, 500.0)


@cache
def months(*knocks_rad, other_poses=False, moved=False):
    """Lines of months with knocks of all joints, and their history.

    A third one is said to stand where the second does: of the first, it was moved all the same.
    """
    lines = []
    for number, knock_rad in enumerate(knocks_rad, 1):
        base = MOVED if moved and number < 3 else SAME
        lines.append(session(month(number, knock_rad, other_poses, moved), number, base))
    return lines, history(*lines)


@pytest.mark.parametrize(("other_poses", "moved"), [(False, False), (True, False), (True, True)])
def test_months_in_which_nothing_happens_raise_no_alarm(other_poses, moved):
    lines, found = months(0.0, 0.0, 0.0, other_poses=other_poses, moved=moved)
    assert list(found["verdict"]) == ["first", "holds", "holds"]
    assert (found["in_force_mean_mm"][1:] < 1.0).all()
    if not moved:
        later = lines[1].observations
        at = lines[0].calibration.pose(later.at, "instrument")
        sizes = np.linalg.norm(later.position_mm - at.position_mm, axis=1)
        assert found["in_force_mean_mm"][1] == pytest.approx(sizes.mean())


def test_a_knocked_joint_is_named_and_the_new_calibration_is_in_force_from_then_on():
    _, found = months(0.0, KNOCK_RAD, KNOCK_RAD)
    assert list(found["verdict"]) == ["first", "recalibrate", "holds"]
    assert found["in_force"][2] == "ur-2026-02-01"
    assert found["joint"][1] == 3
    assert found["beyond_mm"][1] == found["moved_mm"][1] - found["chance_mm"][1] > 0.1
    assert found["probability"][1] < LEVEL


def test_a_tracker_that_was_moved_is_seen_but_not_beside_as_large_a_drift():
    """A series may be as a whole in any state that another one passes through."""
    up = np.array([0.0, 0.0, 1.0])
    for drift_mm, verdict in ((0.0, "recalibrate"), (0.4, "cannot be told")):
        lines = []
        for number, shift_mm in ((1, 0.0), (2, 0.3)):
            seen = month(number)
            rises_mm = shift_mm + drift_mm * np.linspace(-1.0, 1.0, len(seen))
            seen = replace(seen, position_mm=seen.position_mm + rises_mm[:, None] * up)
            lines.append(session(seen, number))
        found = history(*lines)
        assert found["verdict"][1] == verdict
        assert found["moved_mm"][1] == pytest.approx(0.3, abs=0.05)
    # Either series may be in a state as large as these, along any of 25 directions.
    state_mm2 = np.mean((drift_mm * np.linspace(-1.0, 1.0, len(seen))) ** 2) / 25
    chance_mm = np.sqrt(2.0 * state_mm2 * scipy.stats.chi2.isf(LEVEL, 25))
    assert found["chance_mm"][1] == pytest.approx(chance_mm, rel=0.05)


def test_chance_along_all_directions_alike_is_that_of_chi_square(monkeypatch):
    monkeypatch.setattr(histories.history_model, "DRAWS", DRAWS)
    moved = Moved(np.eye(4), np.array([0.1, -0.2, 0.25, 0.1]), 0.01 * np.eye(4))
    probability, chance_mm = moved.test(0.005)
    assert probability == pytest.approx(scipy.stats.chi2.sf(12.25, 4), rel=0.05)
    assert chance_mm == pytest.approx(0.1 * scipy.stats.chi2.isf(0.005, 4) ** 0.5, rel=0.01)
    monkeypatch.setattr(histories.history_model, "moved", lambda half, _: half)
    still = moved._replace(change=np.zeros(4))
    assert misfit_factor([moved, still]) == pytest.approx((0.5 * 12.25 / 4.0) ** 0.5)
    assert misfit_factor([still]) == 1.0


def test_misfit_that_differs_between_halves_widens_the_limit_at_other_poses(monkeypatch):
    (*lines, _), usual = months(0.0, 0.0, 0.0, other_poses=True, moved=False)
    monkeypatch.setattr(histories.history_model, "misfit_factor", lambda halves: 3.0)
    wide = history(*lines)
    assert wide["chance_mm"][1] == pytest.approx(3.0 * usual["chance_mm"][1], rel=0.15)
    assert wide["moved_mm"][1] == usual["moved_mm"][1]


def test_the_history_is_the_same_in_whatever_order_lines_were_added():
    (one, two, _), whole = months(0.0, 0.0, 0.0, other_poses=False, moved=False)
    backward = history(two, one)
    for name, column in whole.items():
        np.testing.assert_array_equal(column[:2], backward[name])


def test_what_was_moved_counts_since_the_line_in_force_and_not_before_it():
    seen = month(2, KNOCK_RAD, moved=True)
    pushed = replace(seen, position_mm=seen.position_mm + 0.3)
    lines = [month(1), month(2, moved=True), seen, pushed]
    found = history(
        *(session(each, n, MOVED if n == 2 else SAME) for n, each in enumerate(lines, 1))
    )
    assert list(found["verdict"]) == ["first", "holds", "recalibrate", "recalibrate"]
    assert found["joint"][2] == 3
    # A growth of all lengths takes up a part of the push.
    assert found["moved_mm"][3] == pytest.approx(0.3 * 3.0**0.5, abs=0.03)


def test_readings_of_the_line_in_force_are_not_compared_with_themselves():
    (first, second, _), alone = months(0.0, KNOCK_RAD, KNOCK_RAD)
    both = histories.joined(second.observations, first.observations, set())
    grown = history(first, replace(second, observations=both))
    assert grown["verdict"][1] == "recalibrate"
    for name in ("moved_mm", "chance_mm", "in_force_mean_mm"):
        assert grown[name][1] == pytest.approx(alone[name][1], rel=1e-3)


def tables_as_the_workflow_gives_them(seen):
    """A VEC model is selected; covariances are not among the tables that a history is made of."""
    made = results_of("ur10", seen, with_vec=True)
    names = ("robot", "frames", "dh_model", "vec_model")
    none = dict.fromkeys(("estimate", "comparison", "row", "ex_mm", "ey_mm", "ez_mm"), np.zeros(0))
    choice = {"model": np.array(["dh", "vec"]), "selected": np.array([False, True])}
    choice["held_out_rms_mm"] = np.ones(2)
    return {name: made[name] for name in names} | {
        "measurements": columns_of(seen), "pose_errors": none, "model_selection": choice
    }  # fmt: skip


def test_series_are_compared_about_the_fitted_dh_model_where_a_vec_model_is_selected():
    """A VEC model holds the nominal one: about that, noise alone moves this arm by 16 % more."""
    far, about_dh = months(FAR_RAD, FAR_RAD, moved=True)
    tables = [tables_as_the_workflow_gives_them(line.observations) for line in far]
    found = history(
        *(session_of(each, f"ur-{n}", f"{n}", MOVED, SAME) for n, each in enumerate(tables, 1))
    )
    assert found["model"][1] == "vec"
    assert found["probability"][1] > LEVEL
    for name in ("moved_mm", "chance_mm", "probability"):
        assert found[name][1] == pytest.approx(about_dh[name][1], rel=1e-6)


def test_an_arm_far_from_its_dh_model_raises_no_alarm():
    """What base, tool and joints share is bound to the model, but so softly that nothing moves."""
    lines, about_fitted = months(FAR_RAD, FAR_RAD, moved=True)
    far = history(*(replace(line, dh=robots.load("ur10").dh) for line in lines))
    assert far["verdict"][1] == "holds"
    assert far["probability"][1] > 0.05
    assert far["moved_mm"][1] == pytest.approx(about_fitted["moved_mm"][1], rel=0.2)


def ur10_series(name, number, every=3):
    """Rows of a series of one UR10, tracker and tool set up anew for each."""
    path = shared_data.path_of(f"ur10_tmac/series_{name}.csv")
    table = pd.read_csv(path)[::every]
    q = np.deg2rad(table[Q_DEG].to_numpy())
    turns = table[["rx_deg", "ry_deg", "rz_deg"]].to_numpy()
    turned = Rotation.from_euler("XYZ", turns, degrees=True).as_matrix()
    at = table[XYZ_MM].to_numpy()
    seen = full_poses(robots.load("ur10").dh_joints(q), Pose(turned, at))
    return replace(session(seen, number, MOVED), tool=MOVED)


def test_series_of_one_ur10_measured_in_other_poses_raise_no_alarm():
    """By the covariance of the fits B and D differ with a probability of 1e-67."""
    found = history(ur10_series("D", 1), ur10_series("B", 2))
    assert found["verdict"][1] != "recalibrate"
    assert found["moved_mm"][1] < found["chance_mm"][1]
    assert found["probability"][1] > 0.05


def test_what_cannot_be_told_has_a_reason():
    """Series in different parts of the joints, and too few poses."""
    found = history(ur10_series("C", 1, 12), ur10_series("B", 2, 12))
    assert found["verdict"][1] == "cannot be told"
    assert "joint ranges of ur-2026-01-01" in found["reason"][1]
    few = session(month(2).select(np.arange(12)), 2)
    found = history(session(month(1), 1), few)
    assert found["verdict"][1] == "cannot be told"
