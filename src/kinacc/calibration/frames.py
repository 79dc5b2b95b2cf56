"""Robot base and targets as parameters: coordinates, closed-form start, conversions.

A target's frame seen from the robot base is ``flange . target`` by the model and
``invert(base) . measured`` by the instrument. The fits work on the inverse of the base: residuals
then live in the robot base and the flange Jacobians need no further rotation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.calibration.observations import Observations
from kinacc.geometry import IDENTITY, Pose, exp_so3, invert, project_so3, skew

_SMALL_ANGLE_RAD = 1e-3
_START_RCOND = 1e-3  # weaker directions of the start are left at zero for the fit to find


@dataclass(frozen=True)
class Frames:
    """``base``: robot base in the instrument's frame; ``targets``: T frames in the flange."""

    base: Pose
    targets: Pose

    @property
    def count(self) -> int:
        """Number of targets T."""
        return len(self.targets.position_mm)

    @property
    def tool(self) -> Pose:
        """The first target, the tool centre point of a single-target data set."""
        return Pose(self.targets.rotation[0], self.targets.position_mm[0])


def known(base: Pose = IDENTITY, tool: Pose = IDENTITY) -> Frames:
    """Frames with one target at ``tool``."""
    return Frames(base, Pose(tool.rotation[None], tool.position_mm[None]))


@dataclass(frozen=True)
class FrameCoordinates:
    """Vector coordinates of the estimated part of ``Frames`` around ``anchor``.

    Order: inverse base (3 mm, 3 rad) about ``centroid_mm`` of the measurements if ``base_free``;
    then, if ``targets_free``, per target 3 mm and, where ``turns`` (T,) is true, 3 rad. A rotation
    vector w stands for ``exp(w)`` in front of the anchor's rotation.
    """

    anchor: Frames
    base_free: bool
    targets_free: bool
    turns: np.ndarray
    centroid_mm: np.ndarray

    @property
    def size(self) -> int:
        """Number of coordinates."""
        targets = int(3 * self.turns.size + 3 * self.turns.sum()) if self.targets_free else 0
        return 6 * self.base_free + targets

    def target_columns(self, target: int) -> slice:
        """Columns of one target: 3, or 6 with its rotation."""
        begin = 6 * self.base_free + int(3 * target + 3 * self.turns[:target].sum())
        return slice(begin, begin + 3 + 3 * int(self.turns[target]))

    def is_angle(self) -> np.ndarray:
        """True (size,) where a coordinate is an angle in rad."""
        kinds = [False] * 3 + [True] * 3 if self.base_free else []
        if self.targets_free:
            for turn in self.turns:
                kinds += [False] * 3 + [True] * 3 * int(turn)
        return np.array(kinds, dtype=bool)

    def inverse_base(self, x: np.ndarray) -> Pose:
        """Inverse base at coordinates ``x``, applied to points minus ``centroid_mm``."""
        inverse = invert(self.anchor.base)
        at_centroid = inverse.rotation @ self.centroid_mm + inverse.position_mm
        if not self.base_free:
            return Pose(inverse.rotation, at_centroid)
        return Pose(exp_so3(x[3:6]) @ inverse.rotation, at_centroid + x[:3])

    def targets(self, x: np.ndarray) -> Pose:
        """Target frames (T, ...) in the flange at coordinates ``x``."""
        if not self.targets_free:
            return self.anchor.targets
        rotation = self.anchor.targets.rotation.copy()
        position = self.anchor.targets.position_mm.copy()
        for target in range(self.turns.size):
            part = x[self.target_columns(target)]
            position[target] += part[:3]
            if self.turns[target]:
                rotation[target] = exp_so3(part[3:]) @ rotation[target]
        return Pose(rotation, position)

    def frames(self, x: np.ndarray) -> Frames:
        """``Frames`` at coordinates ``x``."""
        inverse = self.inverse_base(x)
        offset = inverse.position_mm - inverse.rotation @ self.centroid_mm
        return Frames(invert(Pose(inverse.rotation, offset)), self.targets(x))


def coordinates(
    observations: Observations, anchor: Frames, base_free: bool, targets_free: bool
) -> FrameCoordinates:
    """Coordinates around ``anchor``; a target turns where any of its orientations was measured."""
    turns = np.zeros(anchor.count, dtype=bool)
    turns[np.unique(observations.target[observations.has_rotation])] = True
    centroid = observations.position_mm.mean(axis=0)
    return FrameCoordinates(anchor, base_free, targets_free, turns, centroid)


