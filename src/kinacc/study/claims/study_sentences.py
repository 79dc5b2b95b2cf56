"""Sentences of the abstract and of sections IV-C and V: Fig. 4, and the histories of Figs. 5, 6."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from kinacc.study.histories import KEPT, LARGER, REJECTED
from kinacc.tables.columns import Columns

_PRINTED = ["mean_mm", "min_mm", "max_mm", "bias_mm"]


def study_values(study_summary: Columns) -> dict[str, float]:
    """Values of the sentences about the lines of Fig. 4, by claim.

    Lines are tables with a row a noise, rising, and a column an assessor, mm.
    """
    table = pd.DataFrame(dict(study_summary)).pivot(
        index="noise_mm", columns="assessor", values=_PRINTED
    )
    mean, low, high, bias = (table[name].astype(float) for name in _PRINTED)
    spread, truth = high - low, (mean - bias)["maximum"].mean()
    with np.errstate(divide="ignore", invalid="ignore"):
        # 0 is even, positive upward.
        skew = np.log((high - mean) / (mean - low)).mean(skipna=False)
    assessors = ["maximum", "outlier_rejection", "model_invalidation"]
    change = (mean.iloc[-1] - mean.iloc[0])[assessors].abs()
    noise = mean.index.to_numpy()
    maximum, outlier, invalidation = assessors
    upper = spread.iloc[len(spread) // 2 :]
    return {
        "all_affected_by_noise": _ratio(change.max(), change.min()),
        "maximum_overestimates": bias[maximum].min(),
        "maximum_much_larger": bias[maximum].mean() / truth,
        "maximum_grows_with_noise": mean[maximum].diff().min(),
        "maximum_skewed_upward": skew[maximum],
        "outlier_rejection_grows_with_noise": mean[outlier].diff().min(),
        "outlier_rejection_below_at_low_noise": bias[outlier].iloc[0],
        "outlier_rejection_above_at_high_noise": bias[outlier].iloc[-1],
        "outlier_rejection_smaller_spread": (spread[outlier] / spread[maximum]).max(),
        "outlier_rejection_more_even": abs(skew[outlier]) - abs(skew[maximum]),
        "outlier_rejection_equally_bad": (bias[outlier] / bias[maximum]).abs().max(),
        "model_invalidation_varies_least": _over_others(mean.max() - mean.min()),
        "model_invalidation_even_spread": skew[invalidation],
        "model_invalidation_larger_spread": (upper[invalidation] / upper[outlier]).mean(),
        "model_invalidation_performs_well": _over_others(bias.abs().max()),
        "model_invalidation_less_sensitive": _over_others(((noise - noise.mean()) @ mean).abs()),
    }


def _ratio(value: float, other: float) -> float:
    return value / other if other > 0.0 else math.nan


def _over_others(sizes: pd.Series) -> float:
    """Model invalidation's over the smaller of the conventional ones."""
    return _ratio(sizes["model_invalidation"], sizes[["maximum", "outlier_rejection"]].min())


def points_values(assessment_points: Columns) -> dict[str, float]:
    """Share of the operating points whose error is near the largest."""
    errors = np.asarray(assessment_points["true_error_mm"], dtype=float)
    return {"few_points_near_limit": float(np.mean(errors > 0.9 * errors.max()))}


def history_values(histories: Columns) -> dict[str, float]:
    """Values of the sentences about the simulations of Figs. 5 and 6 that are there, by claim."""
    table = pd.DataFrame(dict(histories)).sort_values("iteration")
    rows = {name: own.reset_index(drop=True) for name, own in table.groupby("example")}
    values = {}
    for claim, example in (
        ("fig5_rejected", REJECTED),
        ("fig5_larger_eta_not_rejected", LARGER),
        ("fig6_not_rejected", KEPT),
    ):
        if example in rows:
            last = rows[example].iloc[-1]
            values[claim] = last["rejection_probability"] - last["alpha"]
    if REJECTED in rows:
        values |= _rejected_values(rows[REJECTED])
    if KEPT in rows:
        values |= _kept_values(rows[KEPT])
    return values


def _rejected_values(rows: pd.DataFrame) -> dict[str, float]:
    near, beyond = rows["rejection_probability"] >= 0.8 * rows["alpha"], rows["eta_mm"]
    is_above, first = rows["true_mm"] > beyond, rows["true_mm"].argmax()
    is_worst = rows["point"] == rows["point"][first]
    average_above = rows["averaged_mm"] - beyond
    return {
        "fig5_approaches_alpha": rows["iteration"][near].min(),
        "fig5_few_true_errors_above": is_above[:first][~rows["point"][:first].duplicated()].mean(),
        "fig5_worst_point_resampled": is_worst[first + 1 :].mean(),
        "fig5_average_stays_above": average_above[is_worst].iloc[-1],
        "fig5_prioritises_bad_points": is_above[rows["repeat"] > 1].mean(),
    }


def _kept_values(rows: pd.DataFrame) -> dict[str, float]:
    excess = (rows["true_mm"] - rows["eta_mm"]).max()
    exceeding = rows["rejection_probability"] > rows["alpha"]
    starts = (exceeding & ~exceeding.shift(fill_value=False)).sum()
    return {
        "fig6_resampling_by_noise": excess if (rows["repeat"] > 1).any() else max(excess, 0.0),
        # Of all stretches above alpha only the last one can still be above it at the end.
        "fig6_recovers": 1.0 - _ratio(exceeding.iloc[-1], starts),
    }
