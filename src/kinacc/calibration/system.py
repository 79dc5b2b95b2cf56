"""Whitened residuals of a flange model seen through base and targets, with their Jacobian.

Numbers first, observations last: one operation for a whole block of them, and products of Jacobians
without a copy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kinacc.calibration.basis_expansion import Group, gram, spread_rows, summed
from kinacc.calibration.frames import FrameCoordinates, left_jacobian
from kinacc.calibration.observations import Observations
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, log_so3
from kinacc.kinematics.chain import cross
from kinacc.kinematics.model import JointState

BLOCK_ROWS = 1024
WRITTEN_OUT = 350  # parameters up to which the written-out Jacobian is the shorter way to J'J
_KEPT = 32  # blocks up to which functions of their poses are kept
_NEAR = 0.5  # cosine of the angle below which a rotation vector follows from the skew part alone
_SMALL_ANGLE_RAD = 1e-3


def require_enough(observations: Observations, parameters: int, name: str, fix: str) -> None:
    """Raise InputError where ``observations`` have fewer residuals than ``parameters`` to fit."""
    if observations.components < max(parameters, 1):
        what = (
            f"{observations.components} residual components of {len(observations)} training rows "
            f"for the {parameters} free parameters of the {name}"
        )
        allowed = "at least as many components as parameters"
        raise InputError(Problem("measurements", what, allowed, fix))


Pull = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class FlangeModel:
    """A kinematic model with P parameters, as functions of the vector and of the observations.

    ``pose(x, at)``: flange poses (n, ...). ``linearised(x, at)``: these and motions (E, 6, n),
    rows 0-2 mm per parameter, rows 3-5 the rotation vector w of ``exp(w) R``, robot base. Motions
    are those of the parameters, E = P, or ``expansion(at)`` spreads them over these. None: P = 0.
    ``pulled(x, at)``: poses and, of forces and moments (3, n) on the flange, their product (E, n)
    with the motions, where that takes less than these.
    """

    size: int
    pose: Callable[[np.ndarray, JointState], Pose]
    linearised: Callable[[np.ndarray, JointState], tuple[Pose, np.ndarray]] | None = None
    expansion: Callable[[JointState], list[Group]] | None = None
    pulled: Callable[[np.ndarray, JointState], tuple[Pose, Pull]] | None = None

    def with_motions(self, x: np.ndarray, at: JointState) -> tuple[Pose, np.ndarray]:
        """Flange poses (n, ...) and motions (E, 6, n)."""
        if self.linearised is None:
            return self.pose(x, at), np.zeros((0, 6, len(at)))
        return self.linearised(x, at)


@dataclass(frozen=True)
class _Part:
    """A block of n observations as residuals need it, which no parameter changes.

    ``components`` 3, or 6 where an orientation was measured; ``turned`` (n,) says where.
    ``centred`` (3, n): positions about their session's centroid; ``rotation`` (3, 3, n): measured,
    the identity where not. ``sessions``, ``targets``: which there are, and their rows.
    ``root`` (n,): factors of the residuals, None for ones.
    """

    at: JointState
    target: np.ndarray
    turned: np.ndarray
    centred: np.ndarray
    rotation: np.ndarray
    sessions: tuple[tuple[int, np.ndarray | slice], ...]
    targets: tuple[tuple[int, np.ndarray | slice], ...]
    root: np.ndarray | None

    @classmethod
    def of(
        cls, seen: Observations, coordinates: FrameCoordinates, root: np.ndarray | None
    ) -> _Part:
        """``seen`` under what ``coordinates`` know of it."""
        turned = seen.has_rotation
        rotation = np.where(turned[:, None, None], seen.rotation, np.eye(3))
        return cls(
            seen.at,
            seen.target,
            turned,
            np.ascontiguousarray((seen.position_mm - coordinates.centroid_mm[seen.session]).T),
            np.ascontiguousarray(rotation.transpose(1, 2, 0)),
            _rows(seen.session),
            _rows(seen.target),
            root,
        )

    @property
    def components(self) -> int:
        return 6 if self.turned.any() else 3

    @cached_property
    def factor(self) -> np.ndarray | None:
        """Factors (c, n) of the residuals, 0 where nothing was measured; None for ones."""
        if self.root is None and (self.components == 3 or self.turned.all()):
            return None
        factor = np.ones((self.components, len(self.turned)))
        factor[3:] = self.turned
        return factor if self.root is None else factor * self.root

    @property
    def kept(self) -> np.ndarray:
        """True (n, c) where a component was measured."""
        kept = np.ones((len(self.turned), self.components), dtype=bool)
        kept[:, 3:] = self.turned[:, None]
        return kept


@dataclass(frozen=True)
class PoseSystem:
    """Residuals model minus measurement in the robot base, in mm.

    Per observation three position residuals and, where an orientation was measured, three of the
    rotation vector log(R_model R_measured'), times ``rotation_weight_mm_per_rad``. Parameters: the
    frame coordinates first, then the model's. ``root`` (n,): factors of the residuals of every
    observation, None for ones.
    """

    observations: Observations
    model: FlangeModel
    coordinates: FrameCoordinates
    rotation_weight_mm_per_rad: float
    root: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.coordinates.size + self.model.size

    @property
    def count(self) -> int:
        """Number of residuals."""
        return self.observations.components

    def weighted(self, root: np.ndarray) -> PoseSystem:
        """The same residuals times ``root`` (n,) by observation."""
        return replace(self, root=root)

    def cost(self, x: np.ndarray) -> float:
        """Sum of squared whitened residuals."""
        return sum(float(np.vdot(each, each)) for each in self._residuals(x))

    def residual(self, x: np.ndarray) -> np.ndarray:
        """All residuals (m,), observation by observation."""
        found = zip(self._residuals(x), self._parts, strict=True)
        return np.concatenate([residual.T[part.kept] for residual, part in found])

    def blocks(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Residual (m,) and Jacobian (m, P) per block of observations, ordered as ``residual``."""
        for part in self._parts:
            rows = spread_rows(self._columns(x, part), self._groups(part))
            rows = rows.transpose(2, 1, 0)[part.kept]
            yield rows[:, -1], rows[:, :-1]

    def stacked(self, x: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        """Rows of ``[J | r]`` (m, P+1) in any order: 0 and those of positions, 1 and of rotations.

        Rows that were not measured are zero.
        """
        for part in self._parts:
            columns, groups = self._columns(x, part), self._groups(part)
            for begin in range(0, part.components, 3):
                rows = spread_rows(columns[:, begin : begin + 3], groups)
                yield begin // 3, rows.reshape(len(rows), -1).T

    def gram(self, x: np.ndarray) -> np.ndarray:
        """Gram matrix (P+1, P+1) of ``[J | r]``: normal equations and, last, the cost."""
        total = np.zeros((self.size + 1, self.size + 1))
        for part in self._parts:
            columns, groups = self._columns(x, part), self._groups(part)
            if self.size > WRITTEN_OUT:
                total += gram(np.ascontiguousarray(columns.transpose(2, 1, 0)), groups)
            else:
                rows = spread_rows(columns, groups).reshape(len(total), -1)
                total += rows @ rows.T
        return total

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """The last row (P+1,) of ``gram`` alone."""
        total = np.zeros(self.size + 1)
        for part in self._parts:
            if self.model.pulled is None:
                columns = self._columns(x, part)
                seen = np.einsum("ecn,cn->en", columns, columns[-1])
            else:
                seen = self._pulled(x, part)
            total += summed(seen, self._groups(part))
        return total

    def gram_blocks(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, list[Group]]]:
        """Per block the columns (n, c, E+1) of motions and, last, residuals, and their groups.

        c is 3, or 6 where an orientation was measured. Rows that were not measured are zero.
        """
        for part in self._parts:
            columns = self._columns(x, part).transpose(2, 1, 0)
            yield np.ascontiguousarray(columns), self._groups(part)

    @cached_property
    def _parts(self) -> list[_Part]:
        seen, root = self.observations, self.root
        blocks = [slice(at, at + BLOCK_ROWS) for at in range(0, len(seen), BLOCK_ROWS)]
        return [
            _Part.of(seen.select(rows), self.coordinates, None if root is None else root[rows])
            for rows in blocks
        ]

    @cached_property
    def _kept_groups(self) -> dict[int, list[Group]]:
        return {}

    def _groups(self, part: _Part) -> list[Group]:
        if len(self._parts) > _KEPT:
            return self._expanded(part)
        found = self._kept_groups.get(id(part))
        if found is None:
            found = self._kept_groups[id(part)] = self._expanded(part)
        return found

    def _expanded(self, part: _Part) -> list[Group]:
        frames = self.coordinates.size
        if self.model.expansion is None:
            return [Group(slice(0, self.size + 1), None)]
        groups, end = [Group(slice(0, frames), None)], frames
        for group in self.model.expansion(part.at):
            end = group.columns.stop + frames
            groups.append(Group(slice(group.columns.start + frames, end), group.basis))
        return [*groups, Group(slice(end, end + 1), None)]

    def _residuals(self, x: np.ndarray) -> Iterator[np.ndarray]:
        for part in self._parts:
            flange = self.model.pose(x[self.coordinates.size :], part.at)
            residual = self._seen(x, part, flange).residual
            yield residual if part.factor is None else residual * part.factor

    def _columns(self, x: np.ndarray, part: _Part) -> np.ndarray:
        """Motions and, last, residuals of a block (E+1, c, n)."""
        frames = self.coordinates.size
        flange, motions = self.model.with_motions(x[frames:], part.at)
        seen = self._seen(x, part, flange)
        columns = np.zeros((frames + len(motions) + 1, part.components, len(part.turned)))
        columns[-1] = seen.residual
        own = columns[frames:-1]
        own[:, :3] = motions[:, :3]
        turns = motions[:, 3:]
        if self._arms_matter():
            # A turn of the flange swings the target's arm: w x arm.
            for axis in range(3):
                u, v = (axis + 1) % 3, (axis + 2) % 3
                own[:, axis] += turns[:, u] * seen.arm[v]
                own[:, axis] -= turns[:, v] * seen.arm[u]
        turning = None
        if part.components == 6:
            turning = self.rotation_weight_mm_per_rad * _inverse_left_jacobian(seen.angles)
            for axis in range(3):
                np.multiply(turns[:, 0], turning[axis, 0], out=own[:, 3 + axis])
                own[:, 3 + axis] += turns[:, 1] * turning[axis, 1]
                own[:, 3 + axis] += turns[:, 2] * turning[axis, 2]
        if frames:
            self._fill_frames(columns, x[:frames], part, seen, turning)
        if part.factor is not None:
            columns *= part.factor
        return columns

    def _pulled(self, x: np.ndarray, part: _Part) -> np.ndarray:
        """``_columns`` (E+1, c, n) times residuals, summed over c, without the motions."""
        coordinates, frames = self.coordinates, self.coordinates.size
        flange, pull = self.model.pulled(x[frames:], part.at)
        seen = self._seen(x, part, flange)
        residual = seen.residual
        squared = residual * residual
        if part.factor is not None:
            residual, squared = residual * part.factor**2, squared * part.factor**2
        force, moment = residual[:3], np.zeros_like(residual[:3])
        turning = None
        if part.components == 6:
            turning = self.rotation_weight_mm_per_rad * _inverse_left_jacobian(seen.angles)
            moment = np.einsum("ijn,in->jn", turning, residual[3:])
        own = pull(force, moment + cross(seen.arm, force))
        found = np.zeros((frames + len(own) + 1, len(part.turned)))
        found[frames:-1], found[-1] = own, squared.sum(axis=0)
        for session, rows in part.sessions if coordinates.base_free else ():
            begin = coordinates.base_columns(session).start
            about = cross(force[:, rows], seen.turned[:, rows])
            if turning is not None:
                about -= np.einsum("ijn,jn->in", turning[..., rows], residual[3:, rows])
            found[begin : begin + 3, rows] = -force[:, rows]
            found[begin + 3 : begin + 6, rows] = left_jacobian(x[begin + 3 : begin + 6]).T @ about
        for target, rows in part.targets if coordinates.targets_free else ():
            begin, rotation = coordinates.target_columns(target).start, seen.rotation[..., rows]
            found[begin : begin + 3, rows] = np.einsum("ijn,in->jn", rotation, force[:, rows])
            if turning is not None and coordinates.turns[target]:
                about = np.einsum("ijn,in->jn", rotation, moment[:, rows])
                turn = left_jacobian(x[begin + 3 : begin + 6])
                found[begin + 3 : begin + 6, rows] = turn.T @ about
        return found

    def _seen(self, x: np.ndarray, part: _Part, flange: Pose) -> _Seen:
        frame_x = x[: self.coordinates.size]
        targets = self.coordinates.targets(frame_x)
        rotation = np.ascontiguousarray(flange.rotation.transpose(1, 2, 0))
        place = targets.position_mm[part.target].T
        arm = rotation[:, 0] * place[0] + rotation[:, 1] * place[1] + rotation[:, 2] * place[2]
        full = part.components == 6
        measured = np.empty_like(part.rotation) if full else None
        turned, shift = np.empty_like(part.centred), np.empty_like(part.centred)
        for session, rows in part.sessions:
            inverse = self.coordinates.inverse_base(frame_x, session)
            turned[:, rows] = inverse.rotation @ part.centred[:, rows]
            shift[:, rows] = inverse.position_mm[:, None]
            if full:
                measured[..., rows] = np.tensordot(inverse.rotation, part.rotation[..., rows], 1)
        residual = np.empty((part.components, len(part.turned)))
        residual[:3] = flange.position_mm.T + arm - turned - shift
        angles = None
        if full:
            held = np.empty_like(rotation)
            for target, rows in part.targets:
                own = targets.rotation[target]
                held[..., rows] = np.einsum("ikn,kj->ijn", rotation[..., rows], own)
            apart = sum(held[:, None, k] * measured[None, :, k] for k in range(3))
            angles = _rotation_vector(apart)
            if not part.turned.all():
                angles[:, ~part.turned] = 0.0
            residual[3:] = self.rotation_weight_mm_per_rad * angles
        return _Seen(residual, rotation, arm, turned, angles)

    def _arms_matter(self) -> bool:
        free = self.coordinates.targets_free
        return free or bool(np.any(self.coordinates.anchor.targets.position_mm))

    def _fill_frames(self, columns, frame_x, part, seen, turning):
        coordinates = self.coordinates
        for session, rows in part.sessions if coordinates.base_free else ():
            begin = coordinates.base_columns(session).start
            turn = left_jacobian(frame_x[begin + 3 : begin + 6])
            for axis in range(3):
                columns[begin + axis, axis, rows] = -1.0
                about = turn[:, axis, None]
                columns[begin + 3 + axis][:3, rows] = cross(seen.turned[:, rows], about)
                if turning is not None:
                    # The measured side stands behind exp(r): L^-1 exp(r) is the transposed L^-1.
                    moved = np.einsum("jin,j->in", turning[..., rows], -turn[:, axis])
                    columns[begin + 3 + axis][3:, rows] = moved
        for target, rows in part.targets if coordinates.targets_free else ():
            begin, rotation = coordinates.target_columns(target).start, seen.rotation[..., rows]
            columns[begin : begin + 3, :3, rows] = rotation.transpose(1, 0, 2)
            if turning is None or not coordinates.turns[target]:
                continue
            turn = left_jacobian(frame_x[begin + 3 : begin + 6])
            for axis in range(3):
                about = np.einsum("ijn,j->in", rotation, turn[:, axis])
                moved = np.einsum("ijn,jn->in", turning[..., rows], about)
                columns[begin + 3 + axis][3:, rows] = moved


@dataclass(frozen=True)
class _Seen:
    """Residuals (c, n) of a block, and what they are made of.

    ``rotation`` (3, 3, n) of the flange, ``arm`` (3, n) from there to the target, ``turned`` (3, n)
    measured points in the robot base about their centroid, ``angles`` (3, n) of rotation residuals.
    """

    residual: np.ndarray
    rotation: np.ndarray
    arm: np.ndarray
    turned: np.ndarray
    angles: np.ndarray | None


def _rows(label: np.ndarray) -> tuple[tuple[int, np.ndarray | slice], ...]:
    """Every label (n,) with its rows."""
    found = np.unique(label)
    if found.size == 1:
        return ((int(found[0]), slice(None)),)
    return tuple((int(each), np.flatnonzero(label == each)) for each in found)


def _rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Rotation vectors (3, n) of rotations (3, 3, n)."""
    cosine = 0.5 * (rotation[0, 0] + rotation[1, 1] + rotation[2, 2] - 1.0)
    if not np.all(cosine > _NEAR):
        return np.ascontiguousarray(log_so3(rotation.transpose(2, 0, 1)).T)
    skewed = 0.5 * np.stack(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    square = skewed[0] ** 2 + skewed[1] ** 2 + skewed[2] ** 2
    sine = np.sqrt(square)
    small = sine < _SMALL_ANGLE_RAD
    factor = 1.0 + square / 6.0 + 0.075 * square**2
    if not small.all():
        safe = np.where(small, 1.0, sine)
        factor = np.where(small, factor, np.arctan2(safe, cosine) / safe)
    return factor * skewed


def _inverse_left_jacobian(angles: np.ndarray) -> np.ndarray:
    """Inverse left Jacobians (3, 3, n) of rotation vectors (3, n), as ``frames`` has them."""
    square = angles[0] ** 2 + angles[1] ** 2 + angles[2] ** 2
    angle = np.sqrt(square)
    factor = 1 / 12 + square / 720
    small = angle < _SMALL_ANGLE_RAD
    if not small.all():
        half = 0.5 * np.where(small, 1.0, angle)
        factor = np.where(small, factor, (1 - half / np.tan(half)) / (4 * half**2))
    found = factor * angles[:, None] * angles[None]
    found += np.eye(3)[..., None] * (1.0 - factor * square)
    half = 0.5 * angles
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        found[u, v] += half[axis]
        found[v, u] -= half[axis]
    return found
