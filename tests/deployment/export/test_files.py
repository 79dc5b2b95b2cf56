"""A calibrated arm as robot file, JSON, CSV and tables: complete, exact, all or nothing."""

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest

from kinacc.deployment.export.files import format_named, write
from kinacc.deployment.export.paper_tables import with_deviation
from kinacc.deployment.export.source import Source
from kinacc.deployment.record import TOOL, nominal
from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3, rotation_from_quaternion, rotation_x, rotation_z
from kinacc.kinematics import dh, robot
from kinacc.kinematics.model import JointState


def bent(name, seed=0):
    arm, rng = robot.load(name), np.random.default_rng(seed)
    vector = arm.dh.start
    model = arm.dh.with_parameters(vector + rng.normal(0.0, 1e-3, vector.size))
    tool = Pose(exp_so3(np.array([0.1, 0.2, 3.0])), np.array([1.0, 2.0, 300.0]))
    return replace(nominal(arm, "probe"), choice="dh", model=model, targets={TOOL: tool})


def written(form, arm, **tables):
    return format_named(form).text(Source(arm, tables))


def read_back(arm, tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text(written("yaml", arm))
    return robot.load(path)


@pytest.mark.parametrize("name", robot.shipped())
def test_a_robot_file_is_read_back_bit_by_bit(name, tmp_path):
    arm = bent(name)
    back = read_back(arm, tmp_path)
    np.testing.assert_array_equal(back.dh.start, arm.model.start)
    np.testing.assert_array_equal(back.dh.prismatic, arm.model.prismatic)
    for each in ("joint_map", "q_min_rad", "q_max_rad"):
        np.testing.assert_array_equal(getattr(back, each), getattr(arm.robot, each))
    carried = robot.carried(back)
    np.testing.assert_allclose(carried.position_mm, arm.targets[TOOL].position_mm, atol=1e-11)
    np.testing.assert_allclose(carried.rotation, arm.targets[TOOL].rotation, atol=1e-14)


def model_table(arm):
    """``dh_model`` of an arm, with standard deviations."""
    table = {"joint": np.arange(1, arm.model.joints + 1)}
    for name in dh.PARAMETERS:
        table[name] = getattr(arm.model, name).copy()
        table[f"std_{name}"] = np.full(arm.model.joints, 1e-3)
    return table


def test_json_and_csv_say_the_same_of_every_joint():
    said = (
        "d of joint 2 and d of joint 3 appear only as their sum",
        "a shift of the base along y cannot be told from a shift of the tool along z",
    )
    arm = replace(bent("ur10"), left_open=said)
    table = model_table(arm)
    table["std_d_mm"][0] = np.nan
    content = json.loads(written("json", arm, dh_model=table))
    rows = list(csv.DictReader(io.StringIO(written("csv", arm, dh_model=table))))
    assert content["undetermined"] == list(said)
    assert content["joints"][0]["std_d_mm"] is None
    assert rows[0]["std_d_mm"] == ""
    told = [row["undetermined"] for row in rows]
    assert told[:5] == ["", said[0], said[0], "", ""]
    assert told[5].startswith(said[1])
    for joint, row in zip(content["joints"], rows, strict=True):
        assert float(row["d_mm"]) == pytest.approx(joint["d_mm"], rel=1e-11)
        alpha = np.rad2deg(joint["alpha_rad"])
        assert float(row["alpha_deg"]) == pytest.approx(alpha, rel=1e-11)
        assert float(row["nominal_a_mm"]) == pytest.approx(joint["nominal_a_mm"], rel=1e-11)


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1150.21234, 0.0353, "1150.212 ± 0.035"),
        (-0.0014806, 0.0000253, "-0.001481 ± 0.000025"),
        (1234.0, 120.0, "1234 ± 120"),
        (-1e-17, np.nan, "0.0000†"),
    ],
)
def test_values_carry_two_digits_of_their_deviation(value, std, text):
    assert with_deviation(value, std) == text


