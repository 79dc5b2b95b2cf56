"""The paper's sentences about the study and the histories, recomputed row by row from the tables.

Each function below does what the ``statistic`` of a claim says in words.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from oracles import tables


def frame(folder, name) -> pd.DataFrame:
    return pd.DataFrame(tables.rows(folder, name))


@pytest.fixture(scope="module")
def check(papers_arm):
    """Hold a claim to its value, and to whether that agrees with the paper; NaN: no value."""
    claims = frame(papers_arm, "claims").set_index("claim")

    def held(name, value, holds):
        row = claims.loc[name]
        verdict = "not comparable" if np.isnan(value) else "agrees" if holds else "differs"
        assert row["verdict"] == verdict, name
        assert row["reproduced"] == pytest.approx(value, rel=1e-9, abs=1e-12, nan_ok=True), name

    return held


def skew(rows) -> float:
    upper, lower = rows.max_mm - rows.mean_mm, rows.mean_mm - rows.min_mm
    return float(np.mean(np.log(upper / lower)))


def slope(rows) -> float:
    x = rows.noise_mm - rows.noise_mm.mean()
    return abs(float((x * (rows.mean_mm - rows.mean_mm.mean())).sum() / (x**2).sum()))


def test_sentences_about_the_study(papers_arm, check):
    summary = frame(papers_arm, "study_summary").sort_values("noise_mm", ignore_index=True)
    names = ("maximum", "outlier_rejection", "model_invalidation")
    by = [summary[summary.assessor == name].reset_index(drop=True) for name in names]
    top, cut, mi = by
    spread = [rows.max_mm - rows.min_mm for rows in by]
    reach = [np.ptp(rows.mean_mm) for rows in by]
    truth = top.mean_mm[0] - top.bias_mm[0]
    errors = frame(papers_arm, "assessment_points").true_error_mm
    assert truth == pytest.approx(errors.max(), rel=1e-12)
    near = (errors > 0.9 * errors.max()).mean()
    check("few_points_near_limit", near, near <= 0.05)
    change = [abs(rows.mean_mm.iloc[-1] - rows.mean_mm[0]) for rows in by]
    check("all_affected_by_noise", max(change) / min(change), max(change) > 2 * min(change))
    check("maximum_overestimates", top.bias_mm.min(), top.bias_mm.min() > 0)
    mean = top.bias_mm.mean() / truth
    check("maximum_much_larger", mean, mean > 0.1)
    for name, rows in zip(names[:2], by[:2], strict=True):
        step = rows.mean_mm.diff().min()
        check(f"{name}_grows_with_noise", step, step > 0)
    check("maximum_skewed_upward", skew(top), skew(top) > 0)
    low, high = cut.bias_mm.iloc[[0, -1]]
    check("outlier_rejection_below_at_low_noise", low, low < 0)
    check("outlier_rejection_above_at_high_noise", high, high > 0)
    half = len(mi) // 2
    later = (spread[2] / spread[1])[half:].mean()
    worst = [rows.bias_mm.abs().max() for rows in by]
    even = abs(skew(cut)) - abs(skew(top))
    for name, ratio, holds in (
        ("outlier_rejection_smaller_spread", (spread[1] / spread[0]).max(), lambda x: x < 1),
        ("outlier_rejection_more_even", even, lambda x: x < 0),
        ("outlier_rejection_equally_bad", (cut.bias_mm / top.bias_mm).abs().max(),
         lambda x: x >= 1),
        ("model_invalidation_varies_least", reach[2] / min(reach[:2]), lambda x: x < 1),
        ("model_invalidation_even_spread", skew(mi), lambda x: abs(x) <= math.log(1.5)),
        ("model_invalidation_larger_spread", later, lambda x: x > 1),
        ("model_invalidation_performs_well", worst[2] / min(worst[:2]), lambda x: x < 1),
        ("model_invalidation_less_sensitive", slope(mi) / min(slope(top), slope(cut)),
         lambda x: x < 1),
    ):  # fmt: skip
        check(name, ratio, holds(ratio))


def history(papers_arm, name):
    rows = frame(papers_arm, "histories")
    return rows[rows.example == name].sort_values("iteration", ignore_index=True)


def test_sentences_about_the_history_that_rejects(papers_arm, check):
    rows = history(papers_arm, "rejected")
    eta, alpha = rows.eta_mm[0], rows.alpha[0]
    last = rows.rejection_probability.iloc[-1] - alpha
    check("fig5_rejected", last, last > 0)
    is_worst = rows.point == rows.point[rows.true_mm.idxmax()]
    first = int(is_worst.idxmax())
    share = (rows[:first].drop_duplicates("point").true_mm > eta).mean()
    check("fig5_few_true_errors_above", share, share <= 0.05)
    share = is_worst[first + 1 :].mean()
    check("fig5_worst_point_resampled", share, share >= 0.95)
    average = rows.averaged_mm[is_worst].iloc[-1] - eta
    check("fig5_average_stays_above", average, average > 0)
    share = (rows.true_mm[rows["repeat"] > 1] > eta).mean()
    check("fig5_prioritises_bad_points", share, share > 0.5)
    larger = history(papers_arm, "rejected_larger_eta").rejection_probability.iloc[-1]
    check("fig5_larger_eta_not_rejected", larger - alpha, larger <= alpha)


def test_sentences_about_the_history_that_cannot_reject(papers_arm, check):
    rows = history(papers_arm, "not_rejected")
    last = rows.rejection_probability.iloc[-1] - rows.alpha[0]
    check("fig6_not_rejected", last, last <= 0)
    excess = rows.true_mm.max() - rows.eta_mm[0]
    check("fig6_resampling_by_noise", excess, excess < 0 and (rows["repeat"] > 1).any())
