"""A calibrated arm as robot file, JSON, CSV and tables: complete, exact, all or nothing."""

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from kinacc.calibration.misfit import Misfit
from kinacc.calibration.noise import UNKNOWN
from kinacc.cli.group import main
from kinacc.deployment.export import description, tables
from kinacc.deployment.record import TOOL, nominal
from kinacc.geometry import Pose, compose, exp_so3, rotation_from_quaternion, rotation_x, rotation_z
from kinacc.kinematics import dh, robot
from kinacc.kinematics.model import JointState

FITS = Misfit("dh", 0.1, UNKNOWN)


def bent(name, seed=0):
    arm, rng = robot.load(name), np.random.default_rng(seed)
    vector = dh.to_vector(arm.dh)
    model = dh.with_vector(arm.dh, vector + rng.normal(0.0, 1e-3, vector.size))
    tool = Pose(exp_so3(np.array([0.1, 0.2, 3.0])), np.array([1.0, 2.0, 300.0]))
    return replace(nominal(arm, "probe"), choice="dh", model=model, targets={TOOL: tool})


@pytest.mark.parametrize("name", robot.shipped())
def test_a_robot_file_is_read_back_bit_by_bit(name, tmp_path):
    arm = bent(name)
    path = tmp_path / "own.yaml"
    path.write_text(description.robot_yaml(arm))
    back = robot.load(path)
    np.testing.assert_array_equal(dh.to_vector(back.dh), dh.to_vector(arm.model))
    np.testing.assert_array_equal(back.dh.prismatic, arm.model.prismatic)
    np.testing.assert_array_equal(back.joint_map, arm.robot.joint_map)
    np.testing.assert_array_equal(back.q_min_rad, arm.robot.q_min_rad)
    np.testing.assert_array_equal(back.q_max_rad, arm.robot.q_max_rad)
    carried = robot.carried(back)
    np.testing.assert_allclose(carried.position_mm, arm.targets[TOOL].position_mm, atol=1e-11)
    np.testing.assert_allclose(carried.rotation, arm.targets[TOOL].rotation, atol=1e-14)


def test_a_coupled_sliding_arm_with_a_base_is_read_back(tmp_path):
    arm = bent("mh180")
    coupled = np.eye(6)
    coupled[2, 1] = -1.0
    slides = np.array([True, *[False] * 5])
    base = Pose(exp_so3(np.array([0.0, 0.1, 0.0])), np.array([0.0, 0.0, 500.0]))
    own = replace(
        arm.robot,
        joint_map=coupled,
        base=base,
        flange=base,
        dh=replace(arm.robot.dh, prismatic=slides),
        q_min_rad=np.array([-500.0, *arm.robot.q_min_rad[1:]]),
        q_max_rad=np.array([500.0, *arm.robot.q_max_rad[1:]]),
    )
    arm = replace(arm, robot=own, model=replace(arm.model, prismatic=slides))
    path = tmp_path / "own.yaml"
    path.write_text(description.robot_yaml(arm))
    back = robot.load(path)
    np.testing.assert_array_equal(back.joint_map, coupled)
    np.testing.assert_array_equal(back.q_min_rad, own.q_min_rad)
    q = np.random.default_rng(1).uniform(-0.5, 0.5, (5, 6))
    wanted = arm.pose(JointState(q @ coupled.T), "base", "flange").position_mm
    np.testing.assert_allclose(robot.forward(back, q).position_mm, wanted, atol=1e-9)


def test_json_and_csv_say_the_same_of_every_joint():
    said = (
        "d of joint 2 and d of joint 3 appear only as their sum",
        "a shift of the base along y cannot be told from a shift of the tool along z",
    )
    arm = replace(bent("ur10"), left_open=said)
    std = np.abs(np.random.default_rng(2).normal(0.0, 1e-3, (6, 5)))
    std[0, 1] = np.nan
    content = json.loads(description.robot_json(arm, std, arm.robot.dh, {"seed": "1"}, FITS))
    rows = list(csv.DictReader(io.StringIO(description.robot_csv(arm, std, arm.robot.dh, FITS))))
    assert content["provenance"] == {"seed": "1"}
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
        (12.3, 4.0, "12.3 ± 4.0"),
        (1234.0, 120.0, "1234 ± 120"),
        (5.0, np.nan, "5.0000†"),
        (-1e-17, np.nan, "0.0000†"),
    ],
)
def test_values_carry_two_digits_of_their_deviation(value, std, text):
    assert tables.with_deviation(value, std) == text


