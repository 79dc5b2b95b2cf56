"""A base frame that drifts slowly is told from one that jumps, which has another remedy."""

import numpy as np
from tracked_arm import NAMES, table, tracked

from kinacc.checks.check import check
from kinacc.kinematics.robot import load
from kinacc.measurements.reader import read


def test_a_slow_drift_is_no_jump(tmp_path):
    arm, robot, file = tracked(poses=160, seed=1), load("ur10"), tmp_path / "seen.csv"
    moved_mm = np.linspace(0.0, 0.36, 160)[:, None] * [0.6, -0.48, 0.64]
    file.write_text(table(NAMES, arm.q, arm.point + moved_mm))
    section = {"path": str(file), "orientation": {"kind": "none"}}
    report = check(read(section, robot, strict=False), section, robot, "seen")
    assert "base_jump" not in {each.kind for each in report.suspicions}
