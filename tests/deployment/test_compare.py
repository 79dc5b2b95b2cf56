"""Two calibrations side by side: nothing where nothing changed, and a planted change by name."""

from dataclasses import fields, replace

import numpy as np
import pytest
from pose_checks import movement
from small_arms import BASE, TOOL, calibrated, joints, measured, moved, results_of, truth

from kinacc.config import schema
from kinacc.deployment import compare as comparison
from kinacc.deployment.folder import calibration
from kinacc.deployment.predict import predict
from kinacc.deployment.record import nominal
from kinacc.deployment.shared_readings import NONE_SHARED, SharedReadings
from kinacc.geometry import compose
from kinacc.kinematics import dh, robot


def compare(first, second, q_rad, shared=NONE_SHARED):
    weight = schema.key("calibration.rotation_weight_mm_per_rad")["default"]
    return comparison.compare(first, second, q_rad, weight, shared)


def ratios(found):
    """Statistics and squared shifts of comparisons over those that chance makes, on average."""
    squares = sum(each.shifts[["rms_mm", "chance_mm"]] ** 2 for each in found)
    statistic = np.mean([each.statistic / each.directions for each in found])
    return statistic, squares["rms_mm"] / squares["chance_mm"]


def sure_of_all(arm):
    """The calibration without undetermined directions."""
    return replace(arm, known=replace(arm.known, undetermined=arm.known.undetermined[:0]))


@pytest.mark.parametrize("name", ["mh180", "ur10"])
def test_repeated_calibrations_of_one_arm_differ_by_chance_alone(name):
    q_rad, arms = joints(name, 60), [calibrated(name, "dh", 60, 200 + i) for i in range(14)]
    found = [compare(arms[i - 1], arm, q_rad) for i, arm in enumerate(arms)]
    assert {each.verdict for each in found} == {comparison.UNPROVEN}
    chances = np.array([each.probability for each in found])
    assert chances.min() > 1e-3
    assert 0.25 < chances.mean() < 0.75
    statistic, shifts = ratios(found)
    assert statistic == pytest.approx(1.0, abs=0.25)
    np.testing.assert_allclose(shifts, 1.0, atol=0.6)


def test_predictions_are_as_far_off_as_they_say():
    """Calibrations of one arm: errors over standard deviations have unit variance."""
    q_rad = joints("mh180", 12, seed=21)
    wanted = compose(BASE, compose(dh.forward(truth("mh180"), q_rad), TOOL)).position_mm
    scores = []
    for seed in range(200, 214):  # those that are compared above
        found = predict(calibrated("mh180", "dh", 60, seed), q_rad, None, "instrument")
        scores.append((found.pose.position_mm - wanted) / found.std[:, :3])
    assert np.mean(np.square(scores)) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(("first", "second", "common"), [(60, 60, 30), (50, 90, 50)])
def test_readings_in_both_calibrations_are_counted_once(first, second, common):
    q_rad, found = joints("mh180", 60), []
    for seed in range(500, 507):
        seen = measured("mh180", first + second - common, seed=seed)
        one, other = (
            calibration(results_of("mh180", seen.select(rows)), "dh", "mh180")
            for rows in (slice(0, first), slice(first - common, None))
        )
        known = SharedReadings(common, first, second)
        found.append(compare(one, other, q_rad, known))
    statistic, shifts = ratios(found)
    assert statistic == pytest.approx(1.0, abs=0.25)
    assert shifts[1] == pytest.approx(1.0, abs=0.6)
    assert compare(one, other, q_rad).statistic < 0.7 * found[-1].statistic


@pytest.mark.parametrize(
    ("parameter", "size"), [("j2.a_mm", 1.0), ("j3.alpha_rad", 2e-3), ("j5.theta_offset_rad", 3e-3)]
)
def test_a_planted_change_is_found_under_its_name(parameter, size):
    before = calibrated("mh180", "dh", 60, 3)
    after = moved(calibrated("mh180", "dh", 60, 4), {parameter: size})
    found = compare(before, after, joints("mh180", 60))
    assert found.probability < 1e-6
    assert found.verdict == comparison.CHANGED
    largest = found.parameters.loc[found.parameters["sigmas"].abs().idxmax()]
    assert largest["name"] == parameter.rpartition("_")[0]
    assert abs(largest["sigmas"]) > 5.0
    assert found.shifts["rms_mm"][1] > 3.0 * found.shifts["chance_mm"][1]
    one, other = (predict(arm, joints("mh180", 60), point="flange") for arm in (before, after))
    gap_mm, turn = np.split(movement(one.pose, other.pose), 2, axis=1)
    variance = one.std**2 + other.std**2
    squares = [gap_mm**2, variance[:, :3], 1e6 * turn**2, 1e6 * variance[:, 3:]]
    stated = found.shifts.drop(columns=["frames", "largest_mm"]).loc[0].tolist()
    assert stated == pytest.approx([np.sqrt(each.sum() / 60) for each in squares])
    most_mm = pytest.approx(np.linalg.norm(gap_mm, axis=1).max())
    assert found.shifts["largest_mm"][0] == found.poses["moved_mm"].max() == most_mm


