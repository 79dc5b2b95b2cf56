"""Residuals of an arm observed through base and targets, their Jacobian and normal equations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kinacc.calibration.frames import (
    FrameParameters,
    Frames,
    inverse_left_jacobians,
    left_jacobians,
)
from kinacc.calibration.observations import Observations
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, log_so3, skew
from kinacc.kinematics.model import ErrorModel

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
class PoseSystem:
    """Residuals model minus measurement in the robot base, in mm.

    Per observation three position residuals and, where an orientation was measured, three of the
    rotation vector log(R_model R_measured'), times the rotation weight.

    Attributes
    ----------
    observations : Observations
        n measured points or poses.
    model : ErrorModel
        The arm; parameters that are not free stay as they are in it.
    free : numpy.ndarray
        True for the parameters of the model that are estimated, shape (P,).
    frames : FrameParameters
        F components of base and targets. Vectors of this system have these first, then the free
        parameters of the model.
    rotation_weight_mm_per_rad : float
        Position error that weighs as much as one radian.
    root : numpy.ndarray or None
        Factors of the residuals of every observation, shape (n,); None for ones.
    """

    observations: Observations
    model: ErrorModel
    free: np.ndarray
    frames: FrameParameters
    rotation_weight_mm_per_rad: float
    root: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Number of estimated parameters."""
        return self.frames.size + int(self.free.sum())

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
        known = FrameParameters.none(self.frames.frames(x[: self.frames.size]))
        still = np.zeros_like(self.free)
        system = replace(self, model=self._model(x), free=still, frames=known)
        return np.concatenate([residual for residual, _ in system.blocks(x[:0])])

    def blocks(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Residual (m,) and Jacobian (m, P) per block of observations, ordered as ``residual``."""
        for columns, measured in self.columns(x):
            rows = columns.transpose(2, 1, 0)[measured.T]
            yield rows[:, -1], rows[:, :-1]

    def normal(self, x: np.ndarray) -> np.ndarray:
        """Gram matrix (P+1, P+1) of ``[J | r]``: normal equations and, last, the cost."""
        total = np.zeros((self.size + 1, self.size + 1))
        for columns, _ in self.columns(x):
            flat = columns.reshape(self.size + 1, -1)
            total += flat @ flat.T
        return total

    def columns(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Weighted ``[J | r]`` (P+1, c, n) per block, 0 where nothing was measured; a mask (c, n).

        c = 3, or 6 in a block with orientations.
        """
        size, model = self.frames.size, self._model(x)
        frames = self.frames.frames(x[:size])
        root = np.ones(len(self.observations)) if self.root is None else self.root
        for begin in range(0, len(root), BLOCK_ROWS):
            rows = slice(begin, begin + BLOCK_ROWS)
            part = self.observations.select(rows)
            if self.free.any():
                flange, motions, of, factors = model.motions(part.at)
            else:
                flange, motions = model.pose(part.at), np.zeros((0, 6, len(part)))
            view = _View.of(part, flange, frames, self.rotation_weight_mm_per_rad)
            lifted = view.lifted(motions)
            columns = np.zeros((self.size + 1, *view.residual.shape))
            columns[-1] = view.residual
            for place, number in enumerate(np.flatnonzero(self.free), size):
                factor = 1.0 if factors is None else factors[number]
                np.multiply(lifted[of[number]], factor, out=columns[place])
            for kind, number, at in self.frames.slots:
                of_base = kind == "bases"
                here = np.flatnonzero((part.session if of_base else part.target) == number)
                ahead = (view.back if of_base else flange.rotation)[here]
                slopes = np.zeros((len(here), len(view.residual), len(at)))
                slopes[:, :3, :3] = ahead
                turn = left_jacobians(x[at[3:]]) if len(at) == 6 else None
                if turn is not None and of_base:
                    slopes[:, :3, 3:] = -ahead @ skew(view.reach[here]) @ turn
                if turn is not None and view.turning is not None:
                    # The measured side stands behind exp(r): L^-1 exp(r) is L^-1 transposed.
                    spin = view.turning[here]
                    spin = np.swapaxes(spin, 1, 2) if of_base else spin
                    slopes[:, 3:, 3:] = spin @ (ahead @ turn)
                columns[at[0] : at[-1] + 1, :, here] = slopes.transpose(2, 1, 0)
            columns *= root[rows] * view.measured
            yield columns, view.measured

    def _model(self, x: np.ndarray) -> ErrorModel:
        vector = self.model.start.copy()
        vector[self.free] = x[self.frames.size :]
        return self.model.with_parameters(vector)


class _View(NamedTuple):
    """Residuals (c, n) of a block, whether measured (c, n), and what their derivatives are made of.

    ``arm`` (3, n): from the flange to the target, robot base. ``turning`` (n, 3, 3): derivative of
    rotation residuals by turns in the robot base. ``back`` (n, 3, 3): from the instrument to the
    robot base; ``reach`` (n, 3): from the base to the measured point, in the instrument's frame.
    """

    residual: np.ndarray
    measured: np.ndarray
    arm: np.ndarray
    turning: np.ndarray | None
    back: np.ndarray
    reach: np.ndarray

    @classmethod
    def of(cls, part: Observations, flange: Pose, frames: Frames, weight: float) -> _View:
        """Observations beside what an arm and its frames predict."""
        back = np.swapaxes(frames.bases.rotation, 1, 2)[part.session]
        reach = part.position_mm - frames.bases.position_mm[part.session]
        arm = (flange.rotation @ frames.targets.position_mm[part.target][..., None])[..., 0]
        residual = (flange.position_mm + arm - (back @ reach[..., None])[..., 0]).T
        turned, turning = part.has_rotation, None
        if turned.any():
            model = flange.rotation @ frames.targets.rotation[part.target]
            measured = back @ np.where(turned[:, None, None], part.rotation, np.eye(3))
            angles = log_so3(model @ np.swapaxes(measured, 1, 2)) * turned[:, None]
            residual = np.concatenate([residual, weight * angles.T])
            turning = weight * inverse_left_jacobians(angles)
        there = np.repeat(np.stack([np.ones_like(turned), turned]), 3, axis=0)
        return cls(residual, there[: len(residual)], arm.T, turning, back, reach)

    def lifted(self, motions: np.ndarray) -> np.ndarray:
        """Derivatives (E, c, n) of the residuals by motions (E, 6, n) of the flange."""
        lifted, turns = np.empty((len(motions), *self.residual.shape)), motions[:, 3:]
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            # A turn w of the flange swings the target: w x arm.
            lifted[:, i] = motions[:, i] + turns[:, j] * self.arm[k] - turns[:, k] * self.arm[j]
            if self.turning is not None:
                lifted[:, 3 + i] = np.einsum("nj,ejn->en", self.turning[:, i], turns)
        return lifted
