"""Parameters cut into directions that data or priors determine and those that neither does."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from kinacc.calibration.system import PoseSystem
from kinacc.errors import FitError

TOUCH_SQUARED = 1e-4  # a parameter is undetermined if a truncated direction holds 1 % of it
MOVES_SQUARED = 0.25  # what moves a known frame by half as much as itself is known too


@dataclass(frozen=True)
class Spectrum:
    """What data can tell of a block of parameters.

    ``values``: singular values of the Jacobian in units of ``scale``, falling, after the frame
    columns are projected out. ``rank`` of them exceed ``threshold`` times the largest; ``gap`` is
    the ratio across that cut, inf at full rank.
    """

    values: np.ndarray
    threshold: float
    rank: int
    gap: float

    @classmethod
    def of(cls, values: np.ndarray, threshold: float, most: int | None = None) -> Spectrum:
        """Spectrum of falling ``values``; no rank above ``most``."""
        rank = int(np.sum(values > threshold * values[0])) if values.size else 0
        rank = rank if most is None else min(rank, most)
        past = values[rank] if rank < values.size else 0.0
        gap = float(values[rank - 1] / past) if rank and past > 0.0 else float("inf")
        return cls(values, threshold, rank, gap)


@dataclass(frozen=True)
class Split:
    """Scaled parameters (P,) cut into directions that are determined and those that are not.

    ``root`` (P, r): its product with its transpose inverts the normal matrix and the prior's on the
    determined directions. ``lost`` (P, l): the others, base and targets following those of the
    model, of which ``anchor`` (P, l) is the part that stays nominal. ``effective``: number of
    parameters that the data, not a prior, decide.
    """

    root: np.ndarray
    lost: np.ndarray
    anchor: np.ndarray
    effective: float
    spectrum: Spectrum | None = None
    ranks: tuple[int, int] | None = None

    @classmethod
    def held(cls, gram: np.ndarray, weight: np.ndarray, name: str) -> Split:
        """Everything is determined, by priors where data do not."""
        normal = gram[:-1, :-1].copy()
        normal[np.diag_indices_from(normal)] += weight**2
        factor, failed = scipy.linalg.lapack.dpotrf(normal, lower=1)
        if failed:
            raise FitError(
                f"{name}: the normal matrix of {len(normal)} parameters is not positive definite; "
                "give every undetermined direction a prior"
            )
        root = scipy.linalg.lapack.dtrtri(factor, lower=1, overwrite_c=1)[0].T
        nothing = np.zeros((len(normal), 0))
        by_prior = float(weight**2 @ np.sum(root**2, axis=1))
        return cls(root, nothing, nothing, len(normal) - by_prior)

    @classmethod
    def of(
        cls,
        gram: np.ndarray,
        frames: int,
        weight: np.ndarray,
        thresholds: tuple[float, float],
        most: tuple[int, int] | None = None,
        reported: bool = False,
    ) -> Split:
        """Cut by ``thresholds`` of the first ``frames`` parameters and of the others.

        ``weight`` (P,): residual over prior standard deviation of parameters, 0 for none. A
        direction that a prior speaks of is determined; ``reported``: in the report of a fit, also
        one that moves a frame with a prior.
        """
        normal, arm = gram[:-1, :-1].copy(), slice(frames, None)
        normal[np.diag_indices(frames)] += weight[:frames] ** 2
        placed = np.eye(frames)[weight[:frames] > 0.0]
        base = normal[:frames, :frames]
        known = [(placed, TOUCH_SQUARED)] if reported else []
        directions, lost_base, base_spectrum = _cut(base, thresholds[0], most and most[0], known)
        root_base = _root(directions, base)
        follow = np.eye(len(normal))
        follow[:frames, arm] = -root_base @ (root_base.T @ normal[:frames, arm])
        rest = normal[arm, arm] + normal[arm, :frames] @ follow[:frames, arm]
        known = [(np.eye(len(rest))[weight[arm] > 0.0], TOUCH_SQUARED)]
        known += [(placed @ follow[:frames, arm], MOVES_SQUARED)] if reported else []
        directions, lost_arm, spectrum = _cut(rest, thresholds[1], most and most[1], known)
        root_arm = _root(directions, rest + np.diag(weight[arm] ** 2))
        root = follow @ scipy.linalg.block_diag(root_base, root_arm)
        anchor = scipy.linalg.block_diag(lost_base, lost_arm)
        effective = float(np.sum(root * (gram[:-1, :-1] @ root)))
        return cls(
            root, follow @ anchor, anchor, effective, spectrum, (base_spectrum.rank, spectrum.rank)
        )

    def step(
        self, gradient: np.ndarray, displacement: np.ndarray, weight_sq: np.ndarray
    ) -> np.ndarray:
        """Least squares in the determined directions, back to nominal in the others."""
        down = self.root @ (self.root.T @ (gradient + weight_sq * displacement))
        return -down - self.lost @ (self.anchor.T @ displacement)


def _cut(
    normal: np.ndarray,
    threshold: float,
    most: int | None,
    known: Sequence[tuple[np.ndarray, float]],
) -> tuple[np.ndarray, np.ndarray, Spectrum]:
    """Orthonormal directions (P, r) kept, (P, l) lost, and the spectrum by which they are cut.

    ``known``: derivatives of what is known otherwise; a lost direction is kept where its squared
    change exceeds the number beside.
    """
    values, vectors = np.linalg.eigh(normal)
    spectrum = Spectrum.of(np.sqrt(np.maximum(values[::-1], 0.0)), threshold, most)
    directions, lost = np.split(vectors[:, ::-1], [spectrum.rank], axis=1)
    for derivative, least in known:
        if len(derivative) and lost.size:
            _, change, turn = np.linalg.svd(derivative @ lost)
            back, lost = np.split(lost @ turn.T, [int(np.sum(change**2 > least))], axis=1)
            directions = np.concatenate([directions, back], axis=1)
    return directions, lost, spectrum


def _root(directions: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Matrix (P, r) whose product with its transpose inverts ``normal`` on the directions."""
    return directions @ np.linalg.inv(np.linalg.cholesky(directions.T @ normal @ directions)).T


def singular_values(jacobians: Iterable[np.ndarray], frames: int = 0) -> np.ndarray:
    """Singular values of a Jacobian (m, P) in blocks of rows, its first columns projected out.

    By orthogonal reduction they keep their digits below 1e-7 of the largest, unlike through the
    normal equations.
    """
    factor = None
    for jacobian in jacobians:
        rows = jacobian if factor is None else np.concatenate([factor, jacobian])
        (factor,) = scipy.linalg.qr(rows, mode="r", check_finite=False)
        factor = factor[: factor.shape[1]]
    return np.linalg.svd(factor[frames:, frames:], compute_uv=False)


def undetermined(
    system: PoseSystem, x: np.ndarray, scale: np.ndarray, threshold: float
) -> np.ndarray:
    """Directions (m, P) that ``system`` linearised at ``x`` does not show, as in ``Solution``."""
    gram = system.normal(x) * np.outer(np.append(scale, 1.0), np.append(scale, 1.0))
    split = Split.of(gram, system.frames.size, np.zeros(system.size), (threshold, threshold))
    return split.lost.T
