"""What moved between two series of one arm, and how much of that chance alone shows.

The null hypothesis: between two series nothing happened at the arm. That does not make them alike.

1. A model is wrong in ways that depend on the pose, the same ways in both series. Two series at the
   same configurations share that misfit, and it cancels; two pose sets do not, and fits to them
   differ however small the noise is. Misfit is taken as errors in front of every joint that change
   smoothly with that joint, of a size that both series show, joint by joint (variance components by
   the evidence, MacKay 1992), and beside these whatever differs from configuration to
   configuration. Misfit may go further from one part of the joints to another than that: how much,
   halves of one series say, between which nothing happened either (``misfit_factor``).
2. The arm warms up, each time differently. What changes with the order of measuring inside the
   series is a state of the arm in which a series may be as a whole.
3. At another temperature all lengths of the arm have grown alike. That is no change of the arm: it
   is left out as base and tool are where these were set up anew, whatever it is.
4. Visits repeat within limits, and the instrument has noise.

The change is estimated together with all of these, by least squares under their variances. Smooth
misfit and states have the covariance of their variances. All else, whatever it is made of, has that
of the shares of configurations in the change, from residuals of a fit without each (a jackknife);
readings of one configuration go together, in both series.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Set
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy

from kinacc.calibration import vec_fit
from kinacc.calibration.fitting import PoseSystem
from kinacc.calibration.frames import BASE, Frames, frame_terms
from kinacc.calibration.observations import TOOL, Observations
from kinacc.kinematics import vec
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.vec import ERRORS
from kinacc.measurements.folds import configurations

ORDER = 8  # of the polynomials of the misfit; finer misfit differs between configurations
CUTS = 2  # of one series into halves, across the widest directions of its joints
DRAWS = 100_000  # of the statistic by chance
_UNITS = (1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3)  # of joint errors: what counts as much as one mm
_NARROW_RAD = 1e-3
_SEEN = 1e-3  # of the best seen movement; what moves less is no direction of the arm
_ROUNDS = 8  # of the variances: further ones would narrow the limit by 1 %
_FREE = 0  # group of what has no variance
_FIRM = 1e-9  # of the largest diagonal: what base, tool and joints share stays where it is
_LEAST_MM = 1e-4  # standard deviation of misfit: less is none
_START_MM = 0.1
_CLEAR = 0.95  # probability that it is this joint, if it is one and each is as likely before
_MOST = 0.5  # of the squared movement beyond chance
_UNSEEN_MM = 1e-3  # by one mm or mrad: base or tool would take it up


@dataclass(frozen=True)
class Pair:
    """m residual components (mm) of two series about one DH model, and what may explain them.

    ``frames`` (m, F): motions of bases and targets. ``constant`` (m, 6k): errors of one mm or mrad
    in front of every joint, ``ERRORS`` joint by joint; ``longer`` (6k,) of them make all lengths
    1e-3 longer. ``misfit`` (m, Q): errors growing with the joints, of prior proportions; ``joint``
    (Q,) says of which (1-based; one more: by travel direction). ``residual`` (m,) is measured minus
    model. ``second``, ``position`` (m,): of the second series, of a position. ``cluster`` (m,):
    configuration, alike in both. ``late`` (m,): order of measuring within a series, of mean 0 and
    variance 1.
    """

    frames: np.ndarray
    constant: np.ndarray
    longer: np.ndarray
    misfit: np.ndarray
    joint: np.ndarray
    residual: np.ndarray
    second: np.ndarray
    position: np.ndarray
    cluster: np.ndarray
    late: np.ndarray

    @property
    def in_both(self) -> np.ndarray:
        """Whether each configuration, by number, is one of both series."""
        number = np.unique(self.cluster)
        earlier, later = self.cluster[~self.second], self.cluster[self.second]
        return np.isin(number, earlier) & np.isin(number, later)


def about(
    model: DHModel,
    frames: Frames,
    both: Observations,
    first: int,
    rotation_weight_mm_per_rad: float,
) -> Pair:
    """The pair linearised at ``model`` and ``frames``; the ``first`` rows are the first series."""
    turns = (np.ptp(both.q_rad, axis=0) > 2.0 * np.pi) & ~model.prismatic
    q_rad = np.where(turns, np.mod(both.q_rad + np.pi, 2.0 * np.pi) - np.pi, both.q_rad)
    both = replace(both, q_rad=q_rad)
    low, high = q_rad.min(axis=0) - _NARROW_RAD, q_rad.max(axis=0) + _NARROW_RAD
    empty = vec.without_errors(model, low, high, ORDER)
    free = vec_fit.informed(both, empty)
    coords = frame_terms(both, frames)
    state = np.append(coords.begin, np.zeros(free.sum()))
    system = PoseSystem(both, empty, free, coords, rotation_weight_mm_per_rad)
    residual, jacobian = (
        np.concatenate(parts) for parts in zip(*system.blocks(state), strict=True)
    )
    row, axis = both.places
    of_frames, errors = np.split(jacobian, [coords.size], axis=1)
    # Coefficients by joint, error and degree; behind them offsets by travel direction.
    joint, degree = np.divmod(np.arange(errors.shape[1]), len(ERRORS) * (ORDER + 1))
    degree = np.where(joint < model.joints, degree % (ORDER + 1), 1)
    smooth = degree > 0
    longer = np.zeros((model.joints, len(ERRORS)))  # the last link's own length goes with the tool
    longer[:, ERRORS.index("delta_z")] = np.where(model.prismatic, 0.0, model.d_mm)
    longer[1:, ERRORS.index("delta_x")] = model.a_mm[:-1]
    order = np.arange(len(both))
    late = pd.Series(order).groupby(order >= first).transform(scipy.stats.zscore)
    return Pair(
        frames=of_frames,
        constant=errors[:, ~smooth] * np.tile(_UNITS, model.joints),
        longer=1e-3 * longer.ravel(),
        misfit=_unit(errors[:, smooth]) * np.sqrt(len(errors)) / degree[smooth],
        joint=1 + joint[smooth],
        residual=-residual,
        second=row >= first,
        position=axis < 3,
        cluster=configurations(both.pose, both.q_rad)[row],
        late=late.to_numpy()[row],
    )


def halves(series: Observations) -> Iterator[tuple[Observations, Observations]]:
    """A series in halves that lie apart in the joints.

    Cut at the median of each of the ``CUTS`` first principal coordinates of the joints.
    """
    turned = np.concatenate([np.sin(series.q_rad), np.cos(series.q_rad)], axis=1)
    turned = turned - turned.mean(axis=0)
    cluster = configurations(series.pose, series.q_rad)
    for axis in np.linalg.svd(turned, full_matrices=False)[2][:CUTS]:
        # Whole configurations: their mean decides.
        mean = np.bincount(cluster, turned @ axis) / np.bincount(cluster)
        is_second = (mean > np.median(mean))[cluster]
        yield series.select(~is_second), series.select(is_second)


def joined(first: Observations, second: Observations, moved: Set[str]) -> Observations:
    """Both series as one; sessions and targets of the second are those of the first by name.

    Unless base or tool, or both, were ``moved`` between the series.
    """
    names = ("q_rad", "s", "position_mm", "rotation", "repeat", "fold", "payload")
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in names
    }
    for name, frame in (("session", BASE), ("target", TOOL)):
        before, after = (
            np.array(getattr(item, f"{name}_names"), dtype=str)[getattr(item, name)]
            for item in (first, second)
        )
        after = np.char.add(after, ", second series") if frame in moved else after
        number, every = pd.factorize(np.append(before, after))
        columns |= {name: number, f"{name}_names": tuple(every)}
    pose = np.append(first.pose, second.pose + first.pose.max() + 1 - second.pose.min())
    return replace(first, **columns, pose=pose)


class Moved(NamedTuple):
    """Movement of the arm between two series, over the poses of the second.

    ``directions`` (d, 6k): joint errors (mm and mrad) that move these by 1 mm rms each, after the
    best growth of all lengths, and base and tool where these were set up anew; ``change`` (d,) in
    mm along them; ``covariance`` (d, d), mm^2: of the changes that an unchanged arm shows.
    """

    directions: np.ndarray
    change: np.ndarray
    covariance: np.ndarray

    @property
    def by_error(self) -> np.ndarray:
        """What one mm or mrad of every joint error is in mm along the directions, (d, 6k)."""
        return np.linalg.pinv(self.directions.T)

    @property
    def moved_mm(self) -> float:
        """Rms movement."""
        return float(np.linalg.norm(self.change))

    @property
    def precision(self) -> np.ndarray:
        """Inverse (d, d) of the covariance with its mean variance added to every direction."""
        ridge = np.trace(self.covariance) / len(self.covariance) + _LEAST_MM**2
        return np.linalg.inv(self.covariance + ridge * np.eye(len(self.covariance)))

    def test(self, level: float) -> tuple[float, float]:
        """Probability of a change as large by chance, and the movement that chance shows.

        Tested is Hotelling's T^2 with ``precision``: along some directions chance is small, and a
        change is not to be hidden by chance along others; but the smallest of the variances, from
        the configurations of two series, are too small. The second number is the rms movement (mm)
        in the direction of ``change`` that an arm that did not change exceeds in a share ``level``
        of cases.

        References
        ----------
        Chen, Paul, Prentice, Wang, A regularized Hotelling's T2 test for pathway analysis in
        proteomic studies, JASA 106 (2011), 1345-1360.
        """
        weight = np.linalg.eigvals(self.precision @ self.covariance).real
        normal = np.random.default_rng(0).standard_normal((DRAWS, len(weight)))
        chance = normal**2 @ weight
        statistic = float(self.change @ self.precision @ self.change)
        probability = (1 + np.sum(chance >= statistic)) / (1 + DRAWS)
        limit = np.quantile(chance, 1.0 - level) / max(statistic, np.finfo(float).tiny)
        return float(probability), self.moved_mm * float(np.sqrt(limit))


def misfit_factor(cuts: Iterable[Pair]) -> float:
    """Factor on deviations of misfit that is not shared, from halves of both series; 1 or more.

    Nothing happens to an arm between halves of a series, but they lie apart in the joints: what
    they show beyond chance, in the mean square, is misfit that poses of one part do not foretell of
    another.
    """
    results = [moved(item, 1.0) for item in cuts]
    ratios = [item.moved_mm**2 / np.trace(item.covariance) for item in results]
    return float(np.sqrt(max(1.0, np.mean(ratios))))


def moved(pair: Pair, misfit: float) -> Moved:
    """The movement between two series and what chance shows.

    ``misfit``: factor on the deviations of the misfit that the series do not share, 1 or more.
    """
    anew = pair.second
    grown = pair.constant @ pair.longer * anew
    # What base and tool of the second series alone, and growth, can explain is no change.
    own = ~np.any(pair.frames[~anew], axis=0)
    apart = np.column_stack([pair.frames[anew][:, own], grown[anew]])
    apart = scipy.linalg.orth(_unit(apart), _FIRM)
    change = pair.constant * anew[:, None]
    change[anew] -= apart @ (apart.T @ change[anew])
    directions = _seen_directions(change[anew & pair.position])
    count = len(directions)
    drift = pair.constant @ directions.T * pair.late[:, None]
    firm = _unit(np.column_stack([pair.frames, pair.constant, grown]))
    parts = [
        change @ directions.T,
        firm,
        pair.misfit,
        drift * ~anew[:, None],
        drift * anew[:, None],
    ]
    columns = np.concatenate(parts, axis=1)
    warming = 1 + int(pair.joint.max())
    free = np.full(count + firm.shape[1], _FREE)
    group = np.concatenate([free, pair.joint, np.full(2 * count, warming)])
    inverse, variance = _fit(columns, pair.residual, group)
    scores = _shares(pair, columns, inverse)[:, :count]
    scores[~pair.in_both] *= misfit
    random = group != _FREE
    blurred = inverse[:count] @ (columns.T @ columns[:, random])
    blurred *= misfit * np.sqrt(variance[group[random]])
    # Between two series a state may differ by both their states.
    states = 2.0 * variance[warming] * np.eye(count)
    result = inverse[:count] @ (columns.T @ pair.residual)
    return Moved(directions, result, scores.T @ scores + blurred @ blurred.T + states)


def _unit(columns: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(columns, axis=0)
    return columns / np.where(size > 0.0, size, 1.0)


def _seen_directions(shifts: np.ndarray) -> np.ndarray:
    """Directions (d, 6k) of joint errors, by what these shift (3n, 6k), that shift by 1 mm rms.

    Orthogonal as movements, so that the root of summed squares along them is the rms movement.
    """
    _, values, right = np.linalg.svd(shifts, full_matrices=False)
    seen = values > _SEEN * values[0]
    return right[seen] / values[seen, None] * np.sqrt(len(shifts) / 3.0)


def _fit(
    columns: np.ndarray, residual: np.ndarray, group: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Inverse (p, p) of the normal matrix, and variances of groups (p,) by the evidence.

    The variance of the group ``_FREE`` is infinite.
    """
    gram, observed = columns.T @ columns, columns.T @ residual
    free = np.flatnonzero(group == _FREE)
    gram[free, free] += _FIRM * gram[free, free].max()
    variance = np.full(group.max() + 1, _START_MM**2)
    variance[_FREE], noise = np.inf, _START_MM**2
    for _ in range(_ROUNDS):
        held = noise / variance[group]
        inverse = scipy.linalg.inv(gram + np.diag(held))  # finds it symmetric: half the time
        result = inverse @ observed
        informed = 1.0 - held * inverse.diagonal()
        unexplained = np.sum((residual - columns @ result) ** 2)
        noise = unexplained / max(len(residual) - informed.sum(), 1.0)
        reported = np.maximum(np.bincount(group, informed), np.finfo(float).tiny)
        variance = np.maximum(np.bincount(group, result**2) / reported, _LEAST_MM**2)
        variance[_FREE] = np.inf
    return inverse, variance


