"""A quick robust fit that tells good readings from bad ones; its estimates serve nothing else.

Base frames, targets and small corrections of every DH parameter are fitted together by iteratively
reweighted least squares with Tukey's biweight, so that a third of the readings may be wrong. The
corrections lean on nominal with a strength that leaving configurations out decides, so that a file
of few poses is not explained away. Kept apart from the calibration, whose fits trust their data.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinacc.checks.cells import Cells
from kinacc.geometry import Pose, exp_so3, log_so3, skew
from kinacc.kinematics import dh
from kinacc.kinematics.dh import DHModel

BIWEIGHT = 7.0  # readings beyond this many sigma (of a 3-D magnitude) have no weight in the end
HUBER = 3.0  # beyond this many sigma a reading pulls no harder, while the strength is sought
STRENGTHS = (0.0, 0.3, 3.0, 30.0, 100.0)  # mm and mrad the corrections may have
# Sigma from a quantile below the median: two fifths of the readings may be wrong together.
_QUANTILE, _QUANTILE_3D = 0.35, 1.2797  # of the norm of three standard normal numbers
_LEAST_SIGMA = 1e-7  # of what is fitted exactly: rounding
_GROSS = 100.0  # sigma: beyond this a reading has no weight at all
_ITERATIONS = 20
_SETTLED = 0.03  # of sigma: finer steps tell no reading from another
_OFF_ZERO = 1e-3
# An arm whose parameters are further off than this is another arm, or its joints are misread.
_FAR_RAD, _FAR_MM = 0.25, 150.0
_CAP = 10.0  # sigma: what is left of a configuration counts no more than this
_READ_PER_PARAMETER = 2.0  # with fewer numbers than this the redescending loss is not used


@dataclass(frozen=True)
class Seen:
    """What is fitted: cells, their DH joint values (n, k), and the frames they are seen through.

    ``base`` and ``target`` (n,): indices of the base frame and of the target point.
    """

    cells: Cells
    q: np.ndarray
    base: np.ndarray
    target: np.ndarray

    def select(self, rows: np.ndarray) -> Seen:
        """The same of ``rows``."""
        return Seen(self.cells.select(rows), self.q[rows], self.base[rows], self.target[rows])


@dataclass(frozen=True)
class Arm:
    """Model, ``base`` (B) in the instrument's frame and ``targets`` (T) in the flange frame."""

    model: DHModel
    base: Pose
    targets: Pose


@dataclass(frozen=True)
class Residuals:
    """Predicted minus measured of n readings, in the instrument's frame.

    ``position_mm`` (n, 3); ``turn_rad`` (n, 3) the rotation vector of predicted times measured
    inverse, NaN where not measured; ``predicted`` frames of the targets; ``flange`` (n, 3, 3) the
    flange's rotation in the instrument's frame.
    """

    position_mm: np.ndarray
    turn_rad: np.ndarray
    predicted: Pose
    flange: np.ndarray


@dataclass(frozen=True)
class Trial:
    """A fit: the arm, and robust standard deviations per axis of what it leaves.

    ``left_out`` (n, 6), mm and rad: residuals of the fitted readings when their configuration is
    left out, to first order; ``judged``: the same over what the fit without it leaves open there.
    ``nominal`` is the model the corrections lean on.
    """

    arm: Arm
    nominal: DHModel
    sigma_mm: float
    sigma_rad: float
    strength: float
    left_out: np.ndarray
    judged: np.ndarray


def sigma_of(vectors: np.ndarray) -> float:
    """Standard deviation per axis of vectors (n, 3), from the shorter ones."""
    length = np.linalg.norm(vectors[np.isfinite(vectors[:, 0])], axis=1)
    if not length.size:
        return np.nan
    return max(float(np.quantile(length, _QUANTILE)) / _QUANTILE_3D, _LEAST_SIGMA)


