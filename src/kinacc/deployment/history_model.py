"""What moved between two series of one arm, and how much of that chance alone shows.

The null hypothesis: between two series nothing happened at the arm. That does not make them alike.

1. A model is wrong in ways that depend on the pose, the same ways in both series. Two series at the
   same configurations share that misfit, and it cancels; two pose sets do not, and fits to them
   differ however small the noise is. Misfit is taken as errors in front of every joint that change
   smoothly with that joint, of a size that both series show, joint by joint (variance components by
   the evidence, MacKay 1992), and beside these whatever differs from configuration to
   configuration. Misfit may go further from one part of the joints to another than that: how much,
   halves of one series say, between which nothing happened either (``understated``).
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

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy

from kinacc.calibration import vec_fit
from kinacc.calibration.fitting import PoseSystem
from kinacc.calibration.frames import Frames, frame_terms
from kinacc.calibration.observations import Observations
from kinacc.kinematics import vec
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.vec import ERRORS
from kinacc.measurements.folds import configurations

ORDER = 8  # of the polynomials of the misfit; finer misfit differs between configurations
CUTS = 2  # of one series into halves, across the widest directions of its joints
DRAWS = 100_000  # of the statistic by chance
UNITS = (1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3)  # of joint errors: what counts as much as one mm
_NARROW_RAD = 1e-3
_SEEN = 1e-3  # of the best seen movement; what moves less is no direction of the arm
_ROUNDS, _SETTLED = 15, 0.1  # of the variances; relative change
_FIRM = 1e-9  # of the largest diagonal: what base, tool and joints share stays where it is
_LEAST_MM = 1e-4  # standard deviation of misfit: less is none
_START_MM = 0.1
_CLEAR = 0.95  # probability that it is this joint, if it is one and each is as likely before
_MOST = 0.5  # of the squared movement beyond chance
_UNSEEN_MM = 1e-3  # by one mm or mrad: base or tool would take it up


class Setup(NamedTuple):
    """Whether base and tool of the second series are those of the first."""

    same_base: bool
    same_tool: bool


@dataclass(frozen=True)
class Pair:
    """m residual components (mm) of two series about one DH model, and what may explain them.

    ``frames`` (m, F): motions of bases and targets, ``is_base`` (F,) says which; ``own`` (F,) marks
    those only the second series has. ``constant`` (m, 6k): errors in front of every joint,
    ``ERRORS`` joint by joint in mm and rad; ``longer`` (6k,) of them make all lengths 1e-3 longer.
    ``misfit`` (m, Q): errors growing with the joints, of prior proportions; ``joint`` (Q,) says of
    which (0-based; one more: by travel direction). ``residual`` (m,) is measured minus model.
    ``second``, ``position`` (m,): of the second series, of a position. ``cluster`` (m,):
    configuration, alike in both. ``late`` (m,): order of measuring within a series, of mean 0 and
    variance 1.
    """

    frames: np.ndarray
    is_base: np.ndarray
    own: np.ndarray
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
    def has_other_poses(self) -> bool:
        """Whether a configuration of one series is none of the other."""
        clusters, later = (np.unique(self.cluster[self.second == item]) for item in (False, True))
        return not np.array_equal(clusters, later)


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
    # Coefficients by joint, error and order; behind them offsets by travel direction.
    joint, order = np.divmod(np.arange(errors.shape[1]), len(ERRORS) * (ORDER + 1))
    order = np.where(joint < model.joints, order % (ORDER + 1), 1)
    size = np.sqrt(np.mean(errors**2, axis=0)) * order
    longer = np.zeros((model.joints, len(ERRORS)))  # the last link's own length goes with the tool
    longer[:, ERRORS.index("delta_z")] = np.where(model.prismatic, 0.0, model.d_mm)
    longer[1:, ERRORS.index("delta_x")] = model.a_mm[:-1]
    late = np.concatenate([_late(first), _late(len(both) - first)])
    return Pair(
        frames=of_frames,
        is_base=np.arange(coords.size) < 6 * frames.sessions,
        own=~np.any(of_frames[row < first] != 0.0, axis=0),
        constant=errors[:, order == 0],
        longer=1e-3 * longer.ravel(),
        misfit=(errors / np.where(size > 0.0, size, 1.0))[:, order > 0],
        joint=joint[order > 0],
        residual=-residual,
        second=row >= first,
        position=axis < 3,
        cluster=configurations(both.pose, both.q_rad)[row],
        late=late[row],
    )


def _late(count: int) -> np.ndarray:
    """Order of measuring (count,), of mean 0 and variance 1."""
    order = np.arange(count) - 0.5 * (count - 1)
    return order / max(np.sqrt(np.mean(order**2)), 0.5) if count else order


def halves(series: Pair, q_rad: np.ndarray, setup: Setup) -> Iterator[Pair]:
    """A series (a pair without a second one) as pairs of halves that lie apart in the joints.

    Each is cut at the median of one of the ``CUTS`` principal coordinates of the joints (m, k) of
    the components. Frames that ``setup`` does not have in common are free in both halves.
    """
    turned = np.concatenate([np.sin(q_rad), np.cos(q_rad)], axis=1)
    turned = turned - turned.mean(axis=0)
    axes = np.linalg.svd(turned, full_matrices=False)[2][:CUTS]
    anew = ~(series.is_base & setup.same_base | ~series.is_base & setup.same_tool)
    for along in (turned @ axes.T).T:
        # Whole configurations: their mean decides.
        mean = np.bincount(series.cluster, along) / np.bincount(series.cluster)
        second = (mean > np.median(mean))[series.cluster]
        frames = [series.frames, series.frames[:, anew] * second[:, None]]
        yield replace(
            series,
            frames=np.concatenate(frames, axis=1),
            is_base=np.append(series.is_base, series.is_base[anew]),
            own=np.append(np.zeros(len(anew), bool), np.ones(anew.sum(), bool)),
            second=second,
        )


def joined(first: Observations, second: Observations, setup: Setup) -> Observations:
    """Both series as one; sessions and targets of the second are those of the first if the same."""
    names = ("q_rad", "s", "position_mm", "rotation", "repeat", "fold", "payload")
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in names
    }
    for name, same in (("session", setup.same_base), ("target", setup.same_tool)):
        before, after = (getattr(item, f"{name}_names") for item in (first, second))
        if not same:
            after = [f"{item}, second series" if item in before else item for item in after]
        every = tuple(dict.fromkeys([*before, *after]))
        number = np.array([every.index(item) for item in after])[getattr(second, name)]
        columns |= {name: np.append(getattr(first, name), number), f"{name}_names": every}
    pose = np.append(first.pose, second.pose + first.pose.max() + 1 - second.pose.min())
    return replace(first, **columns, pose=pose)


class Moved(NamedTuple):
    """Movement of the arm between two series, over the poses of the second.

    ``directions`` (d, 6k): joint errors (mm and rad) that move these by 1 mm rms each, after the
    best growth of all lengths, and base and tool where these were set up anew; ``change`` (d,) in
    mm along them; ``covariance`` (d, d), mm^2: of the changes that an unchanged arm shows.
    """

    directions: np.ndarray
    change: np.ndarray
    covariance: np.ndarray

    def along(self, constant: np.ndarray) -> np.ndarray:
        """What joint errors (6k, n) in mm and rad are in mm along the directions, (d, n)."""
        units = np.tile(UNITS, constant.shape[0] // 6)[:, None]
        return np.linalg.pinv(self.directions.T / units) @ (constant / units)

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


def understated(cuts: Iterable[Pair]) -> float:
    """Mean square movement between halves of one series, over that by chance: 1 if that is right.

    Nothing happens to an arm between halves of a series, but they lie apart in the joints: what
    they show beyond chance is misfit that poses of one part do not foretell of another.
    """
    results = [moved(item, 1.0) for item in cuts]
    return float(np.mean([item.moved_mm**2 / np.trace(item.covariance) for item in results]))


def misfit_factor(first: float, second: float) -> float:
    """On deviations of misfit that is not shared, by what halves of both series showed."""
    return float(np.sqrt(max(1.0, 0.5 * (first + second))))


def moved(pair: Pair, misfit: float) -> Moved:
    """The movement between two series and what chance shows.

    ``misfit``: factor on the deviations of the misfit that the series do not share, 1 or more.
    """
    absorbed = _absorbed(pair)
    directions = _seen_directions(pair, absorbed)
    count = len(directions)
    change = pair.constant @ directions.T
    drift = change * pair.late[:, None]
    grown = pair.constant @ pair.longer * pair.second
    firm = _unit(np.column_stack([pair.frames, pair.constant, grown]))
    # Their part along base, tool and growth can be a thousand times as large as the rest.
    anew = change[pair.second]
    moves = np.zeros_like(change)
    moves[pair.second] = anew - absorbed @ (absorbed.T @ anew)
    free = np.concatenate([firm, moves], axis=1)
    states = [drift * (pair.second == item)[:, None] for item in (False, True)]
    warming = int(pair.joint.max(initial=-1)) + 1
    group = np.concatenate([pair.joint, np.full(2 * count, warming)])
    columns = np.concatenate([free, pair.misfit, *states], axis=1)
    gram, observed = columns.T @ columns, columns.T @ pair.residual
    split = free.shape[1]
    gram[np.diag_indices(split)] += _FIRM * gram[:split, :split].diagonal().max()
    noise, prior = _variances(gram, observed, pair, split, group)
    inverse = _inverse(gram + np.diag(np.append(np.zeros(split), noise / prior[group])))
    result, changes = inverse @ observed, slice(split - count, split)
    scores = _shares(pair, columns, result, inverse, changes)
    blurred = (inverse[changes] @ gram[:, split:]) * np.sqrt(prior[group])
    both = np.intersect1d(pair.cluster[pair.second], pair.cluster[~pair.second])
    scores[~np.isin(np.unique(pair.cluster), both)] *= misfit
    # Between two series a state may differ by both their states.
    smooth = misfit**2 * blurred @ blurred.T + 2.0 * prior[warming] * np.eye(count)
    return Moved(directions, result[changes], scores.T @ scores + smooth)


def _unit(columns: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(columns, axis=0)
    return columns / np.where(size > 0.0, size, 1.0)


def _absorbed(pair: Pair) -> np.ndarray:
    """Orthonormal movements (n, r) of the second series by its own base and tool, and growth."""
    rows = pair.second
    local = np.column_stack([pair.frames[rows][:, pair.own], pair.constant[rows] @ pair.longer])
    return scipy.linalg.orth(_unit(local), _FIRM)


def _seen_directions(pair: Pair, absorbed: np.ndarray) -> np.ndarray:
    """Directions (d, 6k) of joint errors, each moving the second series by 1 mm rms.

    After the best growth of all lengths, and base and tool where these are its own; orthogonal as
    movements, so that the root of summed squares along them is the rms movement.
    """
    rows = pair.second
    constant = pair.constant[rows]
    state = (constant - absorbed @ (absorbed.T @ constant))[pair.position[rows]]
    units = np.tile(UNITS, state.shape[1] // 6)
    _, values, right = np.linalg.svd(state * units, full_matrices=False)
    retained = values > _SEEN * values[0]
    return right[retained] * units / values[retained, None] * np.sqrt(len(state) / 3.0)


def _variances(
    gram: np.ndarray, observed: np.ndarray, pair: Pair, split: int, group: np.ndarray
) -> tuple[float, np.ndarray]:
    """Variance of noise, and of every group of random effects, by the evidence."""
    beside = np.column_stack([gram[:split, split:], observed[:split]])
    free = np.linalg.solve(gram[:split, :split], beside)
    inner = gram[split:, split:] - gram[split:, :split] @ free[:, :-1]
    right = observed[split:] - gram[split:, :split] @ free[:, -1]
    square = float(pair.residual @ pair.residual - observed[:split] @ free[:, -1])
    remaining = len(pair.residual) - split
    prior, noise = np.full(group.max() + 1, _START_MM**2), 0.3 * square / remaining
    for _ in range(_ROUNDS):
        held = noise / prior[group]
        spread = _inverse(inner + np.diag(held))
        result = spread @ right
        informed = 1.0 - held * spread.diagonal()
        unexplained = square - 2.0 * result @ right + result @ inner @ result
        noise = unexplained / max(remaining - informed.sum(), 1.0)
        reported = np.bincount(group, informed, len(prior))
        new = np.bincount(group, result**2, len(prior)) / np.maximum(reported, np.finfo(float).tiny)
        new = np.maximum(new, _LEAST_MM**2)
        # What is no more than a hundredth of the noise settles nothing.
        counts = np.maximum(new, prior) > 1e-4 * noise
        change = np.abs(np.log(new / prior))[counts].max(initial=0.0)
        prior = new
        if change < _SETTLED:
            break
    return noise, prior


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric, positive definite matrix, twice as fast as that of any."""
    lower, _ = scipy.linalg.lapack.dpotrf(matrix, lower=1)
    half, _ = scipy.linalg.lapack.dpotri(lower, lower=1)
    return half + np.tril(half, -1).T


