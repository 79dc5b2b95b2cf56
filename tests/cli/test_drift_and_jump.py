"""A base frame that drifts slowly is told from one that jumps, each with its own remedy."""

import numpy as np
import pytest
from tracked_arm import table, tracked

from kinacc.checks.check import check
from kinacc.kinematics.robot import load
from kinacc.measurements.layout import Layout
from kinacc.measurements.reader import read

DIRECTION = np.array([0.6, -0.48, 0.64])


@pytest.fixture
def findings(tmp_path):
    """Findings by code in a file of 160 poses whose points are moved by (160, 3), mm."""

    def found(moved, seed):
        arm, section = tracked(poses=160, seed=seed), {"path": str(tmp_path / "seen.csv")}
        names = [*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"]
        (tmp_path / "seen.csv").write_text(table(names, arm.q, arm.point + moved))
        robot, layout = load("ur10"), Layout.of(section | {"orientation": {"kind": "none"}})
        reading = read(layout.model_dump(), robot, strict=False)
        report = check(reading, layout, robot, "seen", "seen.csv", lambda items, _: items)
        return {each.kind: each for each in report.suspicions}

    return found


SHARE = np.linspace(0.0, 1.0, 160)[:, None]


@pytest.mark.parametrize(("far_mm", "seed"), [(0.36, 1), (0.36, 2), (1.0, 1)])
def test_a_slow_drift_is_a_drift(findings, far_mm, seed):
    found = findings(far_mm * SHARE * DIRECTION, seed)
    assert "base_jump" not in found
    if far_mm >= 1.0:
        size = np.linalg.norm(found["drift"].values["drift_mm"])
        assert 0.5 * far_mm < size < 1.5 * far_mm


@pytest.mark.parametrize(("at", "seed"), [(50, 1), (110, 2)])
def test_a_jump_is_a_jump(findings, at, seed):
    found = findings(np.where(np.arange(160)[:, None] >= at, 0.36, 0.0) * DIRECTION, seed)
    assert "drift" not in found
    assert len(found["base_jump"].lines) == pytest.approx(160 - at, abs=2)
