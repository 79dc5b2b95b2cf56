"""Distribution-free statement on the region: p % of it has errors below X."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, PositiveInt
from pydantic.dataclasses import dataclass
from scipy.special import bdtr, bdtrc, chdtri, ndtr

from kinacc.assess.adaptive import STRICT, AdaptiveAssessor, Confidence, Ledger
from kinacc.assess.statement import CONFIDENCE, REGION, Reason, Statement

_DEVIATIONS = 1.0  # added to a reading for its upper limit
_LIFTED = 0.01  # probability that noise alone lifts a reading by more than is taken off it


@dataclass(frozen=True, config=STRICT)
class RegionShare(AdaptiveAssessor):
    """Read random points once; order statistics bound the size that ``share`` does not exceed.

    Upper bound: a reading plus one standard deviation is at least the true size with probability
    84 %, for the reading's component along the true error is normal. So at
    each of the largest (1 - share) of the errors it is at least the quantile wanted with that
    probability, and the number of points where it is, is binomial at least. The bound is the
    largest of these sums but so many that fewer are met with the error allowed. Lower bound: the
    same turned round, with the length of the noise vector. Source: Wilks, Ann. Math. Stat. 12
    (1941) 91-96, for exact readings; the noise by the argument above.

    Assumes that the points were drawn at random from the region, which readings cannot show, and
    normal readings of known covariance; nothing of the errors. Withheld where the points are too
    few for any order statistic.
    """

    measurements: PositiveInt
    share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.9
    confidence: Confidence = CONFIDENCE
    name: ClassVar[str] = "region_share"

    def state(self, ledger: Ledger) -> tuple[Statement, ...]:
        """The bounds, or how many points they need."""
        error, sizes = 1.0 - self.confidence, ledger.sizes_mm()
        count, ranks = len(sizes), np.arange(1, len(sizes) + 1)
        met = (1.0 - self.share) * float(ndtr(_DEVIATIONS))
        # The last k such that fewer than k of so many points are met with the error allowed.
        upper = int(np.sum(bdtr(ranks - 1, count, met) <= error))
        if upper == 0:
            needed = math.ceil(math.log(error) / math.log1p(-met))
            few = {"read": count, "share": self.share, "needed": needed}
            return (Statement(REGION, share=self.share, withheld=Reason("few_points", few)),)
        passing = (1.0 - self.share) + self.share * _LIFTED
        lower = int(np.sum(bdtrc(ranks - 1, count, passing) > error))  # before the first such k
        spread = np.sqrt(np.linalg.eigvalsh(ledger.spread_mm2[ledger.visited])[:, -1])
        raised = np.sort(sizes + _DEVIATIONS * spread)[::-1]
        lowered = np.sort(sizes - math.sqrt(float(chdtri(3, _LIFTED))) * spread)[::-1]
        statement = Statement(
            REGION,
            value_mm=float(np.quantile(sizes, self.share)),
            lower_mm=max(float(lowered[lower]), 0.0) if lower < count else 0.0,
            upper_mm=float(raised[upper - 1]),
            confidence=self.confidence,
            share=self.share,
            assumption=Reason("drawn_at_random"),
        )
        return (statement,)
