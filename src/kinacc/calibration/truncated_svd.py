"""Gauss-Newton by truncated SVD: the smallest displacement from nominal that fits the data."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from kinacc.calibration import solve, variances
from kinacc.calibration.solve import Solution, Spectrum, System

# Going back to nominal where the data is (nearly) blind costs a little: the optimum of a truncated
# fit is not quite the least cost.
TRUNCATED_GROWTH = 1e-3
FRAME_THRESHOLD = 1e-6  # frames have no nominal value to keep: only exact ambiguities are cut
MOVES_SQUARED = 0.25  # what moves a known frame by half as much as itself is known too
NEAR = 1e-4  # mm and mrad, of steps from which on the Jacobian itself is reduced
GRAM_TELLS = 1e-5  # share of the largest singular value that a Gram matrix still resolves
TOUCH_SQUARED = 1e-4  # a parameter is undetermined if a truncated direction holds 1 % of it


def minimise_truncated(
    system: System,
    start: np.ndarray,
    nominal: np.ndarray,
    scale: np.ndarray,
    threshold: float,
    frames: int = 0,
    name: str = "fit",
    prior: np.ndarray | None = None,
    is_rotation: np.ndarray | None = None,
    shared: tuple[np.ndarray, ...] = (),
) -> Solution:
    """Gauss-Newton with truncated SVD, from ``start`` (P,), leaning on ``nominal`` (P,).

    Two blocks are judged one after the other: the first ``frames`` parameters (base and targets),
    then the others after what the frames can express is projected out of them. In each, directions
    whose singular value is below a share of the block's largest (``FRAME_THRESHOLD``, then
    ``threshold``) keep their nominal value; frame directions between the two are fitted, but count
    as undetermined in what is said of the solution; ``scale`` (P,) is the unit in which
    displacement is measured (mm, and rad of one mrad).
    ``prior`` (P,): residual standard deviation over prior standard deviation of every parameter, 0
    for none. It adds ``prior (x - nominal)`` to the residuals, and a direction that the data leave
    open is determined where a prior speaks of it. ``cost`` stays that of the data.
    ``is_rotation`` (m,): residuals of rotations, which have a variance of their own in the
    covariance (not in the estimates); None where all are of one kind. ``shared``: errors that
    residuals have in common, as ``variances.shared_errors`` has them; where there are any they
    take the place of ``is_rotation``.
    Converged as ``ridge.minimise_with_prior`` is. Raises FitError where it does not converge.
    """
    found = arrived(system, start, nominal, scale, threshold, frames, name, prior, is_rotation)
    return found.solution(shared)


def arrived(
    system: System,
    start: np.ndarray,
    nominal: np.ndarray,
    scale: np.ndarray,
    threshold: float,
    frames: int,
    name: str,
    prior: np.ndarray | None,
    is_rotation: np.ndarray | None,
) -> Arrived:
    """Where ``minimise_truncated`` ends.

    Steps follow from the Gram matrix of the Jacobian, which costs little but squares its condition;
    the last one, and with it every rank, from the Jacobian's triangular factor.
    """
    x = np.array(start, dtype=float)
    weight = np.zeros(system.size) if prior is None else prior
    held = _Held(nominal, scale, weight * scale, frames)
    unit = np.append(scale, 1.0)
    seen = _Seen(system, scale, np.outer(unit, unit), is_rotation, held)
    closely = threshold < GRAM_TELLS
    cost, ranks, last = seen.look(x, closely), None, np.inf
    iterations = 0
    while iterations < solve.MAX_ITERATIONS:
        iterations += 1
        # A rank that has been lost is not taken back, so the iteration cannot swing between two.
        most = ranks if iterations > 3 else None
        split = _Split.of(held.joined(seen.factor, x), held, threshold, most)
        ranks = split.ranks
        step = split.step(held.displacement(x))
        size = float(np.max(np.abs(step), initial=0.0))
        if seen.closely and size <= solve.STEP_TOLERANCE:
            return Arrived(seen, x + scale * step, step, split, threshold, iterations, size)
        # Where steps go on shortening as they did, the next one may be the last.
        expected = size * min(1.0, size / last) if iterations > 1 else size
        closely = closely or expected <= NEAR
        before, at = cost, x
        x, cost, last = solve.advance(
            lambda at, how=closely: seen.look(at, how), x, scale * step, cost, scale, name,
            TRUNCATED_GROWTH,
        )  # fmt: skip
        if x is at:
            seen.look(x, closely)
        if iterations >= solve.PATIENCE and abs(before - cost) <= solve.STANDSTILL * before:
            break
    else:
        solve.require_converged(name, iterations, last, cost, system.count)
    seen.look(x, True)
    split = _Split.of(held.joined(seen.factor, x), held, threshold, ranks)
    return Arrived(seen, x, np.zeros(system.size), split, threshold, iterations, last)


class _Seen:
    """What a fit sees of its ``system`` at the latest point it looked at.

    ``factor``: triangular factor of ``[J scale | r]``, that of the Gram matrix, or ``closely`` that
    of the Jacobian; then ``factors`` has those of positions and of rotations, and ``counts`` how
    many residuals these are.
    """

    def __init__(self, system, scale, units, is_rotation, held) -> None:
        self.system, self.scale, self.units = system, scale, units
        self.is_rotation, self.held = is_rotation, held
        self.closely, self.factor = False, np.zeros((0, 0))
        self.factors: list[np.ndarray] = []
        self.counts: list[int] = []

    def look(self, x: np.ndarray, closely: bool) -> float:
        """Look at ``x``: the objective there."""
        self.closely = closely
        if closely:
            self.factors, self.counts = solve.triangles(
                self.system, x, self.scale, self.is_rotation
            )
            self.factor = solve.joined(self.factors)
            return float(np.sum(self.factor[:, -1] ** 2)) + self.held.cost(x)
        gram = solve.gram(self.system, x)
        self.factor = solve.triangle_of_gram(gram * self.units)
        return float(gram[-1, -1]) + self.held.cost(x)


@dataclass(frozen=True)
class Arrived:
    """Where a fit ended, and what is to be said of it when asked.

    What was ``seen`` last was one ``step`` (P,), in units of scale, before ``x``.
    """

    seen: _Seen
    x: np.ndarray
    step: np.ndarray
    split: _Split
    threshold: float
    iterations: int
    last: float

    @property
    def cost(self) -> float:
        """Sum of squared residuals at ``x``."""
        to = np.append(self.step, 1.0)
        return float(sum(np.sum((factor @ to) ** 2) for factor in self.seen.factors))

    @property
    def freedom(self) -> float:
        """Residuals less fitted parameters; of these only what the data, not a prior, decide."""
        fitted = float(sum(self.split.ranks))
        if self.seen.held.weight.any():
            root = self.split.root()
            fitted = float(
                sum(np.sum((factor[:, :-1] @ root) ** 2) for factor in self.seen.factors)
            )
        return sum(self.seen.counts) - fitted

    @property
    def variance(self) -> float:
        """That of the residuals; NaN where none is left over."""
        return self.cost / self.freedom if self.freedom > 0 else np.nan

    def solution(self, shared: tuple[np.ndarray, ...]) -> Solution:
        """The fit's outcome with its standard deviations."""
        x, seen, split, scale = self.x, self.seen, self.split, self.seen.scale
        variance, freedom = self.variance, self.freedom
        root = of_fit = split.root()
        told = split
        if self.threshold > FRAME_THRESHOLD and seen.held.frames:
            # Fitted as they are, weak frames still count as undetermined.
            joined = seen.held.joined(seen.factor, x)
            told = _Split.of(joined, seen.held, self.threshold, None, self.threshold)
            root = told.root()
        covariance = variance * (root @ root.T) * np.outer(scale, scale)
        if freedom > 0 and (shared or seen.is_rotation is not None):
            if shared:
                roots = scale[:, None] * of_fit, scale[:, None] * root
                along = variances.along_root_shared(seen.system, x, shared, *roots, variance)
            else:
                to = np.append(self.step, 1.0)
                costs = np.array([np.sum((factor @ to) ** 2) for factor in seen.factors])
                fitted, spoken = (
                    [factor[:, :-1] @ each for factor in seen.factors] for each in (of_fit, root)
                )
                counts = np.array(seen.counts)
                along = variances.along_root(costs, counts, fitted, spoken, variance)
            covariance = (root @ along @ root.T) * np.outer(scale, scale)
        return Solution(
            x=x,
            std=np.where(told.touched(), np.nan, np.sqrt(np.diag(covariance))),
            covariance=covariance,
            cost=self.cost,
            count=sum(seen.counts),
            degrees_of_freedom=freedom,
            variance=variance,
            iterations=self.iterations,
            last_step=self.last,
            converged=self.last <= solve.STEP_TOLERANCE,
            spectrum=split.others.spectrum,
            undetermined=told.undetermined(),
            scale=scale,
        )


