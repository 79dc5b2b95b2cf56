"""The public face on a small data set: the same tables and answers as the commands give."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from stages_by_hand import CALIBRATED, run_stages

import kinacc
import kinacc.errors
from kinacc.deployment import folder
from kinacc.deployment.planning import Experiment
from kinacc.geometry import IDENTITY
from kinacc.kinematics.model import ErrorModel
from kinacc.workflow.described import outdated_reason

CONFIG = """\
datasets: {arm: {robot: mh180}}
measurements: {folds: 3, synthetic: {poses: 60, tracker_noise_mm: 0.05}}
calibration: {vec: {order: 1}}
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    path = tmp_path_factory.mktemp("api") / "arm.yaml"
    path.write_text(CONFIG)
    return path


@pytest.fixture(scope="module")
def calibration(config):
    return kinacc.calibrate(kinacc.read_measurements(config))


@pytest.fixture
def q_rad(calibration):
    return calibration.table("measurements")[[f"q{i}" for i in range(1, 7)]].to_numpy()[:30]


def test_tables_are_those_of_the_workflow(calibration, config, tmp_path):
    folder = run_stages((*CALIBRATED, "summary"), [config], tmp_path / "results")
    for path in folder.glob("*.parquet"):
        workflow, own = kinacc.read_table(path), calibration.table(path.stem)
        assert list(workflow) == list(own)
        for name in workflow.select_dtypes("number"):
            np.testing.assert_array_equal(workflow[name], own[name].astype(float), err_msg=name)


def test_saved_results_are_read_again(calibration, q_rad, tmp_path):
    read = kinacc.load_calibration(calibration.save(tmp_path / "arm"))
    np.testing.assert_array_equal(
        read.predict(q_rad).pose.position_mm, calibration.predict(q_rad).pose.position_mm
    )
    assert read.selected == calibration.selected
    assert read.summary.best == calibration.summary.best
    assert read.unidentifiable == calibration.unidentifiable


def test_saved_results_are_those_of_the_settings_beside_them(calibration, config):
    folder = calibration.save(config.parent / "results" / "arm")
    assert outdated_reason(folder) == ""
    config.with_name("other.yaml").write_text(CONFIG.replace("order: 1", "order: 2"))
    reason = outdated_reason(folder)
    assert "arm.yaml" in reason
    assert reason.endswith("other.yaml")


def test_joints_of_a_predicted_pose_reach_it(calibration, q_rad):
    wanted = calibration.predict(q_rad).pose
    np.testing.assert_allclose(calibration.compensate(wanted, q_rad).q_rad, q_rad, atol=1e-8)


def test_a_program_is_corrected(calibration, tmp_path):
    program = tmp_path / "program.csv"
    program.write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,5,-20,8,60,15\n")
    corrected = calibration.compensate_program(program, at_most_mm=30.0)
    assert list(corrected.table["status"]) == ["corrected"]
    corrected.write(tmp_path / "corrected.csv")
    changed = pd.read_csv(tmp_path / "corrected.csv")
    assert 1e-4 < np.abs(changed.to_numpy() - [10, 5, -20, 8, 60, 15]).max() < 2.0


def test_verify_and_compare_find_no_change_in_the_same_readings(calibration, config):
    readings = kinacc.read_measurements(config)
    verified = kinacc.verify(calibration, readings, base="same", tool="same")
    assert (verified.known, verified.verdict) == (len(readings), "undecided")
    assert kinacc.compare(calibration, calibration).shared.all_of_both


def test_measured_files_are_read_without_a_configuration(tmp_path):
    q_rad = np.random.default_rng(1).uniform(-1.5, 1.5, (40, 6)).round(4)
    point = kinacc.Robot.from_name("ur10").forward(q_rad).position_mm
    table = pd.DataFrame(np.hstack([q_rad, point / 1000.0]), columns=[*"123456", *"XYZ"])
    table.columns = [*(f"J{n}" for n in range(1, 7)), *(f"{axis} [m]" for axis in "XYZ")]
    table.to_csv(path := tmp_path / "tracker.csv", sep=";", index=False)
    file = Path(kinacc.__file__).parent / "kinematics" / "robots" / "ur10.yaml"
    for robot in ("ur10", file, None):
        read = kinacc.read_measurements(
            path, robot=robot, settings={"calibration": {"vec": {"order": 2}}}
        )
        assert (read.name, read.robot.name) == ("tracker", "ur10")
        assert read.settings["calibration"]["vec"]["order"] == 2
        np.testing.assert_allclose(read.table[[f"q{n}" for n in range(1, 7)]], q_rad)
        np.testing.assert_allclose(read.table[["x_mm", "y_mm", "z_mm"]], point, atol=1e-9)


