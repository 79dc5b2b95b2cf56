"""A real UR10 through measurements, fits and residuals, recomputed from its Parquet files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shared_data
from oracles import tables
from stages_by_hand import run_stages

# An independent fit's cross-validated position rms over several random splits, upper end.
REACH_MM = {"series_B": 0.475, "series_D": 0.43}
SETTINGS = """
datasets:
  arm:
    robot: ur10
    measurements: {source: file, file: {path: %s}, folds: 5, validation_fold: 0}
    calibration: {base_and_tool: estimated, dh: {fit_to: measurements, hayati_joints: [2, 3]}}
    evaluation: {space: measured}
"""
ERROR = ["ex_mm", "ey_mm", "ez_mm"]


# What the stages make of the other series is held to these tables in tests/golden.
GOLDEN = Path(__file__).parents[1] / "golden" / "results" / "ur10_d"


@pytest.fixture(scope="module")
def longer(tmp_path_factory):
    """Results of the longer series."""
    folder = tmp_path_factory.mktemp("ur10")
    config = folder / "config.yaml"
    config.write_text(SETTINGS % shared_data.path_of("ur10_tmac/series_B.csv"), encoding="utf-8")
    stages = ("measurements", "vec", "dh", "residuals", "assessment_points")
    return run_stages(stages, [config], folder / "results")


@pytest.mark.parametrize("name", REACH_MM)
def test_residuals_of_the_measured_arm(name, longer):
    folder = longer if name == "series_B" else GOLDEN
    rows = tables.rows(folder, "measurements")
    train = [row for row in rows if row["subset"] == "train"]
    keys = ["comparison", "subset", "quantity"]
    pooled = pd.DataFrame(tables.rows(folder, "residuals")).query("fold.isna()").set_index(keys)
    # The longer series only in the comparison that the reach is stated for.
    for comparison in ("dh_vs_measured", "vec_vs_measured", "dh_vs_vec")[: 1 if "B" in name else 3]:
        both = tables.magnitudes(tables.models(folder), train, comparison)
        for quantity, values in zip(("position", "orientation"), both, strict=True):
            row = pooled.loc[comparison, "train", quantity]
            for statistic, value in tables.statistics(values).items():
                assert row[statistic] == pytest.approx(value, rel=1e-7)
    row = pooled.loc["dh_vs_measured", "validation", "position"]
    assert row["n"] == len(rows)
    assert row["rms"] <= REACH_MM[name]


def test_study_points_are_cross_validated_errors_at_measured_configurations(longer):
    q = np.array([tables.joints(row) for row in tables.rows(longer, "measurements")])
    errors = pd.DataFrame(tables.rows(longer, "pose_errors"))
    errors = errors.query("comparison == 'dh_vs_measured' and estimate == 'cross_validated'")
    held_out = {
        tuple(q[row].round(9)): error
        for row, error in zip(errors["row"], errors[ERROR].to_numpy(), strict=True)
    }
    points = tables.rows(longer, "assessment_points")
    assert len(points) == 200
    for point in points:
        error = held_out[tuple(np.round(tables.joints(point), 9))]
        np.testing.assert_allclose([point[name] for name in ERROR], error, rtol=0, atol=1e-12)
        assert point["true_error_mm"] == pytest.approx(np.linalg.norm(error), rel=1e-12)
