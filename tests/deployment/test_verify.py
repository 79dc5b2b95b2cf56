"""A calibration held to later readings: what was moved does not count, and what was fitted does."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import call, small_study
from small_arms import BASE, TOOL, WEIGHT, joints, results, truth

from kinacc.artifacts import store
from kinacc.calibration.observations import full_poses
from kinacc.calibration.summary import of_errors
from kinacc.deployment.folder import calibration, read_tables, recorded_robot, selected_model
from kinacc.deployment.predict import predict
from kinacc.deployment.verify import with_frames_fitted, with_kept_frames
from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot

ELSEWHERE = Pose(exp_so3(np.array([1.2, 0.3, -0.8])), np.array([-700.0, 3100.0, 250.0]))
LONGER = Pose(exp_so3(np.array([0.1, 1.0, 0.2])), np.array([-60.0, 45.0, 310.0]))
NOISE_MM = 0.03


def readings(base: Pose, tool: Pose, part: float = 0.3, count: int = 60):
    """Later readings of the arm that ``results('irb120')`` are of, dealt into five shares."""
    rng = np.random.default_rng(11)
    q_rad = robot.load("irb120").dh_joints(joints("irb120", count, seed=7, part=part))
    seen = compose(base, compose(dh.forward(truth("irb120"), q_rad), tool))
    turn = exp_so3(rng.normal(0.0, NOISE_MM / WEIGHT, (count, 3)))
    position = seen.position_mm + rng.normal(0.0, NOISE_MM, (count, 3))
    poses = full_poses(q_rad, Pose(turn @ seen.rotation, position))
    return replace(poses, fold=np.arange(count) % 5)


def rms_mm(trial, model: str) -> float:
    return float(np.sqrt(np.mean(np.sum(trial.errors[model].position_mm ** 2, axis=1))))


def test_where_nothing_moved_the_base_and_tool_of_the_calibration_serve():
    (found,) = with_kept_frames(results("irb120"), robot.load("irb120"), readings(BASE, TOOL))
    assert found.rows.all()
    assert rms_mm(found, "dh") < 2.5 * NOISE_MM  # three axes of noise are 1.7
    assert rms_mm(found, "nominal") > 5 * rms_mm(found, "dh")


def test_a_tracker_and_a_tool_that_stand_elsewhere_say_nothing_against_the_arm():
    arm, moved = robot.load("irb120"), readings(ELSEWHERE, LONGER)
    (kept,) = with_kept_frames(results("irb120"), arm, moved)
    (fitted,) = with_frames_fitted(results("irb120"), arm, moved, WEIGHT)
    assert rms_mm(kept, "dh") > 1000.0
    (home,) = with_kept_frames(results("irb120"), arm, readings(BASE, TOOL))
    assert rms_mm(fitted, "dh") == pytest.approx(rms_mm(home, "dh"), rel=0.2)
    assert rms_mm(fitted, "vec") < rms_mm(fitted, "nominal")


def test_base_and_tool_are_judged_at_readings_they_were_not_fitted_to():
    """A reading that is a metre off spoils the base of the other shares, never its own error."""
    arm, moved = robot.load("irb120"), readings(ELSEWHERE, LONGER)
    wrong = moved.position_mm.copy()
    wrong[3] += np.array([1000.0, 0.0, 0.0])
    (found,) = with_frames_fitted(results("irb120"), arm, replace(moved, position_mm=wrong), WEIGHT)
    off = np.linalg.norm(found.errors["dh"].position_mm, axis=1)
    assert off[3] == pytest.approx(1000.0, abs=0.3)
    assert off[moved.fold == moved.fold[3]].min() < 5 * NOISE_MM


def test_models_are_compared_where_each_says_something_and_the_others_at_all_readings_too():
    arm, wide = robot.load("irb120"), readings(BASE, TOOL, part=0.55)
    common, everywhere = with_kept_frames(results("irb120"), arm, wide)
    assert 0 < common.rows.sum() < len(wide) == everywhere.rows.sum()
    assert set(common.errors) == {"nominal", "dh", "vec"}
    assert set(everywhere.errors) == {"nominal", "dh"}
    lengths = {len(each.position_mm) for each in common.errors.values()}
    assert lengths == {common.rows.sum()}
    np.testing.assert_array_equal(
        everywhere.errors["dh"].position_mm[common.rows], common.errors["dh"].position_mm
    )


def test_without_shares_there_is_nothing_to_judge_a_fitted_base_by():
    undealt = replace(readings(BASE, TOOL), fold=np.full(60, -1))
    with pytest.raises(InputError, match=r"measurements\.folds"):
        with_frames_fitted(results("irb120"), robot.load("irb120"), undealt, WEIGHT)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of a small arm, and two files of its readings: as they were, and moved."""
    base = tmp_path_factory.mktemp("verify")
    found = small_study(base)
    table = store.read(found / "measurements.parquet")
    xyz = np.stack([table[f"{axis}_mm"] for axis in "xyz"], axis=1)
    joint_names, turned = [f"q{i}_rad" for i in range(1, 7)], ["qw", "qx", "qy", "qz"]
    q_rad = np.stack([table[f"q{i}"] for i in range(1, 7)], axis=1)
    quaternion = np.stack([table[name] for name in turned], axis=1)
    files = {
        "same": (np.hstack([q_rad, xyz, quaternion]), turned, "quaternion"),
        "moved": (np.hstack([q_rad, xyz @ ELSEWHERE.rotation.T + 2000.0]), [], "none"),
    }
    files["other_target"] = files["moved"]
    for name, (rows, more, kind) in files.items():
        named = "ball_" if name == "other_target" else ""
        header = ",".join([*joint_names, *(f"{named}{axis}_mm" for axis in "xyz"), *more])
        np.savetxt(base / f"{name}.csv", rows, "%.17g", ",", header=header, comments="")
        (base / f"{name}.yaml").write_text(
            f"datasets: {{{name}: {{robot: mh180}}}}\nmeasurements: {{source: file, folds: 5, file:"
            f" {{path: {name}.csv, joint_unit: rad, orientation: {{kind: {kind}}}}}}}\n"
        )
    return base, found


