"""Sentences of the abstract and of sections IV-C and V: Fig. 4, and the histories of Figs. 5, 6."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from kinacc.study.claims.claim import Claim, Statistic, sentences
from kinacc.study.histories import KEPT, LARGER, REJECTED
from kinacc.tables.columns import Tables

MAXIMUM, OUTLIER, INVALIDATION = "maximum", "outlier_rejection", "model_invalidation"
CONVENTIONAL = [MAXIMUM, OUTLIER]
ASSESSORS = [*CONVENTIONAL, INVALIDATION]


class _Curves(NamedTuple):
    """The lines of Fig. 4, mm: a row a noise, rising, a column an assessor."""

    mean: pd.DataFrame
    low: pd.DataFrame
    high: pd.DataFrame
    bias: pd.DataFrame

    @property
    def spread(self) -> pd.DataFrame:
        return self.high - self.low

    @property
    def log_skew(self) -> pd.Series:
        """Mean over noise of log((max - mean) / (mean - min)); 0 is even, positive upward."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.log((self.high - self.mean) / (self.mean - self.low)).mean(skipna=False)


def study_claims() -> list[Claim]:
    """Claims that Fig. 4 and the text around it make."""
    curves: dict[str, Callable[[_Curves], float]] = {
        "all_affected_by_noise": _unequally_affected,
        "maximum_overestimates": lambda c: c.bias[MAXIMUM].min(),
        "maximum_much_larger": lambda c: c.bias[MAXIMUM].mean() / (c.mean - c.bias)[MAXIMUM].mean(),
        "maximum_grows_with_noise": lambda c: c.mean[MAXIMUM].diff().min(),
        "maximum_skewed_upward": lambda c: c.log_skew[MAXIMUM],
        "outlier_rejection_grows_with_noise": lambda c: c.mean[OUTLIER].diff().min(),
        "outlier_rejection_below_at_low_noise": lambda c: c.bias[OUTLIER].iloc[0],
        "outlier_rejection_above_at_high_noise": lambda c: c.bias[OUTLIER].iloc[-1],
        "outlier_rejection_smaller_spread": lambda c: (c.spread[OUTLIER] / c.spread[MAXIMUM]).max(),
        "outlier_rejection_more_even": lambda c: (
            abs(c.log_skew[OUTLIER]) - abs(c.log_skew[MAXIMUM])
        ),
        "outlier_rejection_equally_bad": lambda c: (c.bias[OUTLIER] / c.bias[MAXIMUM]).abs().max(),
        "model_invalidation_varies_least": lambda c: _over_others(c.mean.max() - c.mean.min()),
        "model_invalidation_even_spread": lambda c: c.log_skew[INVALIDATION],
        "model_invalidation_larger_spread": _larger_spread,
        "model_invalidation_performs_well": lambda c: _over_others(c.bias.abs().max()),
        "model_invalidation_less_sensitive": _less_sensitive,
    }
    compute = {name: _of_curves(curve) for name, curve in curves.items()}
    return sentences("study", {"few_points_near_limit": _near_limit, **compute})


def _of_curves(compute: Callable[[_Curves], float]) -> Statistic:
    def value(tables: Tables) -> float:
        columns = ["mean_mm", "min_mm", "max_mm", "bias_mm"]
        table = pd.DataFrame(dict(tables["study_summary"])).pivot(
            index="noise_mm", columns="assessor", values=columns
        )
        return float(compute(_Curves(*(table[name].astype(float) for name in columns))))

    return value


def _over_others(sizes: pd.Series) -> float:
    """Model invalidation's over the smaller of the conventional ones; NaN where that is 0."""
    least = sizes[CONVENTIONAL].min()
    return sizes[INVALIDATION] / least if least > 0.0 else math.nan


def _unequally_affected(curves: _Curves) -> float:
    changes = (curves.mean.iloc[-1] - curves.mean.iloc[0])[ASSESSORS].abs()
    return changes.max() / changes.min() if changes.min() > 0.0 else math.nan


def _larger_spread(curves: _Curves) -> float:
    upper = curves.spread.iloc[len(curves.spread) // 2 :]
    return (upper[INVALIDATION] / upper[OUTLIER]).mean()


def _less_sensitive(curves: _Curves) -> float:
    noise = curves.mean.index.to_numpy()
    return _over_others(((noise - noise.mean()) @ curves.mean).abs())


def _near_limit(tables: Tables) -> float:
    errors = np.asarray(tables["assessment_points"]["true_error_mm"], dtype=float)
    return float(np.mean(errors > 0.9 * errors.max()))


def history_claims() -> list[Claim]:
    """Claims about a simulation that invalidates the model and one that cannot."""
    return sentences(
        "history",
        {
            "fig5_rejected": _on(REJECTED, _beyond_alpha),
            "fig5_approaches_alpha": _on(
                REJECTED,
                lambda r: r["iteration"][r["rejection_probability"] >= 0.8 * r["alpha"]].min(),
            ),
            "fig5_few_true_errors_above": _on(REJECTED, _share_above),
            "fig5_worst_point_resampled": _on(REJECTED, _worst_resampled),
            "fig5_average_stays_above": _on(REJECTED, _average_above),
            "fig5_prioritises_bad_points": _on(
                REJECTED, lambda r: (r["true_mm"] > r["eta_mm"])[r["repeat"] > 1].mean()
            ),
            "fig5_larger_eta_not_rejected": _on(LARGER, _beyond_alpha),
            "fig6_not_rejected": _on(KEPT, _beyond_alpha),
            "fig6_resampling_by_noise": _on(KEPT, _only_noise),
            "fig6_recovers": _on(KEPT, _recovers),
        },
    )


def _on(example: str, compute: Callable[[pd.DataFrame], float]) -> Statistic:
    """The statistic of the rows of one example, in order; NaN where it is not there."""

    def value(tables: Tables) -> float:
        rows = pd.DataFrame(dict(tables["histories"]))
        rows = rows[rows["example"] == example].sort_values("iteration", ignore_index=True)
        return math.nan if rows.empty else float(compute(rows))

    return value


def _beyond_alpha(rows: pd.DataFrame) -> float:
    return (rows["rejection_probability"] - rows["alpha"]).iloc[-1]


def _share_above(rows: pd.DataFrame) -> float:
    before = rows[: rows["true_mm"].argmax()].drop_duplicates("point")
    return (before["true_mm"] > before["eta_mm"]).mean()


def _worst_resampled(rows: pd.DataFrame) -> float:
    first = rows["true_mm"].argmax()
    return (rows["point"][first + 1 :] == rows["point"][first]).mean()


def _average_above(rows: pd.DataFrame) -> float:
    at_worst = rows[rows["point"] == rows["point"][rows["true_mm"].argmax()]]
    return (at_worst["averaged_mm"] - at_worst["eta_mm"]).iloc[-1]


def _only_noise(rows: pd.DataFrame) -> float:
    excess = (rows["true_mm"] - rows["eta_mm"]).max()
    return excess if (rows["repeat"] > 1).any() else max(excess, 0.0)


def _recovers(rows: pd.DataFrame) -> float:
    exceeding = rows["rejection_probability"] > rows["alpha"]
    starts = (exceeding & ~exceeding.shift(fill_value=False)).sum()
    # Of all stretches above alpha only the last one can still be above it at the end.
    return 1.0 - exceeding.iloc[-1] / starts if starts else math.nan
