"""Whether readings contradict what is stated of their noise: its size, and that it is normal."""

from __future__ import annotations

import math

import numpy as np

from kinacc.assess.noise_factor import FEWEST, Contrasts
from kinacc.assess.statement import Reason

SCATTER = 4e-3  # probability that noise as stated is ever called larger in a campaign
BESIDE_REFERENCES = 1e-3  # the same where alarms of reference poses have their part of 1 % in all
_LARGER = 1.2  # times the noise stated: what readings are held against
_LARGER_THAN_TESTED = 1.5  # the same where a test says the noise: no test tells it to 20 %
_TAILS = 5.5  # logarithm of the ratio of likelihoods that tells heavy tails; false in 0.2 %
_HEAVY = 8.0  # degrees of freedom of the heavy-tailed readings that normal ones are held against
_STEP = 0.7  # of the standard deviation of a logarithm of scale: nodes of the integral over it


def scatter_alarm(
    found: Contrasts, *, tested: float = math.inf, margin: float = 1.0, false: float = SCATTER
) -> Reason | None:
    """That readings of the same block differ more than the noise stated allows.

    ``tested``: degrees of freedom of the test that the noise stated comes from; ``margin``: how
    many times that noise the bounds allow for; ``false``: the probability that noise as stated is
    ever called larger. Ratio of two likelihoods: noise 1.2 times as large as allowed for (1.5 times
    where it was tested) over noise as large. Where it is no larger the ratio's mean never exceeds
    1, so it ever exceeds 1/p with a probability of p at most (Ville's inequality).
    """
    squares = np.sum(found.values**2, axis=1)
    if not squares.size:
        return None
    if larger_over_stated(squares / margin**2, tested).max() < -math.log(false):
        return None
    ratio = math.sqrt(float(np.mean(squares)) / 3.0)
    return Reason("scatter", {"ratio": ratio, "freedom": found.freedom})


def larger_over_stated(squares: np.ndarray, tested: float) -> np.ndarray:
    """Logarithm of the ratio of :func:`scatter_alarm` after each of the squared contrasts (n,).

    With a noise that was tested, both likelihoods are averaged over all sizes of it.
    """
    freedom, total = 3.0 * np.arange(1, len(squares) + 1), np.cumsum(squares)
    larger = _LARGER if math.isinf(tested) else _LARGER_THAN_TESTED
    smaller = total / larger**2
    if math.isinf(tested):
        nearer = 0.5 * (total - smaller)
    else:
        nearer = 0.5 * (tested + freedom) * np.log((tested + total) / (tested + smaller))
    return nearer - freedom * math.log(larger)


def tails_alarm(found: Contrasts) -> Reason | None:
    """That some differences within blocks are too far out for normal readings of any noise.

    Ratio of two likelihoods, each averaged over all sizes of noise: heavy-tailed readings (half of
    the weight each: axes by themselves, and all three axes at once) over normal ones. Where
    readings are normal its mean is 1 at all times, so it ever exceeds exp(5.5) with a probability
    of 0.4 % at most (Ville's inequality); how far it jumps beyond makes that 0.2 %.
    """
    if found.freedom < FEWEST:
        return None
    ratio = heavy_over_normal(found.values)
    if ratio <= _TAILS:
        return None
    farthest = float(np.abs(found.values).max() / _scale(found.values))
    return Reason("tails", {"farthest": farthest, "freedom": found.freedom})


def heavy_over_normal(values: np.ndarray) -> float:
    """Logarithm of the ratio of likelihoods of :func:`tails_alarm` for contrasts (n, 3)."""
    from scipy.special import gammaln

    numbers = values.size
    step = _STEP / math.sqrt(2.0 * numbers)
    log_scale = math.log(_scale(values)) + np.arange(-0.8, 0.8 + step, step)
    square, per_square = values**2, np.exp(-2.0 * log_scale)[:, None]
    by_axis = _log_t(square.reshape(-1) * per_square, 1).sum(axis=1)
    at_once = _log_t(square.sum(axis=1) * per_square, 3).sum(axis=1)
    at_scale = np.logaddexp(by_axis, at_once) - math.log(2.0) - numbers * log_scale
    heavy = np.logaddexp.reduce(at_scale)
    half = numbers / 2.0
    total = float(np.sum(square))
    normal = gammaln(half) - math.log(2.0) - half * math.log(math.pi * total)
    return float(heavy + math.log(step) - normal)


def _log_t(square: np.ndarray, axes: int) -> np.ndarray:
    """Log density of Student's t of so many axes and variance 1, at squared distances."""
    from scipy.special import gammaln

    power, spread = (_HEAVY + axes) / 2.0, _HEAVY - 2.0
    log_peak = gammaln(power) - gammaln(_HEAVY / 2.0) - axes / 2.0 * math.log(math.pi * spread)
    return log_peak - power * np.log1p(square / spread)


def _scale(values: np.ndarray) -> float:
    """Standard deviation of normal contrasts, by their median: far ones do not move it."""
    return float(np.median(np.abs(values))) / 0.6745
