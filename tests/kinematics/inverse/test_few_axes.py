"""Arms of four and five axes: the point is exactly there, turned as near as an optimiser can."""

import numpy as np
import pytest
from scipy.optimize import minimize

from kinacc.geometry import Pose, compose, exp_so3, log_so3
from kinacc.kinematics.dh import DHModel, forward
from kinacc.kinematics.inverse.few_axes import refine

TOOL = Pose(exp_so3(np.array([0.2, -0.4, 0.1])), np.array([30.0, -20.0, 150.0]))


def arm(axes):
    columns = np.array([[0.0, 300.0, 40.0, 1.5], [0.3, 20.0, 350.0, 0.1], [-0.4, -15.0, 300.0, 0.2],
                        [0.2, 80.0, 30.0, -1.4], [0.1, 60.0, 20.0, 1.2]])[:axes].T  # fmt: skip
    slides = np.zeros(axes, dtype=bool)
    return DHModel(*columns, np.zeros(axes), slides)


@pytest.mark.parametrize("axes", [4, 5])
@pytest.mark.parametrize("far", [0.1, 1.0])
def test_the_point_is_where_it_is_wanted_and_no_joints_there_turn_it_nearer(axes, far):
    model, rng = arm(axes), np.random.default_rng(axes)
    truth = rng.uniform(-1.0, 1.0, (20, axes))
    wanted = compose(forward(model, truth), TOOL)
    wanted = Pose(exp_so3(0.05 * rng.normal(size=(20, 3))) @ wanted.rotation, wanted.position_mm)
    found = refine(model, wanted, TOOL, truth + far * rng.uniform(-1.0, 1.0, (20, axes)))

    def left(q, row):
        there = compose(forward(model, q[None]), TOOL)
        turn = log_so3(wanted.rotation[row] @ there.rotation[0].T)
        return there.position_mm[0] - wanted.position_mm[row], float(turn @ turn)

    apart = np.array([np.linalg.norm(left(q, row)[0]) for row, q in enumerate(found)])
    assert np.mean(apart < 1e-6) >= 0.85
    for row in np.flatnonzero(apart < 1e-6)[:8]:
        point = {"type": "eq", "fun": lambda q, row=row: 1e-3 * left(q, row)[0]}
        best = minimize(lambda q, row=row: left(q, row)[1], found[row], method="SLSQP",
                        constraints=[point], options={"ftol": 1e-14})  # fmt: skip
        assert left(found[row], row)[1] <= best.fun + 1e-7
