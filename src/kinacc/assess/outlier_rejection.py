"""Outlier Rejection (eqs. 13-14): the largest measured error that no rule calls an outlier."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinacc.assess.world import Assessment, Assessor, World
from kinacc.distributions import gamma99


def normal_limit(magnitudes: np.ndarray) -> float:
    """Mean + 1.96 standard deviations (divisor n) of the magnitudes."""
    return float(magnitudes.mean() + 1.96 * magnitudes.std())


def tukey_limit(magnitudes: np.ndarray) -> float:
    """Tukey's upper fence: third quartile + 1.5 interquartile ranges (linear quantiles)."""
    low, high = np.percentile(magnitudes, (25.0, 75.0))
    return float(high + 1.5 * (high - low))


LIMITS: dict[str, Callable[[np.ndarray], float]] = {
    "normal": normal_limit,
    "gamma": gamma99,
    "iqr": tukey_limit,
}


def largest_inlier(magnitudes: np.ndarray, outlier_rule: str) -> float:
    """Largest of the magnitudes (n,) not above the limit c of the rule (eqs. 13-14), same unit."""
    # No rule puts its limit below the smallest magnitude but for rounding, where all are equal.
    limit = max(LIMITS[outlier_rule](magnitudes), float(magnitudes.min()))
    return float(magnitudes[magnitudes <= limit].max())


@dataclass(frozen=True)
class OutlierRejection(Assessor):
    """Measure each point once, up to ``measurements`` points, drop outliers, take the largest."""

    measurements: int
    outlier_rule: str
    name: ClassVar[str] = "outlier_rejection"
    switches: ClassVar[dict[str, tuple[str, ...]]] = {"outlier_rule": tuple(LIMITS)}

    def assess(self, world: World) -> Assessment:
        """Eq. 13 over the first readings."""
        magnitudes = world.magnitudes_mm(self.measurements)
        assessed = largest_inlier(magnitudes, self.outlier_rule)
        return Assessment(assessed, magnitudes.size, magnitudes.size)
