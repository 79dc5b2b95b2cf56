"""The map against a loop that does one cell, one pose and one search at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles import inverse as brute
from oracles import kinematics as oracle
from two_models import two_models

from kinacc.geometry import Pose, rotation_y
from kinacc.kinematics import dh, region, robot, vec
from kinacc.kinematics.inverse import Status
from kinacc.study import accuracy_map as maps
from kinacc.study.accuracy_map import Models

ARM = robot.load("mh180")
SPACE = region.Cylinder(1200.0, 900.0, 0.0, 500.0, 0.0, np.pi / 3)
DOWN = region.reference_rotation(np.deg2rad([180.0, 0.0, 0.0]))
NINE = region.orientations(np.pi / 4, "signs_and_zero")
WANTED = maps.PosesWanted(SPACE, DOWN, NINE, "dh")
TABLE_II = dh.DHModel(
    [0.001, -1.568, 0.001, -3.142, -3.141, 0.002],
    [-1.157, -0.898, 0.066, -1226.154, -0.104, -224.698],
    [323.453, 1151.356, 299.501, 0.029, 0.026, 0.028],
    [-1.573, 3.140, -1.571, -1.571, -1.571, 3.142],
    np.zeros(6),
)
RANGE = np.deg2rad([-20, -40, -90, -190, -130, -190]), np.deg2rad([80, 70, 30, 190, 130, 190])


def wavy(fitted=RANGE) -> vec.VECModel:
    empty = vec.without_errors(TABLE_II, *fitted, 5)
    noise = np.random.default_rng(3).normal(size=empty.coefficients.shape)
    scale = np.array([0.05] * 3 + [1e-4] * 3)[:, None]
    offsets = np.full((6, 2), [-5e-5, 5e-5])
    return replace(empty, coefficients=noise * scale, direction_offsets_rad=offsets)


def table_of(model: dh.DHModel) -> list[tuple[float, ...]]:
    return [tuple(float(getattr(model, name)[i]) for name in dh.PARAMETERS) for i in range(6)]


def tip(frame: np.ndarray, tool: Pose) -> np.ndarray:
    end = np.eye(4)
    end[:3, :3], end[:3, 3] = tool.rotation, tool.position_mm
    return frame @ end


def slow_cell(models: Models, angle, radius, height):
    """Largest errors of one cell: every pose solved from the arm's working posture on."""
    table, model = table_of(models.by_name["dh"].model), models.by_name["vec"].model
    nominal = table_of(model.dh)
    travel = np.zeros(6, int) if models.travel is None else models.travel
    largest = {"position": (-1.0, None), "orientation": (-1.0, None)}
    for turn, name in zip(NINE.rotation, NINE.names, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        wanted = np.eye(4)
        wanted[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ DOWN @ turn
        wanted[:3, 3] = radius * c, radius * s, height
        flange = wanted @ np.linalg.inv(tip(np.eye(4), models.by_name["dh"].tool))
        solutions = []
        for roll in np.deg2rad([-150, -100, -50, 0, 50, 100, 150]):
            for bend in (-0.7, 0.7, -1.5, 1.5):
                start = np.array([angle, 0.2, -0.5, roll, bend, -roll])
                q = brute.newton(lambda x: brute.dh_step(table, x), flange, start)
                if q is not None:
                    q = brute.wrapped(q)
                    front_up = abs(q[0] - angle) < 0.6 and q[2] < 1.33
                    if front_up and not any(brute.same_turn(q, x) for x in solutions):
                        solutions.append(q)
        assert len(solutions) == 2
        for q in solutions:
            true = tip(
                oracle.projected(
                    oracle.vec_forward(
                        nominal,
                        model.coefficients,
                        model.q_min_rad,
                        model.q_max_rad,
                        model.direction_offsets_rad,
                        q,
                        travel,
                    )
                ),
                models.by_name["vec"].tool,
            )
            modelled = tip(oracle.dh_forward(table, q), models.by_name["dh"].tool)
            error = brute.pose_error(true, modelled)
            branch = f"{name}, front-up-{'noflip' if q[4] > 0 else 'flip'}"
            for key, value in (
                ("position", np.linalg.norm(error[:3])),
                ("orientation", 1e3 * np.linalg.norm(error[3:])),
            ):
                largest[key] = max(largest[key], (float(value), branch), key=lambda x: x[0])
    return largest


TOOL = Pose(rotation_y(np.array(0.2)), np.array([20.0, -10.0, 150.0]))
OTHER_TOOL = Pose(rotation_y(np.array(0.2003)), np.array([20.1, -10.0, 150.1]))


@pytest.mark.parametrize(
    "models",
    [
        two_models(wavy(), TABLE_II),
        two_models(wavy(), TABLE_II, TOOL, OTHER_TOOL, np.array([1, -1, 1, 1, -1, 1])),
    ],
    ids=["flange", "tool and travel"],
)
def test_a_cell_is_what_a_slow_loop_makes_of_it(models):
    cells = region.Cells(np.array([0.3]), np.array([1725.0]), np.array([150.0]))
    found = maps.accuracy_map(ARM, models, cells, WANTED)
    slow = slow_cell(models, 0.3, 1725.0, 150.0)
    assert found.solutions[0] == found.wanted[0] == 18
    assert abs(found.position_max_mm[0] - slow["position"][0]) < 1e-6
    assert abs(found.orientation_max_mrad[0] - slow["orientation"][0]) < 1e-6
    assert found.worst_branch[0] == slow["position"][1]
    assert found.orientation_worst_branch[0] == slow["orientation"][1]


def test_the_default_space_is_reached_in_every_pose():
    cells = region.grid(SPACE, np.deg2rad([0.0, 60.0]), 100.0)
    found = maps.accuracy_map(ARM, two_models(wavy(), TABLE_II), cells, WANTED)
    assert (found.solutions == 18).all()
    assert (found.extrapolating == 0).all()
    assert np.isfinite(found.position_max_mm).all()


def test_unreachable_cells_are_marked_and_the_others_not_touched():
    cells = region.Cells(np.zeros(3), np.array([1500.0, 2600.0, 4000.0]), np.zeros(3))
    found = maps.accuracy_map(ARM, two_models(wavy(), TABLE_II), cells, WANTED)
    assert found.solutions[0] == 18
    assert 0 < found.solutions[1] < 18
    assert np.isfinite(found.position_max_mm[1])
    assert found.solutions[2] == 0
    assert np.isnan(found.position_max_mm[2])
    assert np.isnan(found.orientation_max_mrad[2])
    assert found.worst_branch[2] is None
    assert found.orientation_worst_branch[2] is None
    assert np.isnan(found.worst_q_rad[2]).all()
    assert np.isfinite(found.worst_q_rad[:2]).all()
    alone = region.Cells(*(axis[:1] for axis in cells))
    first = maps.accuracy_map(ARM, two_models(wavy(), TABLE_II), alone, WANTED)
    assert first.position_max_mm[0] == found.position_max_mm[0]


def test_poses_beyond_the_fitted_range_are_counted_and_left_out():
    lower, upper = (np.array(bound) for bound in RANGE)
    upper[4] = np.deg2rad(10.0)  # leaves only one wrist
    cells = region.grid(SPACE, np.array([0.2]), 300.0)
    found = maps.accuracy_map(ARM, two_models(wavy((lower, upper)), TABLE_II), cells, WANTED)
    assert (found.solutions == 9).all()
    assert (found.extrapolating == 9).all()
    assert all(name.endswith("front-up-flip") for name in found.worst_branch)


@pytest.mark.parametrize("invert_with", ["dh", "vec", "nominal"])
def test_the_chosen_model_is_the_one_whose_tool_reaches_the_pose(invert_with):
    models = two_models(wavy(), TABLE_II, TOOL, OTHER_TOOL, nominal=ARM.dh)
    cells = region.grid(SPACE, np.array([0.1]), 250.0)
    tool = region.tool_poses(cells, DOWN, np.eye(3))
    solved = maps.joints_of(ARM, models, tool, invert_with=invert_with)
    assert (solved.status == Status.FOUND).all()
    for branch in range(2):
        for i, q in enumerate(solved.q_rad[:, branch]):
            if invert_with == "vec":
                model = models.by_name["vec"].model
                args = (
                    model.coefficients,
                    model.q_min_rad,
                    model.q_max_rad,
                    model.direction_offsets_rad,
                    q,
                    np.zeros(6, int),
                )
                reached = tip(oracle.projected(oracle.vec_forward(table_of(model.dh), *args)), TOOL)
            else:
                model = models.by_name[invert_with].model
                reached = tip(oracle.dh_forward(table_of(model), q), OTHER_TOOL)
            assert np.linalg.norm(reached[:3, 3] - tool.position_mm[i]) < 2e-6
            assert np.abs(reached[:3, :3] - tool.rotation[i]).max() < 1e-8


def test_no_error_where_the_models_agree():
    same = two_models(vec.without_errors(TABLE_II, *RANGE, 2), TABLE_II)
    cells = region.grid(SPACE, np.array([0.0]), 300.0)
    found = maps.accuracy_map(ARM, same, cells, WANTED)
    assert found.position_max_mm.max() < 1e-9
    assert found.orientation_max_mrad.max() < 1e-6
