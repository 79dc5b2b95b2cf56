"""``kinacc campaign`` as a person uses it: a whole campaign, files, instruments, mistakes."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from command_line import call, small_study

from kinacc.artifacts import store
from kinacc.artifacts.contract import ARTEFACTS
from kinacc.assess.random_numbers import key_of
from kinacc.assess.registry import CHOOSING
from kinacc.assess.simulate import conduct
from kinacc.assess.world import drawn_world
from kinacc.campaign import folder as campaigns
from kinacc.campaign import prediction_check
from kinacc.campaign.reading import Reading
from kinacc.campaign.words import reason
from kinacc.cli import campaigns_answers
from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics.model import JointState
from kinacc.workflow.verification.conformity import check_file

SIGMA_MM = 0.05


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    """Results of a small synthetic study, made by the workflow's own stages."""
    return small_study(tmp_path_factory.mktemp("study"))


@pytest.fixture
def begun(calibration, tmp_path):
    """Start a campaign with further options; its folder."""

    def start(*more, points=20, budget=20):
        folder = tmp_path / f"campaign {len(list(tmp_path.iterdir()))}"
        done = call("campaign", "start", folder, "--calibration", calibration, "--robot", "mh180",
                    "--model", "dh", "--drawn", points, "--budget", budget, *more)  # fmt: skip
        assert done.exit_code == 0, done.output
        return folder

    return start


class Arm:
    """The arm at the campaign: its errors are known here, and its readings are those of a world."""

    def __init__(self, folder, sigma_mm=SIGMA_MM):
        self.plan = campaigns.open_(folder).plan
        rows = self.plan.visiting(frozenset())
        errors = np.random.default_rng(11).normal(size=(len(rows), 3)) * 0.2
        errors[5] = (0.9, -0.6, 0.5)
        self.world = drawn_world(errors[rows], sigma_mm, key_of(5), 200)
        self.row = {int(point): row for row, point in enumerate(rows)}
        self.reads = np.zeros(len(rows), dtype=int)

    def position(self, label):
        """What the instrument reads next at a point, as text."""
        point = self.plan.points.number(label)
        row = self.row[point]
        seen = self.plan.points.modelled_mm[point] + self.world.reading_mm(row, self.reads[row])
        self.reads[row] += 1
        return ",".join(repr(float(each)) for each in seen)


def standing(folder):
    """What status says, without a forecast."""
    return json.loads(call("campaign", "status", folder, "--json", "--simulations", 0).stdout)