def residuals(arm: Arm, seen: Seen, flange: Pose | None = None) -> Residuals:
    """What ``arm`` leaves of the readings; ``flange`` (n) where the model's poses are known."""
    flange = dh.forward(arm.model, seen.q) if flange is None else flange
    base = Pose(arm.base.rotation[seen.base], arm.base.position_mm[seen.base])
    rotation = base.rotation @ flange.rotation
    point = flange.position_mm + _turned(flange.rotation, arm.targets.position_mm[seen.target])
    position = _turned(base.rotation, point) + base.position_mm
    turned = rotation @ arm.targets.rotation[seen.target]
    turn = np.full(position.shape, np.nan)
    there = seen.cells.turned
    if there.any():
        measured = seen.cells.rotation[there]
        turn[there] = log_so3(turned[there] @ np.swapaxes(measured, 1, 2))
    return Residuals(position - seen.cells.position_mm, turn, Pose(turned, position), rotation)


def best(seen: Seen, start: Arm, strengths: tuple[float, ...] = STRENGTHS) -> Trial:
    """The fit whose strength predicts configurations left out best."""
    chosen, least, cap = None, np.inf, None
    arm = start
    for strength in strengths:
        trial = fit(seen, arm, start.model, strength, huber=True)
        if chosen is not None and _far(trial.arm.model, start.model):
            continue
        arm = trial.arm
        cap = cap or _CAP * trial.sigma_mm
        score = _left_out_score(trial, seen, cap)
        # Stronger corrections must pay: noise alone moves the score by a per mille or so.
        if score < 0.99 * least:
            chosen, least = trial, score
        elif score > 1.5 * least:
            break
    if _few(seen, chosen):
        return chosen
    final = fit(seen, chosen.arm, start.model, chosen.strength)
    return chosen if _far(final.arm.model, start.model) else final


def _few(seen: Seen, trial: Trial) -> bool:
    """Whether so little was read that a loss without a say for gross errors could fit any of it."""
    corrections = 5 * trial.nominal.joints if trial.strength > 0.0 else 0
    frames = 6 * int(seen.base.max() + 1) + 3 * int(seen.target.max() + 1)
    return 3 * len(seen.q) < _READ_PER_PARAMETER * (frames + corrections)


def fit(seen: Seen, start: Arm, nominal: DHModel, strength: float, huber: bool = False) -> Trial:
    """Robust fit from ``start`` with corrections of about ``strength`` (mm, mrad) to nominal.

    Tukey's biweight, which gives gross errors no say, or Huber's loss, which needs no good start.
    """
    arm = start
    for _ in range(_ITERATIONS):
        step = _Step.at(seen, arm, nominal, strength, huber)
        arm, moved = step.taken(arm)
        if moved < _SETTLED * min(step.sigma_mm, 1.0):
            break
    step = _Step.at(seen, arm, nominal, strength, huber)
    plain, judged = step.left_out(seen)
    return Trial(arm, nominal, step.sigma_mm, step.sigma_rad, strength, plain, judged)


def _far(model: DHModel, nominal: DHModel) -> bool:
    moved = np.abs(dh.to_vector(model) - dh.to_vector(nominal)).reshape(-1, 5)
    return bool(moved[:, _IS_ANGLE].max() > _FAR_RAD or moved[:, ~_IS_ANGLE].max() > _FAR_MM)


def _left_out_score(trial: Trial, seen: Seen, cap: float) -> float:
    """Mean length of what configurations leave when left out."""
    length = np.minimum(np.linalg.norm(trial.left_out[:, :3], axis=1), cap)
    number = np.unique(seen.cells.pose, return_inverse=True)[1]
    return float(np.mean(np.bincount(number, length) / np.bincount(number)))


