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


@pytest.fixture(scope="session", params=["file", "synthetic"])
def finished(request, tmp_path_factory, written) -> Path:
    """Folder of the finished data set."""
    draws = importlib.util.find_spec("kinacc").submodule_search_locations[0]
    if request.param == "synthetic" and not list(Path(draws, "synthetic").glob("*.csv")):
        pytest.skip("no accepted draws of the synthetic arm yet")
    folder = tmp_path_factory.mktemp("study")
    config = folder / "config.yaml"
    config.write_text(SETTINGS % (request.param, written[0]), encoding="utf-8")
    return run_stages(config, "small", folder / "results")
