"""Positions only: the orientation of flange and tool comes from the robot file."""

import json
import math

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from kinacc.cli.group import main

# A small arm with a spherical wrist: theta offset deg, d mm, a mm, alpha deg.
NOMINAL = np.array(
    [
        [0, 400, 25, -90],
        [0, 0, 455, 0],
        [-90, 0, 35, -90],
        [0, 420, 0, 90],
        [0, 0, 0, -90],
        [0, 80, 0, 0],
    ],
    dtype=float,
)
# Errors that positions determine: none in the last joint.
ERRORS = np.array(
    [
        [0.0, 0.0, 0.3, 0.02],
        [0.04, 0.0, -0.4, 0.03],
        [-0.05, 0.0, 0.2, -0.02],
        [0.04, 0.3, 0.2, 0.03],
        [-0.06, 0.0, 0.15, 0.04],
        [0.0, 0.0, 0.0, 0.0],
    ]
)
LIMITS = [[-170, 170], [-190, 45], [-120, 156], [-185, 185], [-120, 120], [-350, 350]]
FLANGE_RPY, TOOL_RPY, TOOL_MM = [180, 0, 0], [0, 30, 45], [60, -25, 150]
OTHERS_MM = {"mA": [60, -25, 150], "mB": [-70, 40, 120], "mC": [20, 90, 160]}


def matrix(rotation, position):
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation, position
    return found


def end(dh, q_deg):
    """Last DH frame (4, 4): own forward kinematics, joint by joint."""
    found = np.eye(4)
    for (theta, d, a, alpha), q in zip(dh, q_deg, strict=True):
        turn, tilt = (math.radians(each) for each in (theta + q, alpha))
        c, s, ca, sa = math.cos(turn), math.sin(turn), math.cos(tilt), math.sin(tilt)
        found = found @ np.array(
            [
                [c, -s * ca, s * sa, a * c],
                [s, c * ca, -c * sa, a * s],
                [0, sa, ca, d],
                [0, 0, 0, 1],
            ]
        )
    return found


FLANGE = matrix(Rotation.from_euler("xyz", FLANGE_RPY, degrees=True).as_matrix(), [0, 0, 0])
TOOL = matrix(Rotation.from_euler("xyz", TOOL_RPY, degrees=True).as_matrix(), TOOL_MM)
INSTRUMENT = matrix(
    Rotation.from_euler("XYZ", [3, -5, 140], degrees=True).as_matrix(), [2400, -700, 500]
)


def call(*words):
    done = CliRunner().invoke(main, [str(each) for each in words])
    assert done.exit_code == 0, done.stderr
    return done.stdout


def joints(count, seed):
    low, high = 0.5 * np.array(LIMITS, dtype=float).T
    return np.random.default_rng(seed).uniform(low, high, (count, 6))


def calibrated(folder, targets, errors=ERRORS):
    """Results of positions of targets (in the flange) that an arm with ``errors`` showed."""
    rng, arm = np.random.default_rng(5), NOMINAL + errors
    q = joints(120, 1)
    names = ["x_mm", "y_mm", "z_mm"]
    columns = {f"q{i + 1}_deg": q[:, i] for i in range(6)}
    for target, place in targets.items():
        at = [INSTRUMENT @ end(arm, each) @ FLANGE @ [*place, 1.0] for each in q]
        seen = np.array(at)[:, :3] + rng.normal(0.0, 0.01, (len(q), 3))
        prefix = f"{target}_" if len(targets) > 1 else ""
        columns |= {f"{prefix}{name}": seen[:, i] for i, name in enumerate(names)}
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{each:.6f}" for each in row) for row in rows)]
    (folder / "seen.csv").write_text("\n".join(lines) + "\n")
    dh = [
        dict(zip(("theta_offset_deg", "d_mm", "a_mm", "alpha_deg"), map(float, row), strict=True))
        for row in NOMINAL
    ]
    arm_file = {"name": "small", "dh": dh, "limits_deg": LIMITS,
                "flange": {"rpy_deg": FLANGE_RPY},
                "tool": {"position_mm": TOOL_MM, "rpy_deg": TOOL_RPY}}  # fmt: skip
    (folder / "small.robot.yaml").write_text(yaml.safe_dump(arm_file))
    call("init", "seen.csv", "--robot", "small.robot.yaml", "--yes")
    settings = yaml.safe_load((folder / "seen.yaml").read_text())
    settings["datasets"]["seen"].setdefault("calibration", {})["compliance"] = {"joints": [2, 3]}
    (folder / "seen.yaml").write_text(yaml.safe_dump(settings))
    call("calibrate", "seen.yaml", "--cores", "1")
    return folder


