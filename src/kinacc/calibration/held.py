"""Motions of base and targets that poses do not show: found once, and held by every fit alike."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from kinacc.calibration import solve
from kinacc.calibration.constrained import (
    ConstrainedFrames,
    ConstrainedSystem,
    FrameTerms,
    constrained,
)
from kinacc.calibration.frames import ANGLE_UNIT_RAD, FrameCoordinates, Frames, coordinates
from kinacc.calibration.observations import Observations
from kinacc.calibration.solve import Solution
from kinacc.calibration.system import FlangeModel, PoseSystem
from kinacc.calibration.truncated_svd import TOUCH_SQUARED, spoken_of
from kinacc.geometry import Pose
from kinacc.kinematics.model import JointState

Coordinates = FrameCoordinates | ConstrainedFrames

# Of the best-seen motion. Axes tilted by a mrad, as those of every arm are, show as much of a
# motion that the described arm does not: a fit would follow them, each model another way.
SHOWN = 1e-3
_PART = 0.1  # of a unit motion that a target must have to be what is held
_SAME = 6  # digits to which parts are equal


@dataclass(frozen=True)
class Placed:
    """Coordinates of base and targets, those of them that are held, and what is open by that.

    ``held`` (F,): coordinates that stay where the fit starts. ``open`` (m, F): the motions of
    frames that poses do not show, of unit length in ``scale`` (F,).
    """

    coordinates: Coordinates
    held: np.ndarray
    open: np.ndarray

    @property
    def scale(self) -> np.ndarray:
        """Displacements (F,) that count as one mm."""
        return np.where(self.coordinates.is_angle(), ANGLE_UNIT_RAD, 1.0)

    @property
    def known(self) -> tuple[np.ndarray, np.ndarray]:
        """Expected coordinates (F,) and their prior standard deviation (F,), inf for none."""
        if isinstance(self.coordinates, ConstrainedFrames):
            return self.coordinates.known()
        return np.zeros(self.coordinates.size), np.full(self.coordinates.size, np.inf)

    @property
    def inner(self) -> FrameCoordinates:
        """The coordinates residuals are written in."""
        return _inner(self.coordinates)

    @property
    def kept(self) -> np.ndarray:
        """Derivative (E, f) of the ``inner`` coordinates by those not held."""
        coords = self.coordinates
        if isinstance(coords, ConstrainedFrames):
            return coords.change(np.zeros(coords.size))[:, ~self.held]
        return np.eye(coords.size)[:, ~self.held]


def placed(
    observations: Observations,
    described: Callable[[JointState], Pose],
    start: Frames,
    terms: FrameTerms | None,
    rotation_weight_mm_per_rad: float,
) -> Placed:
    """Coordinates of base and targets estimated from ``start`` under ``terms``.

    Motions that poses of the arm as ``described`` show less than ``SHOWN`` of the best-seen one,
    and no prior speaks of, are held: as many places of targets as there are such motions stay
    where they are stated, and the others follow; where no target takes part, the base stays.
    """
    coords = _coordinates(observations, start, terms)
    nothing = FlangeModel(0, lambda x, at: described(at))
    system = pose_system(observations, nothing, coords, rotation_weight_mm_per_rad)
    found = Placed(coords, np.zeros(coords.size, dtype=bool), np.zeros((0, coords.size)))
    factor, _ = solve.triangle(system, np.zeros(coords.size), found.scale)
    _, values, right = np.linalg.svd(factor[: coords.size, :-1])
    hidden = right[values <= SHOWN * values[0]] if values.size else right
    hidden = spoken_of(np.diag(np.isfinite(found.known[1])).astype(float), hidden)[1]
    if not len(hidden):
        return found
    held = np.zeros(coords.size, dtype=bool)
    held[_pivots(hidden, _is_place(coords))] = True
    if terms is not None:
        coords = _coordinates(observations, _stated(start, terms.stated, coords, held), terms)
    return Placed(coords, held, hidden)


def known_frames(observations: Observations, frames: Frames) -> Placed:
    """No coordinates: base and targets are ``frames``."""
    coords = coordinates(observations, frames, base_free=False, targets_free=False)
    return Placed(coords, np.zeros(0, dtype=bool), np.zeros((0, 0)))


def pose_system(
    observations: Observations, flange: FlangeModel, coords: Coordinates, weight: float
) -> PoseSystem | ConstrainedSystem:
    """Residuals of ``flange`` and frames in ``coords``."""
    if isinstance(coords, ConstrainedFrames):
        return ConstrainedSystem(PoseSystem(observations, flange, coords.inner, weight), coords)
    return PoseSystem(observations, flange, coords, weight)


def _coordinates(
    observations: Observations, start: Frames, terms: FrameTerms | None
) -> Coordinates:
    if terms is not None:
        return constrained(observations, start, terms)
    return coordinates(observations, start, base_free=True, targets_free=True)


def _inner(coords: Coordinates) -> FrameCoordinates:
    return coords.inner if isinstance(coords, ConstrainedFrames) else coords


def _is_place(coords: Coordinates) -> np.ndarray:
    """True (F,) for coordinates that are the place of a target."""
    inner = _inner(coords)
    place = ~inner.is_angle()
    place[: inner.base_columns(inner.anchor.sessions).start if inner.base_free else 0] = False
    return place[coords.terms.free] if isinstance(coords, ConstrainedFrames) else place


def _stated(start: Frames, stated: Frames, coords: Coordinates, held: np.ndarray) -> Frames:
    """``start`` with places of targets that are held where they are stated."""
    inner, mask = _inner(coords), held
    if isinstance(coords, ConstrainedFrames):
        mask = np.zeros(inner.size, dtype=bool)
        mask[coords.terms.free] = held
    position = start.targets.position_mm.copy()
    for target in range(start.count):
        begin = inner.target_columns(target).start
        own = mask[begin : begin + 3]
        position[target, own] = stated.targets.position_mm[target, own]
    return replace(start, targets=Pose(start.targets.rotation, position))


def _pivots(motions: np.ndarray, preferred: np.ndarray) -> list[int]:
    """A coordinate for each of ``motions`` (m, F) that stops it, ``preferred`` (F,) where it can.

    Ties go to the first, so that models of the same poses hold the same.
    """
    rest, chosen = motions, []
    while len(rest):
        part = np.round(np.linalg.norm(rest, axis=0), _SAME)
        first = np.where(preferred, part, 0.0)
        chosen.append(int(np.argmax(first if first.max(initial=0.0) > _PART else part)))
        # The mixtures of what is left that do not move what has been chosen.
        rest = np.linalg.qr(rest[:, chosen[-1:]], mode="complete")[0][:, 1:].T @ rest
    return chosen


@dataclass(frozen=True)
class Kept:
    """A system in the parameters ``keep`` (P,), the others at ``at`` (P,)."""

    system: PoseSystem | ConstrainedSystem
    keep: np.ndarray
    at: np.ndarray

    @property
    def size(self) -> int:
        """Number of parameters kept."""
        return int(self.keep.sum())

    @property
    def count(self) -> int:
        """Number of residuals."""
        return self.system.count

    def cost(self, x: np.ndarray) -> float:
        """Sum of squared whitened residuals."""
        return self.system.cost(self.whole(x))

    def residual(self, x: np.ndarray) -> np.ndarray:
        """All residuals (m,)."""
        return self.system.residual(self.whole(x))

    def blocks(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Residual (m,) and Jacobian (m, P) per block of observations."""
        for residual, jacobian in self.system.blocks(self.whole(x)):
            yield residual, jacobian[:, self.keep]

    def stacked(self, x: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        """Rows of ``[J | r]`` (m, P+1), as ``PoseSystem.stacked``."""
        keep = np.append(self.keep, True)
        for kind, rows in self.system.stacked(self.whole(x)):
            yield kind, rows[:, keep]

    def weighted(self, root: np.ndarray) -> Kept:
        """The same residuals times ``root`` (n,) by observation."""
        return replace(self, system=self.system.weighted(root))

    def gram(self, x: np.ndarray) -> np.ndarray:
        """Gram matrix of ``[J | r]``."""
        keep = np.append(self.keep, True)
        return self.system.gram(self.whole(x))[np.ix_(keep, keep)]

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """The last row of ``gram`` alone."""
        return self.system.gradient(self.whole(x))[np.append(self.keep, True)]

    def whole(self, x: np.ndarray) -> np.ndarray:
        """All parameters (P,)."""
        found = self.at.copy()
        found[self.keep] = x
        return found

    def solution(self, found: Solution, open_: np.ndarray, scale: np.ndarray) -> Solution:
        """``found`` for all parameters, with the motions ``open_`` (m, F) of the first of them."""
        size = len(self.keep)
        covariance = np.zeros((size, size))
        covariance[np.ix_(self.keep, self.keep)] = found.covariance
        own = np.zeros((0, self.size)) if found.undetermined is None else found.undetermined
        rows = np.zeros((len(own) + len(open_), size))
        rows[: len(own), self.keep] = own
        rows[len(own) :, : open_.shape[1]] = open_
        std = np.full(size, np.nan)
        std[self.keep] = found.std
        std[np.sum(rows[len(own) :] ** 2, axis=0) > TOUCH_SQUARED] = np.nan
        return replace(
            found,
            x=self.whole(found.x),
            std=std,
            covariance=covariance,
            undetermined=rows,
            scale=scale,
        )
