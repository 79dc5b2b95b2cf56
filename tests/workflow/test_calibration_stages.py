"""The calibration stages on a made-up arm and, where the data is at hand, on a measured UR10."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest

from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3, quaternion_from_rotation
from kinacc.kinematics import dh as dh_kinematics
from kinacc.kinematics import robot
from kinacc.kinematics import vec as vec_kinematics
from kinacc.kinematics.tables import frame, models
from kinacc.study import evaluation
from kinacc.study.in_memory import RUNS
from kinacc.synthetic import source
from kinacc.tables import store
from kinacc.workflow.data_sets import read_data_sets

ROOT = Path(__file__).resolve().parents[2]
POSES = 150
MARKS = {
    "kinacc_version": "0",
    "config_hash": "0" * 16,
    "seed": 1,
}


def settings_of(plan, name, dataset="mh180", **changes):
    found = copy.deepcopy(plan.settings[dataset])
    for path, value in changes.items():
        section, *keys = path.split("__")
        at = found[section]
        for key in keys[:-1]:
            at = at[key]
        at[keys[-1]] = value
    return found


@pytest.fixture(scope="module")
def plan():
    return read_data_sets([ROOT / "config.yaml"])


def columns(base=None, tool=None):
    """A VEC arm of order 2 with 0.05 mm noise; each tenth pose visited twice."""
    arm = robot.load("mh180")
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.5, 0.5, (POSES, 6))
    q[-POSES // 10 :] = q[: POSES // 10]
    true = vec_kinematics.without_errors(arm.dh, np.full(6, -0.6), np.full(6, 0.6), 2)
    unit = np.repeat([0.3, 0.3e-3], 9)
    x = np.concatenate([np.tile(unit, 6), np.zeros(12)]) * rng.normal(size=120)
    seen = vec_kinematics.pose(vec_kinematics.with_vector(true, x), q)
    if base is not None:
        seen = compose(base, compose(seen, tool))
    position = seen.position_mm + 0.05 * rng.normal(size=(POSES, 3))
    quaternion = quaternion_from_rotation(seen.rotation)
    return {
        "pose": np.arange(POSES),
        **{f"q{i + 1}": q[:, i] for i in range(6)},
        **{f"s{i + 1}": np.zeros(POSES, np.int8) for i in range(6)},
        "target": np.full(POSES, "tool", dtype=object),
        **{f"{axis}_mm": position[:, i] for i, axis in enumerate("xyz")},
        **{f"q{part}": quaternion[:, i] for i, part in enumerate("wxyz")},
        "repeat": np.zeros(POSES, dtype=int),
    }


def chain(plan, split, **changes):
    tables = {"measurements": split}
    given = {"calibration__vec__order": 2} | changes
    for name in ("vec", "dh", "residuals"):
        sections = plan.settings["mh180"]["calibration"]
        own = {path: value for path, value in given.items() if path.split("__")[1] in sections}
        tables |= RUNS[name](tables, settings_of(plan, name, **own))
    return tables


@pytest.fixture(scope="module")
def tables(plan):
    return chain(plan, source.split(columns(), plan.settings["mh180"]))


def row(table, **wanted):
    match = np.ones(len(table["n"]), dtype=bool)
    for name, value in wanted.items():
        column = table[name]
        match &= np.isnan(column.astype(float)) if value is None else column == value
    (found,) = np.flatnonzero(match)
    return {name: values[found] for name, values in table.items()}


def test_every_table_is_as_the_contract_says(tables, tmp_path):
    for name, table in tables.items():
        path = tmp_path / f"{name}.parquet"
        store.write(path, name, table, MARKS)
        again = store.read(path)
        assert set(again) == set(table), name


def test_configurations_visited_twice_are_held_out_together(tables):
    fold = tables["measurements"]["fold"]
    twice = POSES // 10
    np.testing.assert_array_equal(fold[:twice], fold[-twice:])
    assert np.ptp(np.bincount(fold.astype(int))) <= 2
    held_out = tables["measurements"]["subset"] == "validation"
    np.testing.assert_array_equal(held_out, fold == 0)


def test_models_can_be_read_back_from_their_tables(tables):
    found = models(tables, robot.load("mh180").dh)
    volumetric, fitted = found["vec"], found["dh"]
    assert (volumetric.order, volumetric.joints) == (2, 6)
    train = tables["measurements"]["subset"] == "train"
    q = np.stack([tables["measurements"][f"q{i}"] for i in range(1, 7)], axis=1)
    seen = np.stack([tables["measurements"][f"{axis}_mm"] for axis in "xyz"], axis=1)
    error = seen - vec_kinematics.pose(volumetric, q).position_mm
    figures = row(
        tables["residuals"],
        comparison="vec_vs_measured",
        subset="train",
        fold=None,
        quantity="position",
    )
    size = np.linalg.norm(error, axis=1)[train]
    assert figures["max"] == pytest.approx(size.max(), rel=1e-12)
    assert figures["n"] == train.sum()
    assert figures["rms"] == pytest.approx(0.05 * np.sqrt(3), rel=0.15)
    apart = vec_kinematics.pose(volumetric, q).position_mm
    apart = apart - dh_kinematics.forward(fitted, q).position_mm
    figures = row(
        tables["residuals"], comparison="dh_vs_vec", subset="train", fold=None, quantity="position"
    )
    assert figures["mean"] == pytest.approx(np.linalg.norm(apart, axis=1)[train].mean(), rel=1e-9)


def test_pooled_validation_covers_every_row_once(tables):
    table, errors = tables["residuals"], tables["pose_errors"]
    for comparison in ("vec_vs_measured", "dh_vs_vec", "dh_vs_measured", "nominal_vs_measured"):
        pooled = row(
            table, comparison=comparison, subset="validation", fold=None, quantity="position"
        )
        assert pooled["n"] == POSES
        parts = [
            row(table, comparison=comparison, subset="validation", fold=k, quantity="position")
            for k in range(5)
        ]
        squares = sum(part["n"] * part["rms"] ** 2 for part in parts)
        assert pooled["rms"] == pytest.approx(np.sqrt(squares / POSES), rel=1e-12)
        chosen = (errors["comparison"] == comparison) & (errors["estimate"] == "cross_validated")
        assert sorted(errors["row"][chosen].tolist()) == list(range(POSES))
        size = np.linalg.norm([errors[f"e{axis}_mm"][chosen] for axis in "xyz"], axis=0)
        assert size.max() == pytest.approx(pooled["max"], rel=1e-12)


def test_rows_of_the_validation_fold_never_reach_the_delivered_models(plan, tables):
    spoiled = {name: values.copy() for name, values in tables["measurements"].items()}
    spoiled["x_mm"][spoiled["subset"] == "validation"] += 100.0
    again = RUNS["vec"](
        {"measurements": spoiled}, settings_of(plan, "vec", calibration__vec__order=2)
    )
    np.testing.assert_array_equal(
        again["vec_model"]["coefficient"], tables["vec_model"]["coefficient"]
    )


def test_rank_of_the_vec_is_in_its_table(tables):
    table = tables["vec_fit"]
    values = dict(zip(table["quantity"], table["value"], strict=True))
    assert values["rank"] == 36 * 3 - 10
    assert values["converged"] == 1.0
    assert np.sum(table["quantity"] == "singular_value") == 108
    prior = table["quantity"] == "prior_std"
    assert table["parameter"][prior][0] == "j1.delta_x.0"


def test_base_and_tool_estimated_and_fitted_to_measurements(plan):
    base = Pose(exp_so3(np.array([0.2, 1.0, -2.0])), np.array([1500.0, -700.0, 300.0]))
    tool = Pose(exp_so3(np.array([0.5, -0.3, 0.1])), np.array([20.0, 30.0, 150.0]))
    split = source.split(columns(base, tool), plan.settings["mh180"])
    found = chain(
        plan,
        split,
        calibration__base_and_tool="estimated",
        calibration__dh__fit_to="measurements",
    )
    names = set(zip(found["frames"]["model"], found["frames"]["frame"], strict=True))
    assert names == {(model, of) for model in ("vec", "dh", "nominal") for of in ("base", "tool")}
    got = frame(found["frames"], "dh", "base")
    assert np.linalg.norm(got.position_mm - base.position_mm) < 20.0
    figures = row(
        found["residuals"],
        comparison="vec_vs_measured",
        subset="validation",
        fold=None,
        quantity="position",
    )
    assert figures["rms"] < 0.05 * np.sqrt(3) * 1.6


def test_masks_priors_loss_and_hayati_angles_come_from_the_configuration(plan):
    base = Pose(exp_so3(np.array([0.2, 1.0, -2.0])), np.array([1500.0, -700.0, 300.0]))
    tool = Pose(exp_so3(np.array([0.5, -0.3, 0.1])), np.array([20.0, 30.0, 150.0]))
    split = source.split(columns(base, tool), plan.settings["mh180"])
    found = chain(
        plan,
        split,
        calibration__base_and_tool="estimated",
        calibration__frames={"base z": {"value_mm": 300.0}, "tool x": {"prior_std_mm": 50.0}},
        calibration__dh__fit_to="measurements",
        calibration__dh__hayati_joints="auto",
        calibration__dh__loss="huber",
        calibration__dh__parameters={"joint 1 d": "fixed", "joint 4 a": {"value_mm": 0.125}},
    )
    table = found["dh_model"]
    assert table["beta_rad"][1] != 0.0  # axes 2 and 3 are parallel
    assert np.count_nonzero(table["beta_rad"]) == 1
    assert (table["d_mm"][0], table["d_mm"][1], table["a_mm"][3]) == (0.0, 0.0, 0.125)
    assert np.isnan(table["std_d_mm"][:2]).all()
    for model in ("dh", "nominal"):
        assert frame(found["frames"], model, "base").position_mm[2] == pytest.approx(300.0)
    figures = dict(zip(found["dh_fit"]["quantity"], found["dh_fit"]["value"], strict=True))
    assert 0.05 < figures["loss_scale"] < 1.0
    assert (
        row(
            found["residuals"],
            comparison="dh_vs_measured",
            subset="validation",
            fold=None,
            quantity="position",
        )["rms"]
        < 1.5
    )


def test_a_cylinder_is_assessed_with_bases_and_tools_that_were_estimated(plan):
    base = Pose(exp_so3(np.array([0.2, 1.0, -2.0])), np.array([1500.0, -700.0, 300.0]))
    tool = Pose(exp_so3(np.array([0.5, -0.3, 0.1])), np.array([20.0, 30.0, 150.0]))
    split = source.split(columns(base, tool), plan.settings["mh180"])
    found = chain(
        plan,
        split,
        calibration__base_and_tool="estimated",
        calibration__dh__fit_to="measurements",
    )
    changes = {
        "evaluation__space": "cylinder",
        "evaluation__points_in": "joints",
        "evaluation__points": 30,
        "evaluation__cylinder": {
            "inner_radius_mm": 1200.0,
            "radial_span_mm": 900.0,
            "bottom_mm": 800.0,
            "height_mm": 1000.0,
            "angle_deg": [-25.0, 25.0],
        },
    }
    made = evaluation.points(found, settings_of(plan, "assessment_points", **changes))
    points = made["assessment_points"]
    q = np.stack([points[f"q{i}"] for i in range(1, 7)], axis=1)
    seen = {}
    of = models(found, robot.load("mh180").dh)
    for name, pose in (
        ("vec", vec_kinematics.pose(of["vec"], q)),
        ("dh", dh_kinematics.forward(of["dh"], q)),
    ):
        ends = (frame(found["frames"], name, which) for which in ("base", "tool"))
        at, carried = ends
        seen[name] = compose(at, compose(pose, carried)).position_mm  # in the instrument's frame
    apart = np.linalg.norm(seen["vec"] - seen["dh"], axis=1)
    np.testing.assert_allclose(points["true_error_mm"], apart, rtol=1e-9, atol=1e-9)
    assert apart.max() < 5.0


def test_a_base_all_of_which_is_fixed_is_held_in_every_model(plan):
    base = Pose(exp_so3(np.array([0.0, 0.0, 0.3])), np.array([1500.0, -700.0, 300.0]))
    split = source.split(columns(base, Pose(np.eye(3), np.zeros(3))), plan.settings["mh180"])
    stated = {f"base {axis}": {"value_mm": base.position_mm[i]} for i, axis in enumerate("xyz")}
    stated |= {"base rx": "fixed", "base ry": "fixed", "base rz": {"value_rad": 0.3}}
    found = chain(
        plan,
        split,
        calibration__base_and_tool="estimated",
        calibration__frames=stated,
        calibration__dh__fit_to="measurements",
    )
    for model in ("vec", "dh", "nominal"):
        at = frame(found["frames"], model, "base")
        np.testing.assert_allclose(at.position_mm, base.position_mm, atol=1e-9)
        np.testing.assert_allclose(at.rotation, base.rotation, atol=1e-12)


def test_without_folds_there_is_nothing_to_cross_validate(plan):
    settings = settings_of(
        plan, "measurements", measurements__folds=None, measurements__validation_fold=None
    )
    split = source.split(columns(), settings)
    assert np.isnan(split["fold"]).all()
    found = chain(plan, split)
    assert set(found["residuals"]["subset"]) == {"train"}
    assert set(found["pose_errors"]["estimate"]) == {"train"}


def test_time_blocks_hold_out_runs_of_the_measurement(plan):
    settings = settings_of(plan, "measurements", measurements__fold_by="time_block")
    split = source.split(columns(), settings)
    fresh = POSES - POSES // 10  # the rows after these visit the first ones again
    assert (np.diff(split["fold"][:fresh]) >= 0).all()
    np.testing.assert_array_equal(split["fold"][fresh:], split["fold"][: POSES // 10])
    assert set(split["fold"]) == {0, 1, 2, 3, 4}


def test_a_session_that_one_fold_holds_alone_always_trains_and_is_named(plan):
    base = Pose(exp_so3(np.array([0.2, 1.0, -2.0])), np.array([1500.0, -700.0, 300.0]))
    measured = columns(base, Pose(np.eye(3), np.array([20.0, 30.0, 150.0])))
    session = np.full(POSES, "morning", dtype=object)
    session[40:44] = "noon"
    measured["session"] = session
    settings = settings_of(plan, "measurements", measurements__fold_by="time_block")
    with pytest.warns(UserWarning, match="session noon has fewer than 3 rows outside"):
        split = source.split(measured, settings)
    assert np.isnan(split["fold"][40:44]).all()
    assert (split["subset"][40:44] == "train").all()
    assert np.isfinite(np.delete(split["fold"], slice(40, 44))).all()
    found = chain(
        plan,
        split,
        calibration__base_and_tool="estimated",
        calibration__dh__fit_to="measurements",
    )
    errors = found["pose_errors"]
    held_out = errors["estimate"] == "cross_validated"
    assert not np.isin(np.arange(40, 44), errors["row"][held_out]).any()
    assert np.abs(errors["ex_mm"][held_out]).max() < 3.0


def test_a_target_seen_in_one_configuration_always_trains(plan):
    measured = {name: np.concatenate([values, values[:1]]) for name, values in columns().items()}
    measured["target"] = np.array(["tool"] * POSES + ["rare"], dtype=object)
    with pytest.warns(UserWarning, match="target rare has fewer than 3 rows"):
        split = source.split(measured, plan.settings["mh180"])
    again = POSES - POSES // 10  # the first configuration is visited again here
    assert np.isnan(split["fold"][[0, again, POSES]]).all()
    assert np.isnan(split["fold"]).sum() == 3


def test_too_few_poses_for_the_order_is_bad_input(plan):
    few = {name: values[:20] for name, values in columns().items()}
    split = source.split(few, plan.settings["mh180"])
    with pytest.raises(InputError, match=r"96 residual components .* 216 free parameters"):
        RUNS["vec"]({"measurements": split}, plan.settings["mh180"])


@pytest.mark.parametrize(("dataset", "reach_mm"), [("ur10_b", 0.475), ("ur10_d", 0.43)])
def test_reach_on_the_measured_ur10(dataset, reach_mm, monkeypatch):
    monkeypatch.chdir(ROOT)
    measured = read_data_sets([ROOT / "config.yaml", ROOT / "examples" / "ur10.yaml"])
    found: dict = {}
    for name in ("measurements", "vec", "dh", "residuals"):
        found |= RUNS[name](found, measured.settings[dataset])
    rms = {
        comparison: row(
            found["residuals"],
            comparison=comparison,
            subset="validation",
            fold=None,
            quantity="position",
        )["rms"]
        for comparison in ("vec_vs_measured", "dh_vs_measured", "nominal_vs_measured")
    }
    assert rms["dh_vs_measured"] <= reach_mm
    assert rms["vec_vs_measured"] <= 0.9 * rms["dh_vs_measured"]
    assert rms["nominal_vs_measured"] > 0.7
