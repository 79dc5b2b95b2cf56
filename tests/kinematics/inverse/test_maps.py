"""Accuracy maps and points of arms without a spherical wrist, and of arms with their own frames."""

from __future__ import annotations

from dataclasses import replace

import arms
import numpy as np
import pytest
from two_models import two_models

from kinacc.geometry import Pose, compose, exp_so3, invert
from kinacc.kinematics import dh, region, robot, vec
from kinacc.kinematics.model import JointState
from kinacc.kinematics.region import Cylinder
from kinacc.study.accuracy_map import Models, PosesWanted, accuracy_map, errors_at

UR10, IIWA = robot.load("ur10"), robot.load("iiwa14")
DOWN = region.reference_rotation(np.array([np.pi, 0.0, 0.0]))
SPACES = {"ur10": Cylinder(500, 300, 0, 200, 0, 1), "iiwa14": Cylinder(450, 100, 300, 100, 0, 1)}
ORIENTATIONS = region.orientations(np.deg2rad(20.0), "signs_and_zero")


def wanted(arm: str) -> PosesWanted:
    return PosesWanted(SPACES[arm], DOWN, ORIENTATIONS, "dh")


def models_of(arm: robot.Robot) -> Models:
    model = arms.calibrated(arm, 0.1)
    return two_models(vec.without_errors(model, arm.q_min_rad, arm.q_max_rad, 2), arm.dh)


def with_base(models: Models, base: Pose) -> Models:
    moved = models.by_name["vec"]._replace(base=base)
    return models._replace(by_name={**models.by_name, "vec": moved})


@pytest.mark.parametrize("arm", [UR10, IIWA], ids=lambda arm: arm.name)
def test_a_map_is_made_with_the_branches_of_the_arm(arm):
    cells = region.grid(SPACES[arm.name], np.array([0.3]), 150.0)
    result = accuracy_map(arm, models_of(arm), cells, wanted(arm.name))
    reached = result.solutions > 0
    assert reached.mean() > 0.8
    assert (result.position_max_mm[reached] > 0.01).all()
    assert (result.position_max_mm[reached] < 5).all()
    expected = "front-up" if arm is UR10 else "q1="
    assert all(expected in name for name in result.worst_branch[reached])


def test_a_base_of_its_own_moves_the_space_with_the_arm():
    base = Pose(exp_so3(np.array([0.0, 0.0, 0.7])), np.array([0.0, 0.0, 150.0]))
    space = SPACES["ur10"]
    here = accuracy_map(
        UR10, models_of(UR10), region.grid(space, np.array([0.3]), 150.0), wanted("ur10")
    )
    moved = region.grid(replace(space, bottom_mm=150), np.array([1.0]), 150.0)
    there = accuracy_map(replace(UR10, base=base), models_of(UR10), moved, wanted("ur10"))
    assert np.array_equal(here.solutions, there.solutions)
    assert np.allclose(here.position_max_mm, there.position_max_mm, equal_nan=True)


def test_bases_fitted_apart_are_brought_together():
    models = models_of(UR10)
    q = arms.joints_within(UR10, 20)
    moved = Pose(exp_so3(np.array([0.001, 0.0, 0.002])), np.array([1.0, 2.0, 3.0]))
    # The same arm described from a base that was fitted elsewhere.
    apart = errors_at(with_base(models, moved), q)
    true = compose(moved, models.by_name["vec"].model.pose(JointState(q)))
    modelled = dh.forward(UR10.dh, q)
    assert np.allclose(apart[:, :3], true.position_mm - modelled.position_mm)
    back = with_base(models, compose(moved, invert(moved)))
    assert np.allclose(errors_at(back, q), errors_at(models, q), atol=1e-9)