def residuals():
    kinds = [
        (comparison, subset, quantity)
        for comparison in ("vec_vs_measured", "dh_vs_vec", "dh_vs_measured")
        for subset in ("train", "validation")
        for quantity in ("position", "orientation")
    ]
    count = len(kinds)
    names = ("comparison", "subset", "quantity")
    table = {
        name: np.array([kind[i] for kind in kinds], dtype=object) for i, name in enumerate(names)
    }
    unit = {"position": "mm", "orientation": "mrad"}
    table["unit"] = np.array([unit[kind[2]] for kind in kinds], dtype=object)
    return table | {
        "fold": np.full(count, np.nan),
        "n": np.arange(1, count + 1),
        **{name: np.arange(count) + 0.25 for name in ("mean", "max", "rms", "gamma99")},
    }


def test_tables_hold_every_residual_and_parameter_in_both_forms():
    arm = bent("mh180")
    fitted = {"joint": np.arange(1, 7)}
    for name in dh.PARAMETERS:
        fitted[name] = getattr(arm.model, name)
        fitted[f"std_{name}"] = np.full(6, 1e-3)
    fitted["std_d_mm"][2] = np.nan
    given = {"joint": np.arange(1, 7)} | {n: getattr(arm.robot.dh, n) for n in dh.PARAMETERS}
    made = tables.paper_tables(residuals(), fitted, given, "mh180", ["+1 a_b -1 c"])
    assert [table.name for table in made] == ["vec", "dh_parameters", "dh_vec", "dh"]
    in_markdown, in_latex = tables.markdown(made), tables.latex(made)
    for value in ("0.250", "11.250", f"{arm.model.a_mm[1]:.4f} ± 0.0010"):
        assert value in in_markdown
    assert f"{arm.model.a_mm[1]:.4f} \\pm 0.0010" in in_latex
    assert in_markdown.count("†") == 2  # in its cell and in the note
    assert r"a\_b" in in_latex
    assert in_latex.count(r"\begin{table}") == in_latex.count(r"\end{table}") == 4
    for line in in_latex.splitlines():
        if line.endswith(r"\\"):
            assert line.count(" & ") in (5, 4)


def test_nothing_is_written_over_or_in_part(tmp_path):
    from kinacc.deployment.export.files import write
    from kinacc.errors import InputError

    write({"a.txt": "first"}, tmp_path)
    with pytest.raises(InputError, match="--force"):
        write({"b.txt": "new", "a.txt": "second"}, tmp_path)
    assert (tmp_path / "a.txt").read_text() == "first"
    assert not (tmp_path / "b.txt").exists()
    assert len(write({"b.txt": "new", "a.txt": "second"}, tmp_path, force=True)) == 2
    assert (tmp_path / "a.txt").read_text() == "second"


def test_the_command_names_what_is_missing(tmp_path):
    done = CliRunner().invoke(main, ["export", str(tmp_path), "--robot", "mh180"])
    assert done.exit_code == 2
    for name in ("vec_model", "dh_model", "frames"):
        assert f"{name}.parquet: no such file" in done.output


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
    std = np.full((4, 5), np.nan)
    content = json.loads(description.robot_json(arm, std, arm.robot.dh, {}, FITS))
    rows = list(csv.DictReader(io.StringIO(description.robot_csv(arm, std, arm.robot.dh, FITS))))
    assert [row["type"] for row in rows] == [joint["type"] for joint in content["joints"]]
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


def test_in_a_paper_the_selected_model_comes_first_and_what_was_not_fitted_is_called_fixed():
    arm = bent("ur10")
    fitted = {"joint": np.arange(1, 7)}
    for name in dh.PARAMETERS:
        fitted[name] = getattr(arm.model, name).copy()
        fitted[f"std_{name}"] = np.full(6, 1e-3)
    fitted["d_mm"][1], fitted["std_d_mm"][[1, 2]] = 0.0, np.nan
    given = {"joint": np.arange(1, 7)} | {n: getattr(arm.robot.dh, n) for n in dh.PARAMETERS}
    of_arm = residuals(), fitted, given, "cell"
    made = tables.paper_tables(*of_arm, fixed={"j2.d_mm"}, selected="dh")
    page, paper = tables.markdown(made), tables.latex(made)
    assert page.startswith("**DH model (selected) against measurements, cell**")
    assert page.count("selected") == 1
    assert sum(table.name == "dh" for table in made) == 1
    (second, third) = (line for line in page.splitlines() if line[:4] in ("| 2 ", "| 3 "))
    assert "| 0 (fixed) |" in second
    assert "†" not in second
    assert "†" in third
    assert "Fixed: not fitted" in page
    assert "$0$ (fixed)" in paper
    assert "VEC model (selected)" in tables.markdown(tables.paper_tables(*of_arm, selected="vec"))