def test_the_command_says_what_it_fitted_and_how_far_each_model_is_off(folder):
    base, found = folder
    done = call("verify", found, base / "moved.yaml", "--base-and-tool", "estimated")
    assert done.exit_code == 0, done.output
    assert "fitted to these readings, 9 numbers for each model" in done.stdout
    said = json.loads(
        call("verify", found, base / "moved.yaml", "--base-and-tool", "estimated", "--json").stdout
    )
    rows = {row["model"]: row for row in said["rows"]}
    assert list(rows) == ["nominal", "DH", "VEC"]
    assert rows["VEC"]["mean_mm"] < rows["DH"]["mean_mm"] < rows["nominal"]["mean_mm"] < 5.0
    assert rows["DH"]["mean_mrad"] is None  # positions were read alone
    assert said["shared_readings"] == 0


def test_an_instrument_that_was_moved_is_noticed_where_it_should_not_have_been(folder):
    base, found = folder
    done = call("verify", found, base / "moved.yaml", "--base-and-tool", "fixed")
    assert "--base-and-tool estimated fits both anew" in done.stdout


def test_readings_that_were_fitted_are_no_proof(folder):
    base, found = folder
    done = call("verify", found, base / "same.yaml", "--base-and-tool", "fixed")
    assert done.exit_code == 0, done.output
    assert "are among those it was fitted to: they say nothing of new ones" in done.stdout


def test_another_robot_is_refused(folder, tmp_path):
    base, found = folder
    own = tmp_path / "other.yaml"
    own.write_text((base / "same.yaml").read_text().replace("mh180", "irb120"))
    (tmp_path / "same.csv").write_text((base / "same.csv").read_text())
    done = call("verify", found, own, "--base-and-tool", "fixed")
    assert done.exit_code == 2
    assert "another robot than" in done.output


def test_another_target_than_the_calibrations_can_be_fitted_anew_and_not_be_kept(folder):
    base, found = folder
    kept = call("verify", found, base / "other_target.yaml", "--base-and-tool", "fixed")
    assert kept.exit_code == 2
    assert "no frame 'ball'" in kept.output
    anew = call("verify", found, base / "other_target.yaml", "--base-and-tool", "estimated")
    assert anew.exit_code == 0, anew.output


@pytest.fixture(scope="module")
def later(folder, tmp_path_factory):
    """Readings near the poses of the arm, off by ``grown`` times its held-out errors."""
    _, found = folder
    measured, errors = (store.read(found / f"{n}.parquet") for n in ("measurements", "pose_errors"))
    tables = read_tables(found)
    choice = selected_model(tables)
    held = errors["estimate"] == "cross_validated"
    held &= errors["comparison"] == f"{choice}_vs_measured"
    off = np.stack([errors[f"e{axis}_mm"][held] for axis in "xyz"], axis=1)

    def write(grown: float, count: int, model: str = choice):
        arm = calibration(tables, recorded_robot(found), model)
        base = tmp_path_factory.mktemp("later")
        rng = np.random.default_rng(5)
        q_rad = np.stack([measured[f"q{i}"] for i in range(1, 7)], axis=1)
        middle = q_rad.mean(axis=0)  # drawn towards it: measured there
        q_rad = middle + 0.6 * (q_rad[rng.integers(len(q_rad), size=count)] - middle)
        q_rad += rng.normal(0.0, 0.01, q_rad.shape)
        seen = predict(arm, q_rad, frame="instrument").pose.position_mm
        seen = seen + grown * off[rng.integers(len(off), size=count)]
        header = ",".join([*(f"q{i}_rad" for i in range(1, 7)), *(f"{x}_mm" for x in "xyz")])
        rows = np.hstack([q_rad, seen])
        np.savetxt(base / "today.csv", rows, "%.17g", ",", header=header, comments="")
        (base / "today.yaml").write_text(
            "datasets: {today: {robot: mh180}}\nmeasurements: {source: file, folds: 5, file:"
            " {path: today.csv, joint_unit: rad, orientation: {kind: none}}}\n"
        )
        return base / "today.yaml"

    return write