def test_what_no_pose_shows_is_marked_and_counts_for_nothing():
    before = calibrated("mh180", "dh", 60, 3)
    after = moved(before, {"j2.d_mm": 5.0, "j3.d_mm": 5.0})  # axes 2 and 3 are antiparallel
    pairs = {"both": (before, after), "second": (sure_of_all(before), after),
             "first": (before, sure_of_all(after))}  # fmt: skip
    for which, pair in pairs.items():
        found = compare(*pair, joints("mh180", 60))
        row = found.parameters.set_index("name").loc["j2.d"]
        assert row["undetermined"] == which
        assert np.isnan(row["sigmas"])
        assert row["difference"] == pytest.approx(5.0)
        assert found.probability > 0.9
        assert found.shifts["rms_mm"][1] < 0.05


def test_what_base_and_tool_take_up_is_no_change_of_the_arm():
    before = calibrated("mh180", "dh", 60, 3)
    steps = {"j1.d_mm": 3.0, "j6.d_mm": 4.0, "j1.theta_offset_rad": 0.1, "j6.theta_offset_rad": 0.2}
    found = compare(before, moved(before, steps), joints("mh180", 60))
    assert found.shifts["rms_mm"][0] > 1.0
    assert found.shifts["rms_mm"][1] < 1e-9


def test_another_geometry_is_another_robot_and_a_calibration_is_not():
    q_rad = joints("irb120", 60)
    arm, other = (nominal(robot.load(name)) for name in ("irb120", "meca500"))
    found = compare(arm, other, q_rad)
    assert found.verdict == comparison.OTHER_ROBOT
    assert found.robots_apart_mm == pytest.approx(found.shifts["rms_mm"][1])
    before, after = (calibrated("mh180", "dh", 60, seed) for seed in (3, 4))
    far = moved(after, {"j2.theta_offset_rad": 0.2})  # the same robot, whatever happened to it
    for each in (after, far):
        found = compare(before, each, joints("mh180", 60))
        assert found.verdict != comparison.OTHER_ROBOT
        assert found.robots_apart_mm == 0.0


class Curves(dh.DHModel):
    """A model whose parameters say nothing by themselves, as those of VEC."""

    kind = "curves"


def covering(calibration, low_rad, high_rad):
    """The calibration, as if joints between ``low_rad`` and ``high_rad`` were measured."""
    return replace(calibration, fitted_range_rad=(low_rad, high_rad), fitted=None)


def test_no_change_is_claimed_without_covariances_or_parameters():
    before, after = (calibrated("mh180", "dh", 60, seed) for seed in (3, 4))
    q_rad = joints("mh180", 60)
    assert compare(before, replace(after, known=None), q_rad).verdict == comparison.UNKNOWN
    values = {each.name: getattr(before.model, each.name) for each in fields(before.model)}
    curves = replace(before, model=Curves(**values))
    far = covering(curves, np.full(6, 3.0), np.full(6, 3.1))
    assert compare(curves, far, q_rad).verdict == comparison.NOT_COMPARABLE


@pytest.mark.parametrize(
    ("outside", "verdict"), [(30, comparison.CHANGED), (31, comparison.IN_DOUBT)]
)
def test_no_arm_is_called_changed_that_was_measured_elsewhere(outside, verdict):
    q_rad = joints("mh180", 60)
    before = covering(calibrated("mh180", "dh", 60, 3), np.full(6, -9.0), np.full(6, 9.0))
    low = np.array([np.sort(q_rad[:, 0])[outside], *[-9.0] * 5])
    after = moved(covering(before, low, np.full(6, 9.0)), {"j3.alpha_rad": 2e-3})
    found = compare(before, after, q_rad)
    assert found.verdict == verdict
    assert found.poses["measured_by_both"].sum() == 60 - outside
