"""A base frame that drifts slowly is told from one that jumps, each with its own remedy."""

import numpy as np
import pytest
from tracked_arm import table, tracked

from kinacc.checks.check import check
from kinacc.kinematics.robot import load
from kinacc.measurements.reader import read

DIRECTION = np.array([0.6, -0.48, 0.64])


SHARE = np.linspace(0.0, 1.0, 160)[:, None]


def kinds(moved_mm, folder):
    """Findings by code in a file of 160 poses whose points are moved by (160, 3)."""
    arm, robot = tracked(poses=160, seed=1), load("ur10")
    section = {"path": str(folder / "seen.csv"), "orientation": {"kind": "none"}}
    names = [*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    (folder / "seen.csv").write_text(table(names, arm.q, arm.point + moved_mm))
    report = check(read(section, robot, strict=False), section, robot, "seen")
    return {each.kind: each for each in report.suspicions}


def test_a_slow_drift_is_no_jump(tmp_path):
    assert "base_jump" not in kinds(0.36 * SHARE * DIRECTION, tmp_path)


def test_a_jump_is_no_drift(tmp_path):
    found = kinds(np.where(np.arange(160)[:, None] < 50, 0.0, 0.36) * DIRECTION, tmp_path)
    assert "drift" not in found
    assert len(found["base_jump"].lines) == pytest.approx(110, abs=2)
