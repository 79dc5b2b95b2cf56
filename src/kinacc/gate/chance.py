"""Whether a statistic of errors is worse than before by more than chance makes of it.

The question: is it surer than asked that the statistic, over all poses like those measured, is
worse by more than what is allowed? So a gate fails where the lower end of the one-sided interval
of the difference is beyond what is allowed; where the true difference is what is allowed exactly,
it fails in at most ``1 - beyond_chance`` of the cases. (The other reading, worse at all and the
difference found larger than allowed, fails half of all arms that are at the limit.)

Chance is from resampling configurations: readings of one go together, as they err together. Runs
held out at the same measurements are resampled together (the poses are then the same, and chance
is that of differences at them); else each by itself. Means, and what is smooth in means, have two
lower ends: that of resampled studentised differences, and Student's; quantiles the percentile of
resampled differences and the normal one of their spread. The lower of the two counts: each by
itself fails too often where errors are few or skewed (``benchmarks/gate_chance.py``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from kinacc.distributions import gamma99
from kinacc.errors import InputError

_SEED, _RESAMPLES, _AT_ONCE = 16, 1999, 500_000
_STEP = 1e-6  # relative, of slopes by differences
_NOTHING = 1e-12  # a spread that is rounding
_LEAST_SCALE = 1e-3  # of a mean, for its steps
FEWEST, FEWEST_OF_QUANTILE = 20, 200  # configurations of which chance can be told
QUANTILE = 0.99


def _gamma(sizes: np.ndarray) -> float:
    try:
        return gamma99(sizes)
    except InputError:  # an error of exactly zero
        return float("nan")


# Statistics of sizes (n,), by the last word of a figure's name, with what they are called.
STATISTICS: Mapping[str, tuple[Callable[[np.ndarray], float], str]] = {
    "mean": (lambda sizes: float(sizes.mean()), "mean"),
    "rms": (lambda sizes: float(np.sqrt(np.mean(sizes**2))), "root mean square"),
    "p99": (lambda sizes: float(np.quantile(sizes, QUANTILE)), "empirical 99 % quantile"),
    "p99_gamma": (_gamma, "99 % gamma quantile"),
    "largest": (lambda sizes: float(sizes.max()), "largest"),
}


def statistic_of(statistic: str, sizes: np.ndarray) -> float:
    """A statistic of sizes (n,), NaN where it is not defined."""
    return STATISTICS[statistic][0](sizes)


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

    ``least`` is the lower end of the one-sided interval, NaN where it cannot be told: ``open`` says
    why.
    """

    difference: float
    least: float
    open: str = ""


def change(statistic: str, now: Sample, before: Sample, paired: bool, confidence: float) -> Change:
    """The change of a ``statistic`` of :data:`STATISTICS` between two samples.

    ``paired``: configurations of both are numbered alike and were measured once for both.
    """
    difference = statistic_of(statistic, now.sizes) - statistic_of(statistic, before.sizes)
    if paired and _same(now, before):
        return Change(difference, difference)
    if statistic == "largest":
        return _change_of_largest(difference, now, before, paired)
    fewest = FEWEST_OF_QUANTILE if statistic == "p99" else FEWEST
    count = min(now.count, before.count)
    if count < fewest:
        why = f"{count} poses are too few to tell chance from change; {fewest} are needed"
        return Change(difference, np.nan, why)
    if np.isnan(difference):
        why = "an error is exactly zero, to which no gamma distribution can be fitted"
        return Change(difference, np.nan, why)
    if statistic == "p99":
        return Change(difference, _least_of_quantiles(now, before, paired, confidence))
    return Change(difference, _least_of_means(statistic, now, before, paired, confidence))


