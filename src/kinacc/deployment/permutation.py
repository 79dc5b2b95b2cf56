"""A permutation test of new configurations against held-out ones, and the smallest change it finds.

Where nothing changed, new configurations are a random sample of all, new and held out. The test
statistic is the larger of two ranks: that of the squared errors that a fit of what moved leaves,
and that of what offsets of the joints explain of these, which shows a joint that lost its zero
while that is small beside all errors. A configuration enters by the products of its columns
(motions of what moved, offsets of the joints, error), which add up over any sample, so that base
and tool are fitted to every sample as they are to the new configurations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

LEVEL = 0.01  # of weekly checks of an arm that does not change one in two years fails
POWER = 0.8
_DRAWS = 4000
_SINGULAR = 1e-9  # of the largest eigenvalue: less is a direction that is not seen
_HARDLY_MM = 0.05  # rms: joints that 1 mrad of moves less, base and tool fitted, are not looked at
_COPIES, _STEPS, _TOO_LARGE = 8, 2, 20.0


class Columns(NamedTuple):
    """Configurations of equally many readings: ``columns`` (n, r, p + k + 1), mm.

    The first ``fitted`` = p columns are motions of base and tool that are fitted anew, the next k
    what 1 mrad (1 mm) of each joint moves, the last one the error.
    """

    columns: np.ndarray
    fitted: int

    @property
    def products(self) -> np.ndarray:
        """Products (n, q, q) of the columns."""
        return np.swapaxes(self.columns, 1, 2) @ self.columns

    def times(self, factor: float) -> Columns:
        """Errors as many times as large."""
        size = self.columns.shape[2]
        return self._replace(columns=self.columns * np.append(np.ones(size - 1), factor))

    @property
    def readings(self) -> int:
        """Readings of a configuration."""
        return self.columns.shape[1] // 3

    @property
    def rank(self) -> int:
        """How many numbers a fit of what moved finds."""
        motions = self.columns[..., : self.fitted]
        flat = motions.reshape(motions.shape[0] * motions.shape[1], -1)
        return int(np.linalg.matrix_rank(flat, tol=1e-6)) if self.fitted else 0


class Held(NamedTuple):
    """New configurations against samples of all, rms errors in mm.

    ``limit_mm`` is kept by all but ``LEVEL`` of the samples where nothing changed, ``expected_mm``
    is their median; ``probability``: of a sample as extreme. ``offset`` (mrad or mm) of ``joint``
    (from 1) explains most of the errors.
    """

    rms_mm: float
    expected_mm: float
    limit_mm: float
    probability: float
    joint: int
    offset: float


def held_to(held_out: Columns, new: Columns) -> Held:
    """Hold ``new`` configurations, of errors that the fit of what moved left, to all there are."""
    count = len(new.columns)
    own = _statistics(new.products.mean(axis=0, keepdims=True), new)
    # What the fit took off the new ones on the whole is put back before samples are drawn.
    left = 1.0 - new.rank / new.columns[..., 0].size
    pool = np.concatenate([held_out.products, new.times(left**-0.5).products])
    drawn = _statistics(_samples(pool, count), new)
    squares, explained = (np.append(a, b) for a, b in zip(own[:2], drawn[:2], strict=True))
    scores, along, of = _scores(squares, explained), own.along[0], np.diagonal(own.of[0])
    offsets = np.divide(along, of, out=np.zeros_like(of), where=of > _HARDLY_MM**2)
    joint = int(np.argmax(offsets * along))
    sizes = squares[0], np.median(drawn.squares), _limits(squares, explained)[0]
    probability = float(np.mean(scores >= scores[0]))
    rms_mm, expected_mm, limit_mm = map(float, np.sqrt(sizes))
    return Held(rms_mm, expected_mm, limit_mm, probability, joint + 1, float(offsets[joint]))


def smallest_changes(held_out: Columns, count: int) -> tuple[float, np.ndarray]:
    """Changes found in four of five samples of ``count`` configurations, or more.

    A factor on all errors, and an offset (k,) of each joint in mrad or mm; inf where none is.
    """
    found, factor = _statistics(_samples(held_out.products, count), held_out), 1.0
    copies = np.tile(held_out.products, (_COPIES, 1, 1))
    some = np.random.default_rng(1).integers(len(copies), size=_COPIES * count)
    for _ in range(_STEPS):  # the changed ones are among those that they are held to
        changed = held_out.times(factor).products[some % len(held_out.columns)]
        among = _statistics(_samples(np.concatenate([copies, changed]), count), held_out)
        limits = _limits(*among[:2])
        with np.errstate(divide="ignore"):
            needed = np.minimum(limits[0] / found.squares, limits[1] / found.explained)
        factor = min(float(np.sqrt(np.quantile(needed, POWER))), _TOO_LARGE)
    own, offsets = np.diagonal(found.of, axis1=1, axis2=2), []
    for limit, value in zip(limits, found[:2], strict=True):
        beyond = np.maximum(limit - value, 0.0)[:, None]  # value + 2 offset along + offset^2 own
        root = np.sqrt(found.along**2 + own * beyond) - found.along
        offsets.append(np.where(own > _HARDLY_MM**2, root / np.maximum(own, _HARDLY_MM**2), np.inf))
    return factor if factor < _TOO_LARGE else np.inf, np.quantile(
        np.minimum(*offsets), POWER, axis=0, method="higher"
    )


class _Statistics(NamedTuple):
    """Of m samples, for each reading: mean square (m,) that the fit of what moved leaves, what
    offsets of joints explain of it (m,), errors ``along`` these (m, k), and products (m, k, k)."""

    squares: np.ndarray
    explained: np.ndarray
    along: np.ndarray
    of: np.ndarray


def _statistics(sums: np.ndarray, like: Columns) -> _Statistics:
    """Statistics of summed products (m, q, q) of samples, configurations ``like`` these."""
    fitted = like.fitted
    left = sums[:, fitted:, fitted:]
    if fitted:
        cross = sums[:, :fitted, fitted:]
        left = left - np.swapaxes(cross, 1, 2) @ _inverse(sums[:, :fitted, :fitted]) @ cross
    left = left / like.readings
    along, of = left[:, :-1, -1], left[:, :-1, :-1]
    found = (_inverse(of, _HARDLY_MM**2) @ along[..., None])[..., 0]
    return _Statistics(left[:, -1, -1], np.sum(found * along, axis=1), along, of)


def _samples(products: np.ndarray, size: int) -> np.ndarray:
    """Mean products (draws, q, q) of random samples, without repeats where there are enough."""
    rng, total = np.random.default_rng(0), len(products)
    if size > total:
        weight = rng.multinomial(size, np.full(total, 1.0 / total), _DRAWS).astype(float)
    else:
        weight = np.zeros((_DRAWS, total))
        chosen = np.argsort(rng.random((_DRAWS, total)), axis=1)[:, :size]
        np.put_along_axis(weight, chosen, 1.0, axis=1)
    return (weight @ products.reshape(total, -1)).reshape(_DRAWS, *products.shape[1:]) / size


def _inverse(products: np.ndarray, hardly: float = 0.0) -> np.ndarray:
    """Inverses (m, p, p) of symmetric matrices, zero along what is ``hardly`` or not seen."""
    values, vectors = np.linalg.eigh(products)
    kept = values > np.maximum(_SINGULAR * values[:, -1:], hardly)
    inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
    return (vectors * inverse[:, None]) @ np.swapaxes(vectors, 1, 2)


def _scores(squares: np.ndarray, explained: np.ndarray) -> np.ndarray:
    """The larger rank (m,) of both statistics."""
    return np.maximum(*(scipy.stats.rankdata(each, "max") for each in (squares, explained)))


def _limits(squares: np.ndarray, explained: np.ndarray) -> tuple[float, float]:
    """What all but ``LEVEL`` of samples keep of both statistics together."""
    share = np.quantile(_scores(squares, explained), 1.0 - LEVEL) / len(squares)
    return float(np.quantile(squares, share)), float(np.quantile(explained, share))
