"""``kinacc campaign`` as a person uses it: a whole campaign, files, instruments, mistakes."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from campaign_on_disk import SIGMA_MM, Arm, files_of, recorded, refused, standing
from command_line import call

from kinacc.assess.registry import ADAPTIVE
from kinacc.assess.simulate import conduct
from kinacc.campaign import folder as campaigns
from kinacc.campaign.words import reason
from kinacc.cli import campaigns_answers
from kinacc.gate.conformity import check_file
from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics.model import JointState
from kinacc.tables import store
from kinacc.tables.contract import ARTEFACTS


def test_a_budget_below_the_candidates_is_told_what_more_would_bring(calibration, tmp_path):
    def start(budget, *more):
        return call("campaign", "start", tmp_path / str(budget), "--calibration", calibration,
                    "--robot", "mh180", "--model", "dh", "--drawn", 60, "--budget", budget,
                    "--noise-mm", SIGMA_MM, *more).output  # fmt: skip

    assert "with 59 readings it would be on all" in " ".join(start(58).split())
    assert "it would be on all" not in start(59)


def test_a_whole_campaign_ends_as_in_memory(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    asked = []
    while point := json.loads(call("campaign", "status", folder, "--json").stdout)["next"]:
        asked.append(point)
        done = call("campaign", "record", folder, "--point", point,
                    "--position-mm", arm.position(point))  # fmt: skip
        assert done.exit_code == 0, done.output
    assert len(asked) == 20
    said = standing(folder)
    wanted = conduct(arm.plan.assessor, arm.world).statements()
    assert [each["target"] for each in said["statements"]] == [each.target for each in wanted]
    for mine, theirs in zip(said["statements"], wanted, strict=True):
        assert mine["withheld"] == reason(theirs.withheld)
        for name in ("value_mm", "lower_mm", "upper_mm"):
            given = np.nan if mine[name] is None else mine[name]
            np.testing.assert_allclose(given, getattr(theirs, name), atol=1e-9)
    assert "the budget is spent" in call("campaign", "status", folder).output
    assert call("campaign", "next", folder).output.strip() == "the budget is spent"
    assert "the budget is spent" in refused(folder, "record", folder, "--position-mm", "1,2,3")


def test_next_names_joints_with_units_and_writes_nothing(begun):
    folder = begun("--noise-mm", SIGMA_MM)
    before = files_of(folder)
    shown = call("campaign", "next", folder).output
    plan = campaigns.open_(folder).plan
    joints = plan.points.joints[plan.route[0]]
    for joint, value in enumerate(joints):
        line = next(line for line in shown.splitlines() if f"q{joint + 1} " in line)
        assert f"{np.rad2deg(value):.4f} deg" in line
        assert f"{value:.7f} rad" in line
    assert files_of(folder) == before


def test_the_rest_of_the_first_visit_can_be_written_for_a_robot_program(begun, tmp_path):
    folder = begun("--noise-mm", SIGMA_MM)
    output = tmp_path / "visit.csv"
    assert call("campaign", "next", folder, "--all", "-o", output).exit_code == 0
    lines = output.read_text().splitlines()
    plan = campaigns.open_(folder).plan
    assert [line.split(",")[0] for line in lines[1:]] == [plan.points.label[p] for p in plan.route]


@pytest.mark.parametrize("frame", ["base", "instrument"])
def test_readings_are_expected_in_the_frame_they_come_in(make_plan, frame):
    to_base = Pose(exp_so3(np.array([0.1, -0.2, 0.3])), np.array([500.0, -20.0, 30.0]))
    plan = replace(make_plan(frame=frame), to_base=to_base)
    sheet = campaigns_answers.visit_sheet(plan, [4, 2])
    fields = {field.name: field for field in sheet.fields}
    assert frame in fields["expected_x_mm"].meaning
    seen = np.stack([fields[f"expected_{axis}_mm"].values for axis in "xyz"], axis=1)
    if frame == "instrument":
        seen = seen @ to_base.rotation.T + to_base.position_mm
    np.testing.assert_allclose(seen, plan.points.modelled_mm[[4, 2]], atol=1e-9)


def test_a_file_of_readings_is_taken_whole(begun, tmp_path):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    names = [arm.plan.points.label[point] for point in arm.plan.route]
    file = tmp_path / "readings.csv"
    rows = "".join(f"{name},{arm.position(name)}\n" for name in names)
    file.write_text("pose,x_mm,y_mm,z_mm\n" + rows)
    done = call("campaign", "record", folder, file)
    assert done.exit_code == 0, done.output
    assert f"recorded: {len(names)} readings" in done.output
    said = standing(folder)
    assert said["readings_used"] == len(names)
    assert said["statements"][0]["upper_mm"] is not None
    assert "was recorded before" in refused(folder, "record", folder, file)


def test_a_file_with_bad_rows_is_refused_whole_with_all_of_them_named(begun, tmp_path):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    a, b, c = (arm.plan.points.label[point] for point in arm.plan.route[:3])
    file = tmp_path / "readings.csv"
    file.write_text(
        f"pose,x_mm,y_mm,z_mm,instrument\n{a},{arm.position(a)},\n{b},nan,1,2,\n{c},1,2,3,\n"
        f"elsewhere,1,2,3,\n{b},{arm.position(b)},sextant\n"
    )
    said = refused(folder, "record", folder, file)
    for words in ("line 3: measured position (nan", "line 4: ", "from where the model has",
                  "line 5: 'elsewhere' is no candidate", "'sextant' is not there"):  # fmt: skip
        assert words in said
    done = call("campaign", "record", folder, file, "--skip-bad")
    assert done.exit_code == 0, done.output
    assert "recorded: 1 readings" in done.output
    assert done.output.count("not taken") == 4


def test_rows_of_a_file_find_their_points_by_their_joints(begun, tmp_path):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    point = int(arm.plan.route[0])
    joints = np.rad2deg(arm.plan.points.joints[point]) + 0.005
    file = tmp_path / "readings.csv"
    head = ",".join([*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"])
    cells = ",".join(f"{each:.6f}" for each in joints)
    file.write_text(f"{head}\n{cells},{arm.position(arm.plan.points.label[point])}\n")
    assert call("campaign", "record", folder, file).exit_code == 0
    (told,) = campaigns.open_(folder).state().told
    assert told.reading.point == point


def test_a_reading_at_slightly_other_joints_is_held_to_the_model_there(begun, calibration):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base", "--joint-tolerance-deg", "0.05")
    plan = campaigns.open_(folder).plan
    point = int(plan.route[0])
    joints = plan.points.joints[point] + np.deg2rad([0.03, -0.02, 0.04, 0.01, -0.05, 0.02]) * 0.99
    from kinacc.cli import choice

    arm = choice.calibration_of(calibration, "dh", "mh180", ())
    there = arm.pose(JointState(joints[None] @ arm.robot.joint_map.T)).position_mm[0]
    assert np.linalg.norm(there - plan.points.modelled_mm[point]) > 0.5
    done = call("campaign", "record", folder,
                "--joints-rad", ",".join(map(repr, joints.tolist())),
                "--position-mm", ",".join(map(repr, there.tolist())))  # fmt: skip
    assert done.exit_code == 0, done.output
    (told,) = campaigns.open_(folder).state().told
    assert np.linalg.norm(told.error_mm) < 2e-3


def test_readings_in_the_instruments_frame_say_the_same(begun, calibration):
    folder = begun("--noise-mm", SIGMA_MM)
    from kinacc.cli import choice

    plan = campaigns.open_(folder).plan
    arm = choice.calibration_of(calibration, "dh", "mh180", ())
    point = int(plan.route[0])
    dh_joints = plan.points.joints[[point]] @ arm.robot.joint_map.T
    seen = arm.pose(JointState(dh_joints), "instrument").position_mm[0] + (0.1, 0.2, -0.2)
    call("campaign", "record", folder, "--position-mm", ",".join(map(repr, seen.tolist())))
    (told,) = campaigns.open_(folder).state().told
    assert np.linalg.norm(told.error_mm) == pytest.approx(0.3, abs=1e-9)


def test_the_wrong_pose_is_refused_by_joints_and_by_position(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    first, second = (int(point) for point in arm.plan.route[:2])
    position = arm.position(arm.plan.points.label[first])
    joints = ",".join(map(repr, arm.plan.points.joints[second].tolist()))
    said = refused(folder, "record", folder, "--joints-rad", joints, "--position-mm", position)
    assert f"is not that of point {arm.plan.points.label[first]}" in said
    assert f"these are the joints of point {arm.plan.points.label[second]}" in said
    position = arm.position(arm.plan.points.label[second])
    said = refused(folder, "record", folder, "--position-mm", position)
    assert "give --accept-implausible" in said
    done = call("campaign", "record", folder, "--position-mm", position, "--accept-implausible")
    assert done.exit_code == 0


def test_a_point_is_left_out_only_before_it_is_read(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    first, second = (arm.plan.points.label[point] for point in arm.plan.route[:2])
    call("campaign", "record", folder, "--position-mm", arm.position(first))
    assert "could hide a large error" in refused(
        folder, "leave-out", folder, first, "--reason", "hidden"
    )
    done = call("campaign", "leave-out", folder, second, "--reason", "hidden")
    assert done.exit_code == 0, done.output
    said = standing(folder)
    assert said["left_out"] == {second: "hidden"}
    assert said["points"] == 19
    assert said["next"] not in (first, second)
    refused(folder, "record", folder, "--point", second, "--position-mm", arm.position(second))


def test_a_reading_that_went_wrong_is_struck_but_stays_in_the_report(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    assert "none was taken yet" in refused(folder, "strike", folder, 1, "--reason", "x")
    recorded(folder, arm, 3)
    first = arm.plan.points.label[arm.plan.route[0]]
    assert "reading 4: is not there" in refused(folder, "strike", folder, 4, "--reason", "x")
    assert "--reason" in refused(folder, "strike", folder, 1, "--reason", " ")
    done = call("campaign", "strike", folder, 1, "--reason", "reflector not seated")
    assert done.exit_code == 0, done.output
    assert "was struck: reflector not seated" in done.output
    said = standing(folder)
    assert said["next"] == first
    assert said["readings"] == 2
    assert said["struck"] == {"1": "reflector not seated"}
    assert "was struck before" in refused(folder, "strike", folder, 1, "--reason", "x")
    recorded(folder, arm, 1)
    assert call("campaign", "report", folder).exit_code == 0
    readings = store.read(folder / "report" / "campaign_readings.parquet")
    assert list(readings["struck"]) == ["reflector not seated", None, None, None]
    np.testing.assert_array_equal(readings["used"], [np.nan, 2, 3, 1])
    assert "reflector not seated" in (folder / "report" / "report.md").read_text()


def test_a_reading_given_twice_to_the_last_digit_is_taken_once(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    label = arm.plan.points.label[int(arm.plan.route[0])]
    words = ("record", folder, "--point", label, "--position-mm", arm.position(label))
    assert call("campaign", *words).exit_code == 0
    assert "is reading 1, to the last digit" in refused(folder, *words)
    assert call("campaign", *words, "--again").exit_code == 0


def test_readings_of_a_file_that_has_grown_are_taken_once(begun, tmp_path):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    names = [arm.plan.points.label[point] for point in arm.plan.route[:3]]
    rows = [f"{name},{arm.position(name)}" for name in names]
    file = tmp_path / "export.csv"

    def export(*kept):
        file.write_text("\n".join(["pose,x_mm,y_mm,z_mm", *kept]) + "\n")

    export(*rows[:2])
    assert call("campaign", "record", folder, file).exit_code == 0
    export(*rows, rows[2])
    said = refused(folder, "record", folder, file)
    assert "line 5: is line 4, to the last digit" in said
    for known_or_new in ("line 2: ", "line 3: ", "line 4: "):
        assert known_or_new not in said
    done = call("campaign", "record", folder, file, "--skip-bad")
    assert done.exit_code == 0
    assert "known: 2 rows recorded before, as readings 1 to 2" in done.output
    assert standing(folder)["readings"] == 3
    assert call("campaign", "record", folder, file, "--again").exit_code == 0
    assert standing(folder)["readings"] == 4
    assert "was recorded before" in refused(folder, "record", folder, file, "--again")


@pytest.mark.parametrize(
    ("noise", "words"),
    [
        (("--noise-mm", "0"), "no instrument is without noise"),
        (("--noise-mm", "-0.1"), "no instrument is without noise"),
        (("--noise-mm", "nan"), "nan"),
        (("--covariance-mm2", "1,2,3,4,5,6,7,8,9"), "not symmetric"),
        (("--covariance-mm2", "1,1,0,1,1,0,0,0,1"), "not positive definite"),
        (("--covariance-mm2", "1,0,0,0,1,0,0,0,-1"), "not positive definite"),
        (("--instrument", "a=0.1,0.2"), "1 standard deviation, 3"),
        (("--instrument", "a=0.1", "--instrument", "a=0.2"), "is given twice"),
        ((), "--noise-mm MM, or --covariance-mm2, or --instrument NAME=MM"),
        (
            ("--noise-mm", "0.1", "--budget", "0"),
            "--budget: 0; allowed: a whole number, at least 1",
        ),
        (("--noise-mm", "0.1", "--assessor", "guess"), "search_and_confirm"),
        (("--noise-mm", "0.1", "--set", "repeats=3"), "setting repeats"),
        (("--noise-mm", "0.1", "--confidence", "2"), "at least 0.5 and below 1"),
        (("--noise-mm", "0.1", "--tolerance-mm", "-1"), "--tolerance-mm"),
        (("--noise-mm", "0.1", "--drawn", "1"), "at least 2 different points"),
        (("--noise-mm", "0.1", "--session", "noon"), "none: the data name no sessions"),
    ],
)
def test_what_cannot_be_begun_leaves_no_folder(calibration, tmp_path, noise, words):
    folder = tmp_path / "campaign"
    done = call("campaign", "start", folder, "--calibration", calibration, "--robot", "mh180",
                *noise)  # fmt: skip
    assert done.exit_code == 2, done.output
    assert words in done.output
    assert "Traceback" not in done.output
    assert not folder.exists()


def test_points_that_are_all_equal_are_refused(calibration, tmp_path):
    file = tmp_path / "points.csv"
    head = ",".join(f"q{i}_deg" for i in range(1, 7))
    file.write_text(f"{head}\n" + "0,0,0,0,60,0\n" * 3)
    done = call("campaign", "start", tmp_path / "c", "--calibration", calibration, "--robot",
                "mh180", "--noise-mm", "0.1", "--candidates", file)  # fmt: skip
    assert done.exit_code == 2
    assert "all 3 are at the same joints" in done.output
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--position-mm", "nan,1,2"), "three numbers x,y,z"),
        (("--position-mm", "inf,1,2"), "three numbers x,y,z"),
        (("--position-mm", "1,2"), "three numbers x,y,z"),
        (("--position-mm", "a,b,c"), "three numbers x,y,z"),
        (("--position-mm", "1,2,3", "--point", "none"), "is no candidate"),
        (("--position-mm", "1,2,3", "--instrument", "none"), "--instrument"),
        (("--position-mm", "1,2,3", "--joints-deg", "1,2"), "6 numbers"),
        (("--position-mm", "1,2,3", "--std-mm", "0"), "no instrument is without noise"),
        ((), "the reading"),
    ],
)
def test_a_bad_reading_leaves_the_campaign_as_it_was(begun, words, said):
    folder = begun("--noise-mm", SIGMA_MM)
    assert said in refused(folder, "record", folder, *words)


def test_a_second_campaign_does_not_overwrite_the_first(begun, calibration):
    folder = begun("--noise-mm", SIGMA_MM)
    said = refused(folder, "start", folder, "--calibration", calibration, "--robot", "mh180",
                   "--noise-mm", "0.1", "--width-mm", "-1")  # fmt: skip
    assert "a campaign is there already" in said
    assert "--width-mm" in said


def test_a_campaign_of_other_bounds_is_read_and_not_continued(begun):
    folder = begun("--noise-mm", SIGMA_MM)
    plan = folder / "campaign.json"
    plan.write_text(plan.read_text().replace('"method": 2', '"method": 1'))
    assert call("campaign", "status", folder).exit_code == 0
    for words in (("next", folder), ("record", folder, "--position-mm", "1,2,3")):
        done = call("campaign", *words)
        assert done.exit_code == 2
        assert "method 1" in done.output


def test_a_plan_that_was_edited_is_noticed(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    label = arm.plan.points.label[int(arm.plan.route[0])]
    call("campaign", "record", folder, "--position-mm", arm.position(label))
    path = folder / "campaign.json"
    path.write_text(path.read_text().replace('"seed": 0', '"seed": 1'))
    assert "belongs to another campaign" in refused(folder, "status", folder)


def test_there_is_no_campaign(tmp_path):
    for name in ("next", "status"):
        done = call("campaign", name, tmp_path / "nowhere")
        assert done.exit_code == 2
        assert "kinacc campaign start" in done.output
    assert not (tmp_path / "nowhere").exists()


def test_a_report_holds_its_contract_and_says_what_status_says(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base", "--tolerance-mm", "2")
    arm = Arm(folder)
    assert "no reading was asked for and taken yet" in refused(folder, "report", folder)
    recorded(folder, arm, 18)
    call("campaign", "leave-out", folder, next(iter(left_to_visit(folder))), "--reason", "hidden")
    done = call("campaign", "report", folder)
    assert done.exit_code == 0, done.output
    made = folder / "report"
    for name in ("campaign_points", "campaign_readings", "campaign_bounds"):
        columns, problems = check_file(made / f"{name}.parquet", ARTEFACTS[name])
        assert not problems
        assert len(columns)
    assert call("check-results", made).exit_code == 0
    said = standing(folder)
    text = (made / "report.md").read_text()
    for each in said["statements"]:
        assert each["in_words"] in text
    assert "measured points: **accept**" in text
    assert "left out: hidden" in text
    bounds = store.read(made / "campaign_bounds.parquet")
    last = bounds["readings"] == bounds["readings"].max()
    upper = bounds["upper_mm"][last & (bounds["target"] == "measured")]
    assert upper[0] == pytest.approx(said["statements"][0]["upper_mm"])
    points = store.read(made / "campaign_points.parquet")
    assert np.nanmax(points["upper_mm"]) == pytest.approx(upper[0])
    before = {path.name: path.read_bytes() for path in made.iterdir()}
    assert call("campaign", "report", folder).exit_code == 0
    assert {path.name: path.read_bytes() for path in made.iterdir()} == before


def left_to_visit(folder):
    """Names of points without readings."""
    state = campaigns.open_(folder).state()
    have = {each.reading.point for each in state.told}
    return [state.plan.points.label[point] for point in state.rows if point not in have]


def test_status_refuses_aims_that_are_none(begun):
    folder = begun("--noise-mm", SIGMA_MM)
    said = refused(folder, "status", folder, "--tolerance-mm", "0")
    assert "--tolerance-mm: 0; allowed: above 0" in said


def test_tables_of_two_states_of_a_campaign_do_not_pass_as_one_report(begun, tmp_path):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    recorded(folder, arm, 13)
    call("campaign", "report", folder)
    earlier = (folder / "report" / "campaign_points.parquet").read_bytes()
    recorded(folder, arm, 1)
    call("campaign", "report", folder)
    (folder / "report" / "campaign_points.parquet").write_bytes(earlier)
    done = call("check-results", folder / "report")
    assert done.exit_code == 1
    assert "campaign_points" in done.output


def test_a_folder_that_cannot_be_written_is_said(begun, calibration, tmp_path):
    taken = tmp_path / "file"
    taken.write_text("")
    done = call("campaign", "start", taken / "campaign", "--calibration", calibration, "--robot",
                "mh180", "--noise-mm", "0.1")  # fmt: skip
    assert done.exit_code == 1
    assert "cannot be written" in done.output
    assert "Traceback" not in done.output


def test_candidates_drawn_for_a_vec_model_are_ones_it_speaks_of(calibration, tmp_path):
    folder = tmp_path / "campaign"
    done = call("campaign", "start", folder, "--calibration", calibration, "--robot", "mh180",
                "--model", "vec", "--drawn", 30, "--noise-mm", "0.1")  # fmt: skip
    assert done.exit_code == 0, done.output
    plan = campaigns.open_(folder).plan
    assert len(plan.points) == 30
    assert np.isfinite(plan.points.modelled_mm).all()
    done = call("campaign", "start", tmp_path / "other", "--calibration", calibration, "--robot",
                "mh180", "--model", "vec", "--region", "limits", "--noise-mm", "0.1")  # fmt: skip
    assert done.exit_code == 2
    assert "says nothing beyond" in done.output


@pytest.mark.parametrize("assessor", ADAPTIVE)
def test_a_campaign_of_any_assessor_begins_as_it_is_offered_and_takes_a_reading(begun, assessor):
    folder = begun("--noise-mm", SIGMA_MM, "--assessor", assessor, "--sure")
    asked = standing(folder)["next"]
    done = call("campaign", "record", folder, "--position-mm", Arm(folder).position(asked))
    assert done.exit_code == 0, done.output
    assert standing(folder)["readings"] == 1


@pytest.mark.parametrize("assessor", ["gamma_quantile", "model_invalidation_full"])
def test_a_confidence_asked_of_an_assessor_without_bounds_is_refused_with_the_reason(
    calibration, tmp_path, assessor
):
    done = call("campaign", "start", tmp_path / "check", "--calibration", calibration,
                "--noise-mm", SIGMA_MM, "--assessor", assessor, "--confidence", 0.9)  # fmt: skip
    assert done.exit_code != 0
    said = " ".join(done.output.split())
    assert f"--confidence: 0.9: {assessor} states a value without bounds" in said