def files_of(folder):
    """Everything in a campaign's folder but the empty lock."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "lock"}


def refused(folder, *words):
    """The message of a command that must fail and leave the campaign as it was."""
    before = files_of(folder)
    done = call("campaign", *words)
    assert done.exit_code == 2, done.output
    assert "Traceback" not in done.output
    assert files_of(folder) == before
    return done.output


def test_a_budget_below_the_candidates_is_told_what_more_would_bring(calibration, tmp_path):
    def start(budget, *more):
        return call("campaign", "start", tmp_path / str(budget), "--calibration", calibration,
                    "--robot", "mh180", "--model", "dh", "--drawn", 60, "--budget", budget,
                    "--noise-mm", SIGMA_MM, *more).output  # fmt: skip

    assert "with 59 readings, the bound on all candidates would need no assumption" in start(58)
    assert "need no assumption" not in start(59)
    assert "no bound will be stated: that takes 84 points" in start(57, "--assessor", "kinematic")


def test_a_whole_campaign_ends_as_in_memory(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    asked = []
    while point := json.loads(
        call("campaign", "status", folder, "--json", "--simulations", 0).stdout
    )["next"]:
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


def test_a_cut_off_reading_is_told_and_can_be_recorded_again(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    arm = Arm(folder)
    first, second = (arm.plan.points.label[point] for point in arm.plan.route[:2])
    call("campaign", "record", folder, "--position-mm", arm.position(first))
    journal = folder / "readings.jsonl"
    whole, confirmed = journal.read_bytes(), (folder / "head.json").read_bytes()
    call("campaign", "record", folder, "--position-mm", arm.position(second))
    journal.write_bytes(journal.read_bytes()[:-9])
    (folder / "head.json").write_bytes(confirmed)  # the command ended while it wrote
    shown = call("campaign", "status", folder)
    assert "was cut off" in shown.output
    assert "1 of 20 readings taken" in shown.output
    arm.reads[arm.row[arm.plan.points.number(second)]] = 0
    done = call("campaign", "record", folder, "--position-mm", arm.position(second))
    assert done.exit_code == 0
    assert journal.read_bytes().startswith(whole)
    assert "cut off" not in call("campaign", "status", folder).output
    assert len(campaigns.open_(folder).state().told) == 2


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
        ((), "--noise-mm or --covariance-mm2, or --instrument"),
        (
            ("--noise-mm", "0.1", "--budget", "0"),
            "--budget: 0; allowed: a whole number, at least 1",
        ),
        (("--noise-mm", "0.1", "--assessor", "two_stage", "--budget", "4"), "do not cover"),
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


def test_what_the_calibration_is_unsure_of_is_said_before_anything_is_written(
    calibration, tmp_path, monkeypatch
):
    folder, seen = tmp_path / "campaign", []

    def doubts(_):
        seen.append(folder.exists())
        return ["warning: doubtful"]

    monkeypatch.setattr(prediction_check.Unsure, "in_words", doubts)
    done = call("campaign", "start", folder, "--calibration", calibration, "--robot", "mh180",
                "--model", "dh", "--noise-mm", "0.1", "--json")  # fmt: skip
    assert done.exit_code == 0, done.output
    assert "warning: doubtful" in done.stderr
    assert json.loads(done.stdout)["points"] == 200
    assert seen == [False]


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


def recorded(folder, arm, count):
    """Take the next ``count`` readings through one file per reading of the arm."""
    for _ in range(count):
        with campaigns.writing(folder) as opened:
            state = opened.state()
            label = arm.plan.points.label[state.asked]
            seen = [float(each) for each in arm.position(label).split(",")]
            taken = Reading(state.asked, np.array(seen), arm.plan.instruments[0].name)
            opened.write(campaigns.readings_entry([taken]))


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
        assert len(next(iter(columns.values())))
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


def test_a_report_kept_elsewhere_tells_that_its_last_readings_were_taken_away(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    recorded(folder, arm := Arm(folder), 5)
    earlier = {each.name: each.read_bytes() for each in folder.iterdir() if each.is_file()}
    recorded(folder, arm, 2)
    call("campaign", "report", folder)
    text = (folder / "report" / "report.md").read_text()
    head = re.search(r"7 readings, head (\w{16})\.", text)[1]
    known = ("verify", folder, "--head", head, "--readings", 7)
    assert "it holds what was reported" in call("campaign", *known).output
    recorded(folder, arm, 1)
    assert call("campaign", *known).exit_code == 0
    for name, content in earlier.items():  # the folder as it was before the two readings
        (folder / name).write_bytes(content)
    assert call("campaign", "verify", folder).exit_code == 0
    done = call("campaign", *known)
    assert done.exit_code == 1
    assert f"holds no entry {head}: it was shortened or rewritten" in done.output
    done = call("campaign", "verify", folder, "--readings", 7)
    assert done.exit_code == 1
    assert "5 readings; allowed: 7 as reported" in done.output


def test_a_clock_that_went_back_is_asked_about_before_a_reading_is_taken(begun, monkeypatch):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    recorded(folder, arm := Arm(folder), 2)
    label = standing(folder)["next"]
    reading = ("--point", label, "--position-mm", arm.position(label))
    with monkeypatch.context() as patched:
        patched.setattr(campaigns, "_stamp", _in_1999(campaigns._stamp))
        said = refused(folder, "record", folder, *reading)
        assert "the clock of this computer: says 1999-12-31" in said
        assert call("campaign", "record", folder, *reading, "--accept-implausible").exit_code == 0
    recorded(folder, arm, 1)
    call("campaign", "report", folder)
    assert "clock was set in between" in (folder / "report" / "report.md").read_text()


def _in_1999(stamp):
    return lambda time=None: stamp(time) if time else "1999-12-31T23:59:59+00:00"


def test_a_reading_from_beyond_all_rooms_is_never_taken(begun, tmp_path):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base")
    label = standing(folder)["next"]
    file = tmp_path / "far.csv"
    file.write_text(f"pose,x_mm,y_mm,z_mm\n{label},1e308,0,0\n")
    said = refused(folder, "record", folder, file, "--accept-implausible")
    assert "three numbers within 1e+06 mm" in said


def test_a_candidate_with_spaces_about_its_name_can_be_recorded(calibration, tmp_path):
    joints = tmp_path / "candidates.csv"
    names = [f"q{joint}_deg" for joint in range(1, 7)]
    rows = [f"  sp{n} ,{n},{10 + n},{n},{n},{20 + n},{n}" for n in range(4)]
    joints.write_text("\n".join(["pose," + ",".join(names), *rows]) + "\n")
    folder = tmp_path / "spaced"
    done = call("campaign", "start", folder, "--calibration", calibration, "--robot", "mh180",
                "--model", "dh", "--candidates", joints, "--budget", 4, "--noise-mm", SIGMA_MM,
                "--frame", "base", "--sure")  # fmt: skip
    assert done.exit_code == 0, done.output
    label = standing(folder)["next"]
    assert label == label.strip()
    plan = campaigns.open_(folder).plan
    seen = ",".join(map(repr, map(float, plan.points.modelled_mm[plan.points.number(label)])))
    done = call("campaign", "record", folder, "--point", f" {label} ", "--position-mm", seen)
    assert done.exit_code == 0, done.output


def left_to_visit(folder):
    """Names of points without readings."""
    state = campaigns.open_(folder).state()
    have = {each.reading.point for each in state.told}
    return [state.plan.points.label[point] for point in state.rows if point not in have]


def test_status_refuses_aims_that_are_none(begun):
    folder = begun("--noise-mm", SIGMA_MM)
    said = refused(folder, "status", folder, "--width-mm", "-1", "--tolerance-mm", "0")
    assert "--width-mm: -1; allowed: above 0" in said
    assert "--tolerance-mm: 0; allowed: above 0" in said


def test_status_forecasts_what_the_wanted_width_takes(begun):
    folder = begun("--noise-mm", SIGMA_MM, "--frame", "base", "--width-mm", "0.25", budget=40)
    arm = Arm(folder)
    assert json.loads(call("campaign", "status", folder, "--json").stdout)["forecast"] is None
    recorded(folder, arm, 22)
    said = json.loads(call("campaign", "status", folder, "--json", "--simulations", "8").stdout)[
        "forecast"
    ]
    assert said["readings_left"] == 18
    assert said["final_width_mm"]["q05"] <= said["final_width_mm"]["q95"]
    assert 0.0 <= said["reached_within_budget"] <= 1.0
    again = call("campaign", "status", folder, "--json", "--simulations", "8").stdout
    assert json.loads(again)["forecast"] == said
    shown = call("campaign", "status", folder, "--simulations", "8").output
    assert "by 8 simulations from the readings so far" in shown


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
    assert "different states of a campaign" in done.output


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


@pytest.mark.parametrize("assessor", CHOOSING)
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
