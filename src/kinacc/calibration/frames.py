"""Robot base and targets: frames, what is known of them beforehand, and their parameters.

A target is measured at ``base . flange . target``. Components are named ``base.x_mm`` ..
``base.rz_rad`` (``base2`` and so on for further sessions) and ``<target>.x_mm`` ..
``<target>.rz_rad``. A position is the frame's own; a rotation vector w turns a reference
orientation R to exp(w) R.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from kinacc.calibration.observations import Observations
from kinacc.config import parameter_rules
from kinacc.config.parameter_rules import Rule
from kinacc.errors import Problem, refuse
from kinacc.geometry import IDENTITY, Pose, compose, exp_so3, log_so3, skew
from kinacc.kinematics.model import ErrorModel

MOTIONS = ("x_mm", "y_mm", "z_mm", "rx_rad", "ry_rad", "rz_rad")
BASE = "base"
ANGLE_UNIT_RAD = 1e-3  # one mrad counts as much displacement as one mm
_SMALL_ANGLE_RAD = 1e-3


@dataclass(frozen=True)
class Frames:
    """Robot bases and targets.

    Attributes
    ----------
    poses : Pose
        Robot base of S sessions in the instrument's frame, then T targets in the flange frame,
        shape (S + T, ...) in mm.
    sessions : int
        Number of sessions S.
    """

    poses: Pose
    sessions: int

    @property
    def bases(self) -> Pose:
        """The bases (S, ...), a view."""
        return self.poses.select(slice(self.sessions))

    @property
    def targets(self) -> Pose:
        """The targets (T, ...), a view."""
        return self.poses.select(slice(self.sessions, None))

    @property
    def base(self) -> Pose:
        """The base of the first session, the only one of most data sets."""
        return self.poses.select(0)

    def at_rows(self, observations: Observations) -> tuple[Pose, Pose]:
        """Base and target (n, ...) of every observation."""
        return self.bases.select(observations.session), self.targets.select(observations.target)

    def seen(self, model: ErrorModel, observations: Observations) -> Pose:
        """Poses of the targets in the instrument's frame, as a model predicts them.

        Parameters
        ----------
        model : ErrorModel
            The arm.
        observations : Observations
            n rows: joints, session and target.

        Returns
        -------
        Pose
            ``base . flange . target``, shape (n, ...) in mm.
        """
        bases, targets = self.at_rows(observations)
        return compose(bases, compose(model.pose(observations.at), targets))

    @property
    def tool(self) -> Pose:
        """The first target, the tool centre point of a single-target data set."""
        return self.poses.select(self.sessions)


def known(
    base: Pose = IDENTITY, tool: Pose = IDENTITY, sessions: int = 1, targets: int = 1
) -> Frames:
    """Frames with the same base in every session and every target at one place.

    Parameters
    ----------
    base : Pose
        Robot base in the instrument's frame, mm.
    tool : Pose
        Target in the flange frame, mm.
    sessions, targets : int
        How many there are.

    Returns
    -------
    Frames
        Bases (sessions, ...) and targets (targets, ...).
    """
    return Frames(stacked([base] * sessions + [tool] * targets), sessions)


def stacked(poses: Sequence[Pose]) -> Pose:
    """Single poses as one of shape (n, ...).

    Parameters
    ----------
    poses : sequence of Pose
        n poses in one unit of length.

    Returns
    -------
    Pose
        Rotation (n, 3, 3) and position (n, 3).
    """
    return Pose(*map(np.stack, zip(*poses, strict=True)))


def frame_terms(
    observations: Observations, stated: Frames, rules: Sequence[Rule] = ()
) -> FrameParameters:
    """Parameters of base and targets that begin at ``stated``, all free but for rules.

    Parameters
    ----------
    observations : Observations
        Measured points and poses.
    stated : Frames
        Where they begin and a fixed frame is.
    rules : sequence of Rule
        What the configuration fixes or knows of components.

    Returns
    -------
    FrameParameters
        The F components that can be estimated, in mm and rad.

    Raises
    ------
    InputError
        Names every rule about a frame that ``observations`` do not let estimate.
    """
    frame, axis = places(observations)
    further = (f"{BASE}{number}" for number in range(2, stated.sessions + 1))
    owners = [BASE, *further, *observations.target_names]
    about = [(MOTIONS[j], None, owners[i]) for i, j in zip(frame, axis, strict=True)]
    names = tuple(f"{owner}.{component}" for component, _, owner in about)
    estimated = {*owners, *names}
    keys = ", ".join(name.rpartition("_")[0] for name in names)
    refuse(
        Problem(f"{parameter_rules.FRAMES}, {rule.name!r}", "is not estimated", keys)
        for rule in rules
        if ".".join(filter(None, (rule.frame, rule.parameter))) not in estimated
    )
    position = stated.poses.position_mm
    begin = np.hstack([position, np.zeros_like(position)])[frame, axis]
    free, value, std = ruled(rules, about, np.ones(len(begin), dtype=bool), begin)
    hidden = np.zeros((0, len(names)))
    return FrameParameters(names, (frame, axis), stated, value, free, value, std, hidden)


def ruled(
    rules: Sequence[Rule],
    parameters: Sequence[tuple[str, int | None, str | None]],
    free: np.ndarray,
    value: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What rules make of P parameters, named with their joint or frame.

    ``free`` (P,), ``value`` (P,) and standard deviations (P,) of priors, mm and rad, inf for none.
    A rule without a parameter speaks of those free by default.
    """
    free, value, std = free.copy(), value.copy(), np.full(len(free), np.inf)
    for i, (name, joint, frame) in enumerate(parameters):
        rule = parameter_rules.rule_for(rules, name, joint, frame)
        if rule is not None and (rule.parameter or free[i]):
            unit = parameter_rules.unit(name)
            free[i], value[i] = rule.free, rule.value.get(unit, value[i])
            std[i] = rule.std.get(unit, np.inf)
    return free, value, std


