"""Gauss-Newton by truncated SVD: the smallest displacement from nominal that fits the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.calibration import solve
from kinacc.calibration.solve import Solution, Spectrum, System

# Going back to nominal where the data is (nearly) blind costs a little: the optimum of a truncated
# fit is not quite the least cost.
TRUNCATED_GROWTH = 1e-3
FRAME_THRESHOLD = 1e-6  # frames have no nominal value to keep: only exact ambiguities are cut
TOUCH_SQUARED = 1e-4  # a parameter is undetermined if a truncated direction holds 1 % of it


def minimise_truncated(
    system: System,
    start: np.ndarray,
    nominal: np.ndarray,
    scale: np.ndarray,
    threshold: float,
    frames: int = 0,
    name: str = "fit",
) -> Solution:
    """Gauss-Newton with truncated SVD, from ``start`` (P,), leaning on ``nominal`` (P,).

    Two blocks are judged one after the other: the first ``frames`` parameters (base and targets),
    then the others after what the frames can express is projected out of them. In each, directions
    whose singular value is below a share of the block's largest (``FRAME_THRESHOLD``, then
    ``threshold``) keep their nominal value; ``scale`` (P,) is the unit in which displacement is
    measured (mm, and rad of one mrad).
    Raises FitError where it does not converge.
    """
    x = np.array(start, dtype=float)
    cost, ranks, last = system.cost(x), None, np.inf
    iterations = 0
    while last > solve.STEP_TOLERANCE and iterations < solve.MAX_ITERATIONS:
        iterations += 1
        factor, count = solve.triangle(system, x, scale)
        # A rank that has been lost is not taken back, so the iteration cannot swing between two.
        split = _Split.of(factor, frames, threshold, ranks if iterations > 3 else None)
        ranks = split.ranks
        step = scale * split.step((x - nominal) / scale)
        x, cost, last = solve.advance(system.cost, x, step, cost, scale, name, TRUNCATED_GROWTH)
    solve.require_converged(name, iterations, last, cost, count)
    factor, count = solve.triangle(system, x, scale)
    split = _Split.of(factor, frames, threshold, ranks)
    cost = float(np.sum(factor[:, -1] ** 2))
    freedom = count - sum(split.ranks)
    variance = cost / freedom if freedom > 0 else np.nan
    covariance = variance * split.inverse_gram() * np.outer(scale, scale)
    return Solution(
        x=x,
        std=np.where(split.touched(), np.nan, np.sqrt(np.diag(covariance))),
        covariance=covariance,
        cost=cost,
        count=count,
        degrees_of_freedom=freedom,
        variance=variance,
        iterations=iterations,
        last_step=last,
        converged=True,
        spectrum=split.others.spectrum,
        undetermined=split.undetermined(),
    )


@dataclass(frozen=True)
class _Truncated:
    """SVD ``left values right`` of a block of columns of which ``rank`` directions are kept."""

    left: np.ndarray
    right: np.ndarray
    spectrum: Spectrum

    @classmethod
    def of(cls, block: np.ndarray, threshold: float, most: int | None) -> _Truncated:
        left, values, right = np.linalg.svd(block)
        values = np.concatenate([values, np.zeros(len(right) - values.size)])
        return cls(left, right, Spectrum.of(values, threshold, most))

    @property
    def rank(self) -> int:
        return self.spectrum.rank

    @property
    def root(self) -> np.ndarray:
        """Matrix (P, rank) whose product with its transpose inverts the block's Gram matrix."""
        return self.right[: self.rank].T / self.spectrum.values[: self.rank]

    def step(self, rhs: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """Least squares in the kept directions, back to nominal in the others."""
        lost = self.right[self.rank :]
        kept = self.root @ (self.left[:, : self.rank].T @ rhs)
        return -kept - lost.T @ (lost @ displacement)

    def touched(self) -> np.ndarray:
        return np.sum(self.right[self.rank :] ** 2, axis=0) > TOUCH_SQUARED


@dataclass(frozen=True)
class _Split:
    """Triangular factor cut into the frames' columns and what is left of the others."""

    frames: _Truncated
    others: _Truncated
    coupling: np.ndarray
    frames_rhs: np.ndarray
    others_rhs: np.ndarray

    @classmethod
    def of(
        cls, factor: np.ndarray, count: int, threshold: float, most: tuple[int, int] | None
    ) -> _Split:
        upper, lower = factor[:count], factor[count:]
        frames = _Truncated.of(upper[:, :count], FRAME_THRESHOLD, most and most[0])
        # Rows of truncated frame directions are equations the frames do not take up.
        unused = frames.left[:, frames.rank :].T @ upper
        rows = np.concatenate([lower, unused])
        others = _Truncated.of(rows[:, count:-1], threshold, most and most[1])
        return cls(frames, others, upper[:, count:-1], upper[:, -1], rows[:, -1])

    @property
    def ranks(self) -> tuple[int, int]:
        return self.frames.rank, self.others.rank

    def step(self, displacement: np.ndarray) -> np.ndarray:
        count = len(self.frames_rhs)
        others = self.others.step(self.others_rhs, displacement[count:])
        frames = self.frames.step(self.frames_rhs + self.coupling @ others, displacement[:count])
        return np.concatenate([frames, others])

    def inverse_gram(self) -> np.ndarray:
        """Inverse (P, P) of J'J on the kept directions."""
        kept = self.frames.left[:, : self.frames.rank]
        seen = -self.frames.root @ (kept.T @ self.coupling @ self.others.root)
        blank = np.zeros((len(self.others.right), self.frames.rank))
        full = np.block([[self.frames.root, seen], [blank, self.others.root]])
        return full @ full.T

    def undetermined(self) -> np.ndarray:
        """Truncated directions (m, P), frames first; those of the others carry the frames along."""
        alone = self.frames.right[self.frames.rank :]
        lost = self.others.right[self.others.rank :]
        kept = self.frames.left[:, : self.frames.rank]
        followed = -(self.frames.root @ (kept.T @ (self.coupling @ lost.T))).T
        blank = np.zeros((len(alone), len(self.others.right)))
        return np.block([[alone, blank], [followed, lost]])

    def touched(self) -> np.ndarray:
        """True (P,) where a truncated direction reaches a parameter."""
        return np.concatenate([self.frames.touched(), self.others.touched()])
