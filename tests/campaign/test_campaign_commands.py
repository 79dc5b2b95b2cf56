"""``kinacc campaign`` as a person uses it: a whole campaign, files, instruments, mistakes."""

from __future__ import annotations

import hashlib
import re

import numpy as np
import pytest
from campaign_on_disk import (
    SIGMA_MM,
    Arm,
    make_plan,
    recorded,
    refusal,
    refused,
    standing,
)
from command_line import call

from kinacc.campaign import folder as campaigns
from kinacc.campaign import plan as plans
from kinacc.campaign.campaign import Campaign
from kinacc.cli import choice
from kinacc.gate.conformity import check_file
from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics.model import JointState
from kinacc.tables import store
from kinacc.tables.contract import ARTEFACTS


@pytest.fixture
def campaign(begun):
    """Folder of a campaign with readings in the base, and the arm at it."""
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    return folder, Arm(folder)


def written(values):
    return ",".join(map(repr, np.asarray(values).tolist()))


@pytest.mark.parametrize("frame", ["base", "instrument"])
def test_readings_are_expected_in_the_frame_they_come_in(tmp_path, frame):
    to_base = Pose(exp_so3(np.array([0.1, -0.2, 0.3])), np.array([500.0, -20.0, 30.0]))
    campaigns.start(tmp_path / "c", make_plan(frame=frame).model_copy(update={"to_base": to_base}))
    found = Campaign(tmp_path / "c")
    pose, visit = found.next_pose(), found.visit()
    assert pose.frame == frame
    assert [visit[f"s{joint}"][0] for joint in range(1, 7)] == pose.directions.tolist()
    expected = visit[["expected_x_mm", "expected_y_mm", "expected_z_mm"]].to_numpy()
    np.testing.assert_allclose(pose.expected_mm, expected[0])
    if frame == "instrument":
        expected = expected @ to_base.rotation.T + to_base.position_mm
    points = [found.plan.points.number(each) for each in visit["pose"]]
    assert points == found.plan.route.tolist()
    np.testing.assert_allclose(expected, found.plan.points.modelled_mm[points], atol=1e-9)


def test_a_file_of_readings_is_taken_whole_and_bad_rows_refuse_it(campaign, tmp_path):
    folder, arm = campaign
    names = [arm.plan.points.label[point] for point in arm.plan.route]
    file, head = tmp_path / "readings.csv", "pose,x_mm,y_mm,z_mm,instrument\n"
    a, b, c = names[:3]
    good = f"{a},{arm.position(a)},\n"
    file.write_text(
        f"{head}{good}{b},nan,1,2,\n{c},1,2,3,\nelsewhere,1,2,3,\n{b},{arm.position(b)},sextant\n"
    )
    said = refused(folder, "record", folder, file)
    for line in ("line 3", "line 4", "line 5", "line 6"):
        assert line in said
    file.write_text(f"{head}{good}")
    call("campaign", "record", folder, file, code=0)
    assert standing(folder)["readings_used"] == 1


def test_a_reading_at_slightly_other_joints_is_held_to_the_model_there(begun, study):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base", "--joint-tolerance-deg", "0.05")
    plan = campaigns.open_(folder).plan
    point = int(plan.route[0])
    joints = plan.points.joints[point] + np.deg2rad([0.03, -0.02, 0.04, 0.01, -0.05, 0.02]) * 0.99
    arm = choice.calibration_of(study, "dh")
    there = arm.pose(JointState(joints[None] @ arm.robot.joint_map.T)).position_mm[0]
    assert np.linalg.norm(there - plan.points.modelled_mm[point]) > 0.5
    call("campaign", "record", folder, "--joints-deg", written(np.rad2deg(joints)),
                "--position-mm", written(there), code=0)  # fmt: skip
    (told,) = campaigns.open_(folder).state.used
    assert np.linalg.norm(told.error_mm) < 2e-3


