"""The paper's sentences about the study and the histories, recomputed row by row from the tables.

Each function below does what the ``statistic`` of a claim says in words, in plain Python.
"""

from __future__ import annotations

import itertools
import math
from statistics import fmean

import pytest
from oracles import tables


@pytest.fixture(scope="module")
def claims(papers_arm):
    return {row["claim"]: row for row in tables.rows(papers_arm, "claims")}


def check(claims, name, value, holds):
    row = claims[name]
    if value is None or math.isnan(value):
        assert row["reproduced"] is None
        assert row["verdict"] == "not comparable"
        return
    assert row["reproduced"] == pytest.approx(value, rel=1e-9, abs=1e-12)
    assert row["verdict"] == ("agrees" if holds else "differs")


def lines(papers_arm):
    """Rows of the summary per assessor, by rising noise."""
    rows = sorted(tables.rows(papers_arm, "study_summary"), key=lambda r: r["noise_mm"])
    names = ("maximum", "outlier_rejection", "model_invalidation")
    return {name: [r for r in rows if r["assessor"] == name] for name in names}


def skew(rows) -> float:
    return fmean(
        math.log((r["max_mm"] - r["mean_mm"]) / (r["mean_mm"] - r["min_mm"])) for r in rows
    )


def spread(row) -> float:
    return row["max_mm"] - row["min_mm"]


def slope(rows) -> float:
    x, y = [r["noise_mm"] for r in rows], [r["mean_mm"] for r in rows]
    mx, my = fmean(x), fmean(y)
    top = math.fsum((a - mx) * (b - my) for a, b in zip(x, y, strict=True))
    return abs(top / math.fsum((a - mx) ** 2 for a in x))


def reach(rows) -> float:
    return max(r["mean_mm"] for r in rows) - min(r["mean_mm"] for r in rows)


def test_sentences_about_the_study(papers_arm, claims):
    by = lines(papers_arm)
    top, cut, mi = by["maximum"], by["outlier_rejection"], by["model_invalidation"]
    truth = top[0]["mean_mm"] - top[0]["bias_mm"]
    errors = [r["true_error_mm"] for r in tables.rows(papers_arm, "assessment_points")]
    assert truth == pytest.approx(max(errors), rel=1e-12)

    near = sum(e > 0.9 * max(errors) for e in errors) / len(errors)
    check(claims, "few_points_near_limit", near, near <= 0.05)
    change = [abs(rows[-1]["mean_mm"] - rows[0]["mean_mm"]) for rows in by.values()]
    check(claims, "all_affected_by_noise", max(change) / min(change), max(change) > 2 * min(change))
    bias = [r["bias_mm"] for r in top]
    check(claims, "maximum_overestimates", min(bias), min(bias) > 0)
    check(claims, "maximum_much_larger", fmean(bias) / truth, fmean(bias) > 0.1 * truth)
    for name, rows in (("maximum", top), ("outlier_rejection", cut)):
        step = min(b["mean_mm"] - a["mean_mm"] for a, b in itertools.pairwise(rows))
        check(claims, f"{name}_grows_with_noise", step, step > 0)
    check(claims, "maximum_skewed_upward", skew(top), skew(top) > 0)
    low, high = cut[0]["bias_mm"], cut[-1]["bias_mm"]
    check(claims, "outlier_rejection_below_at_low_noise", low, low < 0)
    check(claims, "outlier_rejection_above_at_high_noise", high, high > 0)
    ratio = max(spread(a) / spread(b) for a, b in zip(cut, top, strict=True))
    check(claims, "outlier_rejection_smaller_spread", ratio, ratio < 1)
    even = abs(skew(cut)) - abs(skew(top))
    check(claims, "outlier_rejection_more_even", even, even < 0)
    ratio = max(abs(a["bias_mm"] / b["bias_mm"]) for a, b in zip(cut, top, strict=True))
    check(claims, "outlier_rejection_equally_bad", ratio, ratio >= 1)
    ratio = reach(mi) / min(reach(top), reach(cut))
    check(claims, "model_invalidation_varies_least", ratio, ratio < 1)
    check(claims, "model_invalidation_even_spread", skew(mi), abs(skew(mi)) <= math.log(1.5))
    half = len(mi) // 2
    ratio = fmean(spread(a) / spread(b) for a, b in zip(mi[half:], cut[half:], strict=True))
    check(claims, "model_invalidation_larger_spread", ratio, ratio > 1)
    worst = [max(abs(r["bias_mm"]) for r in rows) for rows in (mi, top, cut)]
    ratio = worst[0] / min(worst[1:])
    check(claims, "model_invalidation_performs_well", ratio, ratio < 1)
    ratio = slope(mi) / min(slope(top), slope(cut))
    check(claims, "model_invalidation_less_sensitive", ratio, ratio < 1)


def history(papers_arm, name):
    rows = [r for r in tables.rows(papers_arm, "histories") if r["example"] == name]
    return sorted(rows, key=lambda r: r["iteration"])


def test_sentences_about_the_history_that_rejects(papers_arm, claims):
    rows = history(papers_arm, "rejected")
    eta, alpha = rows[0]["eta_mm"], rows[0]["alpha"]
    last = rows[-1]["rejection_probability"] - alpha
    check(claims, "fig5_rejected", last, last > 0)
    worst = max(rows, key=lambda r: r["true_mm"])["point"]
    first = next(i for i, r in enumerate(rows) if r["point"] == worst)
    before = {r["point"]: r["true_mm"] for r in rows[:first]}
    share = sum(t > eta for t in before.values()) / len(before) if before else math.nan
    check(claims, "fig5_few_true_errors_above", share, share <= 0.05)
    later = [r["point"] == worst for r in rows[first + 1 :]]
    share = fmean(later) if later else math.nan
    check(claims, "fig5_worst_point_resampled", share, share >= 0.95)
    average = [r["averaged_mm"] for r in rows if r["point"] == worst][-1] - eta
    check(claims, "fig5_average_stays_above", average, average > 0)
    again = [r["true_mm"] > eta for r in rows if r["repeat"] > 1]
    share = fmean(again) if again else math.nan
    check(claims, "fig5_prioritises_bad_points", share, share > 0.5)
    larger = history(papers_arm, "rejected_larger_eta")[-1]
    excess = larger["rejection_probability"] - alpha
    check(claims, "fig5_larger_eta_not_rejected", excess, excess <= 0)


def test_sentences_about_the_history_that_cannot_reject(papers_arm, claims):
    rows = history(papers_arm, "not_rejected")
    eta, alpha = rows[0]["eta_mm"], rows[0]["alpha"]
    last = rows[-1]["rejection_probability"] - alpha
    check(claims, "fig6_not_rejected", last, last <= 0)
    excess = max(r["true_mm"] for r in rows) - eta
    repeated = any(r["repeat"] > 1 for r in rows)
    check(claims, "fig6_resampling_by_noise", excess, excess < 0 and repeated)
