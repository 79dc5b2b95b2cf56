"""Order and prior of a VEC model chosen by cross-validation on the rows a fit may see.

Errors are small, so poses are linear in the coefficients to parts of a micrometre: one pass over
the data sums up normal equations by block of folds at the highest order, and every candidate,
trained on any blocks, follows from sums of their parts and is tried pose by pose on another block.
What is held out of a choice is a whole block of folds; the choice never sees it.

A reading that no candidate comes near says nothing of any of them, yet its square would outweigh
all others, and bend high orders most. It counts less, for all candidates alike: where candidates
are trained, by an arm with constant errors only, trained on the same rows; where they are tried, by
the nearest of them. So a candidate that goes astray where others do not gets no pardon.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kinacc.calibration.block_sums import BlockSums, weights
from kinacc.calibration.held import Placed
from kinacc.calibration.observations import Observations
from kinacc.calibration.vec_fit import Prior
from kinacc.errors import InputError, Problem
from kinacc.kinematics.vec import VECModel
from kinacc.measurements.folds import configurations_among, neighbours

ORDERS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 28, 40)
ALWAYS_TRIED = 12  # above it orders are tried as long as that pays
PRIOR_STD = (0.01, 0.03, 0.1, 0.3, 1.0)  # mm and mrad
PRIOR_DECAY = (0.7, 0.85, 1.0)
LEAST_PRIOR = 0.01  # share of a prior left at an order below which it adds nothing to lower ones
MOST_EXCESS = 0.25  # of the least squared error: one of few configurations allows any by its own
CONSTANT_STD = 3.0  # mm and mrad, of order 0 beside a chosen prior: all but free
MOST_BLOCKS = 5
_FIX = "measure more configurations, or state calibration.vec.order and prior"


@dataclass(frozen=True)
class Grid:
    """Candidates: every one of ``orders`` with every one of ``priors``, smoothest first."""

    orders: tuple[int, ...]
    priors: tuple[Prior, ...]

    def within(self, components: int, joints: int, frames: int) -> Grid:
        """The grid without orders that have more parameters than there are residuals."""
        fit = [n for n in self.orders if n <= highest_order(components, joints, frames)]
        return Grid(tuple(fit) or self.orders[:1], self.priors)

    def priors_of(self, order: int) -> tuple[Prior, ...]:
        """The priors to try an order with: not those that have fallen to nothing before it.

        Of order 1 and below the first of each standard deviation: priors fall from order 2 on, and
        rounding would choose among equal ones.
        """
        if order <= 1:
            stds = [prior.delta_mm for prior in self.priors]
            return tuple(p for i, p in enumerate(self.priors) if p.delta_mm not in stds[:i])
        if len(self.orders) == 1:
            return self.priors
        return tuple(p for p in self.priors if p.decay ** (order - 1) >= LEAST_PRIOR)


def highest_order(components: int, joints: int, frames: int) -> int:
    """The highest order with no more parameters than residuals, below 0 where there is none."""
    return (components - frames) // (6 * joints) - 1


def carried(held_out: Observations) -> int:
    """Residual components that every fit of a chosen order has, those without a fold as well.

    Of one reading of every configuration and target: another one of the same tells nothing new.
    """
    near, folds = neighbours(held_out.q_rad), np.unique(held_out.fold)
    seen = [np.arange(len(held_out))]
    seen += [np.flatnonzero(held_out.fold != fold) for fold in folds]
    found = []
    for rows in seen:
        same = configurations_among(rows, held_out.pose, near)
        both = np.stack([same, held_out.target[rows]], axis=1)
        distinct = rows[np.unique(both, axis=0, return_index=True)[1]]
        found.append(held_out.select(distinct).components)
    return min(each for each in found if each > 0)


@dataclass(frozen=True)
class Trial:
    """How the best prior of one order did.

    ``squared_mm2`` (c,): mean squared position error of every configuration tried, by fits that
    had not seen it, times its weight.
    """

    order: int
    prior: Prior
    squared_mm2: np.ndarray

    @property
    def rms_mm(self) -> float:
        """Root of the mean over configurations."""
        return float(np.sqrt(self.squared_mm2.mean()))

    def excess_mm2(self, best: Trial) -> tuple[float, float]:
        """Mean squared error beyond that of ``best`` and its standard error, by configurations."""
        worse = self.squared_mm2 - best.squared_mm2
        error = worse.std(ddof=1) / np.sqrt(worse.size) if worse.size > 1 else np.inf
        return float(worse.mean()), float(error)


@dataclass(frozen=True)
class Choice:
    """Trials by rising order and the one chosen, with nothing seen of the folds ``held_out``."""

    held_out: tuple[int, ...]
    trials: tuple[Trial, ...]
    chosen: Trial

    @property
    def best(self) -> Trial:
        """The trial of the least error."""
        return min(self.trials, key=lambda trial: trial.rms_mm)


def chosen_priors(offset_rad: float) -> tuple[Prior, ...]:
    """The priors tried: standard deviation and fall of everything above order 0."""
    return tuple(
        Prior(std, 1e-3 * std, decay, offset_rad, CONSTANT_STD, 1e-3 * CONSTANT_STD)
        for decay in PRIOR_DECAY
        for std in PRIOR_STD
    )


def blocks(fold: np.ndarray) -> np.ndarray:
    """Block (n,) of every row: its fold where there are at most MOST_BLOCKS, else several folds.

    Rows of no fold (-1) are of no block (-1).
    """
    folds = np.unique(fold[fold >= 0])
    block = np.full(len(fold), -1)
    for number, each in enumerate(folds):
        block[fold == each] = number % MOST_BLOCKS
    return block


def choices(
    observations: Observations,
    empty: VECModel,
    frames: Placed,
    rotation_weight_mm_per_rad: float,
    grid: Grid,
    progress=None,
) -> list[Choice]:
    """The choice of every block with that block held out, and last one that has seen all.

    ``empty`` is the VEC model at the highest order; ``frames`` as a fit has them.
    """
    block = blocks(observations.fold)
    numbers = [int(each) for each in np.unique(block) if each >= 0]
    if len(numbers) < 2:
        what = f"{len(numbers)} folds hold rows: no order or prior can be tried on held-out ones"
        raise InputError(Problem("measurements", what, "rows in two folds or more", _FIX))
    sums = BlockSums.of(observations, block, empty, frames, rotation_weight_mm_per_rad)
    # Of two blocks nothing would be left to try candidates on.
    held_out = [*numbers, None] if len(numbers) > 2 else [None]
    near = neighbours(observations.q_rad)
    searches = {out: _Search.of(observations, block, out, near) for out in held_out}
    pairs = {frozenset({out, test}) for out in held_out for test in numbers if test != out}
    far = {pair: sums.far(pair) for pair in pairs}
    for order in (
        progress(grid.orders, "orders of the VEC model tried") if progress else grid.orders
    ):
        priors, trained = grid.priors_of(order), {}
        for out, search in searches.items():
            if not search.goes_on(order):
                continue
            errors = np.empty((len(observations), len(priors)))
            for test in numbers:
                if test != out:
                    pair = frozenset({out, test})
                    if pair not in trained:
                        trained[pair] = sums.trained(order, priors, far[pair])
                    errors[block == test] = sums.errors(trained[pair], order, test)
            search.add(order, priors, errors)
    return [search.choice() for search in searches.values()]


@dataclass(frozen=True)
class _Search:
    """What was tried with nothing seen of one block: orders, priors and squared errors.

    ``rows`` (r,): those that candidates are tried on; ``configuration`` (r,) numbers from 0.
    """

    held_out: tuple[int, ...]
    rows: np.ndarray
    configuration: np.ndarray
    tried: list[tuple[int, tuple[Prior, ...], np.ndarray]] = field(default_factory=list)

    @classmethod
    def of(
        cls, observations: Observations, block: np.ndarray, out: int | None, near: np.ndarray
    ) -> _Search:
        folds = np.unique(observations.fold[block == out]) if out is not None else ()
        rows = np.flatnonzero((block >= 0) & (block != (-1 if out is None else out)))
        same = configurations_among(rows, observations.pose, near)
        return cls(tuple(int(each) for each in folds), rows, same)

    def add(self, order: int, priors: tuple[Prior, ...], squared_mm2: np.ndarray) -> None:
        """Squared errors (n, priors) of all rows: kept by configuration."""
        size = np.bincount(self.configuration)
        by_prior = [np.bincount(self.configuration, each) for each in squared_mm2[self.rows].T]
        self.tried.append((order, priors, np.stack(by_prior, axis=1) / size[:, None]))

    def goes_on(self, order: int) -> bool:
        """Whether to try an order: not where all from half of it on have gained nothing."""
        return order <= ALWAYS_TRIED or not self.tried or 2 * self.choice().best.order >= order

    def choice(self) -> Choice:
        """One-standard-error rule, paired by configuration."""
        nearest = [errors.min(axis=1) for *_, errors in self.tried]
        weight = weights(np.min(nearest, axis=0))
        trials = []
        for order, priors, errors in self.tried:
            weighted = weight[:, None] * errors
            prior = int(weighted.mean(axis=0).argmin())
            trials.append(Trial(order, priors[prior], weighted[:, prior]))
        best = min(trials, key=lambda trial: trial.rms_mm)
        for trial in trials:
            excess, error = trial.excess_mm2(best)
            if excess <= min(error, MOST_EXCESS * best.rms_mm**2):
                break
        return Choice(self.held_out, tuple(trials), trial)
