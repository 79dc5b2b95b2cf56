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
    bases : Pose
        Robot base of S sessions in the instrument's frame, shape (S, ...) in mm.
    targets : Pose
        T targets in the flange frame, shape (T, ...) in mm.
    """

    bases: Pose
    targets: Pose

    @classmethod
    def split(cls, frames: Pose, sessions: int) -> Frames:
        """The first ``sessions`` of ``frames`` (S + T, ...) as bases, the others as targets."""
        bases, targets = zip(*(np.split(part, [sessions]) for part in frames), strict=True)
        return cls(Pose(*bases), Pose(*targets))

    @property
    def joined(self) -> Pose:
        """Bases, then targets, (S + T, ...)."""
        return Pose(
            *(np.concatenate(parts) for parts in zip(self.bases, self.targets, strict=True))
        )

    @property
    def base(self) -> Pose:
        """The base of the first session, the only one of most data sets."""
        return Pose(self.bases.rotation[0], self.bases.position_mm[0])

    @property
    def sessions(self) -> int:
        """Number of sessions S."""
        return len(self.bases.position_mm)

    def at_rows(self, observations: Observations) -> tuple[Pose, Pose]:
        """Base and target (n, ...) of every observation."""
        bases = Pose(*(part[observations.session] for part in self.bases))
        return bases, Pose(*(part[observations.target] for part in self.targets))

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
        return Pose(self.targets.rotation[0], self.targets.position_mm[0])


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
    return Frames(stacked([base] * sessions), stacked([tool] * targets))


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
    return Pose(
        np.stack([pose.rotation for pose in poses]), np.stack([pose.position_mm for pose in poses])
    )


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
    names = component_names(observations)
    parts = [tuple(name.rpartition(".")[::2]) for name in names]
    frames: dict[str, list[str]] = {}
    for frame, component in parts:
        frames.setdefault(frame, []).append(component)
    refuse(
        [
            Problem(f"{parameter_rules.FRAMES}, {rule.name!r}", message, allowed)
            for rule, message, allowed in parameter_rules.strangers(
                rules, observations.joints, frames
            )
        ]
    )
    begin = np.zeros(len(names))
    begin[[name.endswith("_mm") for name in names]] = stated.joined.position_mm.ravel()
    about = [(component, None, frame) for frame, component in parts]
    free, value, std = ruled(rules, about, np.ones(len(names), dtype=bool), begin)
    return FrameParameters(names, stated, value, free, value, std, np.zeros((0, len(names))))


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


def component_names(observations: Observations) -> tuple[str, ...]:
    """Names of what can be estimated: a target turns where an orientation of it was measured."""
    sessions = range(1, len(observations.session_names) + 1)
    names = [f"{BASE}{i if i > 1 else ''}.{motion}" for i in sessions for motion in MOTIONS]
    for target, turns in zip(
        observations.target_names, orientations_measured(observations), strict=True
    ):
        names += [f"{target}.{motion}" for motion in (MOTIONS if turns else MOTIONS[:3])]
    return tuple(names)


def orientations_measured(observations: Observations) -> np.ndarray:
    """True (T,) for targets of which any orientation was measured."""
    measured = np.zeros(len(observations.target_names), dtype=bool)
    measured[np.unique(observations.target[observations.has_rotation])] = True
    return measured


@dataclass(frozen=True)
class FrameParameters:
    """F components of base and targets as parameters of a fit, in mm and rad.

    No components (F = 0): base and targets are known, at ``reference``.

    Attributes
    ----------
    names : tuple of str
        The components.
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
        return cls((), frames, blank, blank.astype(bool), blank, blank, np.zeros((0, 0)))

    def starting(self, start: Frames) -> FrameParameters:
        """These from ``start``, or where they are fixed.

        Rotation vectors turn the stated orientation where one of their components is fixed or has a
        prior, or where no orientation was measured; else that of ``start``.
        """
        here, turn, turning = start.joined, self.turn, self.turning
        known, begin = np.isfinite(self.std), np.zeros(self.size)
        stated = np.ones(len(here.position_mm), dtype=bool)
        stated[turning] = (~self.free | known)[turn].any(axis=1)
        rotation = np.where(stated[:, None, None], self.reference.joined.rotation, here.rotation)
        apart = here.rotation[turning] @ np.swapaxes(rotation[turning], 1, 2)
        begin[self.place] = here.position_mm
        begin[turn] = log_so3(apart) * stated[turning][:, None]
        begin[~self.free] = self.begin[~self.free]
        reference = Frames.split(Pose(rotation, here.position_mm), start.sessions)
        mean = np.where(known, self.mean, begin)
        return replace(self, reference=reference, begin=begin, mean=mean)

    @property
    def size(self) -> int:
        """Number of components F."""
        return len(self.names)

    @property
    def angle(self) -> np.ndarray:
        """True (F,) for components of rotation vectors."""
        return np.array([name.endswith("_rad") for name in self.names], dtype=bool)

    @property
    def scale(self) -> np.ndarray:
        """Displacements (F,) that count as one mm."""
        return np.where(self.angle, ANGLE_UNIT_RAD, 1.0)

    @property
    def place(self) -> np.ndarray:
        """Indices (S + T, 3) of the components of positions: of the bases, then of the targets."""
        return np.flatnonzero(~self.angle).reshape(-1, 3)

    @property
    def turn(self) -> np.ndarray:
        """Indices (K, 3) of the components of rotation vectors."""
        return np.flatnonzero(self.angle).reshape(-1, 3)

    @property
    def turning(self) -> np.ndarray:
        """Numbers (K,) of the frames that have a rotation vector."""
        return np.searchsorted(self.place[:, 0], self.turn[:, 0]) - 1

    @property
    def slots(self) -> list[tuple[str, int, np.ndarray]]:
        """``bases`` or ``targets``, the number of the frame and the indices of its components."""
        count, turning = self.reference.sessions, self.turning
        return [
            (
                "bases" if frame < count else "targets",
                frame if frame < count else frame - count,
                first + np.arange(6 if frame in turning else 3),
            )
            for frame, (first, *_) in enumerate(self.place)
        ]

    def frames(self, c: np.ndarray) -> Frames:
        """``Frames`` at components ``c`` (F,)."""
        if not self.size:
            return self.reference
        rotation, turning = self.reference.joined.rotation, self.turning
        rotation[turning] = exp_so3(c[self.turn]) @ rotation[turning]
        return Frames.split(Pose(rotation, c[self.place]), self.reference.sessions)

    def motions(self, c: np.ndarray) -> np.ndarray:
        """Derivative (F, F) of shifts and turns of the frames in their components at ``c``."""
        motions, turn = np.eye(self.size), self.turn
        motions[turn[:, :, None], turn[:, None, :]] = left_jacobians(c[turn])
        return motions


