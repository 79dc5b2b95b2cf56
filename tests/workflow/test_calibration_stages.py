"""The calibration stages on a made-up arm and, where the data is at hand, on a measured UR10."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from kinacc.geometry import Pose, compose, exp_so3, quaternion_from_rotation
from kinacc.kinematics import robot
from kinacc.kinematics import vec as vec_kinematics
from kinacc.study.in_memory import RUNS
from kinacc.synthetic import source
from kinacc.workflow.data_sets import read_data_sets

ROOT = Path(__file__).resolve().parents[2]
POSES, AGAIN = 150, 15  # the last poses visit the first ones again
MARKS = {"kinacc_version": "0", "config_hash": "0", "seed": 1}
BASE = Pose(exp_so3(np.array([0.2, 1.0, -2.0])), np.array([1500.0, -700.0, 300.0]))
TOOL = Pose(exp_so3(np.array([0.5, -0.3, 0.1])), np.array([20.0, 30.0, 150.0]))
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


def test_rows_of_the_validation_fold_never_reach_the_delivered_models(tables):
    spoiled = {name: values.copy() for name, values in tables["measurements"].items()}
    spoiled["x_mm"][spoiled["subset"] == "validation"] += 100.0
    again = RUNS["vec"]({"measurements": spoiled}, settings_of(vec__order=2))["vec_model"]
    np.testing.assert_array_equal(again["coefficient"], tables["vec_model"]["coefficient"])


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
