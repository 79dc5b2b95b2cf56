"""What readings of poses that were gone to again and again say of instrument and arm.

Three nested kinds of scatter: of readings of one visit (the instrument), of visits of a pose from
one side, and of the sides a pose is approached from (both the arm). Their variances are found by
the analysis of variance of unweighted means, the noise of one reading is their sum, and its degrees
of freedom are those of Welch and Satterthwaite.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy import ndarray
from scipy.special import chdtrc, gammaincinv

AXES = ["x_mm", "y_mm", "z_mm"]
# A side is of one pose, and a visit is of one side.
POSE, SIDE, VISIT = ["pose"], ["pose", "side"], ["pose", "side", "visit"]
# Levels at which axes, and poses, are taken to differ. Axes that are wrongly averaged make bounds
# too small along one: at this level 5 % become 6.0 at worst of 40 degrees of freedom, 6.5 of 20.
EQUAL, UNEQUAL = 0.2, 0.01
_FAR = 6.0  # medians from the middle of a pose's readings
_FEWEST_VISITS = 3  # whose distances from their middle can differ
_FEWEST = 5  # degrees of freedom that a covariance is told from an equal one by


@dataclass(frozen=True)
class Parts:
    """Covariances (3, 3), mm^2: of readings of one visit, of visits from one side, of sides.

    NaN where the readings do not tell. ``whole`` is that of a reading, of ``freedom`` degrees for
    each axis (0: not told). It is less than the sum of the others where one of these is 0.
    """

    instrument: ndarray
    visits: ndarray
    sides: ndarray
    whole: ndarray
    freedom: float


@dataclass(frozen=True)
class Noise:
    """Covariance (3, 3), mm^2, of one reading of a campaign, right up to one factor.

    The factor has ``freedom`` degrees. ``by_axis``: probability that axes differ so by chance; they
    are taken as equal where ``is_even``. ``rounded`` (3,): whether an axis is that of rounding.
    """

    covariance_mm2: ndarray
    freedom: float
    by_axis: float
    is_even: bool
    rounded: ndarray

    @property
    def std_mm(self) -> ndarray:
        """Standard deviation per axis (3,)."""
        return np.sqrt(np.diag(self.covariance_mm2))


def parts(read: pd.DataFrame) -> Parts:
    """Covariances of instrument, visits and sides, and of a reading from any side.

    Parameters
    ----------
    read
        Readings: labels ``pose``, ``side`` and ``visit``, and ``AXES`` in mm.

    Returns
    -------
    Parts
        By the analysis of variance of unweighted means; degrees of freedom by Welch and
        Satterthwaite.
    """
    values = read[AXES].to_numpy()
    shares: list[ndarray] = []
    squares, degrees = np.zeros((3, 3, 3)), np.zeros(3)
    combined = np.eye(3)  # of which mean squares each variance is the difference
    for level, group in enumerate(_nested(read)):
        squares[level], degrees[level] = scatter(values, group)
        # What part of the variance of each level below is in the mean square of this one.
        weight = (1.0 - 1.0 / np.bincount(group)[group]) / max(degrees[level], 1.0)
        below = np.array([share @ weight for share in shares])
        combined[level] -= below @ combined[:level]
        values, count = means(values, group)
        shares = [means(share[:, None], group)[0][:, 0] / count for share in shares]
        shares.append(1.0 / count)
    unknown, known = np.full((3, 3), np.nan), degrees > 0
    instrument, visits, sides = (
        _no_less_than_zero(variance) if is_known else unknown
        for variance, is_known in zip(np.tensordot(combined, squares, 1), known, strict=True)
    )
    if not known[1]:
        return Parts(instrument, unknown, unknown, unknown, 0.0)
    # Of the variances as they are: with negative ones raised to 0 it would be too large.
    weights = combined.sum(axis=0)
    terms = (weights * np.trace(squares, axis1=1, axis2=2))[known]
    spread = np.sum(terms**2 / degrees[known])
    freedom = terms.sum() ** 2 / spread if spread > 0.0 else degrees[1]
    whole = np.tensordot(weights, squares, 1)
    return Parts(instrument, visits, sides, whole, float(freedom))


def noise_of(results: Parts, resolution_mm: ndarray) -> Noise | None:
    """The noise of a reading, no less than rounding.

    Parameters
    ----------
    results
        Covariances of :func:`parts`.
    resolution_mm
        Steps (3,) of the values.

    Returns
    -------
    Noise or None
        None where no pose was revisited. Equal along the axes, with three times their degrees of
        freedom, unless they are shown to differ: then a covariance, every direction with the
        degrees of one.
    """
    if not results.freedom:
        return None
    by_axis = differ_by_axis(results.whole, results.freedom)
    is_even = not by_axis < EQUAL
    whole = np.eye(3) * np.trace(results.whole) / 3.0 if is_even else results.whole
    least = resolution_mm**2 / 12.0
    least = np.full(3, least.max()) if is_even else least
    lacking = np.maximum(least - np.diag(whole), 0.0)
    freedom = (3.0 if is_even else 1.0) * results.freedom
    return Noise(whole + np.diag(lacking), freedom, by_axis, is_even, lacking > 0.0)


def differ_by_axis(covariance_mm2: ndarray, freedom: float) -> float:
    """Probability of a covariance (3, 3) so unlike an equal one, where it is equal (Mauchly).

    NaN for fewer than five degrees of freedom, or a covariance of less than three directions.
    """
    sizes = np.linalg.eigvalsh(covariance_mm2)
    if freedom < _FEWEST or sizes[0] <= 1e-12 * sizes[-1]:
        return math.nan
    shape = float(np.sum(np.log(sizes)) - 3.0 * np.log(np.mean(sizes)))
    return float(chdtrc(5, -(freedom - 23.0 / 18.0) * shape))


def differ_by_pose(read: pd.DataFrame, resolution_mm: ndarray) -> tuple[float, pd.Series]:
    """Probability that poses scatter so differently by chance (Bartlett), and their scatter.

    Of the visits of every pose from one side, over that of all poses, where a pose tells it. Less
    than the rounding of ``resolution_mm`` (3,) counts as that.
    """
    visits = read.groupby(VISIT, sort=False)[AXES].mean()
    groups = visits.groupby(SIDE, sort=False)
    centred = visits - groups.transform("mean")
    nu = 3.0 * (groups.size() - 1).groupby(POSE, sort=False).sum()
    nu = nu[nu > 0.0]
    if len(nu) < 2:
        return math.nan, nu * math.nan
    rounding = np.diag(resolution_mm**2 / 12.0 + 1e-24)
    inverse = np.linalg.inv(3.0 * (centred.T @ centred) / nu.sum() + rounding)
    square = ((centred @ inverse) * centred.to_numpy()).sum(axis=1)
    variance = square.groupby(POSE, sort=False).sum()[nu.index] / nu
    variance = variance.clip(lower=max(np.trace(inverse @ rounding) / 3.0, 1e-12))
    middle = np.average(variance, weights=nu)
    statistic = nu.sum() * math.log(middle) - float(np.sum(nu * np.log(variance)))
    correction = 1.0 + (np.sum(1.0 / nu) - 1.0 / nu.sum()) / (3.0 * (len(nu) - 1))
    return float(chdtrc(len(nu) - 1, statistic / correction)), np.sqrt(variance / middle)


def by_side(read: pd.DataFrame) -> pd.DataFrame:
    """Every pose from every side: ``visits``, ``readings``, repeatability by ISO 9283's formula.

    ``mean_distance_mm`` of the visits from their middle, pose repeatability ``rp_mm`` (that mean
    and three standard deviations of the distances) and ``std_x_mm`` and so on. NaN for a single
    visit, RP also for two, which are equally far from their middle.
    """
    visits = read.groupby(VISIT, sort=False)[AXES].mean()
    groups = visits.groupby(SIDE, sort=False)
    apart = pd.Series(np.linalg.norm(visits - groups.transform("mean"), axis=1), visits.index)
    distance, count = apart.groupby(SIDE, sort=False), groups.size()
    table = pd.DataFrame(
        {
            "visits": count,
            "readings": read.groupby(SIDE, sort=False).size(),
            "mean_distance_mm": distance.mean().where(count > 1),
            "rp_mm": (distance.mean() + 3.0 * distance.std()).where(count >= _FEWEST_VISITS),
        }
    )
    return table.join(groups.std().add_prefix("std_")).reset_index()


def pooled_rp(sides: pd.DataFrame) -> tuple[float, float]:
    """Mean distance of all visits from the middle of their pose and side, and RP over all of them.

    ``sides`` are those of :func:`by_side`; standard deviations are pooled. NaN without a pose that
    was visited thrice from one side.
    """
    known = sides.dropna(subset="rp_mm")
    if known.empty:
        return math.nan, math.nan
    mean = np.average(known["mean_distance_mm"], weights=known["visits"])
    std = (known["rp_mm"] - known["mean_distance_mm"]) / 3.0
    pooled = math.sqrt(np.average(std**2, weights=known["visits"] - 1))
    return float(mean), float(mean + 3.0 * pooled)


def far_off(read: pd.DataFrame) -> ndarray:
    """Readings, by index, that lie much farther from the others of their pose than most do.

    More than six times the median distance from the median position of the pose from that side.
    """
    sides = read.groupby(SIDE)[AXES]
    length = np.linalg.norm(read[AXES] - sides.transform("median"), axis=1)
    several = sides.transform("size").to_numpy() > 2
    if not several.any():
        return np.zeros(0, dtype=int)
    limit = _FAR * max(float(np.median(length[several])), 1e-12)
    return np.flatnonzero(several & (length > limit))


def limits(std_mm: ndarray, freedom: float) -> tuple[ndarray, ndarray]:
    """95 % limits of standard deviations (93 % after the choice of :func:`noise_of`).

    Parameters
    ----------
    std_mm
        Standard deviations (m,).
    freedom
        Degrees of freedom of each.

    Returns
    -------
    low_mm, high_mm
        Each (m,).
    """
    low, high = (np.sqrt(freedom / (2.0 * gammaincinv(freedom / 2.0, p))) for p in (0.975, 0.025))
    return std_mm * low, std_mm * high


def _nested(read: pd.DataFrame) -> list[ndarray]:
    """Numbers of the visit of every reading, of the side of every visit, the pose of every side."""
    numbers = []
    for keys in (VISIT, SIDE, POSE):
        numbers.append(read.groupby(keys, sort=False).ngroup().to_numpy())
        read = read.drop_duplicates(keys)
    return numbers


def _no_less_than_zero(covariance: ndarray) -> ndarray:
    """The nearest covariance (3, 3) of a difference of two, which need not be one."""
    size, axes = np.linalg.eigh(0.5 * (covariance + covariance.T))
    return (axes * np.maximum(size, 0.0)) @ axes.T


def scatter(values: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, int]:
    """Mean square of values about the means of their groups.

    Parameters
    ----------
    values : numpy.ndarray
        Shape (n, k).
    group : numpy.ndarray
        Number of the group of each row, shape (n,), from 0 without gaps.

    Returns
    -------
    mean_square : numpy.ndarray
        Shape (k, k), in the square of the unit of ``values``.
    freedom : int
        Rows beyond the first of each group.
    """
    mean, count = means(values, group)
    centred, freedom = values - mean[group], int(np.sum(count - 1))
    return centred.T @ centred / max(freedom, 1), freedom


def means(values: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of values in every group.

    Parameters
    ----------
    values, group
        See ``scatter``.

    Returns
    -------
    mean : numpy.ndarray
        Shape (g, k).
    count : numpy.ndarray
        Rows of each group, shape (g,).
    """
    count = np.bincount(group)
    sums = [np.bincount(group, column) for column in values.T]
    return np.stack(sums, axis=1) / count[:, None], count
