"""Steps in the order of the file: a base frame that jumps, a target that moved.

A step at one reading is judged by how much of the residuals it explains (the score test of two
more frames). Residuals of real arms are no noise: they vary smoothly with the joints, and files
run through the joints in order. What a step must beat is therefore not only chance but what steps
along each joint and each coordinate explain of the rest, which cannot be a jump of anything.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from kinacc.checks.robust_fit import HUBER, Residuals, Seen, sigma_of
from kinacc.checks.tails import FAMILY_WISE
from kinacc.geometry import skew

WINDOW = 300  # readings looked at together: drifts are slower
_FEWEST = 5  # readings on either side of a step


@dataclass(frozen=True)
class Step:
    """A step before reading ``row``: of the base, or of target ``target`` (None for the base).

    ``gain`` is the part of the squared residuals it explains, in squared sigma; ``reference`` what
    the best step along a joint or coordinate explains of the rest, ``chance`` what noise would.
    """

    row: int
    target: int | None
    gain: float
    reference: float
    chance: float

    @property
    def excess(self) -> float:
        """Gain over what it must beat."""
        return self.gain / max(self.reference, self.chance)


def candidates(seen: Seen, left: Residuals, rows: np.ndarray) -> list[Step]:
    """Best steps of base and targets among ``rows``, in the order of the file, by windows."""
    found = []
    for begin in range(0, max(len(rows) - WINDOW // 2, 1), WINDOW // 2):
        part = rows[begin : begin + WINDOW]
        if len(part) < 4 * _FEWEST:
            continue
        found += _in_window(seen, left, part)
    return found


def _in_window(seen: Seen, left: Residuals, rows: np.ndarray) -> list[Step]:
    sigma = sigma_of(left.position_mm[rows])
    residual = left.position_mm[rows] / sigma
    length = np.linalg.norm(residual, axis=1)
    weight = HUBER / np.maximum(length, HUBER)
    points = left.predicted.position_mm[rows]
    spread = max(float(np.abs(points - points.mean(axis=0)).max()), 1.0)
    base = np.concatenate(
        [
            np.broadcast_to(np.eye(3), (len(rows), 3, 3)),
            -skew(points - points.mean(axis=0)) / spread,
        ],
        axis=2,
    )
    orders = [np.argsort(values, kind="stable") for values in (*seen.q[rows].T, *points.T)]
    found = []
    kinds: list[tuple[int | None, np.ndarray, np.ndarray]] = [(None, base, np.arange(len(rows)))]
    for target in np.unique(seen.target[rows]):
        of = np.flatnonzero(seen.target[rows] == target)
        kinds.append((int(target), left.flange[rows], of))
    for target, regressors, of in kinds:
        if len(of) < 4 * _FEWEST:
            continue
        chance = float(
            scipy.special.chdtri(regressors.shape[2], FAMILY_WISE / (len(of) * len(kinds)))
        )
        gains = _gains(regressors[of], residual[of], weight[of])
        place = int(np.argmax(gains))
        rest = _without(regressors[of], residual[of], weight[of], place)
        reference = 0.0
        for order in orders:
            kept = np.argsort(np.argsort(order)[of], kind="stable")
            along = _gains(regressors[of][kept], rest[kept], weight[of][kept])
            reference = max(reference, float(along.max()))
        found.append(Step(int(rows[of[place]]), target, float(gains[place]), reference, chance))
    return found


def _gains(regressors: np.ndarray, residual: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Gain (n,) of a step before each row beside a constant shift; 0 too near either end."""
    weighted = regressors * weight[:, None, None]
    gram = np.einsum("nia,nib->nab", weighted, regressors)
    score = np.einsum("nia,ni->na", weighted, residual)
    gram_after = np.cumsum(gram[::-1], axis=0)[::-1]
    score_after = np.cumsum(score[::-1], axis=0)[::-1]
    total, size = gram_after[0], regressors.shape[2]
    ridge = 1e-6 * np.trace(total) / size * np.eye(size)
    inverse = np.linalg.inv(total + ridge)
    score_after = score_after - gram_after @ (inverse @ score_after[0])
    inner = gram_after - gram_after @ inverse @ gram_after
    gains = np.zeros(len(residual))
    rows = slice(_FEWEST, len(residual) - _FEWEST + 1)
    solved = np.linalg.solve(inner[rows] + ridge, score_after[rows][..., None])[..., 0]
    gains[rows] = np.sum(solved * score_after[rows], axis=1)
    return gains


def _without(regressors, residual, weight, place: int) -> np.ndarray:
    """Residuals (n, 3) without a constant shift and without the step at ``place``."""
    after = np.where(np.arange(len(residual)) >= place, 1.0, 0.0)[:, None, None]
    both = np.concatenate([regressors, regressors * after], axis=2)
    root = np.sqrt(weight)[:, None]
    design = (both * root[:, :, None]).reshape(-1, both.shape[2])
    shift = np.linalg.lstsq(design, (residual * root).ravel(), rcond=1e-6)[0]
    return residual - both @ shift