def _turned(rotation: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", rotation, vectors)


@dataclass(frozen=True)
class _Step:
    """One linearisation: weighted design of all readings and the solution of its normal equations.

    Columns: per base 3 mm and 3 rad about its readings' centroid, per target 3 mm and 3 rad, then
    the 5 corrections per joint (mm, mrad) where the strength is above zero.
    """

    design: np.ndarray
    residual: np.ndarray
    weights: np.ndarray
    inverse: np.ndarray
    step: np.ndarray
    centroids: np.ndarray
    sigma_mm: float
    sigma_rad: float
    units: np.ndarray

    @classmethod
    def at(cls, seen: Seen, arm: Arm, nominal: DHModel, strength: float, huber: bool) -> _Step:
        left = residuals(arm, seen)
        sigma_mm, sigma_rad = sigma_of(left.position_mm), sigma_of(left.turn_rad)
        centroids = _centroids(left.predicted.position_mm, seen.base, len(arm.base.rotation))
        design = _design(seen, arm, left, centroids, strength > 0.0)
        units = np.tile(np.where(_IS_ANGLE, 1e-3, 1.0), arm.model.joints)
        frames = design.shape[2] - (units.size if strength > 0.0 else 0)
        design[:, :, frames:] *= units if strength > 0.0 else 1.0
        residual = np.concatenate([left.position_mm, np.nan_to_num(left.turn_rad)], axis=1)
        weights = np.empty(residual.shape)
        weights[:, :3] = _weight(left.position_mm, sigma_mm, huber) / sigma_mm**2
        weights[:, 3:] = 0.0
        if np.isfinite(sigma_rad):
            weights[:, 3:] = _weight(left.turn_rad, sigma_rad, huber) / sigma_rad**2
        flat = design.reshape(-1, design.shape[2])
        weighted = flat * weights.reshape(-1, 1)
        gram = weighted.T @ flat
        rhs = weighted.T @ residual.ravel()
        if strength > 0.0:
            moved = (dh.to_vector(arm.model) - dh.to_vector(nominal)) / units
            gram[range(frames, len(gram)), range(frames, len(gram))] += strength**-2.0
            rhs[frames:] += moved / strength**2
        # What no reading shows (a target's turn, a base nobody sees) stays where it is.
        diagonal = np.diag(gram)
        scale = np.where(
            diagonal > 0.0, 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)), 0.0
        )
        inverse = np.linalg.pinv(gram * np.outer(scale, scale), rcond=1e-12, hermitian=True)
        inverse *= np.outer(scale, scale)
        step = -inverse @ rhs
        return cls(design, residual, weights, inverse, step, centroids, sigma_mm, sigma_rad, units)

    def taken(self, arm: Arm) -> tuple[Arm, float]:
        """The arm after the step, and how far it moves: mm of lengths, mm at one metre of turns."""
        bases, targets = len(arm.base.rotation), len(arm.targets.rotation)
        base = self.step[: 6 * bases].reshape(bases, 6)
        target = self.step[6 * bases : 6 * (bases + targets)].reshape(targets, 6)
        turn = exp_so3(base[:, 3:])
        offset = arm.base.position_mm - self.centroids
        moved = Arm(
            arm.model,
            Pose(turn @ arm.base.rotation, self.centroids + base[:, :3] + _turned(turn, offset)),
            Pose(
                exp_so3(target[:, 3:]) @ arm.targets.rotation,
                arm.targets.position_mm + target[:, :3],
            ),
        )
        rest = self.step[6 * (bases + targets) :]
        if rest.size:
            vector = dh.to_vector(arm.model) + rest * self.units
            moved = replace(moved, model=dh.with_vector(arm.model, vector))
        lengths = np.abs(np.concatenate([base[:, :3].ravel(), target[:, :3].ravel(), rest]))
        angles = np.abs(np.concatenate([base[:, 3:].ravel(), target[:, 3:].ravel()]))
        return moved, float(max(lengths.max(), 1e3 * angles.max()))

    def left_out(self, seen: Seen) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (n, 6), mm and rad, of every reading with its configuration left out.

        Then the same over what the fit without it leaves open there: as wide as ``sigma`` for a
        sound reading, whether others determine it or it alone does. NaN where not measured.
        """
        plain, judged = self.residual.copy(), self.residual.copy()
        unit = np.repeat([self.sigma_mm, self.sigma_rad], 3)
        unit = np.where(np.isfinite(unit), unit, 1.0)
        seen_there = np.repeat([np.ones(len(seen.q), bool), seen.cells.turned], 3, axis=0).T
        scaled = self.design / unit[:, None] * seen_there[:, :, None]
        share = self.weights * unit**2
        order = np.argsort(seen.cells.pose, kind="stable")
        sizes = np.unique(seen.cells.pose, return_counts=True)[1]
        begins = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        for size in np.unique(sizes):
            rows = order[begins[sizes == size][:, None] + np.arange(size)]
            block = scaled[rows].reshape(len(rows), 6 * size, -1)
            weight = share[rows].reshape(len(rows), 1, -1)
            open_there = block @ self.inverse @ np.swapaxes(block, 1, 2)
            # What one configuration alone determines is unknown without it: far, not infinite.
            whole = (1.0 + _OFF_ZERO) * np.eye(6 * size)
            rest = np.linalg.pinv(whole - open_there * weight, rcond=1e-12)
            left = rest @ (self.residual[rows] / unit).reshape(len(rows), -1, 1)
            value, axes = np.linalg.eigh(_symmetric(rest @ open_there))
            spread = np.sqrt(1.0 + np.maximum(value, 0.0))[:, :, None]
            found = axes @ ((np.swapaxes(axes, 1, 2) @ left) / spread)
            plain[rows.ravel()] = left.reshape(-1, 6) * unit
            judged[rows.ravel()] = found.reshape(-1, 6) * unit
        return np.where(seen_there, plain, np.nan), np.where(seen_there, judged, np.nan)


def _symmetric(matrices: np.ndarray) -> np.ndarray:
    return 0.5 * (matrices + np.swapaxes(matrices, 1, 2))


_IS_ANGLE = np.array([True, False, False, True, True])  # of dh.PARAMETERS


def _design(seen: Seen, arm: Arm, left: Residuals, centroids, corrected: bool) -> np.ndarray:
    """Derivatives (n, 6, P) of the residuals."""
    count, bases, targets = len(seen.q), len(arm.base.rotation), len(arm.targets.rotation)
    joints = arm.model.joints
    frames = 6 * (bases + targets)
    design = np.zeros((count, 6, frames + (5 * joints if corrected else 0)))
    rows = np.arange(count)[:, None]
    spoke = left.predicted.position_mm - centroids[seen.base]
    column = 6 * seen.base[:, None] + np.arange(3)
    design[rows, np.arange(3), column] = 1.0
    design[rows, 3 + np.arange(3), column + 3] = 1.0
    design[rows[:, :, None], np.arange(3)[:, None], (column + 3)[:, None, :]] = -skew(spoke)
    column = 6 * bases + 6 * seen.target[:, None] + np.arange(3)
    place = (rows[:, :, None], np.arange(3)[:, None], column[:, None, :])
    design[place] = left.flange
    design[rows[:, :, None], 3 + np.arange(3)[:, None], (column + 3)[:, None, :]] = left.flange
    if corrected:
        base = arm.base.rotation[seen.base]
        inner = dh.parameter_jacobian(arm.model, seen.q).reshape(count, 6, -1)
        turns = base @ inner[:, 3:]
        swing = _turned(left.flange, arm.targets.position_mm[seen.target])
        design[:, :3, frames:] = base @ inner[:, :3] - skew(swing) @ turns
        design[:, 3:, frames:] = turns
    return design


def _centroids(points: np.ndarray, base: np.ndarray, bases: int) -> np.ndarray:
    count = np.maximum(np.bincount(base, minlength=bases), 1)[:, None]
    sums = np.zeros((bases, 3))
    np.add.at(sums, base, points)
    return sums / count


def _weight(vectors: np.ndarray, sigma: float, huber: bool) -> np.ndarray:
    """Weights (n, 1) of vectors (n, 3); 0 where not measured."""
    length = np.linalg.norm(np.nan_to_num(vectors, nan=np.inf), axis=1)
    if huber:
        weight = HUBER * sigma / np.maximum(length, HUBER * sigma)
        # Where a quarter or more is that far off, the start is to blame and not the readings.
        usual = np.quantile(length[np.isfinite(length)], 0.75) if np.isfinite(sigma) else 0.0
        return np.where(length < max(_GROSS * sigma, 3.0 * usual), weight, 0.0)[:, None]
    share = np.minimum(length / (BIWEIGHT * sigma), 1.0)
    return ((1.0 - share**2) ** 2)[:, None]
