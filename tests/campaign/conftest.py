"""Campaigns of a small calibration, started once and copied."""

from __future__ import annotations

import shutil
from functools import cache

import pytest
from command_line import call


@pytest.fixture(scope="session")
def started(study, tmp_path_factory):
    """Start a campaign by its options, each once; its folder."""

    @cache
    def start(points, budget, *more):
        folder = tmp_path_factory.mktemp("started") / "campaign"
        call("campaign", "start", folder, "--calibration", study,
             "--model", "dh", "--candidates", points, "--budget", budget, *more,
             code=0)  # fmt: skip
        return folder

    return start


@pytest.fixture
def begun(started, tmp_path):
    """Copy a campaign that was started with further options; its folder."""

    def copy(*more, points=20, budget=20):
        folder = tmp_path / f"campaign {len(list(tmp_path.iterdir()))}"
        return shutil.copytree(started(points, budget, *more), folder)

    return copy
