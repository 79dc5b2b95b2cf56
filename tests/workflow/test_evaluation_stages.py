"""The map and the assessment points as stages: tables in, tables that fit the contract out."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest
from calibration.simulated import wavy

from kinacc.config.schema import defaults
from kinacc.config.values import overlay
from kinacc.kinematics import dh, robot, vec
from kinacc.kinematics.inverse import limits
from kinacc.study import evaluation
from kinacc.tables.store import to_table

ARM = robot.load("mh180")
PROVENANCE = {"kinacc_version": "0", "config_hash": "0", "seed": 1}
SETTINGS = overlay(
    {"robot": "mh180", "evaluation": defaults()["evaluation"]},
    {
        "evaluation": {
            "reference_orientation_deg": [180.0, 0.0, 0.0],
            "reference_frame": "slice",
            "rotations": "signs_and_zero",
            "points": 30,
        },
        "map": {"slices_deg": [0.0, 15.0, 30.0], "grid_mm": 250.0},
    },
)
LOW, HIGH = np.deg2rad([[-20, -40, -90, -190, -130, -190], [80, 70, 30, 190, 130, 190]])


@pytest.fixture(scope="module")
def model():
    return wavy(vec.without_errors(ARM.dh, LOW, HIGH, 3), np.random.default_rng(4))


@pytest.fixture(scope="module")
def inputs(model):
    std = np.append(np.full(model.coefficients.size, np.nan), np.zeros(12))
    return {
        "vec_model": model.to_columns(std),
        "dh_model": ARM.dh.to_columns(np.full(30, np.nan)),
    }


def joints(columns: dict, letter: str = "q") -> np.ndarray:
    return np.stack([columns[f"{letter}{i}"] for i in range(1, 7)], axis=1)


def test_the_joints_of_a_cell_are_those_the_controller_reports(inputs, tmp_path):
    own = tmp_path / "turned.yaml"
    shipped = files("kinacc.kinematics") / "robots" / "mh180.yaml"
    text = shipped.read_text("utf-8").replace("[-60, 76]", "[-76, 60]")
    turned = np.diag([1, -1, 1, 1, 1, 1]).tolist()
    own.write_text(f"{text}joint_map: {turned}\n", encoding="utf-8")
    reported, plain = (
        evaluation.mapped(inputs, {**SETTINGS, "robot": name})["accuracy_map"]
        for name in (str(own), "mh180")
    )
    assert np.array_equal(reported["q2"], -plain["q2"])
    assert np.array_equal(reported["q3"], plain["q3"])


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"points_in": "joints"},
        {"sequence": "halton", "rotations": "all_27", "invert_with": "vec", "travel_direction": -1},
    ],
)
def test_points_fit_their_contract_and_state_the_error_of_their_joints(model, inputs, changed):
    settings = overlay(SETTINGS, {"evaluation": changed})
    columns = evaluation.points(inputs, settings)["assessment_points"]
    to_table("assessment_points", columns, PROVENANCE)
    q, s = joints(columns), joints(columns, "s")
    assert (s == changed.get("travel_direction", 0)).all()
    error = vec.pose(model, q, s).position_mm - dh.forward(ARM.dh, q).position_mm
    stated = np.stack([columns[f"e{axis}_mm"] for axis in "xyz"], axis=1)
    assert np.allclose(stated, error, atol=1e-9)
    assert np.allclose(columns["true_error_mm"], np.linalg.norm(error, axis=1))
    assert limits.within(q, LOW, HIGH).all()
