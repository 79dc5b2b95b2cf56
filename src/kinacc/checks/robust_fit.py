"""A quick robust fit that tells good readings from bad ones; its estimates serve nothing else.

Base frames, targets and small corrections of every DH parameter are fitted together by iteratively
reweighted least squares with Tukey's biweight, so that a third of the readings may be wrong. The
corrections lean on nominal with a strength that leaving configurations out decides, so that a file
of few poses is not explained away. It starts from the best of many closed forms, and judges every
reading with its configuration left out; the fits of the calibration do neither.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy import ndarray

from kinacc.calibration.fitting import PoseSystem
from kinacc.calibration.frames import (
    FrameParameters,
    Frames,
    closed_form_start,
    frame_terms,
    least,
    one_session,
)
from kinacc.checks import tails
from kinacc.checks.readings import Readings, thinned
from kinacc.geometry import Pose, compose, log_so3
from kinacc.kinematics import dh
from kinacc.kinematics.dh import DHModel

BIWEIGHT = 7.0  # readings beyond this many sigma (of a 3-D magnitude) have no weight in the end
HUBER = 3.0  # beyond this many sigma a reading pulls no harder, while the strength is sought
STRENGTHS = (0.3, 3.0, 30.0, 100.0)  # mm and mrad the corrections may have, if any
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
_FITTED_ROWS = 900
_IS_ANGLE = np.array([True, False, False, True, True])  # of dh.PARAMETERS
_PARTS = slice(0, 3), slice(3, 6)  # positions, turns

_STRETCHES = (2, 3, 5)  # parts that the file is cut into, of which one may be of one base
_DRAWS, _DRAWN = 24, 12  # random draws, and configurations in each
_TRUSTED = 0.5  # share of the readings a refinement of the start trusts
_JUDGED = 0.4  # share of the readings that must fit: the rest may be of another base
_REFINEMENTS = 4
_START_ROWS = 600


@dataclass(frozen=True)
class Arm:
    """A DH model with its bases in the instrument's frame and targets in the flange frame.

    ``nominal`` is the model that its corrections lean on.
    """

    model: DHModel
    nominal: DHModel
    frames: Frames


@dataclass(frozen=True)
class Residuals:
    """Predicted minus measured of n readings, in the instrument's frame.

    ``position_mm`` (n, 3); ``turn_rad`` (n, 3) the rotation vector of predicted times measured
    inverse, NaN where not measured; ``predicted`` frames of the targets; ``flange`` (n, 3, 3) the
    flange's rotation in the instrument's frame.
    """

    position_mm: ndarray
    turn_rad: ndarray
    predicted: Pose
    flange: ndarray


@dataclass(frozen=True)
class Fitted:
    """The fit of all readings ``readings``, ``chosen`` (m,) of them, and what it leaves.

    ``left_mm`` and ``left_rad`` (n,): lengths of the residuals, configurations left out where they
    were fitted, -1 without orientation; ``limit_mm`` and ``limit_rad`` what they may be.
    """

    readings: Readings
    chosen: ndarray
    trial: Trial
    residuals: Residuals
    left_mm: ndarray
    left_rad: ndarray
    limit_mm: float
    limit_rad: float

    @property
    def bad(self) -> ndarray:
        """True (n,) where a reading is further out than it may be."""
        return (self.left_mm > self.limit_mm) | (self.left_rad > self.limit_rad)


def fit(observed: Readings, model: DHModel) -> Fitted:
    """The robust fit of at most ``_FITTED_ROWS`` readings, and what it leaves of all."""
    chosen = thinned(np.arange(len(observed)), _FITTED_ROWS)
    few = observed.select(chosen)
    trial = best(few, start(few, model))
    remaining = residuals(trial.arm, observed)
    left_out, judged = trial.left_out(few), trial.left_out(few, judged=True)
    lengths = []
    for part, residual in zip(_PARTS, (remaining.position_mm, remaining.turn_rad), strict=True):
        length, without, over = (
            np.linalg.norm(item, axis=1) for item in (residual, left_out[:, part], judged[:, part])
        )
        # A reading that alone determines something lies anywhere without it, however sound it is:
        # it is far only where it is so too over what the fit without it leaves open.
        unknown = (without > tails.limit(without, 3)) & (over <= tails.limit(over, 3))
        length[chosen] = np.where(unknown, over, without)
        lengths.append(length)
    limits = [tails.limit(length, 3) for length in lengths]
    left_rad = np.where(np.isfinite(lengths[1]), lengths[1], -1.0)
    return Fitted(observed, chosen, trial, remaining, lengths[0], left_rad, *limits)


def residuals(arm: Arm, observed: Readings) -> Residuals:
    """What ``arm`` leaves of the readings."""
    base, target = arm.frames.at_rows(observed)
    flange = compose(base, dh.forward(arm.model, observed.q_rad))
    predicted = compose(flange, target)
    # Where no orientation was measured, its rotation vector is NaN.
    turn = log_so3(predicted.rotation @ np.swapaxes(observed.rotation, 1, 2))
    return Residuals(predicted.position_mm - observed.position_mm, turn, predicted, flange.rotation)


def best(observed: Readings, begin: Arm) -> Trial:
    """The fit whose strength predicts configurations left out best."""
    number = np.unique(observed.pose, return_inverse=True)[1]
    trial = chosen = reweighted(observed, begin, 0.0, huber=True)
    cap = _CAP * trial.sigma_mm

    def score(trial: Trial) -> float:
        length = np.minimum(np.linalg.norm(trial.left_out(observed)[:, :3], axis=1), cap)
        return float(np.mean(np.bincount(number, length) / np.bincount(number)))

    least = score(trial)
    for strength in STRENGTHS:
        trial = reweighted(observed, trial.arm, strength, huber=True)
        if _far(trial) or (now := score(trial)) > 1.5 * least:
            break
        # Stronger corrections must pay: noise alone moves the score by a per mille or so.
        if now < 0.99 * least:
            chosen, least = trial, now
    if 3 * len(observed) < _READ_PER_PARAMETER * chosen.step.size:
        return chosen
    final = reweighted(observed, chosen.arm, chosen.strength)
    return chosen if _far(final) else final


def reweighted(observed: Readings, begin: Arm, strength: float, huber: bool = False) -> Trial:
    """Robust fit from ``begin`` with corrections of about ``strength`` (mm, mrad) to nominal.

    Tukey's biweight, which gives gross errors no say, or Huber's loss, which needs no good start.
    """
    trial = Trial.of(observed, begin, strength, huber)
    for _ in range(_ITERATIONS):
        arm, moved = trial.taken()
        settled = moved < _SETTLED * min(trial.sigma_mm, 1.0)
        trial = Trial.of(observed, arm, strength, huber)
        if settled:
            break
    return trial


@dataclass(frozen=True)
class Trial:
    """An arm that leans on its nominal model by ``strength``, and a step of its fit to n readings.

    ``design`` (n, 6, P), ``residual`` (n, 6) in the robot's base, mm and rad, and ``weights``
    (n, 6): zero where an orientation was not measured. Columns: components of ``frames``, then the
    corrections of the DH parameters where the strength is above zero. ``inverse`` (P, P) of the
    normal equations and their ``step`` (P,). ``sigma_mm`` and ``sigma_rad``: robust standard
    deviations per axis of what the arm leaves.
    """

    arm: Arm
    strength: float
    design: ndarray
    residual: ndarray
    weights: ndarray
    inverse: ndarray
    step: ndarray
    frames: FrameParameters
    sigma_mm: float
    sigma_rad: float

    @classmethod
    def of(cls, observed: Readings, arm: Arm, strength: float, huber: bool) -> Trial:
        """The arm, linearised."""
        frames = frame_terms(observed, arm.frames)
        free = np.full(arm.model.start.size, strength > 0.0)
        system = PoseSystem(observed, arm.model, free, frames, 1.0)
        x = np.concatenate([frames.begin, arm.model.start[free]])
        ((columns, _),) = system.columns(x)  # few enough readings for one block
        columns = np.pad(columns, ((0, 0), (0, 6 - columns.shape[1]), (0, 0)))
        design, residual = columns[:-1].transpose(2, 1, 0), columns[-1].T
        weights, sigmas = np.zeros((len(observed), 6)), [np.nan, np.nan]
        every = np.ones(len(observed), dtype=bool)
        for place, there in enumerate((every, observed.has_rotation)):
            if there.any():
                length = np.linalg.norm(residual[there, _PARTS[place]], axis=1)
                sigma = max(float(np.quantile(length, _QUANTILE)) / _QUANTILE_3D, _LEAST_SIGMA)
                weights[there, _PARTS[place]] = _weight(length, sigma, huber)[:, None] / sigma**2
                sigmas[place] = sigma
        lean = np.append(
            np.zeros(frames.size), (strength * _by_kind(arm.model, 1e-3, 1.0))[free] ** -2
        )
        moved = np.append(np.zeros(frames.size), (arm.model.start - arm.nominal.start)[free])
        flat = columns.reshape(len(columns), -1)
        normal = (flat[:-1] * weights.T.ravel()) @ flat.T
        gram = normal[:, :-1] + np.diag(lean)
        # What no reading shows (a base nobody sees) stays where it is.
        diagonal = np.diag(gram)
        scale = np.divide(1.0, np.sqrt(diagonal), out=0.0 * diagonal, where=diagonal > 0.0)
        both = np.outer(scale, scale)
        inverse = np.linalg.pinv(gram * both, rcond=1e-12, hermitian=True) * both
        step = -inverse @ (normal[:, -1] + lean * moved)
        return cls(arm, strength, design, residual, weights, inverse, step, frames, *sigmas)

    def taken(self) -> tuple[Arm, float]:
        """The arm after the step, and how far it moves: mm of lengths, mm at one metre of turns."""
        of_frames, rest = np.split(self.step, [self.frames.size])
        model = self.arm.model
        model = model.with_parameters(model.start + rest) if rest.size else model
        scale = np.append(self.frames.scale, _by_kind(model, 1e-3, 1.0))[: self.step.size]
        moved = float(np.abs(self.step / scale).max())
        frames = self.frames.frames(self.frames.begin + of_frames)
        return Arm(model, self.arm.nominal, frames), moved

    def left_out(self, observed: Readings, judged: bool = False) -> ndarray:
        """Residuals (n, 6), mm and rad, of every reading with its configuration left out.

        To first order; NaN where not measured. ``judged``: over what the fit without it leaves open
        there, as wide as ``sigma`` for a sound reading, whether others determine it or it alone.
        """
        unit = np.nan_to_num(np.repeat([self.sigma_mm, self.sigma_rad], 3), nan=1.0)
        result = self.residual / unit
        scaled, share = self.design / unit[:, None], self.weights * unit**2
        poses = [*pd.Series(observed.pose).groupby(observed.pose).indices.values()]
        for size in {*map(len, poses)}:
            rows = np.stack([pose for pose in poses if len(pose) == size])
            block = scaled[rows].reshape(len(rows), 6 * size, -1)
            open_there = block @ self.inverse @ np.swapaxes(block, 1, 2)
            # What one configuration alone determines is unknown without it: far, not infinite.
            rest = (1.0 + _OFF_ZERO) * np.eye(6 * size) - open_there * share[rows].reshape(
                len(rows), 1, -1
            )
            rest = np.linalg.pinv(rest, rcond=1e-12)
            remaining = rest @ result[rows].reshape(len(rows), -1, 1)
            if judged:
                spread = rest @ open_there
                value, axes = np.linalg.eigh(0.5 * (spread + np.swapaxes(spread, 1, 2)))
                over = np.sqrt(1.0 + np.maximum(value, 0.0))[:, :, None]
                remaining = axes @ (np.swapaxes(axes, 1, 2) @ remaining / over)
            result[rows] = remaining.reshape(*rows.shape, 6)
        result[~observed.has_rotation, 3:] = np.nan
        return result * unit


def _by_kind(model: DHModel, angle: float, length: float) -> ndarray:
    """One number for every angle of the DH parameters (5k,), another for every length."""
    return np.where(np.tile(_IS_ANGLE, model.joints), angle, length)


def _far(trial: Trial) -> bool:
    arm = trial.arm
    moved = np.abs(arm.model.start - arm.nominal.start)
    return bool((moved > _by_kind(arm.model, _FAR_RAD, _FAR_MM)).any())


def _weight(length: ndarray, sigma: float, huber: bool) -> ndarray:
    """Weights (n,) of residuals of these lengths."""
    if huber:
        weight = HUBER * sigma / np.maximum(length, HUBER * sigma)
        # Where a quarter or more is that far off, the start is to blame and not the readings.
        limit = max(_GROSS * sigma, 3.0 * np.quantile(length, 0.75))
        return np.where(length < limit, weight, 0.0)
    share = np.minimum(length / (BIWEIGHT * sigma), 1.0)
    return (1.0 - share**2) ** 2


def start(observed: Readings, model: DHModel) -> Arm:
    """Bases and targets to start from, though part of the readings may be wrong.

    Of closed forms on all readings of the largest session, on stretches of it and on random draws,
    the one that fits the better two fifths best.
    """
    session = np.argmax(np.bincount(observed.session))
    largest = thinned(np.flatnonzero(observed.session == session), _START_ROWS)
    part = observed.select(largest)
    poses, rng, every = np.unique(part.pose), np.random.default_rng(0), np.arange(len(part))
    pieces = [every]
    if len(poses) > _DRAWN:
        stretches = [piece for count in _STRETCHES for piece in np.array_split(every, count)]
        pieces += [piece for piece in stretches if len(np.unique(part.pose[piece])) >= _DRAWN]
        draws = [rng.choice(poses, _DRAWN, replace=False) for _ in range(_DRAWS)]
        pieces += [np.flatnonzero(np.isin(part.pose, draw)) for draw in draws]
    weight = np.stack([np.isin(every, piece) for piece in pieces]).astype(float)
    weight, *_, middle = placed(part, part.measured, dh.forward(model, part.q_rad), weight)
    chosen = weight[np.argmin(middle)] > 0.0
    # Other sessions, and targets that the chosen rows lack, are placed by the better half of each.
    rows = np.append(largest[chosen], np.flatnonzero(observed.session != session))
    flange, group = dh.forward(model, observed.q_rad), [observed.session, observed.target]
    several = len(np.unique(group, axis=1).T) > 1
    for _ in range(_REFINEMENTS if several else 1):
        arm = Arm(model, model, closed_form_start(observed.select(rows), flange.select(rows)))
        distance = pd.Series(np.linalg.norm(residuals(arm, observed).position_mm, axis=1))
        rows = np.flatnonzero(distance <= distance.groupby(group).transform("median"))
    return arm


def placed(
    observed: Readings, measured: Pose, flange: Pose, weight: ndarray
) -> tuple[ndarray, ...]:
    """The closed form that fits the better two fifths of the readings best, for each of B sets.

    Of one session; of the rows of a set, and then of the half of all readings nearest to it. Shapes
    as ``one_session`` has them.

    Returns
    -------
    tuple of numpy.ndarray
        Weights (B, n) of the rows, rotations and positions of bases, positions (B, T, 3) of
        targets, and the quantile (B,) of distances, mm.
    """
    carried, found = np.eye(len(observed.target_names))[observed.target], []
    count = len(observed)
    trusted = max(int(_TRUSTED * count), min(_DRAWN, count))
    for _ in range(_REFINEMENTS):
        base, points = one_session(measured, carried, flange, weight)
        distance = distances(observed.target, measured, flange, base, points)
        nearest = np.sort(distance, axis=1)
        found.append((weight, *base, points, nearest[:, int(_JUDGED * count)]))
        weight = (distance <= nearest[:, [trusted - 1]]).astype(float)
    return tuple(least(found))


def distances(
    target: ndarray, measured: Pose, flange: Pose, base: Pose, points: ndarray
) -> ndarray:
    """Distances (B, n) of positions from targets at ``points`` (B, T, 3) of the flanges, mm."""
    by_arm = flange.position_mm + (flange.rotation @ points[:, target, :, None])[..., 0]
    predicted = by_arm @ np.swapaxes(base.rotation, 1, 2) + base.position_mm[:, None]
    return np.linalg.norm(predicted - measured.position_mm, axis=2)