def test_the_wrong_pose_is_refused_by_joints_and_by_position(campaign):
    folder, arm = campaign
    points = arm.plan.points
    first, second = (int(point) for point in arm.plan.route[:2])
    position, joints = arm.position(points.label[first]), np.rad2deg(points.joints[second])
    words = ("--joints-deg", written(joints), "--position-mm", position)
    said = refused(folder, "record", folder, *words)
    assert f"deg from point {points.label[first]}" in said
    assert f"these joints are point {points.label[second]}" in said
    words = ("record", folder, "--position-mm", arm.position(points.label[second]))
    assert "--accept-implausible" in refused(folder, *words)
    call("campaign", *words, "--accept-implausible", code=0)


def test_a_point_is_left_out_only_before_it_is_read(campaign):
    folder, arm = campaign
    first, second = (arm.plan.points.label[point] for point in arm.plan.route[:2])
    call("campaign", "record", folder, "--position-mm", arm.position(first))
    refused(folder, "leave-out", folder, first, "--reason", "hidden")
    call("campaign", "leave-out", folder, second, "--reason", "hidden", code=0)
    refused(folder, "leave-out", folder, second, "--reason", "again")
    refused(folder, "leave-out", folder, "nowhere", "--reason", "hidden")
    found = standing(folder)
    assert found["left_out"] == {second: "hidden"}
    assert found["candidates"] == 19
    assert found["next_point"] not in (first, second)
    refused(folder, "record", folder, "--point", second, "--position-mm", arm.position(second))


def test_a_reading_that_went_wrong_is_struck_but_stays_in_the_report(campaign):
    folder, arm = campaign
    refused(folder, "strike", folder, 1, "--reason", "x")
    recorded(folder, arm, 3)
    refused(folder, "strike", folder, 4, "--reason", "x")
    refused(folder, "strike", folder, 1, "--reason", " ")
    call("campaign", "strike", folder, 1, "--reason", "not seated", code=0)
    found = standing(folder)
    assert found["next_point"] == arm.plan.points.label[arm.plan.route[0]]
    assert found["readings"] == 2
    assert found["struck"] == {"1": "not seated"}
    refused(folder, "strike", folder, 1, "--reason", "x")
    recorded(folder, arm, 1)
    call("campaign", "report", folder, code=0)
    readings = store.read(folder / "report" / "campaign_readings.parquet")
    assert list(readings["struck"]) == ["not seated", None, None, None]
    np.testing.assert_array_equal(readings["used"], [np.nan, 2, 3, 1])
    assert "not seated" in (folder / "report" / "report.md").read_text()


@pytest.mark.parametrize(
    ("options", "place"),
    [
        (("--noise-mm", "0"), "noise"),
        (("--noise-mm", "1,2,3,4,5,6,7,8,9"), "is no covariance"),
        (("--instrument", "a=0.1,0.2"), "1 standard deviation, 3"),
        (("--instrument", "a=0.1", "--instrument", "a=0.2"), "is given twice"),
        ((), "--noise-mm"),
        (("--noise-mm", "0.1", "--budget", "0"), "--budget"),
        (("--noise-mm", "0.1", "--assessor", "guess"), "search_and_confirm"),
        (("--noise-mm", "0.1", "--set", "repeats=3"), "setting repeats"),
        (("--noise-mm", "0.1", "--confidence", "2"), "should be less than 1"),
        (("--noise-mm", "0.1", "--tolerance-mm", "-1"), "--tolerance-mm"),
        (("--noise-mm", "0.1", "--session", "noon"), "noon"),
    ],
)  # fmt: skip
def test_what_cannot_be_begun_leaves_no_folder(study, tmp_path, options, place):
    folder = tmp_path / "campaign"
    said = refusal("campaign", "start", folder, "--calibration", study, *options)
    assert place in said
    assert not folder.exists()