def _shares(
    pair: Pair, columns: np.ndarray, solution: np.ndarray, inverse: np.ndarray, changes: slice
) -> np.ndarray:
    """Share (c, d) of every configuration in the change, by residuals of a fit without it."""
    remaining, pull = pair.residual - columns @ solution, columns @ inverse
    shares = []
    for label in np.unique(pair.cluster):
        rows = np.flatnonzero(pair.cluster == label)
        values, vectors = np.linalg.eigh(np.eye(len(rows)) - pull[rows] @ columns[rows].T)
        # A direction that one configuration alone decides has no residual, with or without it.
        along = vectors.T @ remaining[rows] / np.where(values > _FIRM, values, 1.0)
        shares.append(vectors @ along @ pull[rows, changes])
    return np.array(shares)


def joint_of(movement: Moved, prismatic: np.ndarray) -> int | None:
    """The joint (1-based) that a change of explains most of the movement; None where unclear.

    Offsets first, as belts, encoders and collisions change these; then all DH parameters of a
    joint. Clear: it explains most beyond chance, and is it with the probability ``_CLEAR``.
    """
    chance = float(np.trace(movement.covariance))
    floor = 1e-12 * chance * np.eye(len(movement.change))
    whiten = np.linalg.inv(scipy.linalg.cholesky(movement.covariance + floor, lower=True))
    slide, turn, along, about_ = map(ERRORS.index, ("delta_z", "eps_z", "delta_x", "eps_x"))
    count, size = len(prismatic), len(ERRORS)
    units = np.diag(np.tile(UNITS, count))
    for whole in (False, True):
        explained, remaining = np.zeros((2, count))
        for joint in range(count):
            link = [size + along, size + about_] if joint + 1 < count else []  # else the tool's
            local = [slide, turn, *link] if whole else [slide if prismatic[joint] else turn]
            ways = movement.along(units[:, [size * joint + item for item in local]])
            ways = ways[:, np.linalg.norm(ways, axis=0) > _UNSEEN_MM]
            fitted = ways @ np.linalg.lstsq(whiten @ ways, whiten @ movement.change)[0]
            explained[joint] = (whiten @ movement.change) @ (whiten @ fitted)
            remaining[joint] = np.sum((movement.change - fitted) ** 2)
        best = int(np.argmax(explained))
        most = remaining[best] - chance <= (1.0 - _MOST) * (movement.moved_mm**2 - chance)
        clear = np.sum(np.exp(0.5 * (explained - explained[best]))) <= 1.0 / _CLEAR
        if most and clear and explained[best] > 0.0:
            return best + 1
    return None
