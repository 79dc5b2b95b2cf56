"""99 % quantile of a gamma distribution fitted to the sizes read, as Tables I and III use it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinacc.assess.adaptive import Ledger, OnceAssessor, check_settings
from kinacc.assess.statement import CONFIDENCE, REGION, Reason, Statement

_MUCH_NOISE = 0.25  # of the mean square of the readings
_FEWEST = 10  # different sizes that make a distribution
_IMPROBABLE = 0.01  # chance of the largest reading below which the fit counts as contradicted


@dataclass(frozen=True)
class GammaQuantile(OnceAssessor):
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
    confidence: float = CONFIDENCE  # of limits on single points; its statement has none
    name: ClassVar[str] = "gamma_quantile"

    def __post_init__(self) -> None:
        check_settings(self, ("share", 0.0 < self.share < 1.0, "above 0 and below 1"))

    def state(self, ledger: Ledger) -> tuple[Statement, ...]:
        """The quantile, or why it means nothing."""
        from scipy.special import gammainc

        from kinacc.distributions import fit, quantile

        visited, sizes = ledger.visited, ledger.sizes_mm()
        if len(np.unique(sizes)) < _FEWEST or sizes.min() <= 0.0:
            few = Reason("few_sizes", {"read": len(visited), "needed": _FEWEST})
            return (Statement(REGION, share=self.share, withheld=few),)
        fitted = fit(sizes)
        below = float(gammainc(fitted.shape, sizes.max() / fitted.scale))
        beyond = -math.expm1(len(sizes) * math.log(below))
        noise = 3.0 * float(np.mean(ledger.noise_mm[visited] ** 2) / np.mean(sizes**2))
        withheld = Reason("not_gamma") if beyond < _IMPROBABLE else None
        if noise > _MUCH_NOISE:
            withheld = Reason("much_noise", {"part": noise})
        value_mm = quantile(fitted, self.share)
        return (Statement(REGION, value_mm, share=self.share, withheld=withheld),)
