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
from scipy.spatial.distance import pdist
from scipy.special import chdtrc, gammaincinv

from kinacc.calibration.noise import means, scatter

# Levels at which axes, and poses, are taken to differ. Axes that are wrongly averaged make bounds
# too small along one: at this level 5 % become 6.0 at worst of 40 degrees of freedom, 6.5 of 20.
EQUAL, UNEQUAL = 0.2, 0.01
_FAR = 6.0  # medians from the middle of a pose's readings
_FEWEST_VISITS = 3  # whose distances from their middle can differ
_FEWEST = 5  # degrees of freedom that a covariance is told from an equal one by


@dataclass(frozen=True)
class Repeated:
    """The n readings: ``position_mm`` (n, 3), and numbers (n,) from 0 of pose, side and visit.

    A side is of one pose, and a visit is of one side: no number is that of two.
    """

    position_mm: ndarray
    pose: ndarray
    side: ndarray
    visit: ndarray


@dataclass(frozen=True)
class Parts:
    """Covariances (3, 3), mm^2: of readings of one visit, of visits from one side, of sides.

    NaN where the readings do not tell. ``whole`` is that of a reading, of ``freedom`` degrees for
    each axis (0: not told).
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


def parts(read: Repeated) -> Parts:
    """Covariances of instrument, visits and sides, and of a reading from any side.

    Parameters
    ----------
    read
        Readings with their poses, sides and visits.

    Returns
    -------
    Parts
        By the analysis of variance of unweighted means; degrees of freedom by Welch and
        Satterthwaite.
    """
    visit_mm, readings, side_of = _visits(read)
    side_mm, visits = means(visit_mm, side_of)
    pose_of = _larger(read.side, read.pose)
    (within, observed), (between, returned), (across, sides) = levels = [
        scatter(read.position_mm, read.visit),
        scatter(visit_mm, side_of),
        scatter(side_mm, pose_of),
    ]
    # What part of the variance of a level below is in the mean square of each level.
    of_visit = _share(1.0 / readings, side_of, returned)
    of_side = _share(1.0 / visits, pose_of, sides)
    deeper = means(1.0 / readings[:, None], side_of)[0][:, 0] / visits
    of_side_below = _share(deeper, pose_of, sides)
    unknown = np.full((3, 3), np.nan)
    instrument = within if observed else unknown
    if not returned:
        return Parts(instrument, unknown, unknown, unknown, 0.0)
    arm = _no_less_than_zero(between - of_visit * within)
    side = _no_less_than_zero(across - of_side * arm - of_side_below * within)
    shares = (1.0 - of_visit + of_side * of_visit - of_side_below, 1.0 - of_side, 1.0)
    terms = np.array([c * np.trace(square) for c, (square, _) in zip(shares, levels, strict=True)])
    degrees = np.array([freedom for _, freedom in levels])
    terms, degrees = terms[degrees > 0], degrees[degrees > 0]
    spread = np.sum(terms**2 / degrees)
    freedom = terms.sum() ** 2 / spread if spread > 0.0 else returned
    whole = within * bool(observed) + arm + side * bool(sides)
    return Parts(instrument, arm, side if sides else unknown, whole, float(freedom))


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


def differ_by_pose(read: Repeated, resolution_mm: ndarray) -> tuple[float, ndarray]:
    """Probability that poses scatter so differently by chance (Bartlett), and their scatter (p,).

    Of the visits of every pose from one side, over that of all poses; NaN where a pose tells
    nothing. Where there is none, of the readings of one visit. Less than the rounding of
    ``resolution_mm`` (3,) counts as that.
    """
    values, _, group = _visits(read)
    pose_of = _larger(read.side, read.pose)
    if not scatter(values, group)[1]:
        values, group, pose_of = read.position_mm, read.visit, _larger(read.visit, read.pose)
    square_mm2, pooled = scatter(values, group)
    if not pooled:
        return math.nan, np.full(read.pose.max() + 1, np.nan)
    rounding = np.diag(resolution_mm**2 / 12.0)
    root = np.linalg.cholesky(square_mm2 + rounding + 1e-24 * np.eye(3))
    mean, count = means(values, group)
    white = np.linalg.solve(root, (values - mean[group]).T).T
    square = np.bincount(pose_of[group], np.sum(white**2, axis=1))
    freedom = 3.0 * np.bincount(pose_of, count - 1)
    known = freedom > 0
    least = np.trace(np.linalg.solve(root, np.linalg.solve(root, rounding).T)) / 3.0
    variance = np.full(len(freedom), np.nan)
    variance[known] = np.maximum(square[known] / freedom[known], max(least, 1e-12))
    nu, s2 = freedom[known], variance[known]
    if len(nu) < 2:
        return math.nan, np.sqrt(variance)
    middle = np.average(s2, weights=nu)
    statistic = nu.sum() * math.log(middle) - float(np.sum(nu * np.log(s2)))
    correction = 1.0 + (np.sum(1.0 / nu) - 1.0 / nu.sum()) / (3.0 * (len(nu) - 1))
    return float(chdtrc(len(nu) - 1, statistic / correction)), np.sqrt(variance / middle)


def by_side(read: Repeated) -> pd.DataFrame:
    """Every pose from every side: ``visits``, ``readings``, and ISO 9283's repeatability of visits.

    ``mean_distance_mm`` of the visits from their middle, pose repeatability ``rp_mm`` (that mean
    and three standard deviations of the distances) and ``std_x_mm`` and so on. NaN for a single
    visit, RP also for two, which are equally far from their middle.
    """
    visit_mm, readings, side_of = _visits(read)
    axes = ["std_x_mm", "std_y_mm", "std_z_mm"]
    visits = pd.DataFrame(visit_mm, columns=axes)
    middle = visits.groupby(side_of).transform("mean")
    visits["distance"] = np.linalg.norm(visits - middle, axis=1)
    group = visits.groupby(side_of)
    count, mean, std = group.size(), group["distance"].mean(), group["distance"].std()
    table = pd.DataFrame(
        {
            "pose": _larger(read.side, read.pose),
            "side": count.index,
            "visits": count,
            "readings": np.bincount(side_of, readings).astype(int),
            "mean_distance_mm": mean.where(count > 1),
            "rp_mm": (mean + 3.0 * std).where(count >= _FEWEST_VISITS),
        }
    )
    return table.join(group[axes].std())


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


def between_sides_mm(read: Repeated) -> float:
    """ISO 9283's vAP: largest distance of a pose's middle from one side to that from another."""
    visit_mm, _, side_of = _visits(read)
    sides = pd.DataFrame(means(visit_mm, side_of)[0]).groupby(_larger(read.side, read.pose))
    apart = [pdist(side_mm).max() for _, side_mm in sides if len(side_mm) > 1]
    return float(max(apart, default=math.nan))


def far_off(read: Repeated) -> ndarray:
    """Readings, by index, that lie much farther from the others of their pose than most do.

    More than six times the median distance from the median position of the pose from that side.
    """
    by_side = pd.DataFrame(read.position_mm).groupby(read.side)
    length = np.linalg.norm(read.position_mm - by_side.transform("median"), axis=1)
    several = np.bincount(read.side)[read.side] > 2
    if not several.any():
        return np.zeros(0, dtype=int)
    limit = _FAR * max(float(np.median(length[several])), 1e-12)
    return np.flatnonzero(several & (length > limit))


def limits(std_mm: ndarray, freedom: float) -> tuple[ndarray, ndarray]:
    """95 % limits of standard deviations.

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


def _visits(read: Repeated) -> tuple[ndarray, ndarray, ndarray]:
    """Mean (v, 3) of every visit, its number of readings (v,) and its side (v,)."""
    return *means(read.position_mm, read.visit), _larger(read.visit, read.side)


def _larger(group: ndarray, larger: ndarray) -> ndarray:
    """The pose or side (g,), of ``larger`` (n,), that every group (n,) of readings is of."""
    return larger[np.unique(group, return_index=True)[1]]


def _share(part: ndarray, group: ndarray, freedom: int) -> float:
    """Mean of what each member (n,) of a group brings to the mean square of its level."""
    return float(np.sum(part * (1.0 - 1.0 / np.bincount(group)[group])) / max(freedom, 1))


def _no_less_than_zero(covariance: ndarray) -> ndarray:
    """The nearest covariance (3, 3) of a difference of two, which need not be one."""
    size, axes = np.linalg.eigh(0.5 * (covariance + covariance.T))
    return (axes * np.maximum(size, 0.0)) @ axes.T
