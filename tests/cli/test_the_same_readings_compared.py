"""Two calibrations from the same readings, or from some of the same, are no proof of a change."""

import numpy as np
import pytest
from command_line import answer, call
from stages_by_hand import CALIBRATED, run_stages
from tracked_arm import NAMES, Q, table, tracked

ROWS = 50


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Calibrations of one arm: of a file, of it with other settings, and measured anew."""
    base = tmp_path_factory.mktemp("moved")
    it, draw = tracked("ur10", ROWS, 21), np.random.default_rng(9)
    anew = np.round(it.point + draw.normal(0.0, 0.04, it.point.shape), 4)
    sets = {
        "before": ("before", it.point, 0.01),
        "settings": ("before", it.point, 0.2),
        "anew": ("anew", anew, 0.01),
    }
    lines = ["measurements: {validation_fold: null, folds: 3}", "datasets:"]
    for name, (file, point, truncation) in sets.items():
        numbers = np.column_stack([np.arange(ROWS), it.q, point])
        (base / f"{file}.csv").write_text(table(["pose", *NAMES], numbers))
        lines.append(
            f"  {name}: {{robot: ur10, evaluation: {{space: measured}}, calibration: "
            "{base_and_tool: estimated, vec: {order: 1}, dh: {fit_to: measurements, truncation: "
            f"{truncation}}}}}, measurements: {{source: file, file: {{path: {file}.csv, "
            "orientation: {kind: none}}}}"
        )
    (base / "sets.yaml").write_text("\n".join(lines) + "\n")
    for name in sets:
        run_stages(CALIBRATED, [base / "sets.yaml"], base / "results", name)
    return base / "results"


def test_one_file_fitted_twice_shows_no_change_of_the_arm(results, tmp_path):
    moved = ("--picture", tmp_path / "moved.svg")
    told = answer("compare", results / "before", results / "settings", *moved)
    assert moved[1].is_file()
    assert told["verdict"] == "same readings"
    assert told["shared"] == {"count": ROWS, "first": ROWS, "second": ROWS}
    assert told["probability"] is None
    assert told["shifts"][0]["rms_mm"] > 0.0
    assert told["shifts"][0]["chance_mm"] == 0.0


def joints_of(path, shifts_deg):
    """A file of the first readings, then of as many with joint 2 shifted, per shift."""
    q_deg = tracked("ur10", ROWS, 21).q
    shifted = [q_deg[:30] + np.eye(6)[1] * shift for shift in shifts_deg]
    path.write_text(table(Q, np.vstack(shifted)))
    return path


def test_vec_models_are_compared_only_where_both_say_something(results, tmp_path):
    wide = joints_of(tmp_path / "wide.csv", (0.0, 400.0))
    words = ("compare", results / "before", results / "anew", "--model", "vec", "--joints")
    told = answer(*words, wide)
    assert (len(told["poses"]), told["poses_given"]) == (30, 60)
    own = joints_of(tmp_path / "own.csv", (0.0,))
    alone = answer(*words, own)
    assert told["shifts"] == alone["shifts"]
    assert {row["chance_mm"] for row in told["shifts"]} == {None}
    far = joints_of(tmp_path / "far.csv", (400.0,))
    assert call(*words, far).exit_code == 2