@pytest.mark.parametrize(
    ("options", "place"),
    [
        (("--position-mm", "nan,1,2"), "--position-mm"),
        (("--position-mm", "a,b,c"), "3 numbers"),
        (("--position-mm", "1,2,3", "--point", "none"), "'none'"),
        (("--position-mm", "1,2,3", "--instrument", "none"), "instrument"),
        (("--position-mm", "1,2,3", "--joints-deg", "1,2"), "6 numbers"),
        ((), "the reading"),
    ],
)
def test_a_bad_reading_leaves_the_campaign_as_it_was(campaign, options, place):
    folder, _ = campaign
    assert place in refused(folder, "record", folder, *options)


def test_a_second_campaign_does_not_overwrite_the_first(campaign, study):
    folder, _ = campaign
    said = refused(folder, "start", folder, "--calibration", study,
                   "--noise-mm", "0.1")  # fmt: skip
    assert "a campaign is there already" in said


def test_a_campaign_of_other_bounds_is_read_and_not_continued(campaign):
    folder, _ = campaign
    plan = folder / "campaign.json"
    plan.write_text(plan.read_text().replace(f'"method": {plans.METHOD}', '"method": 1'))
    call("campaign", "status", folder, code=0)
    for words in (("next", folder), ("record", folder, "--position-mm", "1,2,3")):
        said = refused(folder, *words)
        assert "method 1" in said
        assert "continue it with kinacc 0." in said


def test_a_plan_that_was_edited_is_noticed(campaign):
    folder, arm = campaign
    recorded(folder, arm, 1)
    path = folder / "campaign.json"
    path.write_text(path.read_text().replace('"seed": 0', '"seed": 1'))
    assert "readings.jsonl, line 1" in refused(folder, "status", folder)


def test_a_report_holds_its_contract_and_the_numbers_of_status(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base", "--tolerance-mm", "2")
    arm = Arm(folder)
    refused(folder, "report", folder)
    recorded(folder, arm, 18)
    state = campaigns.open_(folder).state
    point = next(each for each in state.rows if each not in {e.reading.point for e in state.used})
    label = arm.plan.points.label[point]
    call("campaign", "leave-out", folder, label, "--reason", "hidden")
    call("campaign", "report", folder, code=0)
    made = folder / "report"
    for name in ("campaign_points", "campaign_readings", "campaign_bounds"):
        assert not check_file(made / f"{name}.parquet", ARTEFACTS[name])
    text, main = (made / "report.md").read_text(), standing(folder)["bounds"][0]
    assert f"{main['upper_mm']:.3f} mm" in text
    assert "hidden" in text
    bounds = store.read(made / "campaign_bounds.parquet")
    last = bounds["readings"] == bounds["readings"].max()
    upper = bounds["upper_mm"][last & (bounds["target"] == main["target"])]
    assert upper[0] == pytest.approx(main["upper_mm"])


def test_a_report_kept_elsewhere_tells_that_its_last_readings_were_taken_away(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    recorded(folder, arm := Arm(folder), 5)
    earlier = {each.name: each.read_bytes() for each in folder.iterdir() if each.is_file()}
    recorded(folder, arm, 2)
    call("campaign", "report", folder)
    text = (folder / "report" / "report.md").read_text()
    told = re.search(r"7 readings; SHA-256 of readings.jsonl (\w{64})", text)[1]
    assert told == hashlib.sha256((folder / "readings.jsonl").read_bytes()).hexdigest()
    known = ("verify", folder, "--sha256", told)
    assert call("campaign", *known).output.startswith("PASS")
    recorded(folder, arm, 1)
    call("campaign", *known, code=0)
    for name, content in earlier.items():  # the folder as it was before the two readings
        (folder / name).write_bytes(content)
    call("campaign", "verify", folder, code=0)
    call("campaign", *known, code=1)
    recorded(folder, Arm(folder, 1.1 * SIGMA_MM), 2)  # others in their place
    call("campaign", *known, code=1)