def asked(found, described, *more):
    done = call("verify", found, described, "--base-and-tool", "fixed", *more)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_an_arm_that_did_not_change_is_as_good_as_at_its_held_out_poses(folder, later):
    _, found = folder
    file = later(1.0, 400)
    told = asked(found, file)
    assert "verdict: as good as at its held-out poses" in told
    said = json.loads(asked(found, file, "--json"))
    assert said["verdict"] == "as good"
    assert said["held_out"]["readings"] == 80
    assert said["here"]["readings"] == said["like_measured"] > 100
    assert said["difference_low_mm"] < said["difference_mm"] < said["difference_high_mm"]


def test_the_held_out_error_is_that_which_fitted_states(folder):
    base, found = folder
    said = json.loads(asked(found, base / "same.yaml", "--json"))
    tables = {"pose_errors": store.read(found / "pose_errors.parquet")}
    stated = {
        fact.statistic: fact.value
        for fact in of_errors(tables["pose_errors"])
        if fact.topic == "held_out_error" and fact.item == said["selected"]
    }
    for name in ("mean", "quantile_99"):
        assert said["held_out"][f"{name}_mm"] == pytest.approx(stated[name], rel=1e-12)
    assert said["held_out"]["readings"] == stated["n"]


def test_an_arm_that_changed_is_worse_and_the_next_command_tells_arm_from_set_up(folder, later):
    _, found = folder
    file = later(3.0, 100)
    told = asked(found, file)
    assert "verdict: worse by" in told
    assert told.rstrip().splitlines()[-1].endswith("--base-and-tool estimated")
    assert json.loads(asked(found, file, "--json"))["difference_low_mm"] > 0.0


def test_of_few_readings_where_it_was_measured_nothing_is_told_but_what_to_measure(folder, later):
    _, found = folder
    told = asked(found, later(3.0, 12))
    assert "verdict: cannot be told from these readings: too few readings" in told
    assert "next: measure 60 new configurations near those of the calibration, 20 at least" in told
    below = told[told.index("VEC ") :].splitlines()
    assert "lie where the calibration was measured" in below[1]  # right after the table


def test_readings_of_one_configuration_are_not_many(folder, later):
    _, found = folder
    file = later(1.0, 12)
    header, *rows = (file.parent / "today.csv").read_text().splitlines()
    (file.parent / "today.csv").write_text("\n".join([header, *rows * 5]) + "\n")
    said = json.loads(asked(found, file, "--json"))
    assert said["here"]["readings"] == 5 * said["here"]["configurations"]
    assert said["verdict"] == "cannot be told"


def test_a_moved_instrument_and_fitted_readings_give_no_verdict_on_the_arm(folder):
    base, found = folder
    for name, reason in (("moved", "stands elsewhere"), ("same", "it was fitted to")):
        said = json.loads(asked(found, base / f"{name}.yaml", "--json"))
        assert said["verdict"] == "cannot be told"
        assert reason in said["verdict_reason"]


def test_a_calibrated_model_that_is_worse_than_nominal_is_named(folder, later):
    _, found = folder
    file = later(1.0, 60, "nominal")  # as if the arm had been mastered as its maker has it
    (worst, *_) = json.loads(asked(found, file, "--json"))["worse_than_nominal"]
    assert worst["mean_mm"] > worst["nominal_mean_mm"]
    assert f"{worst['model']} is worse than the nominal arm at" in asked(found, file)


def test_a_file_of_readings_is_answered_with_the_command_that_describes_it(folder):
    base, found = folder
    done = call("verify", found, base / "same.csv", "--base-and-tool", "fixed")
    assert done.exit_code == 2
    assert "holds readings" in done.output
    assert f"kinacc init {base / 'same.csv'} writes it" in done.output


def test_who_does_not_say_whether_something_was_moved_is_told_how_to_choose(folder):
    base, found = folder
    done = call("verify", found, base / "same.yaml")
    assert done.exit_code == 2
    assert "give fixed where instrument and tool stand as they did" in done.output
    assert "estimated where either stands anew" in done.output
