"""99 % quantile of a gamma distribution fitted to the sizes read, as Tables I and III use it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates, OnceCampaign, check_budget
from kinacc.assess.statement import CONFIDENCE, REGION, Reason, Statement
from kinacc.errors import Problem, refuse

_FEWEST = 10  # different sizes that make a distribution
_IMPROBABLE = 0.01  # chance of the largest reading below which the fit counts as contradicted


@dataclass(frozen=True)
class GammaQuantile(AdaptiveAssessor):
    """Read every point once, fit a gamma distribution, state its quantile.

    Speaks of the region: the size that a share ``share`` of it does not exceed. A value without
    bounds. Source: the 99 % gamma figures of Tables I and III; maximum likelihood, location 0.
    Assumes candidates drawn at random from the region, sizes that follow a gamma distribution, and
    noise that is small beside them: the noise is in the readings and so in the quantile. Says that
    this is broken where noise makes up more than a quarter of the mean square of the readings, and
    where the largest reading would be met less than once in a hundred campaigns.
    """

    measurements: int
    share: float = 0.99
    name: ClassVar[str] = "gamma_quantile"
    confidence: ClassVar[float] = CONFIDENCE  # of limits on single points; its statement has none

    def __post_init__(self) -> None:
        problems = check_budget(self.measurements, self.confidence)
        if not 0.0 < self.share < 1.0:
            problems.append(Problem("share", f"{self.share}", "above 0 and below 1"))
        refuse(problems, f"{self.name} cannot work with these settings")

    def begin(self, candidates: Candidates) -> GammaCampaign:
        """A new campaign."""
        return GammaCampaign(self, candidates)


class GammaCampaign(OnceCampaign):
    """See :class:`GammaQuantile`."""

    settings: GammaQuantile

    def statements(self) -> tuple[Statement, ...]:
        """The quantile, or why it means nothing."""
        from scipy.special import gammainc

        from kinacc.distributions import fit, quantile

        visited, share = self.ledger.visited, self.settings.share
        sizes = self.ledger.sizes_mm()
        if len(np.unique(sizes)) < _FEWEST or sizes.min() <= 0.0:
            few = Reason("few_sizes", {"read": len(visited), "needed": _FEWEST})
            return (Statement(REGION, share=share, withheld=few),)
        fitted = fit(sizes)
        below = float(gammainc(fitted.shape, sizes.max() / fitted.scale))
        beyond = -math.expm1(len(sizes) * math.log(below))
        noise = 3.0 * float(np.mean(self.ledger.noise_mm[visited] ** 2) / np.mean(sizes**2))
        withheld = None
        if noise > 0.25:
            withheld = Reason("much_noise", {"part": noise})
        elif beyond < _IMPROBABLE:
            withheld = Reason("not_gamma")
        value = quantile(fitted, share)
        return (Statement(REGION, value, share=share, withheld=withheld),)
