"""A permutation test of new configurations against held-out ones, and the smallest change it finds.

Where nothing changed, the new configurations are a random sample of all, new and held out. The
test statistic is the larger of two ranks: of the squared errors after a fit of what moved, and of
the part of these that offsets of the joints explain. The second shows a joint that lost its zero
while that is small beside all errors. A configuration enters by the products of its columns
(motions of what moved, offsets of the joints, error). Products add up over a sample, so that base
and tool are fitted to every sample as to the new configurations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from kinacc.calibration.least_squares import one_thread

LEVEL = 0.01  # weekly checks of an unchanged arm fail once in two years
POWER = 0.8
_DRAWS = 4000
_SINGULAR = 1e-9  # of the largest eigenvalue: smaller ones are unidentifiable directions
_LEAST_MM = 0.05  # rms: joints that move less by 1 mrad, base and tool fitted, are not tested
_COPIES, _STEPS, _TOO_LARGE = 8, 2, 20.0


class ErrorColumns(NamedTuple):
    """Configurations of equally many readings: ``columns`` (n, r, p + k + 1), mm.

    The first p = ``fitted`` columns are motions of base and tool that are fitted, the next k the
    movement by 1 mrad (1 mm) of each joint, the last one the error.
    """

    columns: np.ndarray
    fitted: int

    @property
    def products(self) -> np.ndarray:
        """Products (n, q, q) of the columns."""
        return np.swapaxes(self.columns, 1, 2) @ self.columns

    def times(self, factor: float) -> ErrorColumns:
        """Errors multiplied by a factor."""
        size = self.columns.shape[2]
        return self._replace(columns=self.columns * np.append(np.ones(size - 1), factor))

    @property
    def rank(self) -> int:
        """Number of parameters that the fit of what moved determines."""
        motions = self.columns[..., : self.fitted]
        flat = motions.reshape(motions.shape[0] * motions.shape[1], self.fitted)
        return int(np.linalg.matrix_rank(flat, tol=1e-6))


@dataclass(frozen=True)
class PermutationTest:
    """Result of the test; rms position errors in mm.

    ``expected_mm`` is the median of random samples, ``limit_mm`` the limit of the test at the
    level ``LEVEL``, ``probability`` the p-value. ``joint`` (1-based) is the joint whose
    ``offset`` (mrad or mm) explains most of the errors.
    """

    rms_mm: float
    expected_mm: float
    limit_mm: float
    probability: float
    joint: int
    offset: float


@one_thread
def compare(held_out: ErrorColumns, new: ErrorColumns) -> PermutationTest:
    """Test ``new`` configurations, with errors after the fit of what moved, against all."""
    observed = _statistics(new.products.mean(axis=0, keepdims=True), new)
    # The fit made the new errors smaller: this is undone before samples are drawn.
    retained = 1.0 - new.rank / new.columns[..., 0].size
    pool = np.concatenate([held_out.products, new.times(retained**-0.5).products])
    drawn = _statistics(_samples(pool, len(new.columns)), new)
    squares, explained = (np.append(a, b) for a, b in zip(observed[:2], drawn[:2], strict=True))
    scores, along, size = _scores(squares, explained), observed.along[0], observed.size[0]
    offsets = np.divide(along, size, out=np.zeros_like(size), where=size > _LEAST_MM**2)
    joint = int(np.argmax(offsets * along))
    sizes = squares[0], np.median(drawn.squares), _limits(squares, explained)[0]
    rms_mm, expected_mm, limit_mm = map(float, np.sqrt(sizes))
    probability = float(np.mean(scores >= scores[0]))
    return PermutationTest(
        rms_mm, expected_mm, limit_mm, probability, joint + 1, float(offsets[joint])
    )


@one_thread
def smallest_changes(held_out: ErrorColumns, count: int) -> tuple[float, np.ndarray]:
    """Smallest changes detected in 80 % of samples of ``count`` configurations.

    A factor on all errors, and an offset (k,) of each joint in mrad or mm; inf where none is. Of
    more configurations than are held out it is that of as many.
    """
    count = min(count, len(held_out.columns))
    drawn, factor = _statistics(_samples(held_out.products, count), held_out), 1.0
    copies = np.tile(held_out.products, (_COPIES, 1, 1))
    some = np.random.default_rng(1).integers(len(copies), size=_COPIES * count)
    for _ in range(_STEPS):  # the changed configurations are in the pool of the samples
        changed = held_out.times(factor).products[some % len(held_out.columns)]
        pool = np.concatenate([copies, changed])
        limits = _limits(*_statistics(_samples(pool, count), held_out)[:2])
        with np.errstate(divide="ignore"):
            needed = np.minimum(limits[0] / drawn.squares, limits[1] / drawn.explained)
        factor = min(float(np.sqrt(np.quantile(needed, POWER))), _TOO_LARGE)
    size, offsets = np.maximum(drawn.size, 0.0), []
    for limit, value in zip(limits, drawn[:2], strict=True):
        beyond = np.maximum(limit - value, 0.0)[:, None]  # value + 2 offset along + offset^2 size
        root = np.sqrt(drawn.along**2 + size * beyond) - drawn.along
        offsets.append(np.where(size > _LEAST_MM**2, root / np.maximum(size, _LEAST_MM**2), np.inf))
    offset = np.quantile(np.minimum(*offsets), POWER, axis=0, method="higher")
    return factor if factor < _TOO_LARGE else np.inf, offset


class _Statistics(NamedTuple):
    """Of m samples, for each reading: mean squared error (m,) after the fit of what moved, the
    part (m,) explained by offsets of joints, errors ``along`` these (m, k), their ``size`` (m, k).
    """

    squares: np.ndarray
    explained: np.ndarray
    along: np.ndarray
    size: np.ndarray


def _statistics(sums: np.ndarray, like: ErrorColumns) -> _Statistics:
    """Statistics of mean products (m, q, q) of samples, of configurations ``like`` these."""
    fitted = like.fitted
    cross = sums[:, :fitted, fitted:]
    absorbed = np.swapaxes(cross, 1, 2) @ _inverse(sums[:, :fitted, :fitted]) @ cross
    rest = (sums[:, fitted:, fitted:] - absorbed) / (like.columns.shape[1] // 3)
    along, joints = rest[:, :-1, -1], rest[:, :-1, :-1]
    offsets = (_inverse(joints, _LEAST_MM**2) @ along[..., None])[..., 0]
    explained = np.sum(offsets * along, axis=1)
    return _Statistics(rest[:, -1, -1], explained, along, np.diagonal(joints, axis1=1, axis2=2))


def _samples(products: np.ndarray, size: int) -> np.ndarray:
    """Mean products (draws, q, q) of random samples without repeats."""
    rng, total = np.random.default_rng(0), len(products)
    weight = np.zeros((_DRAWS, total))
    chosen = np.argpartition(rng.random((_DRAWS, total)), size - 1, axis=1)[:, :size]
    np.put_along_axis(weight, chosen, 1.0, axis=1)
    return (weight @ products.reshape(total, -1)).reshape(_DRAWS, *products.shape[1:]) / size


def _inverse(products: np.ndarray, least: float = 0.0) -> np.ndarray:
    """Inverses (m, p, p) of symmetric matrices, zero along directions of an eigenvalue to 0."""
    values, vectors = np.linalg.eigh(products)
    large = values > np.maximum(_SINGULAR * values[:, -1:], least)
    inverse = np.where(large, 1.0 / np.where(large, values, 1.0), 0.0)
    return (vectors * inverse[:, None]) @ np.swapaxes(vectors, 1, 2)


def _scores(squares: np.ndarray, explained: np.ndarray) -> np.ndarray:
    """The larger rank (m,) of both statistics."""
    return np.maximum(*(scipy.stats.rankdata(values, "max") for values in (squares, explained)))


def _limits(squares: np.ndarray, explained: np.ndarray) -> tuple[float, float]:
    """Limits of both statistics that together all but ``LEVEL`` of the samples keep."""
    share = np.quantile(_scores(squares, explained), 1.0 - LEVEL) / len(squares)
    return float(np.quantile(squares, share)), float(np.quantile(explained, share))
