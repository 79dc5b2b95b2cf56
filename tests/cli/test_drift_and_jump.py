"""A base frame that drifts slowly is told from one that jumps, each with its own remedy."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from tracked_arm import table, tracked

from kinacc.cli.group import main

DIRECTION = np.array([0.6, -0.48, 0.64])


@pytest.fixture
def findings(tmp_path, monkeypatch):
    """Findings by code in a file of 160 poses whose points are moved by (160, 3), mm."""
    monkeypatch.chdir(tmp_path)

    def found(moved, seed):
        arm = tracked(poses=160, seed=seed)
        arm = replace(arm, point=arm.point + moved)
        names = [*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"]
        (tmp_path / "seen.csv").write_text(table(names, arm.q, arm.point))
        settings = {"source": "file", "folds": 5, "validation_fold": None,
                    "file": {"path": "seen.csv", "orientation": {"kind": "none"}}}  # fmt: skip
        text = yaml.safe_dump({"datasets": {"seen": {"robot": "ur10", "measurements": settings}}})
        (tmp_path / "seen.yaml").write_text(text)
        done = CliRunner().invoke(main, ["check-data", "seen.yaml", "--json"])
        (told,) = json.loads(done.stdout)["datasets"]
        return {each["kind"]: each for each in told["suspicions"]}

    return found


SHARE = np.linspace(0.0, 1.0, 160)[:, None]


@pytest.mark.parametrize("far_mm", [0.36, 1.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_slow_drift_is_a_drift(findings, far_mm, seed):
    found = findings(far_mm * SHARE * DIRECTION, seed)
    assert "base_jump" not in found
    if far_mm >= 1.0:
        assert "drift" in found
        size = np.linalg.norm(found["drift"]["drift_mm"])
        assert 0.5 * far_mm < size < 1.5 * far_mm


@pytest.mark.parametrize("far_mm", [0.36, 1.0])
@pytest.mark.parametrize(("at", "seed"), [(50, 1), (110, 2)])
def test_a_jump_is_a_jump(findings, far_mm, at, seed):
    moved = np.where(np.arange(160)[:, None] >= at, far_mm, 0.0) * DIRECTION
    found = findings(moved, seed)
    assert "drift" not in found
    assert "base_jump" in found
    assert len(found["base_jump"]["lines"]) == pytest.approx(160 - at, abs=2)
