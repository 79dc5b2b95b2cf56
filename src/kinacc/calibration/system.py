"""Whitened residuals of a flange model seen through base and targets, with their Jacobian."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from kinacc.calibration.basis_expansion import Group, gram, spread
from kinacc.calibration.frames import FrameCoordinates, inverse_left_jacobian, left_jacobian
from kinacc.calibration.observations import Observations
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, exp_so3, log_so3, skew
from kinacc.kinematics.model import JointState

BLOCK_ROWS = 1024


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
class FlangeModel:
    """A kinematic model with P parameters, as functions of the vector and of the observations.

    ``pose(x, at)``: flange poses (n, ...). ``jacobian(x, at)``: (n, 6, E), rows 0-2 mm per
    parameter, rows 3-5 the rotation vector w of ``exp(w) R``, robot base. Its columns are the
    parameters, E = P, or motions that ``expansion(at)`` spreads over them.
    """

    size: int
    pose: Callable[[np.ndarray, JointState], Pose]
    jacobian: Callable[[np.ndarray, JointState], np.ndarray]
    expansion: Callable[[JointState], list[Group]] | None = None


@dataclass(frozen=True)
class PoseSystem:
    """Residuals model minus measurement in the robot base, in mm.

    Per observation three position residuals and, where an orientation was measured, three of the
    rotation vector log(R_model R_measured'), times ``rotation_weight_mm_per_rad``. Parameters: the
    frame coordinates first, then the model's.
    """

    observations: Observations
    model: FlangeModel
    coordinates: FrameCoordinates
    rotation_weight_mm_per_rad: float

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.coordinates.size + self.model.size

    def cost(self, x: np.ndarray) -> float:
        """Sum of squared whitened residuals."""
        residual = self.residual(x)
        return float(residual @ residual)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """All residuals (m,), block by block as ``blocks`` orders them."""
        parts = []
        for rows in self._row_blocks():
            part = self.observations.select(rows)
            residual, keep, _ = self._residual(x, part)
            parts.append(residual[keep])
        return np.concatenate(parts)

    def blocks(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Residual (m,) and Jacobian (m, P) per block of observations."""
        for rows in self._row_blocks():
            part = self.observations.select(rows)
            residual, keep, seen = self._residual(x, part)
            jacobian = spread(self._jacobian(x, part, residual, seen), self._groups(part))
            if keep.all():
                yield residual.ravel(), jacobian.reshape(residual.size, self.size)
            else:
                yield residual[keep], jacobian[keep]

    def gram(self, x: np.ndarray) -> np.ndarray:
        """Gram matrix (P+1, P+1) of ``[J | r]``: normal equations and, last, the cost."""
        total = np.zeros((self.size + 1, self.size + 1))
        for columns, groups in self.gram_blocks(x):
            total += gram(columns, groups)
        return total

    def gram_blocks(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, list[Group]]]:
        """Per block the columns (n, 6, E+1) of motions and, last, residuals, and their groups.

        Rows that were not measured are zero.
        """
        for rows in self._row_blocks():
            part = self.observations.select(rows)
            residual, keep, seen = self._residual(x, part)
            jacobian = self._jacobian(x, part, residual, seen)
            columns = np.concatenate([jacobian, residual[:, :, None]], axis=2)
            columns *= keep[:, :, None]
            last = Group(slice(columns.shape[2] - 1, columns.shape[2]), None)
            yield columns, [*self._groups(part), last]

    @property
    def count(self) -> int:
        """Number of residuals."""
        return self.observations.components

    def _groups(self, part: Observations) -> list[Group]:
        frames = self.coordinates.size
        if self.model.expansion is None:
            return [Group(slice(0, self.size), None)]
        groups = [Group(slice(0, frames), None)]
        for group in self.model.expansion(part.at):
            columns = slice(group.columns.start + frames, group.columns.stop + frames)
            groups.append(Group(columns, group.basis))
        return groups

    def _row_blocks(self) -> Iterator[slice]:
        for begin in range(0, len(self.observations), BLOCK_ROWS):
            yield slice(begin, begin + BLOCK_ROWS)

    def _weights(self) -> np.ndarray:
        weights = np.ones(6)
        weights[3:] = self.rotation_weight_mm_per_rad
        return weights

    def _residual(self, x, part):
        frame_x, model_x = x[: self.coordinates.size], x[self.coordinates.size :]
        targets = self.coordinates.targets(frame_x)
        flange = self.model.pose(model_x, part.at)
        arm = np.einsum("nij,nj->ni", flange.rotation, targets.position_mm[part.target])
        turned, inverse = self._from_base(frame_x, part)
        turn = part.has_rotation
        rotation = np.zeros((len(part), 3))
        if turn.any():
            model_rotation = flange.rotation[turn] @ targets.rotation[part.target[turn]]
            measured = inverse.rotation[turn] @ part.rotation[turn]
            rotation[turn] = log_so3(model_rotation @ np.swapaxes(measured, 1, 2))
        position = flange.position_mm + arm - turned - inverse.position_mm
        residual = np.concatenate([position, rotation], axis=1) * self._weights()
        keep = np.concatenate([np.ones((len(part), 3), bool), np.repeat(turn[:, None], 3, 1)], 1)
        return residual, keep, (flange, arm, turned)

    def _from_base(self, frame_x, part):
        """Measured points turned (n, 3) about their centroid, and inverse bases (n, ...)."""
        turned = np.empty((len(part), 3))
        rotation, position = np.empty((len(part), 3, 3)), np.empty((len(part), 3))
        for session in np.unique(part.session):
            rows = part.session == session
            inverse = self.coordinates.inverse_base(frame_x, session)
            centred = part.position_mm[rows] - self.coordinates.centroid_mm[session]
            turned[rows] = centred @ inverse.rotation.T
            rotation[rows], position[rows] = inverse
        return turned, Pose(rotation, position)

    def _jacobian(self, x, part, residual, seen):
        flange, arm, turned = seen
        frames = self.coordinates.size
        frame_x, model_x = x[:frames], x[frames:]
        jacobian = self.model.jacobian(model_x, part.at)
        if self._arms_matter() and self.model.size:
            # A turn of the flange swings the target's arm: w x arm = -[arm] w.
            jacobian[:, :3] -= skew(arm) @ jacobian[:, 3:]
        angles = residual[:, 3:] / self.rotation_weight_mm_per_rad
        if frames:
            jacobian = np.concatenate([np.zeros((len(part), 6, frames)), jacobian], axis=2)
            self._fill_frames(jacobian, frame_x, part, flange, turned, angles)
        if np.any(angles):
            weighted = self.rotation_weight_mm_per_rad * inverse_left_jacobian(angles)
            jacobian[:, 3:] = weighted @ jacobian[:, 3:]
        else:
            jacobian[:, 3:] *= self.rotation_weight_mm_per_rad
        return jacobian

    def _arms_matter(self) -> bool:
        free = self.coordinates.targets_free
        return free or bool(np.any(self.coordinates.anchor.targets.position_mm))

    def _fill_frames(self, jacobian, frame_x, part, flange, turned, angles):
        coordinates = self.coordinates
        for session in np.unique(part.session) if coordinates.base_free else ():
            rows = part.session == session
            begin = coordinates.base_columns(session).start
            turn = left_jacobian(frame_x[begin + 3 : begin + 6])
            jacobian[rows, :3, begin : begin + 3] = -np.eye(3)
            jacobian[rows, :3, begin + 3 : begin + 6] = skew(turned[rows]) @ turn
            # The measured side stands behind exp(r): exp(r) exp(-d) = exp(-exp(r) d) exp(r).
            jacobian[rows, 3:, begin + 3 : begin + 6] = -exp_so3(angles[rows]) @ turn
        if not coordinates.targets_free:
            return
        for target in range(coordinates.turns.size):
            rows = part.target == target
            columns = coordinates.target_columns(target)
            begin = columns.start
            jacobian[rows, :3, begin : begin + 3] = flange.rotation[rows]
            if coordinates.turns[target]:
                turn = left_jacobian(frame_x[begin + 3 : begin + 6])
                jacobian[rows, 3:, begin + 3 : begin + 6] = flange.rotation[rows] @ turn