@pytest.fixture(scope="module")
def one_target(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("one")
        patch.chdir(folder)
        yield calibrated(folder, {"tool": TOOL_MM})


def far_from_singular(q_deg):
    """Whether a small turn of the tool takes small turns of joints, by differences."""
    columns, step = [], 1e-4
    here = end(NOMINAL, q_deg) @ FLANGE @ TOOL
    for joint in range(6):
        moved = np.array(q_deg)
        moved[joint] += np.rad2deg(step)
        there = end(NOMINAL, moved) @ FLANGE @ TOOL
        turn = Rotation.from_matrix(there[:3, :3] @ here[:3, :3].T).as_rotvec()
        columns.append(np.append(1e-3 * (there - here)[:3, 3], turn) / step)
    return np.linalg.svd(np.array(columns))[1][-1] > 0.1


def rotations(answer):
    quaternions = [[row[name] for name in ("qx", "qy", "qz", "qw")] for row in answer["rows"]]
    return Rotation.from_quat(quaternions)


def apart_deg(found, wanted):
    wanted = Rotation.from_matrix(np.array(wanted)[:, :3, :3])
    return np.rad2deg((found * wanted.inv()).magnitude()).max()


def predicted(folder, model, point, q):
    words = [word for each in q for word in ("--joints-deg", ",".join(f"{x:.6f}" for x in each))]
    told = call("predict", folder / "results/seen", "--model", model, "--point", point,
                "--json", *words)  # fmt: skip
    return json.loads(told)


Q = 0.9 * joints(6, 9)


@pytest.mark.parametrize("model", ["dh", "vec", "compliance", "nominal"])
def test_flange_and_tool_are_turned_as_the_robot_file_says(one_target, model):
    arm = NOMINAL if model == "nominal" else NOMINAL + ERRORS
    allowed_deg = 0.12 if model == "nominal" else 0.05
    for point, behind in (("flange", FLANGE), ("tool", FLANGE @ TOOL)):
        answer = predicted(one_target, model, point, Q)
        wanted = [end(arm, each) @ behind for each in Q]
        assert apart_deg(rotations(answer), wanted) < allowed_deg
        assert answer["orientation"] == "stated"


@pytest.mark.parametrize("model", ["dh", "vec"])
def test_poses_of_a_nominal_program_come_back_as_its_own_joints(one_target, model):
    program = np.array([each for each in 0.9 * joints(60, 4) if far_from_singular(each)])[:8]
    assert len(program) == 8
    poses = [end(NOMINAL, each) @ FLANGE @ TOOL for each in program]
    lines = [",".join(["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz",
                       *(f"q{i}_deg" for i in range(1, 7))])]  # fmt: skip
    for pose, q in zip(poses, program, strict=True):
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        lines.append(",".join(f"{each:.9f}" for each in [*pose[:3, 3], w, x, y, z, *q]))
    (one_target / "program.csv").write_text("\n".join(lines) + "\n")
    told = call("compensate", one_target / "results/seen", one_target / "program.csv",
                "--model", model, "--json")  # fmt: skip
    rows = json.loads(told)["rows"]
    found = np.array([[row[f"q{i}_deg"] for i in range(1, 7)] for row in rows])
    assert np.abs(found - program).max() < 1.0


def test_exports_turn_the_tool_and_tell_measured_from_stated_orientations(one_target):
    out = one_target / "out"
    call("export", one_target / "results/seen", "--out", out, "--format", "urdf", "--format",
         "yaml", "--format", "json", "--format", "csv")  # fmt: skip
    told = json.loads((out / "seen.json").read_text())
    assert told["orientation_of_targets"] == {"tool": "stated"}
    w, x, y, z = told["targets_in_last_dh_frame"]["tool"]["quaternion_wxyz"]
    assert apart_deg(Rotation.from_quat([[x, y, z, w]]), [FLANGE @ TOOL]) < 1e-6
    w, x, y, z = yaml.safe_load((out / "seen.yaml").read_text())["tool"]["quaternion_wxyz"]
    turn = Rotation.from_quat([x, y, z, w])
    assert (turn * Rotation.from_matrix(TOOL[:3, :3]).inv()).magnitude() < 1e-6
    urdf = (out / "seen.urdf").read_text()
    origin = urdf.split('name="tool_fixed"')[1].split('rpy="')[1].split('"')[0]
    turn = Rotation.from_euler("xyz", list(map(float, origin.split())))
    assert (turn * Rotation.from_matrix(TOOL[:3, :3]).inv()).magnitude() < 1e-6
    assert "stated" in (out / "seen.csv").read_text()
