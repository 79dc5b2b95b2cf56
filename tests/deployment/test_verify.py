"""A calibration held to later readings: what was moved does not count, and what was fitted does."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import call, small_study
from small_arms import BASE, TOOL, WEIGHT, joints, results, truth

from kinacc.calibration.observations import full_poses
from kinacc.calibration.summary import error_statistics
from kinacc.deployment.folder import calibration, read_tables, recorded_robot, selected_model
from kinacc.deployment.handful import HeldOut, Places, held_to
from kinacc.deployment.predict import predict
from kinacc.deployment.verify import trials
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot
from kinacc.tables import store

ELSEWHERE = Pose(exp_so3(np.array([1.2, 0.3, -0.8])), np.array([-700.0, 3100.0, 250.0]))
LONGER = Pose(exp_so3(np.array([0.1, 1.0, 0.2])), np.array([-60.0, 45.0, 310.0]))
NOISE_MM = 0.03
SAME, MOVED = (("--base", each, "--tool", each) for each in ("same", "moved"))


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
    (found,) = trials(results("irb120"), robot.load("irb120"), readings(BASE, TOOL), (), WEIGHT)
    assert found.rows.all()
    assert rms_mm(found, "dh") < 2.5 * NOISE_MM  # three axes of noise are 1.7
    assert rms_mm(found, "nominal") > 5 * rms_mm(found, "dh")


def test_a_tracker_and_a_tool_that_stand_elsewhere_say_nothing_against_the_arm():
    arm, moved = robot.load("irb120"), readings(ELSEWHERE, LONGER)
    (kept,) = trials(results("irb120"), arm, moved, (), WEIGHT)
    (fitted,) = trials(results("irb120"), arm, moved, ("base", "tool"), WEIGHT)
    assert rms_mm(kept, "dh") > 1000.0
    (home,) = trials(results("irb120"), arm, readings(BASE, TOOL), (), WEIGHT)
    assert rms_mm(fitted, "dh") == pytest.approx(rms_mm(home, "dh"), rel=0.2)
    assert rms_mm(fitted, "vec") < rms_mm(fitted, "nominal")


@pytest.mark.parametrize(
    ("base", "tool", "moved"), [(ELSEWHERE, TOOL, ("base",)), (BASE, LONGER, ("tool",))]
)
@pytest.mark.parametrize("turned", [True, False])
def test_a_handful_places_the_one_that_moved_and_leaves_the_other(base, tool, moved, turned):
    arm, few = robot.load("irb120"), readings(base, tool, count=5)
    if not turned:
        few = replace(few, rotation=np.full_like(few.rotation, np.nan))
    (found,) = trials(results("irb120"), arm, few, moved, WEIGHT)
    assert rms_mm(found, "dh") < 2.5 * NOISE_MM
    (wrong,) = trials(results("irb120"), arm, few, {"base", "tool"} - set(moved), WEIGHT)
    assert rms_mm(wrong, "dh") > 10.0


def test_models_are_compared_where_each_says_something_and_the_others_at_all_readings_too():
    arm, wide = robot.load("irb120"), readings(BASE, TOOL, part=0.55)
    common, everywhere = trials(results("irb120"), arm, wide, (), WEIGHT)
    assert 0 < common.rows.sum() < len(wide) == everywhere.rows.sum()
    assert set(common.errors) == {"nominal", "dh", "vec"}
    assert set(everywhere.errors) == {"nominal", "dh"}
    lengths = {len(each.position_mm) for each in common.errors.values()}
    assert lengths == {common.rows.sum()}
    np.testing.assert_array_equal(
        everywhere.errors["dh"].position_mm[common.rows], common.errors["dh"].position_mm
    )


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
    done = call("verify", base / "moved.yaml", "--calibration", found, *MOVED)
    assert done.exit_code == 0, done.output
    assert "base and tool fitted to these readings: 9 numbers for each model" in done.stdout
    said = json.loads(
        call("verify", base / "moved.yaml", "--calibration", found, *MOVED, "--json").stdout
    )
    rows = {row["model"]: row for row in said["rows"]}
    assert list(rows) == ["nominal", "DH", "VEC"]
    assert rows["VEC"]["mean_mm"] < rows["DH"]["mean_mm"] < rows["nominal"]["mean_mm"] < 5.0
    assert rows["DH"]["mean_mrad"] is None  # positions were read alone
    assert said["shared_readings"] == 0


def test_an_instrument_that_was_moved_is_noticed_where_it_should_not_have_been(folder):
    base, found = folder
    done = call("verify", base / "moved.yaml", "--calibration", found, *SAME)
    assert "--base moved --tool moved fits both anew" in done.stdout


def test_readings_that_were_fitted_are_no_proof(folder):
    base, found = folder
    done = call("verify", base / "same.yaml", "--calibration", found, *SAME)
    assert done.exit_code == 1, done.output
    assert "are among those it was fitted to: they say nothing of new ones" in done.stdout


def test_another_robot_is_refused(folder, tmp_path):
    base, found = folder
    own = tmp_path / "other.yaml"
    own.write_text((base / "same.yaml").read_text().replace("mh180", "irb120"))
    (tmp_path / "same.csv").write_text((base / "same.csv").read_text())
    done = call("verify", own, "--calibration", found, *SAME)
    assert done.exit_code == 2
    assert "another robot than" in done.output


def test_another_target_than_the_calibrations_can_be_fitted_anew_and_not_be_kept(folder):
    base, found = folder
    kept = call("verify", base / "other_target.yaml", "--calibration", found, *SAME)
    assert kept.exit_code == 2
    assert "no frame 'ball'" in kept.output
    anew = call("verify", base / "other_target.yaml", "--calibration", found, *MOVED)
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
    done = call("verify", described, "--calibration", found, *SAME, *more)
    passes = '"verdict": "passes"' in done.stdout if "--json" in more else "passes" in done.stdout
    assert done.exit_code == (0 if passes else 1), done.output
    return done.stdout


@pytest.mark.parametrize("count", [12, 100])
def test_an_arm_that_did_not_change_passes(folder, later, count):
    _, found = folder
    file = later(1.0, count)
    assert "verdict: passes: where nothing has changed" in asked(found, file)
    said = json.loads(asked(found, file, "--json"))
    assert said["verdict"] == "passes"
    assert said["held_out"]["readings"] == 80
    assert said["here"]["readings"] <= said["like_measured"]
    assert said["here"]["mean_mm"] < said["limit_mm"]
    assert said["probability"] > said["level"] == 0.01


def test_the_held_out_error_is_that_which_fitted_states(folder, later):
    _, found = folder
    said = json.loads(asked(found, later(1.0, 12), "--json"))
    tables = {"pose_errors": store.read(found / "pose_errors.parquet")}
    known = error_statistics(tables["pose_errors"])
    (stated,) = known[
        (known["comparison"] == f"{said['selected']}_vs_measured")
        & (known["estimate"] == "cross_validated")
        & (known["quantity"] == "position")
    ].to_dict("records")
    for name in ("mean", "quantile_99"):
        assert said["held_out"][f"{name}_mm"] == pytest.approx(stated[name], rel=1e-12)
    assert said["held_out"]["readings"] == stated["n"]


@pytest.mark.parametrize("count", [12, 100])
def test_an_arm_that_changed_fails_and_the_next_command_tells_arm_from_set_up(folder, later, count):
    _, found = folder
    file = later(3.0, count)
    told = asked(found, file)
    assert "verdict: fails: " in told
    assert "the mean error is" in told
    assert told.rstrip().splitlines()[-1].endswith("--base moved --tool moved")
    said = json.loads(asked(found, file, "--json"))
    assert said["here"]["mean_mm"] > said["limit_mm"]
    assert said["probability"] <= said["level"]


def test_a_joint_that_lost_its_zero_is_named(folder, later):
    """Where nothing but joint 3 is off, by less than would double the errors."""
    _, found = folder
    file = later(1.0, 12)
    header, *rows = (file.parent / "today.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    moved = [[*row[:2], f"{float(row[2]) + 1.5e-3:.17g}", *row[3:]] for row in cells]
    (file.parent / "today.csv").write_text("\n".join([header, *map(",".join, moved)]) + "\n")
    told = asked(found, file)
    assert "the errors look most like an offset of joint 3 by" in told
    said = json.loads(asked(found, file, "--json"))
    assert said["offsets_mm"] > said["offsets_limit_mm"]
    assert said["most_like_offset_of_joint"] == 3
    assert abs(said["most_like_offset"]) == pytest.approx(1.5, rel=0.4)


def test_the_level_does_not_rest_on_how_errors_are_spread():
    """Of arms that did not change as many fail as is said, though some errors are huge."""
    rng, told = np.random.default_rng(4), []
    for _ in range(100):
        sizes = rng.lognormal(0.0, 1.0, (46, 1, 1)) * rng.normal(size=(46, 1, 3))
        slopes, joints = np.zeros((46, 1, 3, 0)), rng.normal(size=(46, 1, 3, 2))
        every = HeldOut(sizes, Places(slopes, joints))
        found = held_to(every.select(np.arange(6, 46)), every.select(np.arange(6)))
        told.append(found.probability)
    assert np.mean(np.array(told) <= 0.1) == pytest.approx(0.1, abs=0.05)
    assert 0.2 < np.mean(np.array(told) <= 0.5) <= 0.5  # of two that go together, each at half


def test_too_few_that_are_no_worse_say_how_many_it_takes(folder, later):
    _, found = folder
    told = asked(found, later(1.0, 2))
    assert "verdict: cannot be told from these readings: too few configurations" in told
    least = json.loads(asked(found, later(1.0, 2), "--json"))["least_configurations"]
    assert f"it takes {least} configurations to show errors 2 times as large" in told
    assert f"next: measure {least} or more new configurations near those" in told
    below = told[told.index("VEC ") :].splitlines()
    assert "lie where the calibration was measured" in below[1]  # right after the table


def test_more_poses_show_less_and_an_offset_along_the_base_is_not_seen(folder, later):
    _, found = folder
    kept = json.loads(asked(found, later(1.0, 12), "--json"))["seen_with"]
    times = [each["errors_times"] for each in kept]
    assert times == sorted(times, reverse=True)
    done = call("verify", later(1.0, 12), "--calibration", found, *MOVED, "--json")
    said = json.loads(done.stdout)
    assert said["numbers_fitted"] == 9
    assert said["seen"]["offsets_of_joints"][0] is None  # as the base turns
    assert said["seen"]["errors_times"] > kept[2]["errors_times"]
    assert said["verdict"] == "passes"


def test_readings_of_one_configuration_are_not_many(folder, later):
    _, found = folder
    file = later(1.0, 2)
    header, *rows = (file.parent / "today.csv").read_text().splitlines()
    (file.parent / "today.csv").write_text("\n".join([header, *rows * 5]) + "\n")
    said = json.loads(asked(found, file, "--json"))
    assert said["readings"] == 10
    assert said["here"]["configurations"] <= 2
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


def test_a_file_of_readings_is_read_as_those_of_the_calibration_were(folder, later):
    """No .yaml of its own: the configuration beside the results says how."""
    base, found = folder
    file = later(1.0, 12).with_suffix(".csv")
    done = call("verify", file, "--calibration", found, *SAME)
    assert done.exit_code == 2
    assert f"`kinacc init {file}` writes a .yaml that describes it" in done.output
    own, text = found.parent.parent / "own.yaml", (base / "moved.yaml").read_text()
    text = text.replace("{moved:", f"{{{found.name}:")
    own.write_text(text.replace("moved.csv", str(base / "moved.csv")))
    done = call("verify", file, "--calibration", found, *SAME, "--json")
    own.unlink()
    assert done.exit_code == 0, done.output
    described = json.loads(asked(found, file.with_suffix(".yaml"), "--json"))
    said = json.loads(done.stdout)
    assert said["probability"] == described["probability"]
    assert said["rows"] == described["rows"]


def test_who_does_not_say_whether_something_was_moved_is_told_how_to_choose(folder):
    base, found = folder
    done = call("verify", base / "same.yaml", "--calibration", found)
    assert done.exit_code == 2
    for option in ("--base", "--tool"):
        assert f"{option} (the " in done.output
    assert "give same where it stands as it did" in done.output
    assert "moved where it stands anew" in done.output
