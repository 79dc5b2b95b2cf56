"""Programs and values for controllers, on controllers that share no code with kinacc."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from command_line import answer, call
from oracles import tables
from oracles.controllers import judge, measured, programs
from oracles.controllers.arms import ARMS, frame
from oracles.kinematics import apart, dh_forward, rot_x, rot_y, rot_z, trans
from oracles.pendants.controllers import MAKERS, joints_for, shifted_arm
from scipy.spatial.transform import Rotation
from simulated_cells import calibrated

from kinacc.deployment.export.controllers import CONTROLLERS
from kinacc.errors import InputError
from kinacc.kinematics import robot

BASE = frame(150.0, -200.0, 120.0, Rotation.from_rotvec([0.05, -0.1, 0.4]))
FACTOR, POSES = 1.2, 40


def options(program, folder):
    """What the command cannot read from the program."""
    near = ",".join(f"{each:.3f}" for each in np.rad2deg(program.points[0].shown))
    frames = [
        ",".join(f"{each:.9f}" for each in program.convention.of_pose(pose))
        for pose in (program.tool, program.base)
    ]
    if program.maker == "table":
        return ["--near-deg", near, "--tool", frames[0]]
    if program.maker == "ur":
        return ["--near-deg", near]
    if program.maker == "fanuc":
        file = folder / "frames.yaml"
        file.write_text(f"tools: {{1: [{frames[0]}]}}\nbases: {{1: [{frames[1]}]}}\n")
        return ["--frames", file]
    if program.maker == "yaskawa":
        pulses = ",".join(map(str, programs.PULSES))
        return ["--tool", frames[0], "--base", frames[1], "--pulses-per-deg", pulses]
    return []


def judged(folder, results, language, arm):
    """The model chosen; the true arm misses by no more than held-out errors allow."""
    taught = arm.draw(np.random.default_rng(5), programs.POINTS, 0.7)
    program = programs.WRITERS[language](arm, taught, measured.TOOL, BASE)
    assert len(program.points) == programs.POINTS
    path = program.write(folder, "weld")
    before = path.read_bytes()
    out = path.with_name(f"weld_cal{path.suffix}")
    files = "-o", out, "--table", folder / "changes.csv"
    call("compensate", results, "--program", path, *files, *options(program, folder), code=0)
    assert path.read_bytes() == before
    base = tables.models(results).frames["dh", "base"]
    as_written = judge.misses(program, [float(each) for each in program.numbers], base)
    corrected = judge.misses(program, program.read(folder, "weld_cal"), base)
    residuals = pd.read_parquet(results / "residuals.parquet")
    chosen = pd.read_parquet(results / "model_selection.parquet").query("selected == 1")["model"]
    pooled = residuals[residuals["fold"].isna() & (residuals["subset"] == "validation")]
    held = pooled[pooled["comparison"] == f"{chosen.iloc[0]}_vs_measured"]
    allowed = FACTOR * held.set_index("quantity")["mean"]
    rms_mm = held.set_index("quantity")["rms"]["position"]
    assert pd.read_csv(files[-1])["expected_error_mm"].between(rms_mm, 2.0 * rms_mm).all()
    assert as_written[:, 0].mean() > 1.0
    assert corrected[:, 0].mean() <= allowed["position"]
    assert corrected[:, 1].mean() <= allowed["orientation"]
    return chosen.iloc[0]


@pytest.mark.parametrize("language", programs.WRITERS)
def test_the_true_arm_goes_where_the_program_means(tmp_path, language):
    maker = language.replace("csv", "abb")
    judged(tmp_path, calibrated(maker), language, ARMS[maker])


def test_an_arm_whose_axes_run_unevenly_goes_there_by_its_vec_model(tmp_path):
    arm, results = replace(ARMS["kuka"], wave=1e-3), calibrated("kuka", 1e-3, 200, 4)
    assert judged(tmp_path, results, "kuka", arm) == "vec"
    seen = pd.read_parquet(results / "measurements.parquet").filter(regex=r"^q\d$")
    beyond = np.rad2deg(seen.mean().where(seen.columns != "q5", seen.max() + 0.02))  # or turned
    beyond.add_suffix("_deg").to_frame().T.to_csv(tmp_path / "beyond.csv", index=False)
    told = answer("compensate", results, "--program", tmp_path / "beyond.csv", code=1)
    assert told["table"][0]["status"].endswith("outside range: joint 5")


@pytest.mark.parametrize("maker", MAKERS)
def test_values_typed_into_a_controller_err_by_no_more_than_the_page_states(tmp_path, maker):
    """Goals in the frame of the instrument, drawn where the arm was measured."""
    arm, typed = MAKERS[maker], {}
    told = answer("export", calibrated(maker), "--for", maker, "--out", tmp_path)
    for each in told["values"]:
        digits = {"ur": 9, "abb": 9 if each["name"][0] == "q" else 4}.get(maker, 4)
        typed.setdefault(each["group"], {})[each["name"]] = round(each["new"], digits)
    first, *_, last = typed.get("joint zeros", {"A1": 0.0, "A6": 0.0}).values()
    assert first == last == 0.0  # no pose tells them from base and tool
    near = arm.draw(np.random.default_rng(6), POSES)
    goals = measured.BASE @ arm.pose(near) @ measured.TOOL
    shown = joints_for(maker, arm, typed, tmp_path / f"arm_{maker}", goals, near)
    misses = [*map(apart, goals, measured.seen(arm, shown))]
    mean, (stated, best, _) = np.mean(misses, axis=0), told["errors"]
    assert mean[0] <= FACTOR * stated["position_mm"]
    assert mean[1] <= FACTOR * stated["orientation_mrad"] < 9.0
    if maker in ("ur", "staubli"):  # which take all that was fitted
        assert stated["position_mm"] < 1.02 * best["position_mm"]


def test_ur_staubli_and_ros_describe_the_same_arm(tmp_path):
    """Common normals hundreds of metres away, offsets with a turn about y, and joint origins."""
    arm, rng = robot.load("ur10"), np.random.default_rng(3)
    off = rng.normal(0.0, [2e-3, 0.5, 0.5, 1e-3, 1e-3], (6, 5))
    off[5, 4] = 0.0  # which a UR controller cannot take
    model = arm.dh.with_parameters(arm.dh.start + off.ravel())
    for maker, ending in (("ur", "conf"), ("staubli", "cfx"), ("ros", "yaml")):
        text = CONTROLLERS[maker].text(CONTROLLERS[maker].arm(arm, model))
        (tmp_path / f"arm.{ending}").write_text(text)
    described = [shifted_arm(maker, ARMS["ur"], tmp_path / "arm") for maker in ("ur", "staubli")]
    assert np.abs(described[0].errors).max() > 1e3
    links = yaml.safe_load(text)["kinematics"]
    assert {"shoulder", "upper_arm", "wrist_3"} < set(links)
    del links["hash"]
    for q in rng.uniform(-3.0, 3.0, (5, 6)):
        expected, here = dh_forward(ARMS["ur"].table + off, q), np.eye(4)
        for each in described:
            np.testing.assert_allclose(each.pose(q), expected, rtol=0, atol=1e-5)
        for angle, link in zip(q, links.values(), strict=True):
            here = here @ trans(*(1e3 * link[axis] for axis in "xyz")) @ rot_z(link["yaw"])
            here = here @ rot_y(link["pitch"]) @ rot_x(link["roll"]) @ rot_z(angle)
        here = here @ trans(off[5, 2], 0, 0) @ rot_x(off[5, 3])  # behind the last joint
        np.testing.assert_allclose(here, expected, rtol=0, atol=1e-5)


def test_a_table_or_joints_that_a_controller_does_not_have_are_refused(tmp_path):
    for maker in ("ur", "staubli", "ros"):
        call("export", calibrated("fanuc"), "--for", maker, "--out", tmp_path, code=2)
    arm = robot.load("irb120")
    with pytest.raises(InputError, match="no DH table of UR arms"):
        CONTROLLERS["ur"].arm(arm, arm.dh)