def _change_of_largest(difference: float, now: Sample, before: Sample, paired: bool) -> Change:
    """That of maxima: resampling tells nothing of what was not drawn, so only equal poses tell."""
    one, other = len(now.sizes), len(before.sizes)
    if one != other:
        why = f"a maximum of {one} errors says nothing beside one of {other}; use p99"
        return Change(difference, np.nan, why)
    if not paired:
        why = "a maximum of other readings is another by chance, nobody knows by how much; use p99"
        return Change(difference, np.nan, why)
    return Change(difference, difference)


def _same(now: Sample, before: Sample) -> bool:
    return np.array_equal(now.sizes, before.sizes) and np.array_equal(
        now.configuration, before.configuration
    )


def _gamma99(mean: np.ndarray, mean_log: np.ndarray) -> np.ndarray:
    """99 % quantiles (m,) of gamma distributions by means of sizes and of their logarithms (m,)."""
    gap = np.maximum(np.log(mean) - mean_log, 1e-12)
    shape = (3.0 - gap + np.sqrt((gap - 3.0) ** 2 + 24.0 * gap)) / (12.0 * gap)
    for _ in range(4):  # quadratic, from 1.5 %
        miss = np.log(shape) - scipy.special.digamma(shape) - gap
        slope = shape**2 * scipy.special.zeta(2.0, shape) - shape
        shape = 1.0 / (1.0 / shape - miss / slope)
    return scipy.special.gammaincinv(shape, QUANTILE) * mean / shape


# What is smooth in means: features (n, p) of sizes (n,), and the statistic (m,) of means (m, p).
_SMOOTH: Mapping[str, tuple[Callable, Callable]] = {
    "mean": (lambda x: x[:, None], lambda means: means[:, 0]),
    "rms": (lambda x: x[:, None] ** 2, lambda means: np.sqrt(means[:, 0])),
    "p99_gamma": (
        lambda x: np.stack([x, np.log(x)], axis=1),
        lambda means: _gamma99(means[:, 0], means[:, 1]),
    ),
}


