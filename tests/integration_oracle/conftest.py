"""Small but whole studies, run once for all tests here; figures are left out.

``file``: measurements written by the oracle's own arm, so that nothing of kinacc made them.
``synthetic``: the shipped synthetic arm.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest
from oracles.small_study import SETTINGS, Written, run_stages, write_measurements


@pytest.fixture(scope="session")
def written(tmp_path_factory) -> tuple[Path, Written]:
    path = tmp_path_factory.mktemp("measured") / "poses.csv"
    return path, write_measurements(path)


@pytest.fixture(scope="session")
def measured_arm(tmp_path_factory, written) -> Path:
    """Folder of the finished data set ``file``."""
    return finished_study("file", tmp_path_factory.mktemp("study"), written[0])


@pytest.fixture(scope="session")
def papers_arm(tmp_path_factory, written) -> Path:
    """Folder of the finished data set ``synthetic``, the only one with claims of the paper."""
    draws = importlib.util.find_spec("kinacc").submodule_search_locations[0]
    if not list(Path(draws, "synthetic").glob("*.csv")):
        pytest.skip("no accepted draws of the synthetic arm yet")
    return finished_study("synthetic", tmp_path_factory.mktemp("study"), written[0])


@pytest.fixture(scope="session", params=["measured_arm", "papers_arm"])
def finished(request) -> Path:
    """Folder of each finished data set."""
    return request.getfixturevalue(request.param)


def finished_study(source: str, folder: Path, measurements: Path) -> Path:
    config = folder / "config.yaml"
    config.write_text(SETTINGS % (source, measurements), encoding="utf-8")
    return run_stages(config, "small", folder / "results")