def left_jacobians(w_rad: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) with ``exp(w + dw) = exp(L dw) exp(w)`` to first order."""
    angle = np.linalg.norm(w_rad, axis=-1)[..., None, None]
    cross, large = skew(w_rad), np.maximum(angle, _SMALL_ANGLE_RAD)
    small = angle < _SMALL_ANGLE_RAD
    versine = np.where(small, 0.5, (1 - np.cos(large)) / large**2)
    excess = np.where(small, 1 / 6, (large - np.sin(large)) / large**3)
    return np.eye(3) + versine * cross + excess * (cross @ cross)


def inverse_left_jacobians(w_rad: np.ndarray) -> np.ndarray:
    """Inverses (n, 3, 3) of ``left_jacobians`` for rotation vectors (n, 3)."""
    angle = np.linalg.norm(w_rad, axis=1)
    half = 0.5 * np.maximum(angle, _SMALL_ANGLE_RAD)
    series = 1 / 12 + angle**2 / 720
    factor = np.where(angle < _SMALL_ANGLE_RAD, series, (1 - half / np.tan(half)) / (4 * half**2))
    cross = skew(w_rad)
    return np.eye(3) - 0.5 * cross + factor[:, None, None] * (cross @ cross)


_START_RCOND = 1e-3  # weaker directions of the start are left at zero for the fit to find
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
        part, at = observations.select(rows), Pose(*(values[rows] for values in flange))
        measured = np.isin(np.arange(names), part.target)
        new = measured & ~placed
        if not placed[measured].any():
            base, points = one_session(part, at)
            start.targets.position_mm[new] = points[new]
        else:
            base = base_from_targets(part, at, start.targets, placed)
            in_base = (part.position_mm - base.position_mm) @ base.rotation - at.position_mm
            points = np.einsum("nji,nj->ni", at.rotation, in_base)
            for target in np.flatnonzero(new):
                start.targets.position_mm[target] = points[part.target == target].mean(axis=0)
        for target in np.flatnonzero(new):
            turned = part.has_rotation & (part.target == target)
            if turned.any():
                turns = np.swapaxes(at.rotation[turned], 1, 2) @ base.rotation.T
                mean = Rotation.from_matrix(turns @ part.rotation[turned]).mean()
                start.targets.rotation[target] = mean.as_matrix()
        start.bases.rotation[session], start.bases.position_mm[session] = base
        placed |= measured
    return start


def one_session(observations: Observations, flange: Pose) -> tuple[Pose, np.ndarray]:
    """Base and positions of targets from the rows of one session.

    Linear solutions for the base rotation, the one that leaves the smallest position error: from
    positions with a free 3x3 matrix, C m - R_flange t + c = p_flange, which fails where they lie in
    a plane; and from orientations of each target, robot-world/hand-eye by the leading singular
    vectors of a sum of Kronecker products (Shah, J. Mechanisms Robotics 5, 2013), which fails where
    the tool turns about one axis only.

    Parameters
    ----------
    observations : Observations
        n measured points and poses of one session.
    flange : Pose
        Flange poses in the robot base, shape (n, ...), mm.

    Returns
    -------
    base : Pose
        Robot base in the instrument's frame, mm.
    points : numpy.ndarray
        Targets in the flange frame, shape (T, 3), mm; zero for targets that were not measured.
    """
    count, targets = len(observations), len(observations.target_names)
    carried = np.eye(targets)[observations.target]
    levers = np.einsum("nij,nt->nitj", flange.rotation, carried).reshape(count, 3, -1)
    centred = observations.position_mm - observations.position_mm.mean(axis=0)
    centred = centred / (np.abs(centred).max() or 1.0)
    free = np.einsum("ab,nj->nabj", np.eye(3), centred).reshape(3 * count, 9)
    constant, system = np.tile(np.eye(3), (count, 1)), -levers.reshape(3 * count, -1)
    system = np.hstack([free, constant, system])
    solution = _solved(system, flange.position_mm.ravel())
    rotations = [_nearest_rotation(solution[:9].reshape(3, 3)).T]
    for target in np.unique(observations.target[observations.has_rotation]):
        rows = observations.has_rotation & (observations.target == target)
        # vec(base) is proportional to sum(flange (x) measured) vec(tool'), vec by columns.
        kron = np.einsum("nij,nkl->ikjl", flange.rotation[rows], observations.rotation[rows])
        base = np.linalg.svd(kron.reshape(9, 9))[0][:, 0].reshape(3, 3).T
        rotations.append(_nearest_rotation(base if np.linalg.det(base) > 0 else -base))
    starts = []
    for rotation in rotations:  # once the base is turned, positions are linear
        design = rotation @ levers
        goal = observations.position_mm - flange.position_mm @ rotation.T
        # Centred, so that what the turns cannot show of a target is left at zero.
        system = (design - design.mean(axis=0)).reshape(3 * count, -1)
        points = _solved(system, (goal - goal.mean(axis=0)).ravel())
        rest = goal - design @ points
        position = rest.mean(axis=0)
        misfit = float(np.sum((rest - position) ** 2))
        starts.append((misfit, Pose(rotation, position), points.reshape(targets, 3)))
    return min(starts, key=lambda start: start[0])[1:]


def _solved(system: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Least squares by normal equations, weak directions left at zero: enough for a start."""
    gram = np.linalg.pinv(system.T @ system, rcond=_START_RCOND**2, hermitian=True)
    return gram @ (system.T @ right)


