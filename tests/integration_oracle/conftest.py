"""Small studies that nothing of the workflow ran, for all tests here."""

from __future__ import annotations

from pathlib import Path

import pytest
from oracles.small_study import SETTINGS, write_measurements
from stages_by_hand import STUDIED, run_stages


@pytest.fixture(scope="session")
def measured(tmp_path_factory) -> Path:
    """A file of an arm of the oracle's own, so that nothing of kinacc made its readings."""
    path = tmp_path_factory.mktemp("measured") / "poses.csv"
    write_measurements(path)
    return path


@pytest.fixture(scope="session")
def papers_arm(tmp_path_factory, measured) -> Path:
    """Folder of a whole study of the shipped synthetic arm, without figures."""
    folder = tmp_path_factory.mktemp("study")
    config = folder / "config.yaml"
    config.write_text(SETTINGS % ("synthetic", measured), encoding="utf-8")
    return run_stages(STUDIED, [config], folder / "results")
