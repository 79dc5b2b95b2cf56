"""Distribution-free statement on the region: p % of it has errors below X."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates, OnceCampaign, check_budget
from kinacc.assess.statement import CONFIDENCE, REGION, Reason, Statement
from kinacc.errors import Problem, refuse

_LOWER_SLIP = 0.01  # probability that noise alone lifts a reading by more than is taken off it


@dataclass(frozen=True)
class RegionShare(AdaptiveAssessor):
    """Read random points once; order statistics bound the size that ``share`` does not exceed.

    Upper bound: a reading plus ``deviations`` standard deviations is at least the true size with
    probability Phi(deviations), for the reading's component along the true error is normal. So at
    each of the largest (1 - share) of the errors it is at least the quantile wanted with that
    probability, and the number of points where it is, is binomial at least. The bound is the
    largest of these sums but so many that fewer are met with the error allowed. Lower bound: the
    same turned round, with the length of the noise vector. Source: Wilks, Ann. Math. Stat. 12
    (1941) 91-96, for exact readings; the noise by the argument above.

    Assumes that the points were drawn at random from the region, which readings cannot show, and
    normal readings of known covariance; nothing of the errors. Withheld where the points are too
    few for any order statistic.
    """

    measurements: int
    share: float = 0.9
    deviations: float = 1.0
    confidence: float = CONFIDENCE
    name: ClassVar[str] = "region_share"

    def __post_init__(self) -> None:
        problems = check_budget(self.measurements, self.confidence)
        if not 0.0 < self.share < 1.0:
            problems.append(Problem("share", f"{self.share}", "above 0 and below 1"))
        if not self.deviations >= 0.0:
            problems.append(Problem("deviations", f"{self.deviations}", "0 or more"))
        refuse(problems, f"{self.name} cannot work with these settings")

    def begin(self, candidates: Candidates) -> RegionShareCampaign:
        """A new campaign."""
        return RegionShareCampaign(self, candidates)


class RegionShareCampaign(OnceCampaign):
    """See :class:`RegionShare`."""

    settings: RegionShare

    def statements(self) -> tuple[Statement, ...]:
        """The bounds, or how many points they need."""
        from scipy.special import chdtri, ndtr

        chosen = self.settings
        error = 1.0 - chosen.confidence
        count = len(self.ledger.visited)
        met = (1.0 - chosen.share) * float(ndtr(chosen.deviations))
        rank = largest_rank(count, met, error)
        if rank == 0:
            needed = math.ceil(math.log(error) / math.log1p(-met))
            few = {"read": count, "share": chosen.share, "needed": needed}
            withheld = Reason("few_points", few)
            return (Statement(REGION, share=chosen.share, withheld=withheld),)
        sizes, spread = self.ledger.sizes_mm(), self._spread()
        raised = np.sort(sizes + chosen.deviations * spread)[::-1]
        lowered = np.sort(sizes - math.sqrt(float(chdtri(3, _LOWER_SLIP))) * spread)[::-1]
        passing = (1.0 - chosen.share) + chosen.share * _LOWER_SLIP
        lower_rank = smallest_rank(count, passing, error)
        lower = float(lowered[lower_rank - 1]) if lower_rank <= count else 0.0
        said = Statement(
            REGION,
            value_mm=float(np.quantile(sizes, chosen.share)),
            lower_mm=max(lower, 0.0),
            upper_mm=float(raised[rank - 1]),
            confidence=chosen.confidence,
            share=chosen.share,
            assumption=Reason("drawn_at_random"),
        )
        return (said,)

    def _spread(self) -> np.ndarray:
        """Largest standard deviation of each mean reading over the directions, mm."""
        noises = [self.ledger.noise(point) for point in self.ledger.visited]
        return np.array(
            [
                each if isinstance(each, float) else math.sqrt(np.linalg.eigvalsh(each)[-1])
                for each in noises
            ]
        )


def largest_rank(count: int, probability: float, error: float) -> int:
    """Largest k such that fewer than k of ``count`` happen with at most ``error``; 0 if none."""
    from scipy.special import bdtr

    ranks = np.arange(1, count + 1)
    allowed = ranks[bdtr(ranks - 1, count, probability) <= error]
    return int(allowed[-1]) if allowed.size else 0


def smallest_rank(count: int, probability: float, error: float) -> int:
    """Smallest k such that k or more of ``count`` happen with at most ``error``."""
    from scipy.special import bdtrc

    ranks = np.arange(1, count + 1)
    allowed = ranks[bdtrc(ranks - 1, count, probability) <= error]
    return int(allowed[0]) if allowed.size else count + 1
