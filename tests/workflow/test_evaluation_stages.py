"""The map and the assessment points as stages: tables in, tables that fit the contract out."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest

from kinacc.config.schema import defaults
from kinacc.kinematics import dh, robot, vec
from kinacc.kinematics.inverse import limits
from kinacc.study import evaluation
from kinacc.tables.store import to_table

ARM = robot.load("mh180")
PROVENANCE = {"kinacc_version": "0", "config_hash": "0", "seed": 1}
EVALUATION = {
    **defaults()["evaluation"],
    "reference_orientation_deg": [180.0, 0.0, 0.0],
    "reference_frame": "slice",
    "rotations": "signs_and_zero",
    "points": 30,
}
LAYOUT = {"slices_deg": [0.0, 15.0, 30.0], "grid_mm": 250.0}


def vec_of(travel: bool = False) -> vec.VECModel:
    lower, upper = (
        np.deg2rad([-20, -40, -90, -190, -130, -190]),
        np.deg2rad([80, 70, 30, 190, 130, 190]),
    )
    rng = np.random.default_rng(4)
    scale = np.array([0.05] * 3 + [1e-4] * 3)[:, None]
    offsets = rng.normal(size=(6, 2)) * 1e-4 * travel
    return vec.VECModel(ARM.dh, lower, upper, rng.normal(size=(6, 6, 4)) * scale, offsets)


def inputs(travel: bool = False) -> dict[str, dict[str, np.ndarray]]:
    model = vec_of(travel)
    split = model.coefficients.size
    std = np.full(split + 12, np.nan)
    std[split:] = 0.0 if travel else np.nan  # without one, offsets are left out
    return {
        "vec_model": model.to_columns(std),
        "dh_model": ARM.dh.to_columns(np.full(30, np.nan)),
    }


def settings(**changed) -> dict:
    return {"robot": "mh180", "evaluation": {**EVALUATION, **changed}, "map": LAYOUT}


def joints(columns: dict, letter: str = "q") -> np.ndarray:
    return np.stack([columns[f"{letter}{i}"] for i in range(1, 7)], axis=1)


def test_the_joints_of_a_cell_are_those_the_controller_reports(tmp_path):
    own = tmp_path / "turned.yaml"
    shipped = files("kinacc.kinematics") / "robots" / "mh180.yaml"
    text = shipped.read_text("utf-8").replace("[-60, 76]", "[-76, 60]")
    turned = np.diag([1, -1, 1, 1, 1, 1]).tolist()
    own.write_text(f"{text}joint_map: {turned}\n", encoding="utf-8")
    reported = evaluation.mapped(inputs(), {**settings(), "robot": str(own)})["accuracy_map"]
    plain = evaluation.mapped(inputs(), settings())["accuracy_map"]
    assert np.array_equal(reported["q2"], -plain["q2"])
    assert np.array_equal(reported["q3"], plain["q3"])


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"points_in": "joints"},
        {"space": "joint_box"},
        {"space": "joint_box", "joint_box": {"joints_deg": [[-10, 10]] * 6}},
        {"sequence": "halton", "rotations": "all_27", "invert_with": "vec"},
        {"travel_direction": -1},
    ],
)
def test_points_fit_their_contract_and_state_the_error_of_their_joints(changed):
    columns = evaluation.points(inputs(True), settings(**changed))["assessment_points"]
    to_table("assessment_points", columns, PROVENANCE)
    q, s = joints(columns), joints(columns, "s")
    model = vec_of(True)
    assert (s == changed.get("travel_direction", 0)).all()
    error = vec.pose(model, q, s).position_mm - dh.forward(ARM.dh, q).position_mm
    stated = np.stack([columns[f"e{axis}_mm"] for axis in "xyz"], axis=1)
    assert np.allclose(stated, error, atol=1e-9)
    assert np.allclose(columns["true_error_mm"], np.linalg.norm(error, axis=1))
    assert limits.within(q, model.q_min_rad, model.q_max_rad).all()
