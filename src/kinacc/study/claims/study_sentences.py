"""Sentences of the abstract and of sections IV-C and V about the three assessors (Fig. 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kinacc.study.claims.claim import (
    Claim,
    Finding,
    Tables,
    above,
    below,
    negative,
    positive,
    within,
)

CONVENTIONAL = ("maximum", "outlier_rejection")
ASSESSORS = (*CONVENTIONAL, "model_invalidation")


@dataclass(frozen=True)
class _Curve:
    """One assessor's line of Fig. 4, by rising noise; arrays (levels,) in mm."""

    noise: np.ndarray
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    bias: np.ndarray

    @property
    def above(self) -> np.ndarray:
        return self.high - self.mean

    @property
    def below(self) -> np.ndarray:
        return self.mean - self.low

    @property
    def spread(self) -> np.ndarray:
        return self.high - self.low

    @property
    def truth(self) -> float:
        return float(np.mean(self.mean - self.bias))

    @property
    def log_skew(self) -> float:
        """Mean over noise of log((max - mean) / (mean - min)); 0 is even, positive upward."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.mean(np.log(self.above / self.below)))


def _curve(tables: Tables, assessor: str) -> _Curve:
    rows = tables["study_summary"]
    chosen = np.flatnonzero(rows["assessor"] == assessor)
    chosen = chosen[np.argsort(rows["noise_mm"][chosen])]
    columns = ("noise_mm", "mean_mm", "min_mm", "max_mm", "bias_mm")
    return _Curve(*(np.asarray(rows[name][chosen], dtype=float) for name in columns))


def study_claims() -> list[Claim]:
    """Claims that Fig. 4 and the text around it make."""
    summary = ("study_summary",)
    return [
        Claim(
            "few_points_near_limit",
            "Just a few per cent of the points approach the defining accuracy limit",
            "share of points whose true error exceeds 90 % of the largest; holds up to 0.05",
            ("assessment_points",),
            _near_limit,
        ),
        Claim(
            "all_affected_by_noise",
            "All methods are affected by the magnitude of the noise, some more than others",
            "largest over smallest |mean at the highest noise - mean at the lowest| of the three "
            "methods; holds when it exceeds 2",
            summary,
            _unequally_affected,
        ),
        Claim(
            "maximum_overestimates",
            "The maximum measurement is larger than the true accuracy",
            "smallest bias over the noise levels, mm; holds when positive",
            summary,
            lambda t: positive(float(np.min(_curve(t, "maximum").bias))),
        ),
        Claim(
            "maximum_much_larger",
            "The maximum measurement tends to be much larger than the true accuracy",
            "mean bias over the noise levels, as a share of the true accuracy; holds above 0.1",
            summary,
            _much_larger,
        ),
        Claim(
            "maximum_grows_with_noise",
            "The maximum measurement grows with the noise",
            "smallest step of the mean from one noise level to the next, mm; holds when positive",
            summary,
            lambda t: positive(_smallest_step(_curve(t, "maximum"))),
        ),
        Claim(
            "maximum_skewed_upward",
            "The range of the maximum measurement is skewed to values above its mean",
            "mean over noise of log((max - mean) / (mean - min)); holds when positive",
            summary,
            lambda t: positive(_curve(t, "maximum").log_skew),
        ),
        Claim(
            "outlier_rejection_grows_with_noise",
            "The accuracy assessed by outlier rejection grows with the noise",
            "smallest step of the mean from one noise level to the next, mm; holds when positive",
            summary,
            lambda t: positive(_smallest_step(_curve(t, "outlier_rejection"))),
        ),
        Claim(
            "outlier_rejection_below_at_low_noise",
            "Outlier rejection is below the true accuracy at low noise",
            "bias at the lowest noise level, mm; holds when negative",
            summary,
            lambda t: negative(float(_curve(t, "outlier_rejection").bias[0])),
        ),
        Claim(
            "outlier_rejection_above_at_high_noise",
            "Outlier rejection is above the true accuracy at high noise",
            "bias at the highest noise level, mm; holds when positive",
            summary,
            lambda t: positive(float(_curve(t, "outlier_rejection").bias[-1])),
        ),
        Claim(
            "outlier_rejection_smaller_spread",
            "The range of outlier rejection is much smaller than that of the maximum measurement",
            "largest ratio of the two ranges over the noise levels; holds below 1",
            summary,
            _outlier_spread,
        ),
        Claim(
            "outlier_rejection_more_even",
            "The range of outlier rejection is more even about its mean than the maximum's",
            "|mean log((max - mean) / (mean - min))| of outlier rejection minus the maximum's; "
            "holds when negative",
            summary,
            lambda t: negative(
                abs(_curve(t, "outlier_rejection").log_skew) - abs(_curve(t, "maximum").log_skew)
            ),
        ),
        Claim(
            "outlier_rejection_equally_bad",
            "Outlier rejection can be as bad as the maximum measurement",
            "largest ratio of |bias| of outlier rejection to the maximum's over the noise levels; "
            "holds from 1",
            summary,
            _equally_bad,
        ),
        Claim(
            "model_invalidation_varies_least",
            "Model invalidation is the most consistent across the noise levels",
            "range of its mean over the noise levels, over the smaller range of the other two; "
            "holds below 1",
            summary,
            _varies_least,
        ),
        Claim(
            "model_invalidation_even_spread",
            "The range of model invalidation is even about its mean",
            "mean over noise of log((max - mean) / (mean - min)); holds within +-log 1.5",
            summary,
            lambda t: within(_curve(t, "model_invalidation").log_skew, math.log(1.5)),
        ),
        Claim(
            "model_invalidation_larger_spread",
            "The range of model invalidation exceeds outlier rejection's at large noise",
            "mean ratio of the two ranges over the upper half of the noise levels; holds above 1",
            summary,
            _larger_spread,
        ),
        Claim(
            "model_invalidation_performs_well",
            "Model invalidation performs well across all noise levels",
            "its largest |bias| over the noise levels, over the smaller of the others' largest; "
            "holds below 1",
            summary,
            _performs_well,
        ),
        Claim(
            "model_invalidation_less_sensitive",
            "Model invalidation is less sensitive to noise than the conventional methods",
            "|slope of the mean against noise|, over the smaller slope of the other two; "
            "holds below 1",
            summary,
            _less_sensitive,
        ),
    ]


def _ratio(numerator: float, denominator: float) -> float:
    return numerator / denominator if denominator > 0.0 else math.nan


def _near_limit(tables: Tables) -> Finding:
    errors = np.asarray(tables["assessment_points"]["true_error_mm"], dtype=float)
    share = float(np.mean(errors > 0.9 * errors.max()))
    return Finding(share, share <= 0.05)


def _smallest_step(curve: _Curve) -> float:
    return float(np.min(np.diff(curve.mean))) if curve.mean.size > 1 else math.nan


def _unequally_affected(tables: Tables) -> Finding:
    changes = [abs(_curve(tables, name).mean[[0, -1]] @ (-1, 1)) for name in ASSESSORS]
    return above(_ratio(max(changes), min(changes)), 2.0)


def _much_larger(tables: Tables) -> Finding:
    curve = _curve(tables, "maximum")
    return above(float(np.mean(curve.bias)) / curve.truth, 0.1)


def _outlier_spread(tables: Tables) -> Finding:
    ratio = _curve(tables, "outlier_rejection").spread / _curve(tables, "maximum").spread
    return below(float(np.max(ratio)), 1.0)


def _equally_bad(tables: Tables) -> Finding:
    ratio = np.abs(_curve(tables, "outlier_rejection").bias / _curve(tables, "maximum").bias)
    value = float(np.max(ratio))
    return Finding(value, value >= 1.0)


def _varies_least(tables: Tables) -> Finding:
    ranges = {name: float(np.ptp(_curve(tables, name).mean)) for name in ASSESSORS}
    others = min(ranges[name] for name in CONVENTIONAL)
    return below(_ratio(ranges["model_invalidation"], others), 1.0)


def _larger_spread(tables: Tables) -> Finding:
    ours, theirs = _curve(tables, "model_invalidation"), _curve(tables, "outlier_rejection")
    upper = slice(ours.noise.size // 2, None)
    return above(float(np.mean(ours.spread[upper] / theirs.spread[upper])), 1.0)


def _performs_well(tables: Tables) -> Finding:
    worst = {name: float(np.max(np.abs(_curve(tables, name).bias))) for name in ASSESSORS}
    others = min(worst[name] for name in CONVENTIONAL)
    return below(_ratio(worst["model_invalidation"], others), 1.0)


def _less_sensitive(tables: Tables) -> Finding:
    slopes = {name: _slope(_curve(tables, name)) for name in ASSESSORS}
    others = min(slopes[name] for name in CONVENTIONAL)
    return below(_ratio(slopes["model_invalidation"], others), 1.0)


def _slope(curve: _Curve) -> float:
    centred = curve.noise - curve.noise.mean()
    scale = float(centred @ centred)
    return abs(float(centred @ curve.mean)) / scale if scale > 0.0 else math.nan