def places(observations: Observations) -> tuple[np.ndarray, np.ndarray]:
    """Frame and axis (F,) of what can be estimated: bases, then targets; axes as ``MOTIONS``.

    A target turns where an orientation of it was measured.
    """
    sessions = len(observations.session_names)
    estimated = np.ones((sessions + len(observations.target_names), len(MOTIONS)), dtype=bool)
    estimated[sessions:, 3:] = False
    estimated[sessions + observations.target[observations.has_rotation], 3:] = True
    frame, axis = np.nonzero(estimated)
    return frame, axis


@dataclass(frozen=True)
class FrameParameters:
    """F components of base and targets as parameters of a fit, in mm and rad.

    No components (F = 0): base and targets are known, at ``reference``.

    Attributes
    ----------
    names : tuple of str
        The components.
    places : tuple of numpy.ndarray
        Number of the frame and axis of each, shapes (F,).
    reference : Frames
        Whose orientations the rotation vectors turn.
    begin : numpy.ndarray
        Where they start, shape (F,).
    free : numpy.ndarray
        True for those that are estimated, shape (F,).
    mean, std : numpy.ndarray
        Of priors, shapes (F,); std inf for none.
    hidden : numpy.ndarray
        Motions of unit length (mm and mrad) that the poses do not show and that are held, shape (m,
        F).
    """

    names: tuple[str, ...]
    places: tuple[np.ndarray, np.ndarray]
    reference: Frames
    begin: np.ndarray
    free: np.ndarray
    mean: np.ndarray
    std: np.ndarray
    hidden: np.ndarray

    @classmethod
    def none(cls, frames: Frames) -> FrameParameters:
        """No parameters: base and targets are ``frames``."""
        blank = np.zeros(0)
        nowhere = blank.astype(int), blank.astype(int)
        return cls((), nowhere, frames, blank, blank.astype(bool), blank, blank, np.zeros((0, 0)))

    def starting(self, start: Frames) -> FrameParameters:
        """These from ``start``, or where they are fixed.

        Rotation vectors turn the stated orientation where one of their components is fixed or has a
        prior, or where no orientation was measured; else that of ``start``.
        """
        here, known = start.poses, np.isfinite(self.std)
        stated = ~np.all(self.by_frame(self.free & ~known)[:, 3:], axis=1)
        rotation = np.where(stated[:, None, None], self.reference.poses.rotation, here.rotation)
        apart = log_so3(here.rotation @ np.swapaxes(rotation, 1, 2)) * stated[:, None]
        begin = np.hstack([here.position_mm, apart])[self.places]
        begin = np.where(self.free, begin, self.begin)
        reference = replace(start, poses=Pose(rotation, here.position_mm))
        mean = np.where(known, self.mean, begin)
        return replace(self, reference=reference, begin=begin, mean=mean)

    @property
    def size(self) -> int:
        """Number of components F."""
        return len(self.names)

    @property
    def angle(self) -> np.ndarray:
        """True (F,) for components of rotation vectors."""
        return self.places[1] >= 3

    @property
    def scale(self) -> np.ndarray:
        """Displacements (F,) that count as one mm."""
        return np.where(self.angle, ANGLE_UNIT_RAD, 1.0)

    @property
    def slots(self) -> list[tuple[str, int, np.ndarray]]:
        """``session`` or ``target``, its number, and the indices of its components."""
        frames, count, slots = self.places[0], self.reference.sessions, []
        for frame in np.unique(frames):
            at = np.flatnonzero(frames == frame)
            slots.append(("session", frame, at) if frame < count else ("target", frame - count, at))
        return slots

    def by_frame(self, c: np.ndarray) -> np.ndarray:
        """Components ``c`` (F,) as (S + T, 6), zero where there is none."""
        table = np.zeros((len(self.reference.poses.position_mm), len(MOTIONS)), c.dtype)
        table[self.places] = c
        return table

    def frames(self, c: np.ndarray) -> Frames:
        """``Frames`` at components ``c`` (F,)."""
        if not self.size:
            return self.reference
        position, turn = np.hsplit(self.by_frame(c), 2)
        rotation = exp_so3(turn) @ self.reference.poses.rotation
        return replace(self.reference, poses=Pose(rotation, position))

    def motions(self, c: np.ndarray) -> np.ndarray:
        """Derivative (F, F) of shifts and turns of the frames in their components at ``c``."""
        motions, turn = np.eye(self.size), np.flatnonzero(self.angle).reshape(-1, 3)
        motions[turn[:, :, None], turn[:, None, :]] = left_jacobians(c[turn])
        return motions


