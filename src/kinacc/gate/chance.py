"""Whether a statistic of errors is worse than before by more than chance.

A gate fails where the lower end of the one-sided interval of the difference (now less before) lies
beyond what is allowed: where the true difference is exactly what is allowed, it fails in at most
``1 - confidence`` of the cases. Configurations are resampled, as readings of one err together;
runs held out at the same measurements are resampled together, others each by itself. Of the
percentile of resampled differences and Student's interval by their spread the lower end counts:
each by itself fails too often where errors are few or skewed (``benchmarks/README.md``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from kinacc.distributions import gamma99
from kinacc.errors import InputError

_SEED, _RESAMPLES = 16, 1999
FEWEST, FEWEST_OF_QUANTILE = 20, 200  # configurations needed for an interval


def _gamma(sizes: np.ndarray) -> float:
    try:
        return gamma99(sizes)
    except InputError:  # an error of exactly zero
        return float("nan")


# Statistics of sizes (n,), by the last word of a figure's name.
STATISTICS: Mapping[str, Callable[[np.ndarray], float]] = {
    "mean": lambda sizes: float(sizes.mean()),
    "rms": lambda sizes: float(np.sqrt(np.mean(sizes**2))),
    "p99": lambda sizes: float(np.quantile(sizes, 0.99)),
    "p99_gamma": _gamma,
    "largest": lambda sizes: float(sizes.max()),
}


@dataclass(frozen=True)
class Sample:
    """Sizes (n,) of errors, and the configuration (n,) that each was measured at."""

    sizes: np.ndarray
    configuration: np.ndarray

    @property
    def count(self) -> int:
        """Number of configurations."""
        return len(np.unique(self.configuration))


@dataclass(frozen=True)
class Change:
    """By how much a statistic is worse: ``difference`` (now less before), and ``least`` of it.

    ``least`` is the lower end of the one-sided interval, NaN where the data do not suffice:
    ``open`` is the reason.
    """

    difference: float
    least: float
    open: str = ""


def change(statistic: str, now: Sample, before: Sample, paired: bool, confidence: float) -> Change:
    """The change of a ``statistic`` of :data:`STATISTICS` between two samples.

    ``paired``: configurations of both are numbered alike and were measured once for both.
    """
    of, count = STATISTICS[statistic], min(now.count, before.count)
    difference = of(now.sizes) - of(before.sizes)
    fewest = FEWEST_OF_QUANTILE if statistic == "p99" else FEWEST
    why = ""
    if paired and np.array_equal(now.sizes, before.sizes):
        return Change(difference, difference)
    if statistic == "largest":
        if paired and len(now.sizes) == len(before.sizes):
            return Change(difference, difference)
        why = f"largest of {len(now.sizes)} and of {len(before.sizes)} other errors; use p99"
    elif count < fewest:
        why = f"{count} poses; {fewest} are needed"
    elif np.isnan(difference):
        why = "an error is exactly zero: no gamma distribution fits"
    if why:
        return Change(difference, np.nan, why)
    drawn = _resampled(of, now, before, paired)
    spread = drawn.std() * np.sqrt(count / (count - 1.0))
    student = difference - scipy.special.stdtrit(count - 1.0, confidence) * spread
    return Change(difference, float(min(np.quantile(drawn, 1.0 - confidence), student)))


def _resampled(
    of: Callable[[np.ndarray], float], now: Sample, before: Sample, paired: bool
) -> np.ndarray:
    """Differences of a statistic (about 2000,) between resamples of two samples."""
    draw, results = np.random.default_rng(_SEED), []
    apart = 0 if paired else now.configuration.max() + 1
    both = np.concatenate([now.configuration, before.configuration + apart])
    number = np.unique(both, return_inverse=True)[1]
    counts = [number.max() + 1] if paired else [now.count, before.count]
    for _ in range(_RESAMPLES):
        parts = [np.bincount(draw.integers(count, size=count), minlength=count) for count in counts]
        times = np.concatenate(parts)[number]
        new = now.sizes.repeat(times[: len(now.sizes)])
        old = before.sizes.repeat(times[len(now.sizes) :])
        if len(new) and len(old):
            results.append(of(new) - of(old))
    return np.array(results)