def left_jacobian(w_rad: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) with ``exp(w + dw) = exp(left_jacobian(w) dw) exp(w)`` to first order."""
    angle = float(np.linalg.norm(w_rad))
    cross = skew(w_rad)
    if angle < _SMALL_ANGLE_RAD:
        return np.eye(3) + 0.5 * cross + cross @ cross / 6.0
    versine, excess = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.eye(3) + versine * cross + excess * (cross @ cross)


def inverse_left_jacobian(w_rad: np.ndarray) -> np.ndarray:
    """Inverse left Jacobians (n, 3, 3) of rotation vectors (n, 3) shorter than 2 pi."""
    angle = np.linalg.norm(w_rad, axis=-1)
    small = angle < _SMALL_ANGLE_RAD
    half = 0.5 * np.where(small, 1.0, angle)
    factor = np.where(small, 1 / 12 + angle**2 / 720, (1 - half / np.tan(half)) / (4 * half**2))
    cross = skew(w_rad)
    return np.eye(3) - 0.5 * cross + factor[:, None, None] * (cross @ cross)


def closed_form_start(observations: Observations, flange: Pose) -> Frames:
    """Base and targets from flange poses (n, ...) of a nominal model, without a starting value.

    Two linear solutions for the base rotation, the one that leaves the smaller position error:
    from orientations, robot-world/hand-eye by the leading singular vectors of a sum of Kronecker
    products (Shah, J. Mechanisms Robotics 5, 2013), which fails where the tool turns about one
    axis only; and from positions with a free 3x3 matrix, which fails where they lie in a plane.
    """
    bases = [_base_rotation_from_points(observations, flange)]
    turned = observations.has_rotation
    for target in np.unique(observations.target[turned]):
        rows = turned & (observations.target == target)
        bases.append(_hand_eye_base(observations.rotation[rows], flange.rotation[rows]))
    starts = [_translations(observations, flange, base) for base in bases]
    best = int(np.argmin([misfit for _, _, misfit in starts]))
    position, points, _ = starts[best]
    rotations = _target_rotations(observations, flange, bases[best])
    return Frames(Pose(bases[best], position), Pose(rotations, points))


def _hand_eye_base(measured: np.ndarray, flange: np.ndarray) -> np.ndarray:
    """Base rotation of ``measured = base flange tool``, each (n, 3, 3)."""
    # vec(base) is proportional to sum(flange (x) measured) vec(tool'), vec by columns.
    kron = np.einsum("nij,nkl->ikjl", flange, measured).reshape(9, 9)
    base = np.linalg.svd(kron)[0][:, 0].reshape(3, 3).T
    return _nearest_rotation(base if np.linalg.det(base) > 0 else -base)


def _target_rotations(observations: Observations, flange: Pose, base: np.ndarray) -> np.ndarray:
    """Mean target rotations (T, 3, 3) in the flange; identity where none was measured."""
    rotations = np.broadcast_to(np.eye(3), (len(observations.target_names), 3, 3)).copy()
    turned = observations.has_rotation
    for target in np.unique(observations.target[turned]):
        rows = turned & (observations.target == target)
        seen = np.swapaxes(flange.rotation[rows], 1, 2) @ base.T @ observations.rotation[rows]
        rotations[target] = _nearest_rotation(seen.sum(axis=0))
    return rotations


def _nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    left, _, right = np.linalg.svd(matrix)
    left[:, 2] *= np.sign(np.linalg.det(left @ right))
    return project_so3(left @ right)


def _base_rotation_from_points(observations: Observations, flange: Pose) -> np.ndarray:
    """Base rotation of positions alone: C m - R_flange t + c = p_flange, linear in C, t and c."""
    count, targets = len(observations), len(observations.target_names)
    mean = observations.position_mm.mean(axis=0)
    spread = np.abs(observations.position_mm - mean).max() or 1.0
    design = np.zeros((count, 3, 12 + 3 * targets))
    for axis in range(3):
        design[:, axis, 3 * axis : 3 * axis + 3] = (observations.position_mm - mean) / spread
        design[:, axis, 9 + axis] = 1.0
    for target in range(targets):
        rows = observations.target == target
        columns = slice(12 + 3 * target, 15 + 3 * target)
        design[rows, :, columns] = -flange.rotation[rows]
    system = design.reshape(3 * count, -1)
    solution = np.linalg.lstsq(system, flange.position_mm.ravel(), rcond=_START_RCOND)[0]
    return _nearest_rotation(solution[:9].reshape(3, 3)).T


def _translations(
    observations: Observations, flange: Pose, base_rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Base position, target points (linear once the base is turned) and the squared misfit."""
    count, targets = len(observations), len(observations.target_names)
    design = np.zeros((count, 3, 3 * targets))
    for target in range(targets):
        rows = observations.target == target
        design[rows, :, 3 * target : 3 * target + 3] = base_rotation @ flange.rotation[rows]
    goal = observations.position_mm - flange.position_mm @ base_rotation.T
    # Centred, so that what the turns cannot show of a target is left at zero, not shared with base.
    centred = (design - design.mean(axis=0)).reshape(3 * count, -1)
    solution = np.linalg.lstsq(centred, (goal - goal.mean(axis=0)).ravel(), rcond=_START_RCOND)[0]
    rest = goal - design @ solution
    base_position = rest.mean(axis=0)
    misfit = float(np.sum((rest - base_position) ** 2))
    return base_position, solution.reshape(targets, 3), misfit
