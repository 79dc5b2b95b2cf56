"""The figure stages: tables as the runner hands them over, one Figure back."""

from __future__ import annotations

from importlib import import_module

import figure_tables as tables
import numpy as np
import pytest
from figure_words import CYLINDER, problems, said
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from kinacc.kinematics import robot
from kinacc.kinematics.dh import PARAMETERS


def points(q_rad: np.ndarray) -> dict[str, np.ndarray]:
    columns = {f"q{i + 1}": q_rad[:, i] for i in range(q_rad.shape[1])}
    return columns | {"true_error_mm": np.linspace(0.1, 1.111, len(q_rad))}


def dh_model() -> dict[str, np.ndarray]:
    model = robot.load("mh180").dh
    mixed = np.array([3, 0, 5, 1, 2, 4])
    columns = {name: getattr(model, name)[mixed] for name in PARAMETERS}
    return columns | {"joint": mixed + 1}


INPUTS = {
    "fig1": {},
    "fig2": {"dh_model": dh_model(), "assessment_points": points(tables.joint_angles())},
    "fig3": {"accuracy_map": tables.accuracy_map()},
    "fig4": {
        "study_summary": tables.study_summary(),
        "assessment_points": points(tables.joint_angles()),
    },
    "fig5": {
        "histories": tables.history(0.834, seed=0),
        "assessment_points": points(tables.joint_angles()),
    },
    "fig6": {
        "histories": tables.history(1.023, seed=5, example="not_rejected"),
        "assessment_points": points(tables.joint_angles()),
    },
}
CYLINDER_SPACE = {
    "dataset": "mh180",
    "robot": "mh180",
    "evaluation": {"space": "cylinder", "cylinder": CYLINDER, "tool_mm": [0.0, 0.0, 0.0]},
    "measurements": {"source": "synthetic"},
}


@pytest.mark.parametrize("name", INPUTS)
@pytest.mark.parametrize("space", ["cylinder", "joint_box", "measured"])
def test_stage_returns_a_clean_figure(name, space):
    settings = {**CYLINDER_SPACE, "evaluation": {**CYLINDER_SPACE["evaluation"], "space": space}}
    figure = import_module(f"kinacc.figures.{name}").run(INPUTS[name], settings)
    assert isinstance(figure, Figure)
    assert problems(figure) == []


@pytest.mark.parametrize("name", ["fig4", "fig5", "fig6"])
def test_true_accuracy_is_that_of_all_points_visited_or_not(name):
    figure = import_module(f"kinacc.figures.{name}").run(INPUTS[name], CYLINDER_SPACE)
    assert "1.111 mm" in said(figure)


def test_fig2_draws_to_the_fitted_tool_or_else_to_the_configured_one():
    frames = {
        "model": np.array(["vec", "dh", "dh"], dtype=object),
        "frame": np.array(["tool", "base", "tool"], dtype=object),
        "x_mm": np.array([1.0, 2.0, 3.0]),
        "y_mm": np.array([0.0, 0.0, 4.0]),
        "z_mm": np.array([0.0, 0.0, 250.0]),
    } | {name: np.full(3, float(name == "qw")) for name in ("qw", "qx", "qy", "qz")}
    none_fitted = frames | {f"{axis}_mm": np.zeros(3) for axis in "xyz"}
    fitted, configured, bare = [3.0, 4.0, 250.0], [0.0, 0.0, 400.0], [0.0, 0.0, 0.0]
    drawn = {str(tool): fig2_pixels(None, tool) for tool in (fitted, configured, bare)}
    assert len(set(drawn.values())) == 3
    assert fig2_pixels(frames, configured) == drawn[str(fitted)]
    assert fig2_pixels(none_fitted, configured) == drawn[str(configured)]
    assert fig2_pixels(None, None) == drawn[str(bare)]


def fig2_pixels(frames, tool_mm) -> bytes:
    """What the stage draws with a table of fitted frames and a configured tool."""
    evaluation = CYLINDER_SPACE["evaluation"] | ({} if tool_mm is None else {"tool_mm": tool_mm})
    inputs = INPUTS["fig2"] | ({} if frames is None else {"frames": frames})
    stage = import_module("kinacc.figures.fig2")
    figure = stage.run(inputs, CYLINDER_SPACE | {"evaluation": evaluation})
    assert problems(figure) == []
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return bytes(canvas.buffer_rgba())
