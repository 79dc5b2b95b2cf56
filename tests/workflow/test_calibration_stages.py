"""The calibration stages on a made-up arm and, where the data is at hand, on a measured UR10."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pandas as pd
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
from kinacc.tables.store import to_table
from kinacc.workflow.data_sets import read_data_sets

ROOT = Path(__file__).resolve().parents[2]
POSES, AGAIN = 150, 15  # the last poses visit the first ones again
MARKS = {"kinacc_version": "0", "config_hash": "0", "seed": 1}
BASE = Pose(exp_so3(np.array([0.2, 1.0, -2.0])), np.array([1500.0, -700.0, 300.0]))
TOOL = Pose(exp_so3(np.array([0.5, -0.3, 0.1])), np.array([20.0, 30.0, 150.0]))
NO_TOOL = Pose(np.eye(3), np.zeros(3))
# Keys of the section calibration that estimate base and tool and fit DH to what was measured.
MEASURED = {"base_and_tool": "estimated", "dh__fit_to": "measurements"}
SETTINGS = read_data_sets([ROOT / "config.yaml"]).settings["mh180"]


def settings_of(section="calibration", **changes):
    found = copy.deepcopy(SETTINGS)
    for path, value in changes.items():
        *keys, last = path.split("__")
        at = found[section]
        for key in keys:
            at = at[key]
        at[last] = value
    return found


def columns(base=None, tool=None):
    """A VEC arm of order 2 with 0.05 mm noise."""
    arm, rng = robot.load("mh180"), np.random.default_rng(0)
    q = rng.uniform(-0.5, 0.5, (POSES, 6))
    q[-AGAIN:] = q[:AGAIN]
    true = vec_kinematics.without_errors(arm.dh, np.full(6, -0.6), np.full(6, 0.6), 2)
    unit = np.repeat([0.3, 0.3e-3], 9)
    x = np.concatenate([np.tile(unit, 6), np.zeros(12)]) * rng.normal(size=120)
    seen = vec_kinematics.pose(true.with_parameters(x), q)
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


def chain(split, **changes):
    """Tables of all calibration stages, the VEC model of order 2."""
    found, settings = {"measurements": split}, settings_of(**{"vec__order": 2} | changes)
    for name in ("vec", "dh", "residuals"):
        found |= RUNS[name](found, settings)
    return found


@pytest.fixture(scope="module")
def tables():
    return chain(source.split(columns(), SETTINGS))


@pytest.fixture(scope="module")
def placed():
    """Measurements with a base and a tool that are estimated, and all of their tables."""
    split = source.split(columns(BASE, TOOL), SETTINGS)
    return split, chain(split, **MEASURED)


def rows(found, comparison, subset="validation"):
    """Statistics of position errors; folds are the index, -1 for all."""
    table = pd.DataFrame(found["residuals"])
    kept = (table.comparison == comparison) & (table.subset == subset)
    return table[kept & (table.quantity == "position")].fillna({"fold": -1}).set_index("fold")


def joints(table):
    return np.stack([table[f"q{i}"] for i in range(1, 7)], axis=1)


def test_every_table_is_as_the_contract_says(tables):
    for name, table in tables.items():
        assert set(to_table(name, table, MARKS).column_names) >= set(table), name


def test_configurations_visited_twice_are_held_out_together(tables):
    fold = tables["measurements"]["fold"]
    np.testing.assert_array_equal(fold[:AGAIN], fold[-AGAIN:])
    assert np.ptp(np.bincount(fold.astype(int))) <= 2
    np.testing.assert_array_equal(tables["measurements"]["subset"] == "validation", fold == 0)


def test_models_can_be_read_back_from_their_tables(tables):
    found, measured = models(tables, robot.load("mh180").dh), tables["measurements"]
    train = measured["subset"] == "train"
    at = vec_kinematics.pose(found["vec"], joints(measured)).position_mm
    seen = np.stack([measured[f"{axis}_mm"] for axis in "xyz"], axis=1)
    size = np.linalg.norm(seen - at, axis=1)[train]
    figures = rows(tables, "vec_vs_measured", "train").loc[-1]
    assert figures["max"] == pytest.approx(size.max(), rel=1e-12)
    assert figures["n"] == train.sum()
    assert figures["rms"] == pytest.approx(0.05 * np.sqrt(3), rel=0.15)
    apart = at - dh_kinematics.forward(found["dh"], joints(measured)).position_mm
    mean = rows(tables, "dh_vs_vec", "train").loc[-1, "mean"]
    assert mean == pytest.approx(np.linalg.norm(apart, axis=1)[train].mean(), rel=1e-9)


@pytest.mark.parametrize("of", ["vec_vs_measured", "dh_vs_vec", "dh_vs_measured"])
def test_pooled_validation_covers_every_row_once(tables, of):
    figures, errors = rows(tables, of), pd.DataFrame(tables["pose_errors"])
    folds, pooled = figures.drop(-1), figures.loc[-1]
    assert pooled["n"] == POSES
    square = (folds["n"] * folds["rms"] ** 2).sum() / POSES
    assert pooled["rms"] == pytest.approx(np.sqrt(square), rel=1e-12)
    held_out = errors[(errors.comparison == of) & (errors.estimate == "cross_validated")]
    assert sorted(held_out["row"]) == list(range(POSES))
    size = np.linalg.norm(held_out[[f"e{axis}_mm" for axis in "xyz"]], axis=1)
    assert size.max() == pytest.approx(pooled["max"], rel=1e-12)


def test_rows_of_the_validation_fold_never_reach_the_delivered_models(tables):
    spoiled = {name: values.copy() for name, values in tables["measurements"].items()}
    spoiled["x_mm"][spoiled["subset"] == "validation"] += 100.0
    again = RUNS["vec"]({"measurements": spoiled}, settings_of(vec__order=2))["vec_model"]
    np.testing.assert_array_equal(again["coefficient"], tables["vec_model"]["coefficient"])


def test_rank_of_the_vec_is_in_its_table(tables):
    table = pd.DataFrame(tables["vec_fit"])
    values = table.drop_duplicates("quantity").set_index("quantity")
    assert values.loc["rank", "value"] == 36 * 3 - 10
    assert values.loc["converged", "value"] == 1.0
    assert (table.quantity == "singular_value").sum() == 108
    assert values.loc["prior_std", "parameter"] == "j1.delta_x.0"


def test_base_and_tool_estimated_and_fitted_to_measurements(placed):
    _, found = placed
    names = set(zip(found["frames"]["model"], found["frames"]["frame"], strict=True))
    assert names == {(model, of) for model in ("vec", "dh", "nominal") for of in ("base", "tool")}
    got = frame(found["frames"], "dh", "base")
    assert np.linalg.norm(got.position_mm - BASE.position_mm) < 20.0
    assert rows(found, "vec_vs_measured").loc[-1, "rms"] < 0.05 * np.sqrt(3) * 1.6


def test_masks_priors_loss_and_hayati_angles_come_from_the_configuration(placed):
    found = chain(
        placed[0],
        **MEASURED,
        frames={"base z": {"value_mm": 300.0}, "tool x": {"prior_std_mm": 50.0}},
        dh__hayati_joints="auto",
        dh__loss="huber",
        dh__parameters={"joint 1 d": "fixed", "joint 4 a": {"value_mm": 0.125}},
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
    assert rows(found, "dh_vs_measured").loc[-1, "rms"] < 1.5


def test_a_cylinder_is_assessed_with_bases_and_tools_that_were_estimated(placed):
    found = placed[1]
    cylinder = {"inner_radius_mm": 1200.0, "radial_span_mm": 900.0, "bottom_mm": 800.0,
                "height_mm": 1000.0, "angle_deg": [-25.0, 25.0]}  # fmt: skip
    changes = {"space": "cylinder", "points_in": "joints", "points": 30, "cylinder": cylinder}
    points = evaluation.points(found, settings_of("evaluation", **changes))["assessment_points"]
    of, q, seen = models(found, robot.load("mh180").dh), joints(points), []
    for name, pose in (
        ("vec", vec_kinematics.pose(of["vec"], q)),
        ("dh", dh_kinematics.forward(of["dh"], q)),
    ):
        base, tool = (frame(found["frames"], name, which) for which in ("base", "tool"))
        seen.append(compose(base, compose(pose, tool)).position_mm)  # in the instrument's frame
    apart = np.linalg.norm(seen[0] - seen[1], axis=1)
    np.testing.assert_allclose(points["true_error_mm"], apart, rtol=1e-9, atol=1e-9)
    assert apart.max() < 5.0


def test_a_base_all_of_which_is_fixed_is_held_in_every_model():
    base = Pose(exp_so3(np.array([0.0, 0.0, 0.3])), BASE.position_mm)
    stated = {f"base {axis}": {"value_mm": base.position_mm[i]} for i, axis in enumerate("xyz")}
    stated |= {"base rx": "fixed", "base ry": "fixed", "base rz": {"value_rad": 0.3}}
    found = chain(source.split(columns(base, NO_TOOL), SETTINGS), **MEASURED, frames=stated)
    for model in ("vec", "dh", "nominal"):
        at = frame(found["frames"], model, "base")
        np.testing.assert_allclose(at.position_mm, base.position_mm, atol=1e-9)
        np.testing.assert_allclose(at.rotation, base.rotation, atol=1e-12)


def test_without_folds_there_is_nothing_to_cross_validate():
    split = source.split(columns(), settings_of("measurements", folds=None, validation_fold=None))
    assert np.isnan(split["fold"]).all()
    found = chain(split)
    assert set(found["residuals"]["subset"]) == {"train"}
    assert set(found["pose_errors"]["estimate"]) == {"train"}


def test_time_blocks_hold_out_runs_of_the_measurement():
    fold = source.split(columns(), settings_of("measurements", fold_by="time_block"))["fold"]
    assert (np.diff(fold[:-AGAIN]) >= 0).all()
    np.testing.assert_array_equal(fold[-AGAIN:], fold[:AGAIN])
    assert set(fold) == {0, 1, 2, 3, 4}


def test_a_session_that_one_fold_holds_alone_always_trains_and_is_named():
    measured = columns(BASE, Pose(np.eye(3), np.array([20.0, 30.0, 150.0])))
    alone = (np.arange(POSES) >= 40) & (np.arange(POSES) < 44)
    measured["session"] = np.where(alone, "noon", "morning").astype(object)
    with pytest.warns(UserWarning, match="session noon has fewer than 3 rows outside"):
        split = source.split(measured, settings_of("measurements", fold_by="time_block"))
    np.testing.assert_array_equal(np.isnan(split["fold"]), alone)
    assert (split["subset"][alone] == "train").all()
    errors = pd.DataFrame(chain(split, **MEASURED)["pose_errors"])
    held_out = errors[errors.estimate == "cross_validated"]
    assert not held_out["row"].isin(np.flatnonzero(alone)).any()
    assert held_out["ex_mm"].abs().max() < 3.0


def test_a_target_seen_in_one_configuration_always_trains():
    measured = {name: np.concatenate([values, values[:1]]) for name, values in columns().items()}
    measured["target"][POSES] = "rare"
    with pytest.warns(UserWarning, match="target rare has fewer than 3 rows"):
        split = source.split(measured, SETTINGS)
    # The first configuration is visited again by the first of the last poses.
    assert np.flatnonzero(np.isnan(split["fold"])).tolist() == [0, POSES - AGAIN, POSES]


def test_too_few_poses_for_an_order_are_bad_input():
    few = {name: values[:20] for name, values in columns().items()}
    with pytest.raises(InputError, match=r"96 residual components .* 216 free parameters"):
        RUNS["vec"]({"measurements": source.split(few, SETTINGS)}, settings_of(vec__order=5))


@pytest.mark.parametrize(("dataset", "reach_mm"), [("ur10_b", 0.475), ("ur10_d", 0.43)])
def test_reach_on_the_measured_ur10(dataset, reach_mm, monkeypatch):
    monkeypatch.chdir(ROOT)
    measured = read_data_sets([ROOT / "config.yaml", ROOT / "examples" / "ur10.yaml"])
    found: dict = {}
    for name in ("measurements", "vec", "dh", "residuals"):
        found |= RUNS[name](found, measured.settings[dataset])
    rms = {of: rows(found, f"{of}_vs_measured").loc[-1, "rms"] for of in ("vec", "dh", "nominal")}
    assert rms["dh"] <= reach_mm
    assert rms["vec"] <= 0.9 * rms["dh"]
    assert rms["nominal"] > 0.7