class _Group:
    """Sums (c, q) of features over configurations that are resampled together.

    ``parts``: columns of each sample, of which the first is the number of its errors, and the sign
    with which its statistic counts.
    """

    def __init__(self, statistic: str, samples: Sequence[tuple[Sample, float]]) -> None:
        features, self.of = _SMOOTH[statistic]
        every = np.concatenate([each.configuration for each, _ in samples])
        numbers = np.unique(every)
        sums: list[np.ndarray] = []
        self.parts: list[tuple[slice, float]] = []
        for sample, sign in samples:
            found = features(sample.sizes)
            rows = np.column_stack([np.ones(len(found)), found])
            own = np.zeros((len(numbers), rows.shape[1]))
            np.add.at(own, np.searchsorted(numbers, sample.configuration), rows)
            begin = sum(each.shape[1] for each in sums)
            self.parts.append((slice(begin, begin + rows.shape[1]), sign))
            sums.append(own)
        self.sums = np.concatenate(sums, axis=1)
        count, width = self.sums.shape
        self.squares = (self.sums[:, :, None] * self.sums[:, None, :]).reshape(count, width**2)

    def seen(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The signed sum (m,) of the samples' statistics, and its variance (m,).

        Of configurations with weights (m, c), by how the sum changes with each mean.
        """
        count, width = self.sums.shape
        means = weights @ self.sums / count
        squares = (weights @ self.squares / count).reshape(-1, width, width)
        scale = _STEP * np.maximum(np.abs(self.sums).mean(axis=0), _LEAST_SCALE)
        slopes, value = np.empty_like(means), np.zeros(len(means))
        for own, sign in self.parts:
            value += sign * self._of(means[:, own])
            for column, step in enumerate(np.diag(scale[own])):
                ahead, behind = self._of(means[:, own] + step), self._of(means[:, own] - step)
                slopes[:, own.start + column] = sign * (ahead - behind) / (2.0 * step[column])
        spread = np.einsum("mi,mij,mj->m", slopes, squares, slopes)
        return value, np.maximum(spread, 0.0) / (count - 1)

    def _of(self, means: np.ndarray) -> np.ndarray:
        """The statistic (m,) by means (m, 1 + p) over configurations, the first of the number."""
        return self.of(means[:, 1:] / means[:, :1])


def _least_of_means(
    statistic: str, now: Sample, before: Sample, paired: bool, confidence: float
) -> float:
    """Lower end of the difference of what is smooth in means; see above."""
    signed = [(now, 1.0), (before, -1.0)]
    groups = [_Group(statistic, own) for own in ([signed] if paired else [[x] for x in signed])]
    sizes = [len(each.sums) for each in groups]
    whole = [group.seen(np.ones((1, size))) for group, size in zip(groups, sizes, strict=True)]
    difference = float(sum(value[0] for value, _ in whole))
    parts = np.array([variance[0] for _, variance in whole])
    error = float(np.sqrt(parts.sum()))
    if error <= _NOTHING * max(abs(difference), _NOTHING):
        return difference
    freedom = parts.sum() ** 2 / np.sum(parts**2 / (np.array(sizes) - 1.0))
    student = difference - scipy.special.stdtrit(freedom, confidence) * error
    ratios = []
    for weights in _resampled(sizes):
        seen = [group.seen(own) for group, own in zip(groups, weights, strict=True)]
        moved = sum(value for value, _ in seen) - difference
        ratios.append(moved / np.sqrt(np.maximum(sum(spread for _, spread in seen), _NOTHING)))
    drawn = difference - np.quantile(np.concatenate(ratios), confidence) * error
    return float(min(student, drawn))


def _least_of_quantiles(now: Sample, before: Sample, paired: bool, confidence: float) -> float:
    """Lower end of the difference of empirical quantiles; see above."""
    numbers = [np.unique(each.configuration) for each in (now, before)]
    if paired:
        numbers = [np.union1d(*numbers)]
    place = [
        np.searchsorted(own, each.configuration)
        for own, each in zip([numbers[0], numbers[-1]], (now, before), strict=True)
    ]
    order = [np.argsort(each.sizes, kind="stable") for each in (now, before)]
    found = []
    for weights in _resampled([len(each) for each in numbers]):
        values = [
            _quantiles(each.sizes[rows], own[:, at[rows]])
            for each, rows, at, own in zip(
                (now, before), order, place, (weights[0], weights[-1]), strict=True
            )
        ]
        found.append(values[0] - values[1])
    drawn = np.concatenate(found)
    drawn = drawn[np.isfinite(drawn)]
    difference = statistic_of("p99", now.sizes) - statistic_of("p99", before.sizes)
    normal = difference - scipy.special.ndtri(confidence) * float(drawn.std())
    return float(min(np.quantile(drawn, 1.0 - confidence), normal))


def _quantiles(sizes: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Empirical quantiles (m,) of sorted sizes (n,), each weights (m, n) times; NaN of none."""
    until = np.cumsum(weights, axis=1)
    place = QUANTILE * (until[:, -1] - 1.0)
    low = np.floor(place)
    first, second = (
        sizes[np.minimum((until <= each[:, None]).sum(axis=1), len(sizes) - 1)]
        for each in (low, np.minimum(low + 1.0, until[:, -1] - 1.0))
    )
    found = first + (place - low) * (second - first)
    return np.where(until[:, -1] > 0, found, np.nan)


def _resampled(sizes: Sequence[int]) -> Iterator[list[np.ndarray]]:
    """Weights (m, c) of the configurations of each group, some resamples at a time."""
    draw = np.random.default_rng(_SEED)
    at_once = max(1, min(_RESAMPLES, _AT_ONCE // max(sizes)))
    for begin in range(0, _RESAMPLES, at_once):
        count = min(at_once, _RESAMPLES - begin)
        weights = []
        for size in sizes:
            chosen = draw.integers(size, size=(count, size)) + size * np.arange(count)[:, None]
            drawn = np.bincount(chosen.ravel(), minlength=count * size)
            weights.append(drawn.reshape(count, size).astype(float))
        yield weights
