"""Compensated programs on simulated controllers that share no code with kinacc."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from command_line import call
from oracles.controllers import judge, measured, programs
from oracles.controllers.arms import ARMS, frame
from scipy.spatial.transform import Rotation
from simulated_cells import calibrated

pytest.importorskip("kinacc.deployment.programs")
BASE = frame(150.0, -200.0, 120.0, Rotation.from_rotvec([0.05, -0.1, 0.4]))
FACTOR = 1.2


def options(program, folder):
    """What the command cannot read from the program."""
    near = ",".join(f"{each:.3f}" for each in np.rad2deg(program.points[0].shown))
    frames = [
        ",".join(f"{each:.9f}" for each in program.convention.of_pose(pose))
        for pose in (program.tool, program.base)
    ]
    if program.maker == "table":
        joints = program.points[0].of_joints
        fixed = programs.CONVENTIONS["fanuc"].of_pose(program.tool)
        tool = ",".join(f"{each:.9f}" for each in fixed) if joints else frames[0]
        return ["--near-deg", near, "--tool", tool]
    if program.maker == "ur":
        return ["--near-deg", near]
    if program.maker == "fanuc":
        file = folder / "frames.yaml"
        file.write_text(f"tools: {{1: [{frames[0]}]}}\nbases: {{1: [{frames[1]}]}}\n")
        return ["--frames", file]
    if program.maker == "yaskawa":
        pulses = ",".join(map(str, programs.PULSES))
        return ["--tool", frames[0], "--base", frames[1], "--pulses-per-degree", pulses]
    return []


def judged(folder, results, language, arm):
    """The model chosen; the true arm misses by no more than held-out errors allow."""
    taught = arm.draw(np.random.default_rng(5), programs.POINTS, 0.7)
    program = programs.WRITERS[language](arm, taught, measured.TOOL, BASE)
    assert len(program.points) == programs.POINTS
    path = program.write(folder, "weld")
    before = path.read_bytes()
    out = path.with_name(f"weld_cal{path.suffix}")
    done = call("compensate", results, "--program", path, "-o", out, *options(program, folder))
    assert done.exit_code == 0, done.output
    assert path.read_bytes() == before
    frames = pd.read_parquet(results / "frames.parquet")
    row = frames[(frames["model"] == "dh") & (frames["frame"] == "base")].iloc[0]
    turn = Rotation.from_quat(row[["qw", "qx", "qy", "qz"]].astype(float), scalar_first=True)
    base = frame(*row[["x_mm", "y_mm", "z_mm"]].astype(float), turn)
    as_written = judge.misses(program, [float(each) for each in program.numbers], base)
    corrected = judge.misses(program, program.read(folder, "weld_cal"), base)
    residuals = pd.read_parquet(results / "residuals.parquet")
    chosen = pd.read_parquet(results / "model_selection.parquet").query("selected == 1")["model"]
    pooled = residuals[residuals["fold"].isna() & (residuals["subset"] == "validation")]
    held = pooled[pooled["comparison"] == f"{chosen.iloc[0]}_vs_measured"]
    allowed = FACTOR * held.set_index("quantity")["mean"]
    print(language, as_written.mean(axis=0), corrected.mean(axis=0), dict(allowed))
    assert as_written[:, 0].mean() > 1.0
    assert corrected[:, 0].mean() <= allowed["position"]
    assert corrected[:, 1].mean() <= allowed["orientation"]
    return chosen.iloc[0]


@pytest.mark.parametrize("language", programs.WRITERS)
def test_the_true_arm_goes_where_the_program_means(tmp_path, language):
    maker = language.split()[0].replace("csv", "abb")
    judged(tmp_path, calibrated(maker), language, ARMS[maker])


def test_an_arm_whose_axes_run_unevenly_goes_there_by_its_vec_model(tmp_path):
    arm = replace(ARMS["kuka"], wave=1e-3)
    assert judged(tmp_path, calibrated("kuka", 1e-3, 200, 4), "kuka", arm) == "vec"
