"""Every table of a finished study recomputed from the Parquet files before it, by the contract."""

from __future__ import annotations

import math

import numpy as np
import pytest
from oracles import small_study, tables
from stages_by_hand import run_stages

PAPER = {
    ("table1", "vec_vs_measured", "position"): (0.705, 1.635, 1.731),
    ("table1", "vec_vs_measured", "orientation"): (1.487, 3.149, 3.248),
    ("table3", "dh_vs_vec", "position"): (0.405, 0.847, 0.918),
    ("table3", "dh_vs_vec", "orientation"): (1.336, 2.851, 2.866),
}
AXES = {"e": ("x_mm", "y_mm", "z_mm"), "r": ("x_mrad", "y_mrad", "z_mrad")}


# --- claims ---------------------------------------------------------------------------------------


def test_numbers_of_the_claims(papers_arm):
    models = tables.models(papers_arm)
    measurements = tables.rows(papers_arm, "measurements")
    claims = {row["claim"]: row for row in tables.rows(papers_arm, "claims")}
    train = [row for row in measurements if row["subset"] == "train"]
    for (table, comparison, quantity), paper in PAPER.items():
        both = tables.magnitudes(models, train, comparison)
        expected = tables.statistics(both[quantity == "orientation"])
        for name, value in zip(("mean", "max", "gamma99"), paper, strict=True):
            row = claims[f"{table}_{quantity}_{name}"]
            assert row["paper"] == value
            assert row["tolerance"] == pytest.approx(value / 10, rel=1e-12)
            assert row["reproduced"] == pytest.approx(expected[name], rel=1e-7)
            agrees = abs(row["reproduced"] - value) <= value / 10
            assert row["verdict"] == ("agrees" if agrees else "differs")
    points = tables.rows(papers_arm, "assessment_points")
    truth = max(math.hypot(row["ex_mm"], row["ey_mm"], row["ez_mm"]) for row in points)
    assert claims["true_accuracy"]["paper"] == 0.906
    assert claims["true_accuracy"]["reproduced"] == pytest.approx(truth, rel=1e-12)
    d = [row[1] for row in models.dh]
    pair = claims["table2_d_2_minus_d_3"]
    assert pair["paper"] == pytest.approx(-0.964)
    assert pair["reproduced"] == pytest.approx(d[1] - d[2], abs=1e-12)
    for joint in (2, 3):
        assert claims[f"table2_d_{joint}"]["verdict"] == "not comparable"
    fifth = claims["table2_theta_offset_5"]
    assert fifth["paper"] == pytest.approx(-3.141)
    assert math.cos(fifth["reproduced"] - models.dh[4][0]) == pytest.approx(1, abs=1e-12)


# --- measured files and folds ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory, measured):
    """Folders of the measured file, calibrated with fold 1 and with fold 2 as validation."""
    folders = []
    for fold in (1, 2):
        folder = tmp_path_factory.mktemp("fold")
        settings = small_study.SETTINGS % ("file", measured)
        settings = settings.replace("validation_fold: 1", f"validation_fold: {fold}")
        (folder / "config.yaml").write_text(settings, "utf-8")
        stages = ("measurements", "vec", "dh", "residuals")
        folders.append(run_stages(stages, [folder / "config.yaml"], folder / "results"))
    return folders


def test_cross_validated_errors_are_those_of_models_that_never_saw_the_fold(calibrated):
    here, other_fold = calibrated
    rows, unseen = tables.rows(here, "measurements"), tables.models(other_fold)
    assert [r["fold"] for r in rows] == [r["fold"] for r in tables.rows(other_fold, "measurements")]
    checked = 0
    for row in tables.rows(here, "pose_errors"):
        if (row["estimate"], row["fold"]) != ("cross_validated", 2):
            continue
        found = [math.hypot(*(row[f"{kind}{axis}"] for axis in AXES[kind])) for kind in AXES]
        expected = tables.magnitudes(unseen, [rows[row["row"]]], row["comparison"])
        np.testing.assert_allclose(found, np.ravel(expected), rtol=0, atol=1e-6)
        checked += 1
    assert checked >= 4 * 35
