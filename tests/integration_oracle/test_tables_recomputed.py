"""Every table of a finished study recomputed from the Parquet files before it, by the contract."""

from __future__ import annotations

import math

import numpy as np
import pytest
from oracles import assessors, small_study, tables

PAPER = {
    ("table1", "vec_vs_measured", "position"): (0.705, 1.635, 1.731),
    ("table1", "vec_vs_measured", "orientation"): (1.487, 3.149, 3.248),
    ("table3", "dh_vs_vec", "position"): (0.405, 0.847, 0.918),
    ("table3", "dh_vs_vec", "orientation"): (1.336, 2.851, 2.866),
}


@pytest.fixture(scope="module")
def measurements(finished):
    return tables.rows(finished, "measurements")


# --- measurements and fits ------------------------------------------------------------------------


def test_folds_keep_a_configuration_together_and_name_the_validation_rows(measurements):
    assert len(measurements) >= 160
    fold_of = {}
    for row in measurements:
        key = tuple(round(q, 9) for q in tables.joints(row))
        assert fold_of.setdefault(key, row["fold"]) == row["fold"]
        assert row["subset"] == ("validation" if row["fold"] == 1 else "train")
    sizes = [list(fold_of.values()).count(fold) for fold in range(4)]
    assert max(sizes) - min(sizes) <= 1


def true_errors(finished) -> np.ndarray:
    rows = tables.rows(finished, "assessment_points")
    return np.array([[row["ex_mm"], row["ey_mm"], row["ez_mm"]] for row in rows])


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
    truth = max(assessors.norm(e) for e in true_errors(papers_arm).tolist())
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
def other_fold(tmp_path_factory, written):
    """The study of the written file with fold 2 held out of the delivered models."""
    folder = tmp_path_factory.mktemp("other")
    config = folder / "config.yaml"
    settings = small_study.SETTINGS % ("file", written[0])
    config.write_text(settings.replace("validation_fold: 1", "validation_fold: 2"), "utf-8")
    stages = ("measurements", "vec", "dh", "residuals")
    return small_study.run_stages(config, "small", folder / "results", stages)


def test_cross_validated_errors_are_those_of_models_that_never_saw_the_fold(
    other_fold, tmp_path_factory, written
):
    folder = tmp_path_factory.mktemp("this")
    config = folder / "config.yaml"
    config.write_text(small_study.SETTINGS % ("file", written[0]), "utf-8")
    stages = ("measurements", "vec", "dh", "residuals")
    here = small_study.run_stages(config, "small", folder / "results", stages)
    rows = tables.rows(here, "measurements")
    assert [r["fold"] for r in rows] == [r["fold"] for r in tables.rows(other_fold, "measurements")]
    unseen = tables.models(other_fold)
    checked = 0
    for row in tables.rows(here, "pose_errors"):
        if (row["estimate"], row["fold"]) != ("cross_validated", 2):
            continue
        source = rows[row["row"]]
        position, turn = tables.magnitudes(unseen, [source], row["comparison"])
        found = math.dist((row["ex_mm"], row["ey_mm"], row["ez_mm"]), (0, 0, 0))
        assert found == pytest.approx(position[0], abs=1e-6)
        found = math.dist((row["rx_mrad"], row["ry_mrad"], row["rz_mrad"]), (0, 0, 0))
        assert found == pytest.approx(turn[0], abs=1e-6)
        checked += 1
    assert checked >= 4 * 35