def base_from_targets(
    observations: Observations, flange: Pose, targets: Pose, placed: np.ndarray | None = None
) -> Pose:
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
    placed : numpy.ndarray, optional
        True for the targets that are known, shape (T,); all if not given.

    Returns
    -------
    Pose
        Robot base in the instrument's frame, mm.
    """
    rows = np.ones(len(observations), bool) if placed is None else placed[observations.target]
    at = targets.position_mm[observations.target[rows]]
    by_arm = flange.position_mm[rows] + (flange.rotation[rows] @ at[..., None])[..., 0]
    measured = observations.position_mm[rows]
    arm_centre, centre = by_arm.mean(axis=0), measured.mean(axis=0)
    # Orientations, where measured, decide what few or collinear points leave open.
    spread = (measured - centre).T @ (by_arm - arm_centre)
    turned = rows & observations.has_rotation
    by_flange = flange.rotation[turned] @ targets.rotation[observations.target[turned]]
    turns = np.einsum("nij,nkj->ik", observations.rotation[turned], by_flange)
    rotation = _nearest_rotation(spread + _LEVER_MM**2 * turns)
    return Pose(rotation, centre - rotation @ arm_centre)


def _nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    left, _, right = np.linalg.svd(matrix)
    left[:, 2] *= np.sign(np.linalg.det(left @ right))
    return left @ right
