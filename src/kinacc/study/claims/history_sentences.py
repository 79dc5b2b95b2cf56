"""Sentences of section IV-C about two simulations followed step by step (Figs. 5 and 6)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from kinacc.study.claims.claim import Claim, Finding, Tables, above
from kinacc.tables.columns import Columns

REJECTED, LARGER, KEPT = "rejected", "rejected_larger_eta", "not_rejected"


def history_claims() -> list[Claim]:
    """Claims about a simulation that invalidates the model and one that cannot."""
    evidence = ("histories",)
    return [
        Claim(
            "fig5_rejected",
            "With a bound below the true accuracy the model is rejected at the last measurement",
            "rejection probability after the last measurement minus alpha; holds above 0",
            evidence,
            _on(REJECTED, _rejected),
        ),
        Claim(
            "fig5_approaches_alpha",
            "The rejection probability approaches alpha after only 20 iterations",
            "first iteration whose rejection probability is at least 0.8 alpha",
            evidence,
            _on(REJECTED, _first_near_alpha),
            paper=20.0,
            tolerance=20.0,
            arm_specific=True,
        ),
        Claim(
            "fig5_few_true_errors_above",
            "Before the worst point the true errors are primarily below the bound",
            "share of the points visited before the worst one whose true error exceeds eta; "
            "holds up to 0.05",
            evidence,
            _on(REJECTED, _few_above),
        ),
        Claim(
            "fig5_worst_point_resampled",
            "Once the worst point is found it is measured again for the rest of the run",
            "share of the measurements after the worst point's first that go to the worst point; "
            "holds from 0.95",
            evidence,
            _on(REJECTED, _worst_resampled),
        ),
        Claim(
            "fig5_average_stays_above",
            "Further resampling of the worst point gives an average that remains above the bound",
            "average at the worst point after the last measurement minus eta, mm; holds above 0",
            evidence,
            _on(REJECTED, _average_above),
        ),
        Claim(
            "fig5_prioritises_bad_points",
            "Resampling goes to points whose true error is beyond the bound",
            "share of the repeated measurements made where the true error exceeds eta; "
            "holds above 0.5",
            evidence,
            _on(REJECTED, _prioritises),
        ),
        Claim(
            "fig5_larger_eta_not_rejected",
            "With a slightly larger bound (0.844 for 0.834) the same simulation is not rejected",
            "rejection probability after the last measurement minus alpha; holds up to 0",
            evidence,
            _on(LARGER, _kept),
        ),
        Claim(
            "fig6_not_rejected",
            "With a bound above the true accuracy the model cannot be invalidated",
            "rejection probability after the last measurement minus alpha; holds up to 0",
            evidence,
            _on(KEPT, _kept),
        ),
        Claim(
            "fig6_resampling_by_noise",
            "All true errors are below the bound, so resampling is due to noise alone",
            "largest true error visited minus eta, mm, with at least one measurement repeated; "
            "holds below 0",
            evidence,
            _on(KEPT, _only_noise),
        ),
        Claim(
            "fig6_recovers",
            "Resampling brings the rejection probability back below alpha",
            "share of the visits to a point that are measured again after exceeding alpha and end "
            "at or below it; holds when all do",
            evidence,
            _on(KEPT, _recovers),
        ),
    ]


def _on(example: str, compute: Callable[[Columns], Finding]) -> Callable[[Tables], Finding]:
    """A finding on the rows of one example, in order; NaN where it is not there."""

    def found(tables: Tables) -> Finding:
        rows = tables["histories"]
        chosen = np.flatnonzero(rows["example"] == example)
        if not chosen.size:
            return Finding(math.nan)
        chosen = chosen[np.argsort(rows["iteration"][chosen])]
        return compute({name: np.asarray(column)[chosen] for name, column in rows.items()})

    return found


def _rejected(rows: Columns) -> Finding:
    excess = float(rows["rejection_probability"][-1] - rows["alpha"][-1])
    return Finding(excess, excess > 0.0)


def _kept(rows: Columns) -> Finding:
    excess = _rejected(rows).value
    return Finding(excess, excess <= 0.0)


def _first_near_alpha(rows: Columns) -> Finding:
    near = rows["rejection_probability"] >= 0.8 * rows["alpha"]
    return Finding(float(rows["iteration"][np.argmax(near)]) if near.any() else math.nan)


def _first_at_worst(rows: Columns) -> int:
    return int(np.argmax(rows["true_mm"]))


def _few_above(rows: Columns) -> Finding:
    before = slice(0, _first_at_worst(rows))
    _, firsts = np.unique(rows["point"][before], return_index=True)
    if not firsts.size:
        return Finding(math.nan)
    share = float(np.mean(rows["true_mm"][firsts] > rows["eta_mm"][0]))
    return Finding(share, share <= 0.05)


def _worst_resampled(rows: Columns) -> Finding:
    first = _first_at_worst(rows)
    later = rows["point"][first + 1 :]
    if not later.size:
        return Finding(math.nan)
    share = float(np.mean(later == rows["point"][first]))
    return Finding(share, share >= 0.95)


def _average_above(rows: Columns) -> Finding:
    at_worst = np.flatnonzero(rows["point"] == rows["point"][_first_at_worst(rows)])
    return above(float(rows["averaged_mm"][at_worst[-1]] - rows["eta_mm"][0]), 0.0)


def _prioritises(rows: Columns) -> Finding:
    repeated = rows["repeat"] > 1
    if not repeated.any():
        return Finding(math.nan)
    return above(float(np.mean(rows["true_mm"][repeated] > rows["eta_mm"][repeated])), 0.5)


def _only_noise(rows: Columns) -> Finding:
    excess = float(np.max(rows["true_mm"]) - rows["eta_mm"][0])
    return Finding(excess, bool(excess < 0.0 and (rows["repeat"] > 1).any()))


def _recovers(rows: Columns) -> Finding:
    exceeding = rows["rejection_probability"] > rows["alpha"]
    starts = np.flatnonzero(exceeding & ~np.concatenate([[False], exceeding[:-1]]))
    if not starts.size:
        return Finding(math.nan)
    ended = [not exceeding[start:].all() for start in starts]
    return Finding(float(np.mean(ended)), all(ended))