def unseen(
    system: System, x: np.ndarray, scale: np.ndarray, frames: int, threshold: float
) -> np.ndarray:
    """Directions (m, P) that ``system`` linearised at ``x`` does not show, as in ``Solution``."""
    factor, _ = solve.triangle(system, x, scale)
    held = _Held(x, scale, np.zeros(system.size), frames)
    return _Split.of(factor, held, threshold, None).undetermined()


@dataclass(frozen=True)
class _Held:
    """Rows ``weight (x - nominal) / scale`` of the prior, in scaled parameters; frames first."""

    nominal: np.ndarray
    scale: np.ndarray
    weight: np.ndarray
    frames: int

    def displacement(self, x: np.ndarray) -> np.ndarray:
        return (x - self.nominal) / self.scale

    def cost(self, x: np.ndarray) -> float:
        return float(np.sum((self.weight * self.displacement(x)) ** 2))

    def joined(self, factor: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Triangular factor of the data and of the prior on the frames."""
        chosen = np.flatnonzero(self.weight[: self.frames])
        if not chosen.size:
            return factor
        rows = np.zeros((chosen.size, len(factor)))
        rows[np.arange(chosen.size), chosen] = self.weight[chosen]
        rows[:, -1] = (self.weight * self.displacement(x))[chosen]
        stacked = np.concatenate([factor, rows])
        return scipy.linalg.qr(stacked, mode="r", check_finite=False)[0][: len(factor)]

    @property
    def known_frames(self) -> np.ndarray:
        """Rows (p, frames) that choose the coordinates of frames with a prior."""
        return np.eye(self.frames)[self.weight[: self.frames] > 0.0]

    @property
    def of_others(self) -> np.ndarray:
        """Rows (p, P - frames) of the prior on the parameters after the frames."""
        weight = self.weight[self.frames :]
        return np.diag(weight)[weight > 0.0]


@dataclass(frozen=True)
class _Truncated:
    """A block of columns cut into ``kept`` (r, P) and ``lost`` directions, orthonormal rows.

    ``root`` (P, r): its product with its transpose inverts the Gram matrix of block and prior on
    the kept directions. ``left`` (m, r): orthonormal columns, root' times the block's. ``prior``
    (p, P): rows that follow those of the block. ``rank`` counts what the block alone determines.
    """

    left: np.ndarray
    root: np.ndarray
    lost: np.ndarray
    prior: np.ndarray
    spectrum: Spectrum
    unused: np.ndarray

    @classmethod
    def of(
        cls, block: np.ndarray, threshold: float, most: int | None, prior: np.ndarray | None = None
    ) -> _Truncated:
        left, values, right = np.linalg.svd(block)
        values = np.concatenate([values, np.zeros(len(right) - values.size)])
        spectrum = Spectrum.of(values, threshold, most)
        rank = spectrum.rank
        kept, lost = right[:rank], right[rank:]
        root, unused = kept.T / values[:rank], left[:, rank:]
        if prior is None or not len(prior):
            return cls(left[:, :rank], root, lost, np.zeros((0, len(right))), spectrum, unused)
        # Which parameters have a prior counts here, not how tight it is.
        told, lost = spoken_of(np.sign(prior), lost)
        kept = np.concatenate([kept, told])
        both, upper = np.linalg.qr(np.concatenate([block, prior]) @ kept.T)
        return cls(both, kept.T @ np.linalg.inv(upper), lost, prior, spectrum, unused)

    def keeping(
        self, block: np.ndarray, known: np.ndarray, least: float = TOUCH_SQUARED
    ) -> _Truncated:
        """The same cut of ``block`` and prior with directions kept that change what is ``known``.

        ``known`` (p, P): derivative of it, ``least``: squared change of a direction that counts.
        """
        told, lost = spoken_of(known, self.lost, least)
        if not len(told):
            return self
        kept = np.concatenate([np.linalg.qr(self.root)[0].T, told])
        block = np.concatenate([block, self.prior])
        left, upper = np.linalg.qr(block @ kept.T, mode="complete")
        root = kept.T @ np.linalg.inv(upper[: len(kept)])
        return replace(
            self, left=left[:, : len(kept)], root=root, lost=lost, unused=left[:, len(kept) :]
        )

    @property
    def rank(self) -> int:
        return self.spectrum.rank

    def step(self, rhs: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """Least squares in the kept directions, back to nominal in the others."""
        rhs = np.concatenate([rhs, self.prior @ displacement])
        kept = self.root @ (self.left.T @ rhs)
        return -kept - self.lost.T @ (self.lost @ displacement)

    def touched(self) -> np.ndarray:
        return np.sum(self.lost**2, axis=0) > TOUCH_SQUARED


def spoken_of(
    known: np.ndarray, lost: np.ndarray, least: float = TOUCH_SQUARED
) -> tuple[np.ndarray, np.ndarray]:
    """The directions ``lost`` (m, P) turned into those that change what is known, and the rest.

    ``known`` (p, P): its derivative; a direction counts if it changes that by more than ``least``.
    """
    if not len(lost) or not len(known):
        return lost[:0], lost
    _, values, turn = np.linalg.svd(known @ lost.T)
    told = int(np.sum(values**2 > least))
    return turn[:told] @ lost, turn[told:] @ lost


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
        cls,
        factor: np.ndarray,
        held: _Held,
        threshold: float,
        most: tuple[int | None, int | None] | None,
        frame_threshold: float = FRAME_THRESHOLD,
    ) -> _Split:
        count = held.frames
        upper, lower = factor[:count], factor[count:]
        frames = _Truncated.of(upper[:, :count], frame_threshold, most and most[0])
        telling = frame_threshold > FRAME_THRESHOLD
        if telling:
            frames = frames.keeping(upper[:, :count], held.known_frames)
        # Rows of truncated frame directions are equations the frames do not take up.
        rows = np.concatenate([lower, frames.unused.T @ upper])
        others = _Truncated.of(rows[:, count:-1], threshold, most and most[1], held.of_others)
        if telling:
            # What moves a frame that is known is not left open, however little the data show it.
            followed = -frames.root @ (frames.left.T @ upper[:, count:-1])
            known = held.known_frames @ followed
            others = others.keeping(rows[:, count:-1], known, MOVES_SQUARED)
        return cls(frames, others, upper[:, count:-1], upper[:, -1], rows[:, -1])

    @property
    def ranks(self) -> tuple[int, int]:
        return self.frames.rank, self.others.rank

    def step(self, displacement: np.ndarray) -> np.ndarray:
        count = len(self.frames_rhs)
        others = self.others.step(self.others_rhs, displacement[count:])
        frames = self.frames.step(self.frames_rhs + self.coupling @ others, displacement[:count])
        return np.concatenate([frames, others])

    def root(self) -> np.ndarray:
        """Matrix (P, r) whose product with its transpose inverts J'J on the kept directions."""
        seen = -self.frames.root @ (self.frames.left.T @ self.coupling @ self.others.root)
        blank = np.zeros((len(self.others.root), self.frames.root.shape[1]))
        return np.block([[self.frames.root, seen], [blank, self.others.root]])

    def undetermined(self) -> np.ndarray:
        """Truncated directions (m, P), frames first; those of the others carry the frames along."""
        alone, lost = self.frames.lost, self.others.lost
        kept = self.frames.left
        followed = -(self.frames.root @ (kept.T @ (self.coupling @ lost.T))).T
        blank = np.zeros((len(alone), len(self.others.root)))
        return np.block([[alone, blank], [followed, lost]])

    def touched(self) -> np.ndarray:
        """True (P,) where a truncated direction reaches a parameter."""
        return np.concatenate([self.frames.touched(), self.others.touched()])
