"""Base and targets of which some components are fixed or known beforehand.

Components are named as in ``uncertainty``: ``base.x_mm`` .. ``base.rz_rad`` and the like. A
position is the frame's own; a rotation vector w turns the stated orientation R to exp(w) R.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from kinacc.calibration.frames import FrameCoordinates, Frames, coordinates, left_jacobian, stacked
from kinacc.calibration.observations import Observations
from kinacc.calibration.system import PoseSystem
from kinacc.geometry import Pose, compose, exp_so3, invert, log_so3


@dataclass(frozen=True)
class FrameTerms:
    """What is known of the F components ``names`` of base and targets before a fit.

    ``free`` (F,): estimated. ``value`` (F,) in mm and rad: where the others stay and what a prior
    of standard deviation ``std`` (F,) expects; std inf where there is none. ``stated``: the frames
    whose orientations the rotation vectors start from.
    """

    names: tuple[str, ...]
    free: np.ndarray
    value: np.ndarray
    std: np.ndarray
    stated: Frames


@dataclass(frozen=True)
class ConstrainedFrames:
    """Coordinates y (f,): the free components of base and targets, as deviations from ``begin``.

    ``inner`` are the coordinates the residuals are written in, ``begin`` (F,) all components at
    the start and ``origin`` the orientations their rotation vectors turn.
    """

    inner: FrameCoordinates
    terms: FrameTerms
    begin: np.ndarray
    origin: Frames

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.terms.free.sum())

    def is_angle(self) -> np.ndarray:
        """True (f,) where a coordinate is an angle in rad."""
        return self.inner.is_angle()[self.terms.free]

    def known(self) -> tuple[np.ndarray, np.ndarray]:
        """Expected coordinates (f,) and their prior standard deviation (f,), inf for none."""
        free = self.terms.free
        std = self.terms.std[free]
        expected = np.where(np.isfinite(std), (self.terms.value - self.begin)[free], 0.0)
        return expected, std

    def frames(self, y: np.ndarray) -> Frames:
        """``Frames`` at coordinates ``y``."""
        values = self._components(y)
        bases, targets = self.origin.bases, self.origin.targets
        if self.inner.base_free:
            bases = stacked(
                [
                    _placed(bases.rotation[i], values[self.inner.base_columns(i)])
                    for i in range(self.inner.anchor.sessions)
                ]
            )
        if self.inner.targets_free:
            targets = stacked(
                [
                    _placed(targets.rotation[i], values[self.inner.target_columns(i)])
                    for i in range(self.inner.anchor.count)
                ]
            )
        return Frames(bases, targets)

    def inner_coordinates(self, y: np.ndarray) -> np.ndarray:
        """Coordinates (F,) of ``inner`` of the same frames."""
        found, inner = self.frames(y), self.inner
        x = np.zeros(inner.size)
        for session in range(inner.anchor.sessions if inner.base_free else 0):
            centre = inner.centroid_mm[session]
            now, anchor = (
                compose(invert(_one(each.bases, session)), Pose(np.eye(3), centre))
                for each in (found, inner.anchor)
            )
            x[inner.base_columns(session)] = _apart(anchor, now)
        for target in range(inner.anchor.count if inner.targets_free else 0):
            columns = inner.target_columns(target)
            both = _one(inner.anchor.targets, target), _one(found.targets, target)
            x[columns] = _apart(*both)[: columns.stop - columns.start]
        return x

    def change(self, y: np.ndarray) -> np.ndarray:
        """Derivative (F, f) of ``inner_coordinates``."""
        motions = self.inner.motions(self.inner_coordinates(y))
        return np.linalg.solve(motions, self.motions(y))

    def motions(self, y: np.ndarray) -> np.ndarray:
        """Derivative (F, f) of the named motions of the frames."""
        values, turn = self._components(y), np.eye(self.inner.size)
        angle = self.inner.is_angle()
        for begin in np.flatnonzero(angle)[::3]:
            part = slice(begin, begin + 3)
            turn[part, part] = left_jacobian(values[part])
        return turn[:, self.terms.free]

    def motion_names(self, target_names: tuple[str, ...]) -> list[str]:
        """Names of the rows of ``motions``."""
        return self.inner.motion_names(target_names)

    def _components(self, y: np.ndarray) -> np.ndarray:
        values = self.begin.copy()
        values[self.terms.free] += y
        return values


@dataclass(frozen=True)
class ConstrainedSystem:
    """``system`` in the free components of its frames, then its model's parameters."""

    system: PoseSystem
    frames: ConstrainedFrames

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.frames.size + self.system.model.size

    def cost(self, y: np.ndarray) -> float:
        """Sum of squared whitened residuals."""
        return self.system.cost(self._inner(y))

    def residual(self, y: np.ndarray) -> np.ndarray:
        """All residuals (m,)."""
        return self.system.residual(self._inner(y))

    def blocks(self, y: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Residual (m,) and Jacobian (m, P) per block of observations."""
        split, change = self.frames.inner.size, self.frames.change(y[: self.frames.size])
        for residual, jacobian in self.system.blocks(self._inner(y)):
            yield residual, np.concatenate([jacobian[:, :split] @ change, jacobian[:, split:]], 1)

    def stacked(self, y: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        """Rows of ``[J | r]`` (m, P+1), as ``PoseSystem.stacked``."""
        split, change = self.frames.inner.size, self.frames.change(y[: self.frames.size])
        for kind, rows in self.system.stacked(self._inner(y)):
            yield kind, np.concatenate([rows[:, :split] @ change, rows[:, split:]], axis=1)

    @property
    def count(self) -> int:
        """Number of residuals."""
        return self.system.count

    def weighted(self, root: np.ndarray) -> ConstrainedSystem:
        """The same residuals times ``root`` (n,) by observation."""
        return replace(self, system=self.system.weighted(root))

    def gram(self, y: np.ndarray) -> np.ndarray:
        """Gram matrix (P+1, P+1) of ``[J | r]``."""
        change = self._change(y)
        return change.T @ self.system.gram(self._inner(y)) @ change

    def gradient(self, y: np.ndarray) -> np.ndarray:
        """The last row (P+1,) of ``gram`` alone."""
        return self.system.gradient(self._inner(y)) @ self._change(y)

    def _change(self, y: np.ndarray) -> np.ndarray:
        return scipy.linalg.block_diag(
            self.frames.change(y[: self.frames.size]), np.eye(self.system.model.size + 1)
        )

    def _inner(self, y: np.ndarray) -> np.ndarray:
        split = self.frames.size
        return np.concatenate([self.frames.inner_coordinates(y[:split]), y[split:]])


def constrained(
    observations: Observations, start: Frames, terms: FrameTerms
) -> ConstrainedFrames | FrameCoordinates:
    """Coordinates of base and targets under ``terms``, beginning near ``start``.

    Without a component that is fixed or has a prior they are those of ``frames.coordinates``.
    """
    inner = coordinates(observations, start, base_free=True, targets_free=True)
    if terms.free.all() and np.isinf(terms.std).all():
        return inner
    names = inner.motion_names(observations.target_names)
    place = {name: number for number, name in enumerate(terms.names)}
    order = np.array([place[name] for name in names])
    terms = FrameTerms(
        tuple(names), terms.free[order], terms.value[order], terms.std[order], terms.stated
    )
    bound = ~terms.free | np.isfinite(terms.std)
    origin, begin = start, np.zeros(inner.size)
    for kind, columns_of, count in (
        ("bases", inner.base_columns, start.sessions),
        ("targets", inner.target_columns, start.count),
    ):
        rotation = getattr(start, kind).rotation.copy()
        for number in range(count):
            columns = columns_of(number)
            turned = slice(columns.start + 3, columns.stop)
            here = _one(getattr(start, kind), number)
            begin[columns.start : columns.start + 3] = here.position_mm
            if bound[turned].any() or columns.stop - columns.start == 3:
                rotation[number] = getattr(terms.stated, kind).rotation[number]
            if columns.stop - columns.start == 6:
                begin[turned] = log_so3((here.rotation @ rotation[number].T)[None])[0]
        origin = replace(origin, **{kind: Pose(rotation, getattr(start, kind).position_mm)})
    begin[~terms.free] = terms.value[~terms.free]
    made = ConstrainedFrames(inner, terms, begin, origin)
    # Anchored where the fit begins: far from there a rotation vector would lose its meaning.
    anchored = coordinates(
        observations, made.frames(np.zeros(made.size)), base_free=True, targets_free=True
    )
    return replace(made, inner=anchored)


def _one(poses: Pose, number: int) -> Pose:
    return Pose(poses.rotation[number], poses.position_mm[number])


def _placed(rotation: np.ndarray, part: np.ndarray) -> Pose:
    return Pose(exp_so3(part[3:]) @ rotation if part.size == 6 else rotation, part[:3])


def _apart(anchor: Pose, now: Pose) -> np.ndarray:
    """Shift and rotation vector (6,) from ``anchor`` to ``now``."""
    turned = log_so3((now.rotation @ anchor.rotation.T)[None])[0]
    return np.concatenate([now.position_mm - anchor.position_mm, turned])
