"""A model that a data set may ask for: part of its plan, hashes and answers where it does."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import call
from stages_by_hand import run_stage

from kinacc.errors import InputError
from kinacc.geometry import log_so3
from kinacc.kinematics import robot
from kinacc.kinematics.compliance import ComplianceModel
from kinacc.kinematics.model import JointState
from kinacc.workflow.data_sets import read_data_sets

COUNT, LOAD = 90, np.array([60.0, 20.0, -10.0, 150.0])
ARM = robot.load("mh180")
SOFT = np.array([np.nan, 1e-6, 2e-6, np.nan, np.nan, np.nan])


def bent_arm():
    weight = np.full(6, np.nan)
    weight[1:3] = 1.5e-6, 0.8e-6
    links = np.full((6, 4), np.nan)
    return ComplianceModel(ARM.dh, SOFT, weight, np.array([0.0, 0.0, -1.0]), links, np.zeros(4))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A data set whose rows carry nothing or a load, run up to the comparison of its models."""
    base = tmp_path_factory.mktemp("bent")
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, (COUNT, 6))
    payload = np.where(rng.random((COUNT, 1)) < 0.5, LOAD, np.zeros(4))
    seen = bent_arm().pose(JointState(q @ ARM.joint_map.T, None, payload)).position_mm
    names = [*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm", "Nutzlast [kg]"]
    names += [f"payload_{axis}_mm" for axis in "xyz"]
    rows = np.hstack([np.rad2deg(q), seen + 0.01 * rng.normal(size=seen.shape), payload])
    np.savetxt(base / "rows.csv", rows, "%.12g", ",", header=",".join(names), comments="")
    (base / "set.yaml").write_text(f"""
datasets:
  bent:
    robot: mh180
    measurements:
      source: file
      folds: 3
      file:
        path: {json.dumps(str(base / "rows.csv"))}
        orientation: {{kind: none}}
        columns: {{payload: "Nutzlast [kg]"}}
    calibration:
      vec: {{order: 1}}
      dh: {{fit_to: measurements}}
      compliance: {{joints: [2, 3]}}
""")
    for stage in ("measurements", "data_check", "vec", "compliance", "dh", "residuals"):
        done = run_stage(stage, "--config", base / "set.yaml", "--results", base / "results")
        assert done.exit_code == 0, done.output
    return base / "results" / "bent"


def test_fitted_says_how_joints_bend_and_that_only_products_are_seen(folder):
    answer = json.loads(call("fitted", folder, "--json").output)
    assert answer["selected"] == "compliance"
    assert list(answer["position_error_mm"]) == ["nominal", "dh", "compliance", "vec"]
    found = np.array([each["compliance_rad_per_nm"] for each in answer["bending"]])
    std = np.array([each["std_compliance_rad_per_nm"] for each in answer["bending"]])
    assert [each["joint"] for each in answer["bending"]] == [2, 3]
    assert np.all(np.abs(found - SOFT[1:3]) < 4.0 * std)
    assert "product of weight and compliance" in call("fitted", folder).output


def test_predictions_depend_on_what_is_carried(folder, tmp_path):
    q = np.random.default_rng(1).uniform(-0.8, 0.8, (4, 6))
    names = [f"q{i}_rad" for i in range(1, 7)] + ["payload_kg", "payload_x_mm"]
    names += ["payload_y_mm", "payload_z_mm"]
    for name, load in (("empty", np.zeros(4)), ("loaded", LOAD)):
        rows = np.hstack([q, np.tile(load, (4, 1))])
        path = tmp_path / f"{name}.csv"
        np.savetxt(path, rows, "%.12g", ",", header=",".join(names), comments="")
        answer = json.loads(call("predict", folder, path, "--json").output)
        seen = np.array([[row[f"{axis}_mm"] for axis in "xyz"] for row in answer["rows"]])
        at = JointState(q @ ARM.joint_map.T, None, np.tile(load, (4, 1)))
        assert np.abs(seen - bent_arm().pose(at).position_mm).max() < 0.05
        done = call("predict", folder, path, "--model", "dh")
        assert "not used: payload; the dh model was fitted without loads" in done.output


def test_compensation_comes_back_to_the_pose_with_the_load_of_each_row(folder):
    from kinacc.deployment import folder as results
    from kinacc.deployment.compensate import compensate

    arm = results.calibration(results.read_tables(folder), results.recorded_robot(folder))
    assert arm.choice == "compliance"
    q = np.random.default_rng(2).uniform(-0.8, 0.8, (4, 6))
    payload = np.array([[0.0, 0, 0, 0], LOAD, LOAD / 2.0, [np.nan] * 4])
    at = JointState(q @ ARM.joint_map.T, None, payload)
    found = compensate(arm, arm.pose(at), q, payload=payload)
    np.testing.assert_allclose(found.q_rad, q, atol=1e-8)
    other = compensate(arm, arm.pose(at), q)
    assert np.abs(other.q_rad - q)[1].max() > 1e-5
    again = arm.pose(JointState(found.q_rad @ ARM.joint_map.T, None, payload))
    turned = again.rotation @ np.swapaxes(arm.pose(at).rotation, 1, 2)
    assert np.abs(log_so3(turned)).max() < 1e-6


def test_a_format_that_cannot_carry_the_model_says_so(folder, tmp_path):
    done = call("export", folder, "--model", "compliance", "--format", "urdf", "--to", tmp_path)
    assert done.exit_code != 0
    assert "cannot carry a compliance model" in done.output
    assert not list(tmp_path.iterdir())
    done = call("export", folder, "--model", "compliance", "--to", tmp_path)
    assert done.exit_code == 0, done.output
    (path,) = tmp_path.iterdir()
    table = json.loads(path.read_text())["error_model_table"]
    columns = {name: np.array(values, dtype=float) for name, values in table.items()}
    model = ComplianceModel.from_columns(columns, ARM.dh.prismatic)
    answer = json.loads(call("fitted", folder, "--json").output)
    assert model.compliance_rad_per_nm[1] == answer["bending"][0]["compliance_rad_per_nm"]


def plan_of(tmp_path, text):
    (tmp_path / "a.yaml").write_text(f"datasets: {{arm: {{robot: mh180}}}}\n{text}")
    return read_data_sets([tmp_path / "a.yaml"])


def test_everything_wrong_with_the_settings_is_said_at_once(tmp_path):
    text = "{joints: [2, 7], gravity: [0, 0, 0], links: [{mass_kg: 1, centre_mm: [0, 0, 0]}]}"
    with pytest.raises(InputError) as raised:
        plan_of(tmp_path, f"calibration: {{compliance: {text}}}")
    said = str(raised.value)
    for words in ("mh180 has no joint 7", "has no direction", "1 links for the 6 joints"):
        assert words in said
    with pytest.raises(InputError, match=r"-3\.0 is out of range"):
        plan_of(
            tmp_path,
            "calibration: {compliance: {joints: [2], "
            "links: [{mass_kg: -3.0, centre_mm: [0, 0, 0]}]}}",
        )
    with pytest.raises(InputError, match="does not give mass_kg and centre_mm"):
        plan_of(tmp_path, "calibration: {compliance: {joints: [2], links: [{mass_kg: 3.0}]}}")
