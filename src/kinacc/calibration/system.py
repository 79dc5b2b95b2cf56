"""Whitened residuals of a flange model seen through base and targets, and their normal equations.

A parameter of a model may move the arm as a few motions do, times a function of the pose: a VEC
coefficient is a joint's error times a Chebyshev polynomial. Normal equations follow from motions
and functions without the Jacobian of the parameters ever being formed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from kinacc.calibration.frames import FrameParameters, inverse_left_jacobians, left_jacobian
from kinacc.calibration.observations import Observations
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, log_so3, skew
from kinacc.kinematics.model import JointState

BLOCK_ROWS = 1024
WRITTEN_OUT = 350  # parameters up to which the written-out Jacobian is the shorter way to J'J


def require_enough(observations: Observations, parameters: int, name: str, fix: str) -> None:
    """Raise InputError where ``observations`` have fewer residuals than ``parameters`` to fit."""
    if observations.components < max(parameters, 1):
        what = (
            f"{observations.components} residual components of {len(observations)} training rows "
            f"for the {parameters} free parameters of the {name}"
        )
        allowed = "at least as many components as parameters"
        raise InputError(Problem("measurements", what, allowed, fix))


@dataclass(frozen=True)
class Group:
    """Motions ``columns``, each spread over the T functions ``basis`` (n, T); None: as they are.

    Parameters follow motion by motion, function by function.
    """

    columns: slice
    basis: np.ndarray | None = None

    @property
    def motions(self) -> int:
        """Number of motions."""
        return self.columns.stop - self.columns.start

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.motions * (1 if self.basis is None else self.basis.shape[1])


@dataclass(frozen=True)
class FlangeModel:
    """A kinematic model with P parameters, as functions of their vector and of joint states.

    ``pose(x, at)``: flange poses (n, ...). ``linearised(x, at)``: these and motions (E, 6, n), rows
    0-2 mm per parameter, rows 3-5 the rotation vector w of ``exp(w) R``, robot base. Motions are
    those of the parameters, E = P, or ``expansion(at)`` spreads them over these. None: P = 0.
    """

    size: int
    pose: Callable[[np.ndarray, JointState], Pose]
    linearised: Callable[[np.ndarray, JointState], tuple[Pose, np.ndarray]] | None = None
    expansion: Callable[[JointState], list[Group]] | None = None


@dataclass(frozen=True)
class PoseSystem:
    """Residuals model minus measurement in the robot base, in mm.

    Per observation three position residuals and, where an orientation was measured, three of the
    rotation vector log(R_model R_measured'), times ``rotation_weight_mm_per_rad``. Parameters: the
    components of ``frames`` first, then the model's. ``root`` (n,): factors of the residuals of
    every observation, None for ones.
    """

    observations: Observations
    model: FlangeModel
    frames: FrameParameters
    rotation_weight_mm_per_rad: float
    root: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.frames.size + self.model.size

    @property
    def counts(self) -> np.ndarray:
        """Numbers (2,) of residuals of positions and of rotations."""
        seen = self.observations
        return 3 * np.array([len(seen), int(seen.has_rotation.sum())])

    @property
    def weight(self) -> float:
        """Number of residuals, each times its squared factor."""
        squared = 1.0 if self.root is None else self.root**2
        return float(np.sum(squared * (3 + 3 * self.observations.has_rotation)))

    def weighted(self, root: np.ndarray) -> PoseSystem:
        """The same residuals times ``root`` (n,) by observation."""
        return replace(self, root=root)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """All residuals (m,), observation by observation."""
        found = []
        for part, factor, _ in self._parts:
            pose = self.model.pose(x[self.frames.size :], part.at)
            residual = _Seen(self, x, part, pose).residual
            found.append((residual * factor).T[factor.T > 0.0])
        return np.concatenate(found)

    def blocks(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Residual (m,) and Jacobian (m, P) per block of observations, ordered as ``residual``."""
        for part, factor, groups in self._parts:
            rows = spread(self._columns(x, part, factor), groups).transpose(2, 1, 0)[factor.T > 0.0]
            yield rows[:, -1], rows[:, :-1]

    def normal(self, x: np.ndarray, by_kind: bool = False) -> np.ndarray:
        """Gram matrices (K, P+1, P+1) of ``[J | r]``: normal equations and, last, the cost.

        K = 1 for all residuals, or 2 ``by_kind``: of positions and of rotations.
        """
        kinds = (slice(0, 3), slice(3, 6)) if by_kind else (slice(None),)
        total = np.zeros((len(kinds), self.size + 1, self.size + 1))
        for part, factor, groups in self._parts:
            columns = self._columns(x, part, factor)
            for number, kind in enumerate(kinds[: len(factor) // 3]):
                total[number] += gram(columns[:, kind], groups)
        return total

    @cached_property
    def _parts(self) -> list[tuple[Observations, np.ndarray, list[Group]]]:
        """Blocks of observations, factors (3 or 6, n) of residuals, 0 if not measured, groups."""
        found = []
        for begin in range(0, len(self.observations), BLOCK_ROWS):
            rows = slice(begin, begin + BLOCK_ROWS)
            part = self.observations.select(rows)
            turned = part.has_rotation
            factor = np.ones((6 if turned.any() else 3, len(part)))
            factor[3:] = turned
            if self.root is not None:
                # An observation of no weight stays a row.
                factor *= np.maximum(self.root[rows], np.finfo(float).tiny)
            found.append((part, factor, self._groups(part.at)))
        return found

    def _groups(self, at: JointState) -> list[Group]:
        if self.model.expansion is None:
            return [Group(slice(0, self.size + 1))]
        groups, end = [Group(slice(0, self.frames.size))], self.frames.size
        for each in self.model.expansion(at):
            groups.append(Group(slice(end, end + each.motions), each.basis))
            end += each.motions
        return [*groups, Group(slice(end, end + 1))]

    def _columns(self, x: np.ndarray, part: Observations, factor: np.ndarray) -> np.ndarray:
        """Motions and, last, residuals of a block (E+1, 3 or 6, n), times ``factor``."""
        frames = self.frames.size
        if self.model.linearised is None:
            pose, motions = self.model.pose(x, part.at), np.zeros((0, 6, len(part)))
        else:
            pose, motions = self.model.linearised(x[frames:], part.at)
        seen = _Seen(self, x, part, pose)
        columns = np.zeros((frames + len(motions) + 1, *factor.shape))
        own, turns = columns[frames:-1], motions[:, 3:]
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            # A turn w of the flange swings the target's arm: w x arm.
            own[:, i] = motions[:, i] + turns[:, j] * seen.arm[k] - turns[:, k] * seen.arm[j]
            if seen.turning is not None:
                own[:, 3 + i] = np.einsum("jn,ejn->en", seen.turning[:, i].T, turns)
        for kind, number, at in self.frames.slots:
            rows = part.session == number if kind == "bases" else part.target == number
            if rows.any():
                turn = left_jacobian(x[at[3:]]) if len(at) == 6 else None
                columns[at[0] : at[-1] + 1, :, rows] = seen.of_frame(kind, rows, turn, len(factor))
        columns[-1] = seen.residual
        return columns if self._plain else columns * factor

    @cached_property
    def _plain(self) -> bool:
        """Whether every residual counts once."""
        turned = self.observations.has_rotation
        return self.root is None and bool(turned.all() or not turned.any())


class _Seen:
    """Residuals (3 or 6, n) of a block at flange poses, and what their derivatives are made of.

    ``arm`` (3, n): from the flange to the target, robot base; ``turning`` (n, 3, 3): derivative of
    rotation residuals by turns of the model in the robot base.
    """

    def __init__(self, system: PoseSystem, x: np.ndarray, part: Observations, flange: Pose) -> None:
        frames = system.frames.frames(x[: system.frames.size])
        self.flange = flange.rotation
        self.back = np.swapaxes(frames.bases.rotation, 1, 2)[part.session]
        self.reach = part.position_mm - frames.bases.position_mm[part.session]
        place = frames.targets.position_mm[part.target]
        self.arm = np.einsum("nij,nj->in", flange.rotation, place)
        local = np.einsum("nij,nj->in", self.back, self.reach)
        self.residual = flange.position_mm.T + self.arm - local
        turned = part.has_rotation
        self.turning = None
        if turned.any():
            weight = system.rotation_weight_mm_per_rad
            model = flange.rotation @ frames.targets.rotation[part.target]
            seen = self.back @ np.where(turned[:, None, None], part.rotation, np.eye(3))
            angles = log_so3(model @ np.swapaxes(seen, 1, 2)) * turned[:, None]
            self.residual = np.concatenate([self.residual, weight * angles.T])
            self.turning = weight * inverse_left_jacobians(angles)

    def of_frame(
        self, kind: str, rows: np.ndarray, turn: np.ndarray | None, count: int
    ) -> np.ndarray:
        """Derivative (3 or 6, 3 or 6, r) of residuals by the components of one base or target."""
        ahead = self.back[rows] if kind == "bases" else self.flange[rows]
        found = np.zeros((len(ahead), count, 3 if turn is None else 6))
        found[:, :3, :3] = ahead
        if turn is not None:
            if kind == "bases":
                found[:, :3, 3:] = -ahead @ skew(self.reach[rows]) @ turn
            if self.turning is not None:
                # The measured side stands behind exp(r): L^-1 exp(r) is the transposed L^-1.
                turning = self.turning[rows]
                turning = np.swapaxes(turning, 1, 2) if kind == "bases" else turning
                found[:, 3:, 3:] = turning @ (ahead @ turn)
        return found.transpose(2, 1, 0)


def spread(columns: np.ndarray, groups: Sequence[Group]) -> np.ndarray:
    """Rows (P, m, n) of the parameters, from those of the motions ``columns`` (E, m, n)."""
    if all(group.basis is None for group in groups):
        return columns
    full = np.empty((sum(group.size for group in groups), *columns.shape[1:]))
    begin = 0
    for group in groups:
        own, into = columns[group.columns], full[begin : begin + group.size]
        begin += group.size
        if group.basis is None:
            into[:] = own
        else:
            basis = np.ascontiguousarray(group.basis.T)[:, None]
            np.multiply(own[:, None], basis, out=into.reshape(group.motions, -1, *own.shape[1:]))
    return full


def gram(columns: np.ndarray, groups: Sequence[Group]) -> np.ndarray:
    """Gram matrix (P, P) of the spread rows of ``columns`` (E, m, n), summed over m and n."""
    count = columns.shape[2]
    sizes = [group.size for group in groups]
    if sum(sizes) <= WRITTEN_OUT:
        rows = spread(columns, groups).reshape(sum(sizes), -1)
        half = scipy.linalg.blas.dsyrk(1.0, rows.T, trans=1, lower=1)
        return half + np.tril(half, -1).T
    by_pose = np.ascontiguousarray(columns.transpose(2, 1, 0))
    products = np.swapaxes(by_pose, 1, 2) @ by_pose  # (n, E, E)
    bases = [np.ones((count, 1)) if group.basis is None else group.basis for group in groups]
    ends = np.cumsum([0, *sizes])
    result = np.empty((ends[-1], ends[-1]))
    for i, (first, basis) in enumerate(zip(groups, bases, strict=True)):
        for j, (second, other) in enumerate(zip(groups[: i + 1], bases, strict=False)):
            # A GEMM over the poses: every pair of motions against every pair of functions.
            own = products[:, first.columns, second.columns].reshape(count, -1)
            both = (basis[:, :, None] * other[:, None, :]).reshape(count, -1)
            shape = first.motions, second.motions, basis.shape[1], other.shape[1]
            block = (own.T @ both).reshape(shape).transpose(0, 2, 1, 3)
            block = block.reshape(shape[0] * shape[2], shape[1] * shape[3])
            result[ends[i] : ends[i + 1], ends[j] : ends[j + 1]] = block
            result[ends[j] : ends[j + 1], ends[i] : ends[i + 1]] = block.T
    return result
