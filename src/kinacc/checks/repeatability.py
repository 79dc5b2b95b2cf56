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


@dataclass(frozen=True)
class Group:
    """Visits of one pose from one side: how many, of how many readings; per axis ``std_mm`` (3,).

    ``mean_distance_mm`` of the visits from their middle, and ISO 9283's pose repeatability
    ``rp_mm``: that mean and three standard deviations of the distances. NaN for a single visit, RP
    also for two, which are equally far from their middle.
    """

    pose: int
    side: int
    visits: int
    readings: int
    std_mm: ndarray
    mean_distance_mm: float
    rp_mm: float


def parts(read: Repeated) -> Parts:
    """Variances of instrument, visits and sides, and that of a reading from any side."""
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
    subset = np.array([freedom for _, freedom in levels])
    spread = np.sum(terms[subset > 0] ** 2 / subset[subset > 0])
    freedom = terms[subset > 0].sum() ** 2 / spread if spread > 0.0 else returned
    whole = within * bool(observed) + arm + side * bool(sides)
    return Parts(instrument, arm, side if sides else unknown, whole, float(freedom))


def noise_of(results: Parts, resolution_mm: ndarray) -> Noise | None:
    """The noise of a reading, no less than the rounding of ``resolution_mm`` (3,).

    None where it is not told. Equal along the axes, with three times their degrees of freedom,
    unless they are shown to differ: then a covariance, every direction with the degrees of one.
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
    floor = np.diag(resolution_mm**2 / 12.0) + 1e-24 * np.eye(3)
    root = np.linalg.cholesky(square_mm2 + floor)
    mean, count = means(values, group)
    white = np.linalg.solve(root, (values - mean[group]).T).T
    square = np.bincount(pose_of[group], np.sum(white**2, axis=1))
    freedom = 3.0 * np.bincount(pose_of, count - 1)
    least = np.sum(np.linalg.solve(root, np.diag(resolution_mm / math.sqrt(12.0))) ** 2) / 3.0
    with np.errstate(invalid="ignore", divide="ignore"):
        subset = np.maximum(square / freedom, max(least, 1e-12))
    subset[freedom == 0] = np.nan
    texts = freedom > 0
    if texts.sum() < 2:
        return math.nan, np.sqrt(subset)
    nu, s2 = freedom[texts], subset[texts]
    middle = np.sum(nu * s2) / nu.sum()
    statistic = nu.sum() * math.log(middle) - float(np.sum(nu * np.log(s2)))
    correction = 1.0 + (np.sum(1.0 / nu) - 1.0 / nu.sum()) / (3.0 * (len(nu) - 1))
    return float(chdtrc(len(nu) - 1, statistic / correction)), np.sqrt(subset / middle)


def groups(read: Repeated) -> list[Group]:
    """Every pose from every side, with ISO 9283's repeatability of its visits."""
    visit_mm, readings, side_of = _visits(read)
    results = []
    for side, pose in enumerate(_larger(read.side, read.pose)):
        subset, std = visit_mm[side_of == side], np.full(3, np.nan)
        middle = spread = math.nan
        length = np.linalg.norm(subset - subset.mean(axis=0), axis=1)
        if len(subset) > 1:
            std, middle = np.std(subset, axis=0, ddof=1), float(length.mean())
        if len(subset) >= _FEWEST_VISITS:
            spread = float(np.std(length, ddof=1))
        observed = int(readings[side_of == side].sum())
        results.append(
            Group(int(pose), side, len(subset), observed, std, middle, middle + 3.0 * spread)
        )
    return results


def pooled_rp(read: Repeated) -> tuple[float, float]:
    """Mean distance of all visits from the middle of their pose and side, and RP over all of them.

    The standard deviation is pooled. NaN without a pose that was visited thrice from one side.
    """
    visit_mm, _, side_of = _visits(read)
    mean, count = means(visit_mm, side_of)
    many = count[side_of] >= _FEWEST_VISITS
    if not many.any():
        return math.nan, math.nan
    length = np.linalg.norm(visit_mm - mean[side_of], axis=1)[many]
    subset = np.unique(side_of[many], return_inverse=True)[1]
    square = scatter(length[:, None], subset)[0].item()
    return float(length.mean()), float(length.mean() + 3.0 * math.sqrt(square))


def between_sides_mm(read: Repeated) -> float:
    """ISO 9283's vAP: largest distance of a pose's middle from one side to that from another."""
    visit_mm, _, side_of = _visits(read)
    side_mm, pose_of = means(visit_mm, side_of)[0], _larger(read.side, read.pose)
    pairs = [side_mm[pose_of == pose] for pose in np.unique(pose_of)]
    apart = [
        np.linalg.norm(subset[:, None] - subset, axis=2).max()
        for subset in pairs
        if len(subset) > 1
    ]
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
    """95 % limits of standard deviations of ``freedom`` degrees each."""
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
