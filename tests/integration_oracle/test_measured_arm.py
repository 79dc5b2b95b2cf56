"""A real UR10 through measurements, fits and residuals, recomputed from its Parquet files."""

from __future__ import annotations

import numpy as np
import pytest
import shared_data
from oracles import small_study, tables

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


@pytest.fixture(scope="module", params=["series_D", "series_B"])
def series(request, tmp_path_factory):
    path = shared_data.path_of(f"ur10_tmac/{request.param}.csv")
    folder = tmp_path_factory.mktemp("ur10")
    config = folder / "config.yaml"
    config.write_text(SETTINGS % path, encoding="utf-8")
    stages = ("measurements", "vec", "dh", "residuals", "assessment_points")
    return request.param, small_study.run_stages(config, "arm", folder / "results", stages)


def test_residuals_of_the_measured_arm(series):
    name, folder = series
    models, rows = tables.models(folder), tables.rows(folder, "measurements")
    residuals = tables.rows(folder, "residuals")
    # The longer series only in the comparison that the reach is stated for.
    every = ("vec_vs_measured", "dh_vs_measured", "dh_vs_vec")
    for comparison in every if name == "series_D" else every[1:2]:
        train = [row for row in rows if row["subset"] == "train"]
        both = tables.magnitudes(models, train, comparison)
        for quantity, values in zip(("position", "orientation"), both, strict=True):
            (row,) = [
                r
                for r in residuals
                if (r["comparison"], r["subset"], r["fold"], r["quantity"])
                == (comparison, "train", None, quantity)
            ]
            expected = tables.statistics(values)
            for statistic, value in expected.items():
                assert row[statistic] == pytest.approx(value, rel=1e-7)
    (row,) = [
        r
        for r in residuals
        if (r["comparison"], r["subset"], r["fold"], r["quantity"])
        == ("dh_vs_measured", "validation", None, "position")
    ]
    assert row["n"] == len(rows)
    assert row["rms"] <= REACH_MM[name]


def test_revisits_stay_in_one_fold(series):
    name, folder = series
    rows = tables.rows(folder, "measurements")
    q = np.array([tables.joints(row) for row in rows])
    fold = np.array([row["fold"] for row in rows])
    turn = 2 * np.pi
    apart = [np.abs((joint[:, None] - joint + np.pi) % turn - np.pi) for joint in q.T]
    same = np.max(apart, axis=0) < np.radians(0.05)
    assert (fold[:, None] == fold)[same].all()
    sizes = np.bincount(fold)
    assert len(sizes) == 5
    assert sizes.min() >= 0.8 * len(q) / 5
    assert name != "series_B" or same.sum() >= len(q) + 2 * 39


def test_study_points_are_cross_validated_errors_at_measured_configurations(series):
    _, folder = series
    rows = tables.rows(folder, "measurements")
    held_out = {
        tuple(np.round(tables.joints(rows[e["row"]]), 9)): (e["ex_mm"], e["ey_mm"], e["ez_mm"])
        for e in tables.rows(folder, "pose_errors")
        if (e["comparison"], e["estimate"]) == ("dh_vs_measured", "cross_validated")
    }
    points = tables.rows(folder, "assessment_points")
    assert len(points) == 200
    for point in points:
        error = held_out[tuple(np.round(tables.joints(point), 9))]
        found = (point["ex_mm"], point["ey_mm"], point["ez_mm"])
        np.testing.assert_allclose(found, error, rtol=0, atol=1e-12)
        assert point["true_error_mm"] == pytest.approx(np.linalg.norm(error), rel=1e-12)