def left_jacobians(w_rad: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) with ``exp(w + dw) = exp(L dw) exp(w)`` to first order."""
    angle = np.linalg.norm(w_rad, axis=-1)[..., None, None]
    cross, large = skew(w_rad), np.maximum(angle, _SMALL_ANGLE_RAD)
    versine = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    excess = np.where(angle < _SMALL_ANGLE_RAD, 1 / 6, (1 - np.sinc(large / np.pi)) / large**2)
    return np.eye(3) + versine * cross + excess * (cross @ cross)


_START_RCOND = 1e-3  # weaker directions of the start are left at zero for the fit to find
_TINY_MM = 1e-12  # points all in one place are not scaled
_LEVER_MM = 100.0  # one radian of orientation counts as much as a point this far away


def closed_form_start(observations: Observations, flange: Pose) -> Frames:
    """Bases and targets from flange poses of a nominal model, without a starting value.

    The session with most rows first, base and targets together; the bases of the others then from
    the targets known by then. What was never measured starts at the identity.

    Parameters
    ----------
    observations : Observations
        n measured points and poses.
    flange : Pose
        Flange poses in the robot base, shape (n, ...), mm.

    Returns
    -------
    Frames
        Bases in the instrument's frame, targets in the flange frame.
    """
    sessions, names = len(observations.session_names), len(observations.target_names)
    start = known(sessions=sessions, targets=names)
    placed = np.zeros(names, dtype=bool)
    sizes = np.bincount(observations.session, minlength=sessions)
    for session in np.argsort(-sizes, kind="stable")[: np.count_nonzero(sizes)]:
        rows = np.flatnonzero(observations.session == session)
        part, at = observations.select(rows), flange.select(rows)
        seen = placed[part.target]
        if seen.any():
            base = base_from_targets(part.select(seen), at.select(seen), start.targets)
        else:
            carried, every = np.eye(names)[part.target], np.ones((1, len(part)))
            base = one_session(part.measured, carried, at, every)[0].select(0)
        start.bases.rotation[session], start.bases.position_mm[session] = base
        in_base = (part.position_mm - base.position_mm) @ base.rotation - at.position_mm
        points = np.einsum("nji,nj->ni", at.rotation, in_base)
        turns = np.swapaxes(at.rotation, 1, 2) @ base.rotation.T @ part.rotation
        for target in np.setdiff1d(part.target, np.flatnonzero(placed)):
            here = part.target == target
            start.targets.position_mm[target] = points[here].mean(axis=0)
            turned = turns[here & part.has_rotation]
            if len(turned):
                start.targets.rotation[target] = Rotation.from_matrix(turned).mean().as_matrix()
            placed[target] = True
    return start


def one_session(
    measured: Pose, carried: np.ndarray, flange: Pose, weight: np.ndarray
) -> tuple[Pose, np.ndarray]:
    """Base and positions of targets from the rows of one session, for each of B sets of rows.

    Linear solutions for the base rotation, the one that leaves the smallest position error: from
    positions with a free 3x3 matrix, C m - R_flange t + c = p_flange, which fails where they lie in
    a plane; and from orientations of each target, robot-world/hand-eye by the leading singular
    vectors of a sum of Kronecker products (Shah, J. Mechanisms Robotics 5, 2013), which fails where
    the tool turns about one axis only.

    Parameters
    ----------
    measured : Pose
        n rotations in the instrument's frame, NaN where not measured, and positions of shape
        (n, 3) or (B, n, 3), mm.
    carried : numpy.ndarray
        One where a row is of a target and zero elsewhere, shape (n, T).
    flange : Pose
        Flange poses in the robot base, shape (n, ...) or (B, n, ...), mm.
    weight : numpy.ndarray
        One for the rows of a set and zero for others, shape (B, n).

    Returns
    -------
    base : Pose
        Robot bases in the instrument's frame, shape (B, ...), mm.
    points : numpy.ndarray
        Targets in the flange frame, shape (B, T, 3), mm; zero for targets that were not measured.
    """
    sets, count = weight.shape
    share, used = (weight / weight.sum(axis=1, keepdims=True))[:, None], weight[:, :, None]
    levers = np.einsum("...nij,nt->...nitj", flange.rotation, carried)
    levers = levers.reshape(-1, count, 3, levers.shape[-2] * 3)
    centred = measured.position_mm - share @ measured.position_mm
    largest = np.abs(used * centred).max(axis=(1, 2), keepdims=True)
    centred = np.pad(centred / np.maximum(largest, _TINY_MM), ((0, 0), (0, 0), (0, 1)))
    centred[:, :, 3] = 1.0
    free = np.einsum("ab,snj->snabj", np.eye(3), centred).reshape(sets, 3 * count, -1)
    system = np.broadcast_to(-levers, (sets, *levers.shape[1:])).reshape(sets, 3 * count, -1)
    system = np.concatenate([free, system], axis=2)
    solution = _solved(system, flange.position_mm.reshape(-1, 3 * count), weight)
    rotations = [_nearest_rotation(np.swapaxes(solution[:, :12].reshape(-1, 3, 4), 1, 2)[:, :3])]
    for rows in (carried.T > 0.0) & np.isfinite(measured.rotation[:, 0, 0]):
        if rows.any():
            # vec(base) is proportional to sum(flange (x) measured) vec(tool'), vec by columns.
            turns = used[:, rows, :, None] * flange.rotation[..., rows, :, :]
            kron = np.einsum("snij,nkl->sikjl", turns, measured.rotation[rows])
            base = np.linalg.svd(kron.reshape(-1, 9, 9))[0][:, :, 0].reshape(-1, 3, 3)
            sign = np.sign(np.linalg.det(base))[:, None, None]
            rotations.append(_nearest_rotation(sign * np.swapaxes(base, 1, 2)))
    starts = []
    for rotation in rotations:  # once the base is turned, positions are linear
        design = (rotation[:, None] @ levers).reshape(sets, count, -1)
        goal = measured.position_mm - flange.position_mm @ np.swapaxes(rotation, 1, 2)
        # Centred, so that what the turns cannot show of a target is left at zero.
        system = (design - share @ design).reshape(sets, 3 * count, -1)
        points = _solved(system, (goal - share @ goal).reshape(sets, -1), weight)
        rest = goal - (rotation[:, None] @ levers @ points[:, None, :, None])[..., 0]
        position = share @ rest
        misfit = np.sum(used * (rest - position) ** 2, axis=(1, 2))
        starts.append((rotation, position[:, 0], points.reshape(sets, -1, 3), misfit))
    turn, position, points, _ = least(starts)
    return Pose(turn, position), points


def least(found: Sequence[tuple[np.ndarray, ...]]) -> list[np.ndarray]:
    """Of arrays (B, ...) found in several ways, those of the way whose last is least, each set."""
    columns = [np.stack(column) for column in zip(*found, strict=True)]
    best = np.argmin(columns[-1], axis=0)
    return [column[best, np.arange(len(best))] for column in columns]


def _solved(system: np.ndarray, right: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Least squares by normal equations, weak directions left at zero: enough for a start."""
    used = np.swapaxes(system * np.repeat(weight, 3, axis=1)[:, :, None], 1, 2)
    gram = np.linalg.pinv(used @ system, rcond=_START_RCOND**2, hermitian=True)
    return (gram @ (used @ right[:, :, None]))[:, :, 0]