def test_rows_taken_out_are_not_fitted(config):
    measured = kinacc.read_measurements(config)
    fewer = kinacc.Measurements(
        measured.name, measured.robot, measured.table[measured.table["pose"] >= 5],
        measured.settings,
    )  # fmt: skip
    assert kinacc.calibrate(fewer).summary.readings == len(measured) - 5


def test_pinocchio_gets_the_dh_model_whatever_was_selected(calibration):
    pytest.importorskip("pinocchio")
    made = [
        replace(calibration, model=folder.calibration(calibration.tables, kind))
        for kind in ("dh", "vec")
    ]
    assert made[0].to_pinocchio() == made[1].to_pinocchio()


def test_export_writes_files(calibration, tmp_path):
    (path,) = calibration.export(tmp_path, "json")
    assert path.is_file()
    assert len(calibration.values_for("staubli").values) == 6 * 6 + 2 * 6


def plan(degrees=0.0, count=40, joint=2):
    arm, experiment = (
        kinacc.Robot.from_name("ur10"),
        Experiment(IDENTITY, True, (joint,), 500, 0.01),
    )
    kinacc.plan_poses(arm, np.full((50, 6), degrees), experiment, count, np.zeros(6))


def unfinished(calibration, folder):
    (calibration.save(folder) / "summary.parquet").unlink()
    kinacc.load_calibration(folder)


NAN = np.full((3, 6), np.nan)
WRONG = {
    "five joints": lambda calibration, _: calibration.predict(np.zeros(5)),
    "a text": lambda calibration, _: calibration.predict("home"),
    "directions of two": lambda calibration, _: calibration.predict(np.zeros((3, 6)), s=[1, 1]),
    "joints to compensate": lambda calibration, _: calibration.compensate(np.zeros((3, 6))),
    "no program": lambda calibration, folder: calibration.compensate_program(folder / "a.src"),
    "no such format": lambda calibration, folder: calibration.export(folder, "docx"),
    "no such controller": lambda calibration, _: calibration.values_for("arduino"),
    "no such table": lambda calibration, _: calibration.table("residual"),
    "a missing file": lambda _, folder: kinacc.calibrate(str(folder / "arm.yaml")),
    "no paths": lambda *_: kinacc.read_measurements(),
    "no folder": lambda _, folder: kinacc.load_calibration(folder / "results"),
    "no calibration": lambda calibration, _: kinacc.compare(calibration, "results/arm"),
    "joints of NaN": lambda calibration, _: kinacc.compare(calibration, calibration, NAN),
    "a pose of NaN": lambda calibration, _: calibration.robot.forward(NAN),
    "an unknown answer": lambda *_: kinacc.read_measurements("a.csv", joint_units="rad"),
    "candidates in degrees": lambda *_: plan(degrees=45.0),
    "half a pose": lambda *_: plan(count=40.5),
    "a ninth joint": lambda *_: plan(joint=9),
    "an assessor's name": lambda *_: kinacc.evaluate_assessors(
        [[1, 0, 0]], ["maximum"], 0.1, 9, 1, 1
    ),
    "candidates of four": lambda calibration, folder: kinacc.Campaign.start(
        folder, calibration, np.zeros((9, 4)), 0.1
    ),
    "half a model": lambda *_: kinacc.register_error_model(ErrorModel),
    "an unfinished folder": unfinished,
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_values_end_in_one_line(calibration, tmp_path, case):
    with pytest.raises(kinacc.errors.InputError) as caught:
        WRONG[case](calibration, tmp_path)
    assert len(caught.value.problems) == 1


def test_a_campaign_that_cannot_be_begun_leaves_no_folder(calibration, q_rad, tmp_path):
    for noise_mm in (-0.1, np.zeros((3, 3)), 0.0):
        with pytest.raises(kinacc.errors.InputError):
            kinacc.Campaign.start(tmp_path / "other", calibration, q_rad, noise_mm)
    for wrong in ({"frame": "x"}, {"tolerance_mm": "x"}):
        with pytest.raises(kinacc.errors.InputError):
            kinacc.Campaign.start(tmp_path / "other", calibration, q_rad, 0.05, **wrong)
    assert not (tmp_path / "other").exists()
