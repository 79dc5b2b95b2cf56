"""Two calibrations on a page: what is called a change, and what is not."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from parsed import read

from kinacc.calibration.uncertainty import Uncertainty, scale_of
from kinacc.config import schema
from kinacc.deployment.compare import compare
from kinacc.deployment.planning import spread
from kinacc.deployment.record import nominal
from kinacc.deployment.shared_readings import NONE_SHARED, SharedReadings
from kinacc.kinematics import dh
from kinacc.kinematics import robot as robots
from kinacc.report import page
from kinacc.report.comparison import comparison_page

STD = 0.02  # mm and mrad


def arm(name="March", fitted=True, robot="ur10", **changes):
    """A calibration of an arm whose DH parameters are known to ``STD``, with some changed."""
    made = nominal(robots.load(robot), name)
    names = made.model.names
    vector = made.model.start.copy()
    for parameter, by in changes.items():
        vector[names.index(parameter.replace("_", ".", 1))] += by
    made = replace(made, model=made.model.with_parameters(vector), choice="dh")
    if not fitted:
        return made
    covariance = np.diag([(STD * scale_of(each)) ** 2 for each in names])
    open_ = np.zeros((1, len(names)))
    open_[0, names.index("j1.d_mm")] = 1.0
    return replace(made, known=Uncertainty(names, covariance, open_))


def compared(first, second, shared=NONE_SHARED, poses=40):
    weight = schema.key("calibration.rotation_weight_mm_per_rad")["default"]
    return compare(first, second, spread(first.robot, poses), weight, shared)


def paged(first, second, shared=NONE_SHARED, poses=40):
    found = compared(first, second, shared, poses)
    return comparison_page(found, first, spread(first.robot, poses))


@pytest.fixture(scope="module")
def bent():
    return paged(arm(), arm("November", j3_alpha_rad=1e-3, j2_a_mm=0.1))


def test_an_arm_that_changed_is_said_to_against_chance(bent):
    assert bent.first.badge == ("CHANGED", True)
    plain, apart = bent.first.tables[0].rows
    assert plain["rms_mm"] > apart["rms_mm"] > 2 * apart["chance_mm"] > 0.0


def test_an_arm_that_did_not_change_needs_nothing():
    built = paged(arm(), arm("November", j2_a_mm=0.01))
    assert built.first.badge == ("NO CHANGE PROVEN", False)


def test_a_base_that_moved_is_not_taken_for_the_arm():
    built = paged(arm(), arm("November", j1_theta_offset_rad=2e-3))
    stands, stays = built.first.tables[0].rows
    assert stands["rms_mm"] > 0.5
    assert stays["rms_mm"] < 1e-6


@pytest.mark.parametrize(("row", "verdict"), [(0, "changed"), (22, "change in doubt")])
def test_no_arm_is_called_changed_that_was_measured_elsewhere(row, verdict):
    first, near = arm(), arm("November", j3_alpha_rad=5e-4)
    low = np.sort(spread(first.robot, 40)[:, 0])[row]
    ranges = np.array([low, *[-9.0] * 5]), np.full(6, 9.0)
    found = compared(first, replace(near, fitted_range_rad=ranges))
    assert found.verdict == verdict
    assert found.poses["measured_by_both"].sum() == 40 - row


class Curves(dh.DHModel):
    """A model whose parameters say nothing by themselves, as those of VEC."""

    comparable = None


def test_models_without_parameters_are_not_compared_where_one_was_never_measured():
    first, far = arm(), (np.full(6, 3.0), np.full(6, 3.1))
    fields_ = {each.name: getattr(first.model, each.name) for each in fields(first.model)}
    first = replace(first, model=Curves(**fields_), choice="vec")
    second = replace(first, name="November", fitted_range_rad=far)
    built = paged(first, second)
    assert built.first.badge == ("NOT COMPARABLE HERE", True)
    assert not built.first.tables


def test_a_robot_that_was_never_fitted_gives_distances_and_no_verdict():
    built = paged(arm(j2_a_mm=0.5), arm("ur10.yaml", fitted=False))
    assert built.first.badge == ("UNKNOWN", True)


def test_the_same_readings_and_other_robots_are_no_change():
    same = paged(arm(), arm("other settings", j2_a_mm=0.5), SharedReadings(80, 80, 80))
    assert same.first.badge == ("SAME READINGS", False)
    other = paged(arm(), arm("B", robot="mh180"))
    assert other.first.badge == ("DIFFERENT ROBOTS", True)


def test_what_the_poses_leave_open_is_not_counted(bent):
    table = read(bent.sections[-1]).tables[0]
    row = next(each for each in table.rows if each[0] == "j1.d")
    assert row[6:] == ("–", "both")


def test_the_poses_that_moved_the_most_are_listed(bent):
    where = next(each for each in bent.sections if each.key == "where")
    sizes = [float(row[2]) for row in read(where).tables[0].rows]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] == pytest.approx(bent.first.tables[0].rows[1]["largest_mm"], abs=5e-4)


def test_names_a_user_gave_are_text():
    text = page.html(paged(arm('<script>"1'), arm("<b>two", j2_a_mm=0.5)))
    assert '<script>"1' not in text
    assert "&lt;b&gt;two" in text


def test_one_pose_is_enough_for_a_page():
    built = paged(arm(), arm("November", j2_a_mm=0.5), poses=1)
    assert "1 poses" in built.first.subtitle
    assert page.html(built)
