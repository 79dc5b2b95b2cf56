"""The map and the assessment points as stages: tables in, tables that fit the contract out."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinacc.calibration.frames import Frames
from kinacc.calibration.tables import frames_columns
from kinacc.geometry import Pose
from kinacc.kinematics import dh, robot, vec
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.model import JointState
from kinacc.study import evaluation
from kinacc.synthetic import source
from kinacc.tables.store import to_table

ARM = robot.load("mh180")
PROVENANCE = {
    "kinacc_version": "0",
    "config_hash": "0",
    "seed": 1,
}
EVALUATION = {
    "space": "cylinder",
    "cylinder": {
        "inner_radius_mm": 1200.0,
        "radial_span_mm": 900.0,
        "bottom_mm": 0.0,
        "height_mm": 500.0,
        "angle_deg": [0.0, 60.0],
    },
    "joint_box": {"joints_deg": None},
    "reference_orientation_deg": [180.0, 0.0, 0.0],
    "reference_frame": "slice",
    "rotation_deg": 45.0,
    "rotations": "signs_and_zero",
    "tool_mm": [0.0, 0.0, 0.0],
    "sequence": "sobol",
    "points": 30,
    "points_in": "space",
    "invert_with": "dh",
    "travel_direction": 0,
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


def frames(tool_mm: tuple[float, float, float]) -> dict[str, np.ndarray]:
    tool = Pose(np.eye(3)[None], np.array([tool_mm]))
    same = Frames(Pose(np.eye(3), np.zeros(3)), tool)
    return frames_columns({"vec": same, "dh": same}, ("tool",))


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


def test_the_map_fits_its_contract_and_keeps_the_slices_as_configured():
    columns = evaluation.mapped(inputs(), settings())["accuracy_map"]
    table = to_table("accuracy_map", columns, PROVENANCE)
    assert table.num_rows == 3 * 5 * 3
    assert np.unique(columns["slice_deg"]).tolist() == [0.0, 15.0, 30.0]


def test_the_worst_pose_of_a_cell_can_be_driven_to_and_shows_the_error_that_is_stated():
    columns = evaluation.mapped(inputs(), settings())["accuracy_map"]
    q, model = joints(columns), vec_of(False)
    assert np.isfinite(q).all()
    seen = dh.forward(ARM.dh, q).position_mm
    error_mm = np.linalg.norm(model.pose(JointState(q)).position_mm - seen, axis=1)
    assert np.allclose(error_mm, columns["position_max_mm"], rtol=0.0, atol=1e-9)
    assert np.allclose(np.hypot(seen[:, 0], seen[:, 1]), columns["radius_mm"], atol=1e-5)
    assert np.allclose(seen[:, 2], columns["height_mm"], atol=1e-5)


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


def test_held_to_a_workpiece_the_tool_keeps_its_attitude_over_the_whole_space():
    euler_deg = [180.0, -20.0, 10.0]
    held = settings(reference_orientation_deg=euler_deg, reference_frame="base")
    points = evaluation.points(inputs(), held)["assessment_points"]
    seen = dh.forward(ARM.dh, joints(points))
    angles = np.rad2deg(np.arctan2(seen.position_mm[:, 1], seen.position_mm[:, 0]))
    assert np.ptp(angles) > 50.0
    in_base = Rotation.from_euler("XYZ", euler_deg, degrees=True).inv()
    turns = (in_base * Rotation.from_matrix(seen.rotation)).as_euler("XYZ", degrees=True)
    assert np.allclose(np.sort(np.unique(np.round(turns, 4) + 0.0)), [-45.0, 0.0, 45.0])


@pytest.mark.parametrize("slice_deg", [0.0, 15.0, 30.0])
def test_a_slice_of_the_map_held_to_a_workpiece_is_that_of_a_tool_turned_back(slice_deg):
    # Rz(-a) Rx(180) = Rx(180) Rz(a): in the frame of slice a the tool stands turned about itself.
    held = evaluation.mapped(inputs(), settings(reference_frame="base"))["accuracy_map"]
    turned = settings(reference_orientation_deg=[180.0, 0.0, slice_deg])
    wanted = evaluation.mapped(inputs(), turned)["accuracy_map"]
    rows = held["slice_deg"] == slice_deg
    for name in ("position_max_mm", "orientation_max_mrad"):
        assert np.allclose(held[name][rows], wanted[name][rows], rtol=0.0, atol=1e-7)
    assert held["worst_branch"][rows].tolist() == wanted["worst_branch"][rows].tolist()


@pytest.mark.parametrize("frame", ["slice", "base"])
def test_a_calibration_covers_the_attitudes_its_arm_is_judged_in(frame):
    euler_deg = [180.0, -45.0, 20.0]
    section = {**EVALUATION, "reference_orientation_deg": euler_deg, "reference_frame": frame}
    arm = {"robot": "mh180", "seed": 1, "evaluation": section}
    synthetic = {"draw": 0, "poses": 200, "tracker_noise_mm": 0.0}
    file_settings = {"source": "synthetic", "folds": None, "validation_fold": None}
    seen = source.run({}, {**arm, "measurements": {**file_settings, "synthetic": synthetic}})
    columns = seen["measurements"]
    quaternion = np.stack([columns[name] for name in ("qx", "qy", "qz", "qw")], axis=1)
    attitude = Rotation.from_euler("XYZ", euler_deg, degrees=True)
    if frame == "slice":
        turned = np.arctan2(columns["y_mm"], columns["x_mm"])
        attitude = Rotation.from_euler("z", turned[:, None]) * attitude
    turns = (attitude.inv() * Rotation.from_quat(quaternion)).as_euler("XYZ", degrees=True)
    # Errors of the arm are below a degree; the plan turns the flange by up to 50 degrees.
    assert 45.0 < np.abs(turns).max() < 51.0


def test_a_joint_box_is_in_millimetres_where_a_joint_slides():
    slides = np.array([False, False, True, False, False, False])
    arm = replace(ARM, dh=replace(ARM.dh, prismatic=slides))
    ranges = [[-10, 20], [0, 90], [-50, 150], [0, 1], [0, 1], [0, 1]]
    low, high = evaluation.joint_box({"joint_box": {"joints_deg": ranges}}, arm)
    np.testing.assert_allclose(low[:3], [np.deg2rad(-10), 0.0, -50.0])
    np.testing.assert_allclose(high[:3], [np.deg2rad(20), np.pi / 2, 150.0])
    assert evaluation.joint_box({"joint_box": {"joints_deg": None}}, arm) is None


def test_a_fitted_tool_carries_the_point_assessed():
    tool = (0.0, 0.0, 200.0)
    given = {**inputs(), "frames": frames(tool)}
    columns = evaluation.points(given, settings())["assessment_points"]
    configured = evaluation.points(inputs(), settings(tool_mm=list(tool)))["assessment_points"]
    assert all(np.array_equal(columns[name], configured[name]) for name in columns)
    height = dh.forward(ARM.dh, joints(columns))
    tip = height.position_mm + height.rotation @ np.array(tool)
    assert (tip[:, 2] >= -1e-5).all()
    assert (tip[:, 2] <= 500 + 1e-5).all()


def test_measured_points_are_cross_validated_errors_averaged_over_readings():
    count = 12
    rows = np.repeat(np.arange(count), 2)
    rng = np.random.default_rng(1)
    measurements = {f"q{i}": rng.normal(size=2 * count) for i in range(1, 7)}
    measurements |= {f"s{i}": np.ones(2 * count, dtype=np.int8) for i in range(1, 7)}
    comparison = np.repeat(["dh_vs_measured", "vec_vs_measured"], 4 * count).astype(object)
    estimate = np.tile(np.repeat(["train", "cross_validated"], 2 * count), 2).astype(object)
    errors = {
        "comparison": comparison,
        "estimate": estimate,
        "row": np.tile(np.arange(2 * count), 4),
        "pose": np.tile(rows, 4),
        "target": np.full(8 * count, "tool", dtype=object),
    }
    errors |= {f"e{axis}_mm": rng.normal(size=8 * count) for axis in "xyz"}
    given = {"pose_errors": errors, "measurements": measurements}
    columns = evaluation.points(given, settings(space="measured", points=5))["assessment_points"]
    to_table("assessment_points", columns, PROVENANCE)
    assert len(columns["point"]) == 5
    held_out = (comparison == "dh_vs_measured") & (estimate == "cross_validated")
    for i in range(5):
        row = np.flatnonzero(measurements["q1"] == columns["q1"][i])[0]
        same = held_out & (errors["pose"] == rows[row])
        assert same.sum() == 2
        assert np.isclose(columns["ey_mm"][i], errors["ey_mm"][same].mean())