def base_from_targets(observations: Observations, flange: Pose, targets: Pose) -> Pose:
    """Base that best carries targets onto their measured points.

    Closed form of absolute orientation by singular values (Arun, Huang and Blostein, PAMI 9, 1987),
    where orientations count as points ``_LEVER_MM`` away.

    Parameters
    ----------
    observations : Observations
        n points and poses of one session.
    flange : Pose
        Flange in the robot base, shape (n, ...) in mm.
    targets : Pose
        Targets in the flange frame, shape (T, ...) in mm.

    Returns
    -------
    Pose
        Robot base in the instrument's frame, mm.
    """
    at, measured = targets.position_mm[observations.target], observations.position_mm
    by_arm = flange.position_mm + (flange.rotation @ at[..., None])[..., 0]
    arm_centre, centre = by_arm.mean(axis=0), measured.mean(axis=0)
    # Orientations, where measured, decide what few or collinear points leave open.
    spread = (measured - centre).T @ (by_arm - arm_centre)
    turned = observations.has_rotation
    by_flange = flange.rotation[turned] @ targets.rotation[observations.target[turned]]
    turns = np.einsum("nij,nkj->ik", observations.rotation[turned], by_flange)
    rotation = _nearest_rotation(spread + _LEVER_MM**2 * turns)
    return Pose(rotation, centre - rotation @ arm_centre)


def _nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    left, _, right = np.linalg.svd(matrix)
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[..., None]
    return left @ right
