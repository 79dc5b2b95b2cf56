"""Robot base and targets as parameters: coordinates, closed-form start, conversions.

A target's frame seen from the robot base is ``flange . target`` by the model and
``invert(base) . measured`` by the instrument. The fits work on the inverse of the base: residuals
then live in the robot base and the flange Jacobians need no further rotation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.calibration.observations import Observations
from kinacc.geometry import IDENTITY, Pose, exp_so3, invert, skew

MOTIONS = ("x_mm", "y_mm", "z_mm", "rx_rad", "ry_rad", "rz_rad")
BASE = "base"
ANGLE_UNIT_RAD = 1e-3  # one mrad counts as much displacement as one mm
_SMALL_ANGLE_RAD = 1e-3


@dataclass(frozen=True)
class Frames:
    """``bases``: robot base in the instrument's frame, S sessions; ``targets``: T in the flange.

    A single base may be given without its leading axis.
    """

    bases: Pose
    targets: Pose

    def __post_init__(self) -> None:
        if self.bases.rotation.ndim == 2:
            alone = Pose(self.bases.rotation[None], self.bases.position_mm[None])
            object.__setattr__(self, "bases", alone)

    @property
    def base(self) -> Pose:
        """The base of the first session, the only one of most data sets."""
        return Pose(self.bases.rotation[0], self.bases.position_mm[0])

    @property
    def sessions(self) -> int:
        """Number of sessions S."""
        return len(self.bases.position_mm)

    @property
    def count(self) -> int:
        """Number of targets T."""
        return len(self.targets.position_mm)

    @property
    def tool(self) -> Pose:
        """The first target, the tool centre point of a single-target data set."""
        return Pose(self.targets.rotation[0], self.targets.position_mm[0])


def known(
    base: Pose = IDENTITY, tool: Pose = IDENTITY, sessions: int = 1, targets: int = 1
) -> Frames:
    """Frames with ``base`` in every session and every target at ``tool``."""
    return Frames(stacked([base] * sessions), stacked([tool] * targets))


@dataclass(frozen=True)
class FrameCoordinates:
    """Vector coordinates of the estimated part of ``Frames`` around ``anchor``.

    Order: per session the inverse base (3 mm, 3 rad) about its ``centroid_mm`` (S, 3) of the
    measurements if ``base_free``; then, if ``targets_free``, per target 3 mm and, where ``turns``
    (T,) is true, 3 rad. A rotation vector w stands for ``exp(w)`` before the anchor's rotation.
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
        return self._bases + targets

    @property
    def _bases(self) -> int:
        return 6 * self.anchor.sessions if self.base_free else 0

    def base_columns(self, session: int) -> slice:
        """Columns of one session's inverse base."""
        return slice(6 * session, 6 * session + 6)

    def target_columns(self, target: int) -> slice:
        """Columns of one target: 3, or 6 with its rotation."""
        begin = self._bases + int(3 * target + 3 * self.turns[:target].sum())
        return slice(begin, begin + 3 + 3 * int(self.turns[target]))

    def is_angle(self) -> np.ndarray:
        """True (size,) where a coordinate is an angle in rad."""
        kinds = ([False] * 3 + [True] * 3) * (self._bases // 6)
        if self.targets_free:
            for turn in self.turns:
                kinds += [False] * 3 + [True] * 3 * int(turn)
        return np.array(kinds, dtype=bool)

    def inverse_base(self, x: np.ndarray, session: int = 0) -> Pose:
        """Inverse base at coordinates ``x``, applied to points minus the session's centroid."""
        bases, centre = self.anchor.bases, self.centroid_mm[session]
        inverse = invert(Pose(bases.rotation[session], bases.position_mm[session]))
        at_centroid = inverse.rotation @ centre + inverse.position_mm
        if not self.base_free:
            return Pose(inverse.rotation, at_centroid)
        part = x[self.base_columns(session)]
        return Pose(exp_so3(part[3:]) @ inverse.rotation, at_centroid + part[:3])

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
        bases = []
        for session, centre in enumerate(self.centroid_mm):
            inverse = self.inverse_base(x, session)
            offset = inverse.position_mm - inverse.rotation @ centre
            bases.append(invert(Pose(inverse.rotation, offset)))
        return Frames(stacked(bases), self.targets(x))

    def motion_names(self, target_names: tuple[str, ...]) -> list[str]:
        """Names of the parameters, in the order of the rows of ``motions``."""
        names = []
        for session in range(self.anchor.sessions if self.base_free else 0):
            base = BASE if session == 0 else f"{BASE}{session + 1}"
            names += [f"{base}.{motion}" for motion in MOTIONS]
        if self.targets_free:
            for name, turns in zip(target_names, self.turns, strict=True):
                names += [f"{name}.{motion}" for motion in (MOTIONS if turns else MOTIONS[:3])]
        return names

    def motions(self, x: np.ndarray) -> np.ndarray:
        """Derivative (F, F) of the named motions of base and targets in the coordinates at x."""
        motions = np.zeros((self.size, self.size))
        for session in range(self.anchor.sessions if self.base_free else 0):
            inverse = self.inverse_base(x, session)
            place = self.base_columns(session)
            shift, turned = slice(place.start, place.start + 3), slice(place.start + 3, place.stop)
            base = inverse.rotation.T
            turn = base @ left_jacobian(x[turned])
            # m = c - R'p, R' turning by exp(-R'J dw): see inverse_base.
            motions[shift, shift] = -base
            motions[shift, turned] = -skew(base @ inverse.position_mm) @ turn
            motions[turned, turned] = -turn
        if self.targets_free:
            for target, turns in enumerate(self.turns):
                columns = self.target_columns(target)
                begin = columns.start
                motions[begin : begin + 3, begin : begin + 3] = np.eye(3)
                if turns:
                    turned = left_jacobian(x[begin + 3 : begin + 6])
                    motions[begin + 3 : begin + 6, begin + 3 : begin + 6] = turned
        return motions


def stacked(poses: Sequence[Pose]) -> Pose:
    """Single poses as one with a leading axis."""
    return Pose(
        np.stack([pose.rotation for pose in poses]), np.stack([pose.position_mm for pose in poses])
    )


def coordinates(
    observations: Observations, anchor: Frames, base_free: bool, targets_free: bool
) -> FrameCoordinates:
    """Coordinates around ``anchor``; a target turns where any of its orientations was measured.

    A session that nothing was measured in keeps its base, a target never seen its place.
    """
    turns = orientations_measured(observations)
    centroid = np.zeros((anchor.sessions, 3))
    for session in np.unique(observations.session):
        centroid[session] = observations.position_mm[observations.session == session].mean(axis=0)
    return FrameCoordinates(anchor, base_free, targets_free, turns, centroid)


def orientations_measured(observations: Observations) -> np.ndarray:
    """True (T,) for targets of which any orientation was measured."""
    found = np.zeros(len(observations.target_names), dtype=bool)
    found[np.unique(observations.target[observations.has_rotation])] = True
    return found


def with_stated_orientations(frames: Frames, stated: Frames, observations: Observations) -> Frames:
    """``frames`` whose targets have the ``stated`` orientation where none was measured."""
    measured = orientations_measured(observations)[:, None, None]
    rotation = np.where(measured, frames.targets.rotation, stated.targets.rotation)
    return Frames(frames.bases, Pose(rotation, frames.targets.position_mm))


def left_jacobian(w_rad: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) with ``exp(w + dw) = exp(left_jacobian(w) dw) exp(w)`` to first order."""
    angle = float(np.linalg.norm(w_rad))
    cross = skew(w_rad)
    if angle < _SMALL_ANGLE_RAD:
        return np.eye(3) + 0.5 * cross + cross @ cross / 6.0
    versine, excess = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.eye(3) + versine * cross + excess * (cross @ cross)
