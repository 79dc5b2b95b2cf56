"""Sentences of section IV-C about two simulations followed step by step (Figs. 5 and 6)."""

from __future__ import annotations

import math
from collections.abc import Callable

import pandas as pd

from kinacc.study.claims.claim import Claim, Statistic, Tables, sentences

REJECTED, LARGER, KEPT = "rejected", "rejected_larger_eta", "not_rejected"


def history_claims() -> list[Claim]:
    """Claims about a simulation that invalidates the model and one that cannot."""
    return sentences(
        "history",
        {
            "fig5_rejected": _on(REJECTED, _beyond_alpha),
            "fig5_approaches_alpha": _on(REJECTED, _first_near_alpha),
            "fig5_few_true_errors_above": _on(REJECTED, _share_above),
            "fig5_worst_point_resampled": _on(REJECTED, _worst_resampled),
            "fig5_average_stays_above": _on(REJECTED, _average_above),
            "fig5_prioritises_bad_points": _on(REJECTED, _prioritises),
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
    last = rows.iloc[-1]
    return last["rejection_probability"] - last["alpha"]


def _first_near_alpha(rows: pd.DataFrame) -> float:
    return rows["iteration"][rows["rejection_probability"] >= 0.8 * rows["alpha"]].min()


def _share_above(rows: pd.DataFrame) -> float:
    before = rows[: rows["true_mm"].argmax()].drop_duplicates("point")
    return (before["true_mm"] > before["eta_mm"]).mean()


def _worst_resampled(rows: pd.DataFrame) -> float:
    first = rows["true_mm"].argmax()
    return (rows["point"][first + 1 :] == rows["point"][first]).mean()


def _average_above(rows: pd.DataFrame) -> float:
    at_worst = rows[rows["point"] == rows["point"][rows["true_mm"].argmax()]]
    return at_worst["averaged_mm"].iloc[-1] - rows["eta_mm"].iloc[0]


def _prioritises(rows: pd.DataFrame) -> float:
    return (rows["true_mm"] > rows["eta_mm"])[rows["repeat"] > 1].mean()


def _only_noise(rows: pd.DataFrame) -> float:
    excess = rows["true_mm"].max() - rows["eta_mm"].iloc[0]
    return excess if (rows["repeat"] > 1).any() else max(excess, 0.0)


def _recovers(rows: pd.DataFrame) -> float:
    exceeding = rows["rejection_probability"] > rows["alpha"]
    starts = (exceeding & ~exceeding.shift(fill_value=False)).sum()
    # Of all stretches above alpha only the last one can still be above it at the end.
    return 1.0 - exceeding.iloc[-1] / starts if starts else math.nan