def residuals():
    kinds = [
        (comparison, subset, quantity)
        for comparison in ("vec_vs_measured", "dh_vs_vec", "dh_vs_measured")
        for subset in ("train", "validation")
        for quantity in ("position", "orientation")
    ]
    columns = dict(
        zip(("comparison", "subset", "quantity"), np.array(kinds, dtype=object).T, strict=True)
    )
    units = {"position": "mm", "orientation": "mrad"}
    columns["unit"] = np.array([units[kind[2]] for kind in kinds], dtype=object)
    columns |= {"fold": np.full(len(kinds), np.nan), "n": np.arange(1, len(kinds) + 1)}
    return columns | dict.fromkeys(("mean", "max", "rms", "gamma99"), np.arange(len(kinds)) + 0.25)


def test_tables_hold_every_residual_and_parameter_in_both_forms():
    arm = replace(bent("mh180"), left_open=("+1 a_b -1 c",))
    table = model_table(arm)
    table["std_d_mm"][2] = np.nan
    page, paper = (
        written(form, arm, dh_model=table, residuals=residuals()) for form in ("markdown", "latex")
    )
    for value in ("0.250", "11.250", f"{arm.model.a_mm[1]:.4f} ± 0.0010"):
        assert value in page
    assert f"{arm.model.a_mm[1]:.4f} $\\pm$ 0.0010" in paper
    assert page.count("†") == 2  # in its cell and in the note
    assert r"a\_b" in paper
    assert paper.count(r"\begin{table}") == paper.count(r"\end{table}") == 4
    assert {line.count(" & ") for line in paper.splitlines() if line.endswith(r"\\")} == {5}


def test_nothing_is_written_over_or_in_part(tmp_path):
    write({"a.txt": "first"}, tmp_path)
    with pytest.raises(InputError, match="--force"):
        write({"b.txt": "new", "a.txt": "second"}, tmp_path)
    assert (tmp_path / "a.txt").read_text() == "first"
    assert not (tmp_path / "b.txt").exists()
    assert len(write({"b.txt": "new", "a.txt": "second"}, tmp_path, force=True)) == 2
    assert (tmp_path / "a.txt").read_text() == "second"


def test_json_rebuilds_an_arm_whose_first_axis_points_down():
    """A modified table has frames before its first row and none behind its last."""
    text = """
convention: modified
dh:
  - {theta_offset_deg: 0, d_mm: -400, a_mm: 0, alpha_deg: 180, limits_deg: [-140, 140]}
  - {theta_offset_deg: 0, d_mm: 0, a_mm: 25, alpha_deg: 90, limits_deg: [-145, 145]}
  - {joint: prismatic, theta_offset_deg: 0, d_mm: 5, a_mm: 250, alpha_deg: 0, limits_mm: [0, 200]}
  - {theta_offset_deg: 0, d_mm: 50, a_mm: 0, alpha_deg: 90, limits_deg: [-90, 90]}
"""
    arm = replace(nominal(robot.of_text(text, "down.yaml")), choice="dh")
    content = json.loads(written("json", arm))
    q = np.array([0.3, -0.7, 120.0, 0.2])
    frame = content["first_dh_frame_in_base"]
    turned = rotation_from_quaternion(np.array(frame["quaternion_wxyz"]))
    here = Pose(turned, np.array(frame["position_mm"]))
    for joint, value in zip(content["joints"], q, strict=True):
        slides = joint["type"] == "prismatic"
        turn = joint["theta_offset_rad"] + (0.0 if slides else value)
        shift = joint["d_mm"] + (value if slides else 0.0)
        here = compose(here, Pose(rotation_z(turn), np.array([0.0, 0.0, shift])))
        here = compose(here, Pose(rotation_x(joint["alpha_rad"]), np.array([joint["a_mm"], 0, 0])))
    wanted = arm.pose(JointState(q), "base", "flange")
    np.testing.assert_allclose(here.position_mm, wanted.position_mm[0], rtol=0, atol=1e-9)
