"""A calibration held to later readings: what was moved does not count, and what was fitted does."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import call
from held_out_errors import held_out_mm
from read_columns import XYZ_MM

from kinacc.calibration.observations import from_columns, full_poses
from kinacc.deployment import permutation
from kinacc.deployment.folder import calibration, read_tables, robot_of
from kinacc.deployment.permutation import ErrorColumns, compare, smallest_changes
from kinacc.deployment.predict import predict
from kinacc.deployment.verify import error_columns, model_errors, verify
from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot

ELSEWHERE = Pose(exp_so3(np.array([1.2, 0.3, -0.8])), np.array([-700.0, 3100.0, 250.0]))
JOINTS = [f"q{i}" for i in range(1, 7)]
SAME, MOVED = (("--base", each, "--tool", each) for each in ("same", "moved"))


def heavy_tailed(rng, count, is_fitted):
    """Errors of which some are huge, of one reading a configuration, and what explains them.

    Shifts of the base, which are fitted to the new ones, and two joints.
    """
    shifts, joints = np.tile(np.eye(3), (count, 1, 1)), rng.normal(size=(count, 3, 2))
    sizes = rng.lognormal(0.0, 1.0, (count, 1, 1)) * rng.normal(size=(count, 3, 1))
    sizes -= is_fitted * sizes.mean(axis=0)
    return ErrorColumns(np.concatenate([shifts, joints, sizes], axis=2), 3)


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    """A quarter of the random samples: levels and powers are the same, and tests quick."""
    monkeypatch.setattr(permutation, "_DRAWS", 1000)


def test_the_level_does_not_rest_on_how_errors_are_spread():
    rng = np.random.default_rng(4)
    chances = []
    for _ in range(200):
        held_out, new = heavy_tailed(rng, 12, False), heavy_tailed(rng, 4, True)
        chances.append(compare(held_out, new).probability)
    for level in (0.1, 0.5):
        assert np.mean(np.array(chances) <= level) == pytest.approx(level, abs=0.09)


def test_a_single_configuration_is_expected_to_err_as_the_median_one():
    columns = np.multiply.outer([3.0, 4.0, 90.0, 90.0, 8.0], np.eye(3)[:, :2])
    found = compare(ErrorColumns(columns[:4], 0), ErrorColumns(columns[4:], 0))
    assert found.expected_mm == pytest.approx(8.0)


def test_a_fit_to_the_new_errors_is_undone_by_its_degrees_of_freedom():
    new = heavy_tailed(np.random.default_rng(1), 4, True)
    found = compare(new._replace(columns=new.columns[:0]), new)  # each sample is all of the new
    assert found.expected_mm == pytest.approx(found.rms_mm / np.sqrt(1.0 - 3 / 12))


def test_changes_of_the_stated_sizes_are_found_in_four_of_five_cases():
    found = np.zeros((3, 40, 2))
    for seed in range(3):
        rng = np.random.default_rng(seed)
        held_out = ErrorColumns(rng.normal(size=(80, 3, 3)), 0)
        factor, offsets = smallest_changes(held_out, 10)
        for row in found[seed]:
            new = ErrorColumns(rng.normal(size=(10, 3, 3)), 0)
            off = new.columns.copy()
            off[..., -1] += offsets[1] * off[..., 1]
            changed = (new.times(factor), ErrorColumns(off, 0))
            row[:] = [compare(held_out, each).probability <= 0.01 for each in changed]
    assert (found.mean(axis=(0, 1)) > 0.75).all()
    assert factor < 2.5


def test_columns_are_those_of_what_was_moved_and_of_the_joints_as_reported():
    """Of two targets on an arm with signs, a coupling and a sliding joint, by differences."""
    arm, slides = robot.load("fanuc_crx10ia"), np.arange(6) == 4
    arm = replace(arm, dh=replace(arm.dh, prismatic=slides))
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 6))
    points = Pose(np.array([np.eye(3)] * 2), np.array([[10.0, 20.0, 150.0], [-80.0, 5.0, 60.0]]))

    def at(motion):
        reported = q + motion[12:] * np.where(slides, 1.0, 1e-3)
        base = Pose(exp_so3(1e-3 * motion[3:6]), motion[:3])
        flange = compose(base, dh.forward(arm.dh, arm.dh_joints(reported)))
        places = points.position_mm + motion[6:12].reshape(2, 3)
        turned = places @ np.swapaxes(flange.rotation, 1, 2)
        return (flange.position_mm[:, None] + turned).reshape(5, 6)

    seen = full_poses(arm.dh_joints(q), dh.forward(arm.dh, arm.dh_joints(q)))
    seen = replace(seen.select(np.repeat(np.arange(5), 2)), target=np.tile([0, 1], 5))
    found = error_columns(arm.dh, arm, seen, points, ("base", "tool"), np.zeros((10, 3)))
    assert found.fitted == 12
    for number, step in enumerate(0.1 * np.eye(18)):
        per_unit = (at(step) - at(-step)) / 0.2
        np.testing.assert_allclose(found.columns[..., number], per_unit, atol=1e-5)


@pytest.fixture(scope="module")
def folder(study, tmp_path_factory):
    """Results of a small arm, and its readings from elsewhere, without and with a target."""
    base = tmp_path_factory.mktemp("verify")
    found = Path(shutil.copytree(study, base / "results" / "mh180"))
    table = pd.read_parquet(found / "measurements.parquet")[::3]
    elsewhere = np.hstack([table[JOINTS], table[XYZ_MM] @ ELSEWHERE.rotation.T + 2000.0])
    written(base, "moved", elsewhere)
    written(base, "other_target", elsewhere, target="ball_")
    return base, found


def written(base, name, rows, target=""):
    header = [*(f"{name}_rad" for name in JOINTS), *(target + name for name in XYZ_MM)]
    np.savetxt(base / f"{name}.csv", rows, "%.17g", ",", header=",".join(header), comments="")
    (base / f"{name}.yaml").write_text(
        f"datasets: {{{name}: {{robot: mh180}}}}\nmeasurements: {{source: file, folds: 5, file:"
        f" {{path: {name}.csv, joint_unit: rad, orientation: {{kind: none}}}}}}\n"
    )
    return base / f"{name}.yaml"


def answered(found, described, *more):
    done = call("verify", described, "--calibration", found, *(more or SAME), "--json")
    answer = json.loads(done.stdout)
    assert done.exit_code == {"pass": 0, "fail": 1, "undecided": 3}[answer["verdict"]], done.output
    return answer


def test_every_model_is_held_to_readings_of_another_set_up(folder):
    base, found = folder
    answer = answered(found, base / "moved.yaml", *MOVED)
    rows = {row["model"]: row for row in answer["errors"]}
    assert list(rows) == ["nominal", "dh", "vec"]
    assert rows["vec"]["mean_mm"] < rows["dh"]["mean_mm"] < rows["nominal"]["mean_mm"] < 5.0
    assert rows["dh"]["mean_mrad"] is None  # positions were read alone
    assert answer["known"] == 0
    assert answer["verdict"] == "pass"
    assert answer["smallest_offsets"][0] is None  # as the base turns
    anew = answered(found, base / "other_target.yaml", *MOVED)
    assert anew["test"] == answer["test"]


def test_what_cannot_count_gives_no_verdict(folder, later):
    base, found = folder
    for described, known in ((base / "moved.yaml", 0), (later(1.0, 0, known=80), 80)):
        answer = answered(found, described)
        assert (answer["verdict"], answer["known"]) == ("undecided", known)


def test_readings_without_a_session_belong_to_no_base_of_several(folder):
    _, found = folder
    tables = read_tables(found)
    frames = pd.DataFrame(dict(tables["frames"]))
    frames = pd.concat([frames.assign(session=name) for name in "ab"])
    tables["frames"] = {name: column.to_numpy() for name, column in frames.items()}
    seen = from_columns(tables["measurements"], robot_of(tables))
    fitted = "estimate == 'train' and comparison == 'dh_vs_measured'"
    left = pd.read_parquet(found / "pose_errors.parquet").query(fitted)
    there = seen.select(left["row"].to_numpy())
    stated = model_errors(read_tables(found), there, (), 500.0).set_index("model").loc["dh"]
    for unit in ("_mm$", "_mrad$"):
        sizes = np.linalg.norm(left.filter(regex=unit), axis=1)
        wanted = [sizes.mean(), np.quantile(sizes, 0.99), sizes.max(), (sizes**2).mean() ** 0.5]
        assert stated.filter(regex=unit).tolist() == pytest.approx(wanted)
    with pytest.raises(InputError, match="each has its own base; allowed: one of a, b"):
        model_errors(tables, seen, (), 500.0)


@pytest.fixture(scope="module")
def later(folder, tmp_path_factory):
    """Readings near the poses of the arm, off by ``grown`` times its held-out errors."""
    _, found = folder
    measured = pd.read_parquet(found / "measurements.parquet")
    off, every = held_out_mm(found), measured[JOINTS].to_numpy()
    arm = calibration(read_tables(found))

    def write(grown: float, count: int, offset_rad=0.0, times=1, known=0, wrong=()):
        rng = np.random.default_rng(5)
        middle = every.mean(axis=0)  # drawn towards it: measured there
        q_rad = middle + 0.6 * (every[rng.integers(len(every), size=count)] - middle)
        q_rad += rng.normal(0.0, 0.01, q_rad.shape)
        seen = predict(arm, q_rad, frame="instrument").pose.position_mm
        seen = seen + grown * off[rng.integers(len(off), size=count)]
        seen[list(wrong), 0] += 5.0
        q_rad[:, 2] += offset_rad
        rows = np.tile(np.hstack([q_rad, seen]), (times, 1))
        rows = np.vstack([rows, measured[JOINTS + XYZ_MM][:known]])
        return written(tmp_path_factory.mktemp("later"), "today", rows)

    return write


@pytest.mark.parametrize(
    ("grown", "count", "verdict"), [(1.0, 12, "pass"), (1.0, 100, "pass"), (3.0, 12, "fail")]
)
def test_an_arm_passes_that_did_not_change_alone(folder, later, grown, count, verdict):
    answer = answered(folder[1], later(grown, count))
    assert answer["verdict"] == verdict
    assert answer["held_out"] == 80
    assert answer["configurations"] <= answer["near"]
    test = answer["test"]
    assert (
        (test["rms_mm"] < test["limit_mm"]) == (verdict == "pass") == (test["probability"] > 0.01)
    )


def test_an_arm_far_from_its_nominal_lengths_was_not_set_up_anew(folder):
    tables = read_tables(folder[1], "pose_errors")
    moved, apart = ({name: table.copy() for name, table in tables[each].items()}
                    for each in ("measurements", "frames"))  # fmt: skip
    moved["x_mm"] += 1e-3
    apart["x_mm"][apart["model"] == "nominal"] += 20.0
    answer = verify(tables | {"frames": apart}, moved, (), 500.0)
    assert answer.errors["mean_mm"].max() > 10.0
    assert answer.test == verify(tables, moved, (), 500.0).test is not None


def test_readings_that_were_fitted_are_left_out_and_the_others_count(folder, later):
    alone, more = (answered(folder[1], later(1.0, 12, known=known)) for known in (0, 30))
    assert (more["readings"], more["known"]) == (42, 30)
    assert more["test"] == alone["test"]


def test_a_joint_that_lost_its_zero_is_named(folder, later):
    """By less than would double the errors."""
    answer = answered(folder[1], later(1.0, 12, offset_rad=1.5e-3))
    assert answer["verdict"] == "fail"
    assert answer["test"]["joint"] == 3
    assert answer["test"]["offset"] == pytest.approx(-1.5, rel=0.4)  # less than is reported


@pytest.mark.parametrize("how", [SAME, MOVED])
def test_one_wrong_reading_does_not_pass_among_good_ones(folder, later, how, tmp_path):
    table = tmp_path / "rows.csv"
    answer = answered(folder[1], later(1.0, 20, wrong=[7]), *how, "-o", table)
    assert answer["verdict"] == "undecided"
    assert answer["test"]["probability"] > 0.01
    assert "line 9," in answer["reason"]
    rows = pd.read_csv(table)
    assert rows["near"].sum() == rows["error_mm"].count() == answer["near"]
    worst = rows.loc[rows["error_mm"].idxmax()]
    assert (len(rows), worst["row"], worst["far_off"]) == (20, 9, True)
    assert worst["error_mm"] == pytest.approx(5.0, abs=2.0)
    assert (rows["far_off"] == (rows["error_mm"] > worst["limit_mm"])).all()
    assert answered(folder[1], later(1.0, 20), *how)["verdict"] == "pass"


def test_too_few_configurations_that_are_no_worse_pass_nothing(folder, later):
    """However often they are read."""
    answer = answered(folder[1], later(1.0, 2, times=5))
    assert answer["readings"] == 10
    assert answer["configurations"] <= 2
    assert answer["verdict"] == "undecided"
    assert answer["smallest_factor"] is None or answer["smallest_factor"] > 2.0


def test_a_file_of_readings_is_read_as_those_of_the_calibration_were(folder, later):
    """No .yaml of its own: the configuration beside the results says how."""
    base, found = folder
    file = later(1.0, 12).with_suffix(".csv")
    call("verify", file, "--calibration", found, *SAME, code=2)
    own, text = found.parent.parent / "own.yaml", (base / "moved.yaml").read_text()
    text = text.replace("{moved:", f"{{{found.name}:")
    own.write_text(text.replace("moved.csv", str(base / "moved.csv")))
    answer = answered(found, file)
    own.unlink()
    described = answered(found, file.with_suffix(".yaml"))
    assert answer["test"] == described["test"]
    assert answer["errors"] == described["errors"]
    own.write_text(text.replace("moved.csv", str(base / "moved.csv")))
    file.write_text(file.read_text().replace("q1_rad", "axis one"))
    call("verify", file, "--calibration", found, *SAME, code=2)
