"""Values of ``kinacc export --for`` typed into controllers that share no code with kinacc."""

import json

import numpy as np
import pytest
from command_line import call
from oracles.controllers import measured
from oracles.pendants.controllers import MAKERS, joints_for
from scipy.spatial.transform import Rotation
from simulated_cells import calibrated

FACTOR, POSES = 1.2, 40


@pytest.mark.parametrize("maker", MAKERS)
def test_the_true_arm_misses_by_no_more_than_the_page_states(tmp_path, maker):
    """Goals in the frame of the instrument, drawn where the arm was measured."""
    arm = MAKERS[maker]
    results = calibrated(maker)
    done = call("export", results, "--for", maker, "--out", tmp_path, "--json")
    assert done.exit_code == 0, done.output
    answer, typed = json.loads(done.output), {}
    digits = 9 if maker == "ur" else 4
    for each in answer["values"]:
        typed.setdefault(each["group"], {})[each["name"]] = round(each["new"], digits)
    if maker == "abb":  # quaternions have more digits
        typed |= {
            group: {
                each["name"]: each["new"] for each in answer["values"] if each["group"] == group
            }
            for group in ("TOOL tool", "BASE")
        }
    misses = []
    for near in arm.draw(np.random.default_rng(6), POSES):
        goal = measured.BASE @ arm.pose(near) @ measured.TOOL
        shown = joints_for(maker, arm, typed, tmp_path / f"arm_{maker}", goal, near)
        there = measured.seen(arm, shown)
        turn = Rotation.from_matrix(goal[:3, :3].T @ there[:3, :3]).magnitude()
        misses.append((np.linalg.norm(goal[:3, 3] - there[:3, 3]), 1e3 * turn))
    mean, stated = np.mean(misses, axis=0), answer["errors"][0]
    print(maker, mean, stated, answer["errors"][2]["position_mm"])
    assert mean[0] <= FACTOR * stated["position_mm"]
    assert mean[1] <= FACTOR * stated["orientation_mrad"]
