"""The notebooks in examples/: their cells run in order, and give what their texts say."""

import json

import matplotlib
import numpy as np
import pytest
from shared_data import EXAMPLES


def run(name, monkeypatch):
    """Variables that a notebook leaves behind."""
    matplotlib.use("agg")
    monkeypatch.chdir(EXAMPLES)
    cells = json.loads((EXAMPLES / name).read_text())["cells"]
    variables = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            exec(compile("".join(cell["source"]), f"{name}:{cell['id']}", "exec"), variables)  # noqa: S102
    return variables


def test_figure_4_with_an_assessor_of_ones_own(monkeypatch):
    left = run("paper_figure_4.ipynb", monkeypatch)
    assert np.linalg.norm(left["errors_mm"], axis=1).max() == pytest.approx(0.916, abs=5e-4)
    bias = left["table"].pivot(index="noise_mm", columns="assessor", values="bias_mm")
    assert (bias["corrected_maximum"] < bias["maximum"]).all()
    assert (bias["corrected_maximum"] > 0).all()
    # Fig. 4 of the workflow, docs/the-paper.md.
    assert bias["maximum"].iloc[-1] + 0.916 == pytest.approx(1.442, abs=1e-3)
    assert len(left["figure"].axes[0].containers) == 4


def test_a_tracker_file_leads_to_a_bound_that_the_measured_errors_keep(monkeypatch):
    left = run("tracker_to_bound.ipynb", monkeypatch)
    predicted = left["calibration"].predict(left["joints"], frame="instrument")
    error_mm = np.linalg.norm(predicted.pose.position_mm - left["points_mm"], axis=1).max()
    bound = left["bound"]
    assert bound.points == len(left["joints"])
    assert bound.lower_mm < error_mm < bound.upper_mm
