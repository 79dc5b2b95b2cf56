"""Positions only: the orientation of flange and tool comes from the robot file."""

import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import answer
from oracles.controllers import measured
from oracles.controllers.arms import ARMS, errors
from oracles.controllers.measured import TOOL
from scipy.spatial.transform import Rotation
from stages_by_hand import CALIBRATED, run_stages

# Base and tool take up those of the first and the last joint.
ERRORS = 0.3 * errors(3) * np.array([[0.0]] + [[1.0]] * 4 + [[0.0]])
ARM = replace(ARMS["kuka"], errors=ERRORS)
SHOWN = ARM.draw(np.random.default_rng(9), 6, 0.8)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("positions")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measured, "NOISE_MM", 0.01)
        config = measured.write(folder, ARM, poses=120)
    config.write_text(config.read_text().replace("kind: quaternion", "kind: none"))
    turn = Rotation.from_matrix(TOOL[:3, :3]).as_rotvec(degrees=True)
    tool = {"position_mm": TOOL[:3, 3].tolist(), "rotation_vector_deg": turn.tolist()}
    (folder / "robot.yaml").write_text(f"{ARM.description()}tool: {json.dumps(tool)}\n")
    return run_stages(CALIBRATED, [config], folder / "results")


def apart_deg(found, wanted):
    return np.rad2deg((found * Rotation.from_matrix(wanted).inv()).magnitude().max())


@pytest.mark.parametrize(("model", "allowed_deg"), [("dh", 0.05), ("vec", 0.05), ("nominal", 0.12)])
@pytest.mark.parametrize(("point", "behind"), [("flange", np.eye(4)), ("tool", TOOL)])
def test_flange_and_tool_are_turned_as_the_robot_file_says(
    results, model, allowed_deg, point, behind
):
    words = [part for q in np.rad2deg(SHOWN) for part in ("--joints-deg", ",".join(map(str, q)))]
    told = answer("predict", results, "--model", model, "--point", point, *words)
    found = [[row[name] for name in ("qw", "qx", "qy", "qz")] for row in told["rows"]]
    wanted = [(ARM.pose(q, true=model != "nominal") @ behind)[:3, :3] for q in SHOWN]
    assert apart_deg(Rotation.from_quat(found, scalar_first=True), wanted) < allowed_deg
    assert told["orientation"] == "stated"
