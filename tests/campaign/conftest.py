"""A campaign on a shipped arm whose true errors are known, and readings of it."""

from __future__ import annotations

import shutil
from functools import cache

import numpy as np
import pytest
from command_line import call, small_study

from kinacc.campaign import begin
from kinacc.campaign.instrument import instruments
from kinacc.campaign.plan import Limits, Plan, assessor_of
from kinacc.deployment.planning import spread
from kinacc.deployment.record import nominal
from kinacc.kinematics import robot as robots


@pytest.fixture(scope="session")
def arm():
    return nominal(robots.load("mh180"))


@pytest.fixture(scope="session")
def make_plan(arm):
    """A plan of a campaign over ``points`` candidates."""

    def make(
        assessor="search_and_confirm", points=40, budget=40, texts=("tracker=0.05",), frame="base",
        seed=3, limits=None, **settings,
    ) -> Plan:  # fmt: skip
        joints = spread(arm.robot, points)
        found = begin.points_of(arm, joints, [f"p{i}" for i in range(points)])
        chosen = assessor_of(assessor, {"measurements": budget, **settings})
        used = instruments(texts, frame)
        limits = limits or Limits(np.deg2rad(0.02), 10.0)
        about = {"robot": "mh180", "calibration": "none", "model": "nominal", "point": "tool",
                 "candidates": "drawn"}  # fmt: skip
        return begin.plan_of(arm, found, chosen, used, limits, about, seed)

    return make


@pytest.fixture(scope="session")
def calibration(tmp_path_factory):
    """Results of a small synthetic study, made by the workflow's own stages."""
    return small_study(tmp_path_factory.mktemp("study"))


@pytest.fixture(scope="session")
def started(calibration, tmp_path_factory):
    """Start a campaign by its options, each once; its folder."""

    @cache
    def start(points, budget, *more):
        folder = tmp_path_factory.mktemp("started") / "campaign"
        call("campaign", "start", folder, "--calibration", calibration,
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