def _shares(pair: Pair, columns: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Share (c, p) of every configuration in the result, by residuals of a fit without it."""
    pull = columns @ inverse
    remaining = pair.residual - pull @ (columns.T @ pair.residual)
    shares = []
    for label in np.unique(pair.cluster):
        rows = np.flatnonzero(pair.cluster == label)
        # A direction that one configuration alone decides has no residual, with or without it.
        left = np.eye(len(rows)) - pull[rows] @ columns[rows].T
        without = np.linalg.pinv(left, rcond=_FIRM, hermitian=True)
        shares.append(without @ remaining[rows] @ pull[rows])
    return np.array(shares)


def joint_of(movement: Moved, prismatic: np.ndarray) -> int | None:
    """The joint (1-based) that a change of explains most of the movement; None where unclear.

    Offsets first, as belts, encoders and collisions change these; then all DH parameters of a
    joint. Clear: it explains most beyond chance, and is it with the probability ``_CLEAR``.
    """
    change, chance = movement.change, float(np.trace(movement.covariance))
    floor = 1e-12 * chance * np.eye(len(change))
    whiten = np.linalg.inv(scipy.linalg.cholesky(movement.covariance + floor, lower=True))
    slide, turn, along, about_ = map(ERRORS.index, ("delta_z", "eps_z", "delta_x", "eps_x"))
    errors = movement.by_error.reshape(len(change), len(prismatic), len(ERRORS))
    errors = np.where(np.linalg.norm(errors, axis=0) > _UNSEEN_MM, errors, 0.0).swapaxes(0, 1)
    offset = np.where(prismatic[:, None, None], errors[..., [slide]], errors[..., [turn]])
    # Errors in front of the next joint are those of this joint's link; the last link is the tool's.
    link = np.pad(errors[1:, :, [along, about_]], ((0, 1), (0, 0), (0, 0)))
    for ways in (offset, np.concatenate([errors[..., [slide, turn]], link], axis=2)):
        best_fits = [np.linalg.lstsq(whiten @ way, whiten @ change)[0] for way in ways]
        fitted = np.array([way @ fit for way, fit in zip(ways, best_fits, strict=True)])
        explained = fitted @ whiten.T @ whiten @ change
        best = int(np.argmax(explained))
        remaining = np.sum((change - fitted[best]) ** 2) - chance
        most = remaining <= (1.0 - _MOST) * (movement.moved_mm**2 - chance)
        clear = np.sum(np.exp(0.5 * (explained - explained[best]))) <= 1.0 / _CLEAR
        if most and clear:
            return best + 1
    return None
