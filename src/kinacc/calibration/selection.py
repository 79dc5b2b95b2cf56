"""Order and prior of a VEC model chosen by cross-validation on the rows a fit may see.

Errors are small, so poses are linear in the coefficients to parts of a micrometre: one pass over
the data sums up normal equations by block of folds at the highest order, and every candidate,
trained on any blocks and tried on another, follows from sums of their parts. What is held out of a
choice is a whole block of folds; the choice never sees it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from kinacc.calibration import vec_fit
from kinacc.calibration.basis_expansion import gram
from kinacc.calibration.held import Placed
from kinacc.calibration.observations import Observations
from kinacc.calibration.system import PoseSystem
from kinacc.calibration.vec_fit import Prior
from kinacc.errors import InputError, Problem
from kinacc.kinematics.vec import VECModel

ORDERS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 28, 32, 40)
PRIOR_STD = (0.01, 0.03, 0.1, 0.3, 1.0)  # mm and mrad
PRIOR_DECAY = (0.7, 0.85, 1.0)
CONSTANT_STD = 3.0  # mm and mrad, of order 0 beside a chosen prior: all but free
MOST_BLOCKS = 5
_FIX = "measure more configurations, or state calibration.vec.order and prior"
_VARIANCE_STEPS = 40
_VARIANCE_TOLERANCE = 1e-4
_LEAST_SHARE = 1e-6  # of the mean squared misfit, where the residual variance starts
_GAUGE_RIDGE = 1e-9  # holds constants no pose shows, as a share of those it does


@dataclass(frozen=True)
class Grid:
    """Candidates: every one of ``orders`` with every one of ``priors``, smoothest first."""

    orders: tuple[int, ...]
    priors: tuple[Prior, ...]

    def within(self, components: int, joints: int, frames: int) -> Grid:
        """The grid without orders that have more parameters than there are residuals."""
        fit = [n for n in self.orders if 6 * joints * (n + 1) + frames <= components]
        return Grid(tuple(fit) or self.orders[:1], self.priors)


@dataclass(frozen=True)
class Trial:
    """How the best prior of one order did: ``squared_mm2`` (b,), the mean squared position error
    of every block tried on by a fit to the others."""

    order: int
    prior: Prior
    squared_mm2: np.ndarray

    @property
    def rms_mm(self) -> float:
        """Root of the mean over blocks."""
        return float(np.sqrt(self.squared_mm2.mean()))


@dataclass(frozen=True)
class Choice:
    """Trials by rising order and the one chosen, with nothing seen of the folds ``held_out``."""

    held_out: tuple[int, ...]
    trials: tuple[Trial, ...]
    chosen: Trial


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
    sums = _Sums.of(observations, block, empty, frames, rotation_weight_mm_per_rad)
    held_out = [*numbers, None]
    if len(numbers) < 3:
        held_out = [None]  # nothing would be left to try candidates on
    pairs = [(out, test) for out in held_out for test in numbers if test != out]
    counted = progress(pairs, "trials of order and prior") if progress else pairs
    tried: dict[tuple, np.ndarray] = {}
    for out, test in counted:
        mirror = tried.get((test, out)) if out is not None else None
        tried[out, test] = sums.trained(grid, (out, test)) if mirror is None else mirror
    found = []
    for out in held_out:
        errors = [
            sums.errors(grid, tried[out, test], test) for test in numbers if (out, test) in tried
        ]
        folds = np.unique(observations.fold[block == out]) if out is not None else ()
        found.append(_choice(grid, tuple(int(each) for each in folds), np.array(errors)))
    return found


def _choice(grid: Grid, held_out: tuple[int, ...], errors: np.ndarray) -> Choice:
    """One-standard-error rule on ``errors`` (blocks, orders, priors), paired by block."""
    best_prior = errors.mean(axis=0).argmin(axis=1)
    trials = tuple(
        Trial(order, grid.priors[prior], errors[:, i, prior])
        for i, (order, prior) in enumerate(zip(grid.orders, best_prior, strict=True))
    )
    best = min(trials, key=lambda trial: trial.squared_mm2.mean())
    for trial in trials:
        worse = trial.squared_mm2 - best.squared_mm2
        if worse.mean() <= worse.std(ddof=1) / np.sqrt(worse.size):
            return Choice(held_out, trials, trial)
    return Choice(held_out, trials, best)


@dataclass(frozen=True)
class _Sums:
    """Gram matrices of ``[J | r]`` by block: of positions, of all residuals; and their counts."""

    position: dict[int, np.ndarray]
    everything: dict[int, np.ndarray]
    rows: dict[int, int]
    components: dict[int, int]
    order: np.ndarray  # (P,) Chebyshev order; -1 for frames and offsets, which stay as they are
    empty: VECModel
    free: np.ndarray

    @classmethod
    def of(
        cls,
        observations: Observations,
        block: np.ndarray,
        empty: VECModel,
        frames: Placed,
        weight: float,
    ) -> _Sums:
        coords, kept = frames.inner, frames.kept
        free, flange = vec_fit.flange_model(observations, empty)
        position, everything, rows, components = {}, {}, {}, {}
        for number in np.unique(block[block >= 0]):
            part = observations.select(block == number)
            system = PoseSystem(part, flange, coords, weight)
            size = system.size + 1
            place, all_rows = np.zeros((size, size)), np.zeros((size, size))
            for columns, groups in system.gram_blocks(np.zeros(system.size)):
                place += gram(columns[:, :3], groups)
                if part.has_rotation.any():
                    all_rows += gram(columns[:, 3:], groups)
            key = int(number)
            position[key], everything[key] = _in(kept, place), _in(kept, all_rows + place)
            rows[key], components[key] = len(part), part.components
        terms = np.tile(np.arange(empty.order + 1), empty.coefficients.size // (empty.order + 1))
        order = np.concatenate([terms, np.full(empty.direction_offsets_rad.size, -1)])[free]
        order = np.concatenate([np.full(kept.shape[1], -1), order])
        return cls(position, everything, rows, components, order, empty, free)

    def trained(self, grid: Grid, left_out: Sequence[int | None]) -> list[np.ndarray]:
        """Per order the coefficients (P, priors) fitted to all blocks but those left out."""
        kept = [number for number in self.rows if number not in left_out]
        normal = sum(self.everything[number] for number in kept)
        count = sum(self.components[number] for number in kept)
        return [
            np.stack(list(self._solutions(normal, count, order, grid.priors)), axis=1)
            for order in grid.orders
        ]

    def errors(self, grid: Grid, trained: list[np.ndarray], test: int) -> np.ndarray:
        """Mean squared position error (orders, priors) in block ``test``, mm^2."""
        gram_test, result = self.position[test], np.empty((len(grid.orders), len(grid.priors)))
        for i, solutions in enumerate(trained):
            used = np.flatnonzero(self.order <= grid.orders[i])
            part = solutions[used]
            moved = gram_test[np.ix_(used, used)] @ part + 2.0 * gram_test[used, -1][:, None]
            result[i] = gram_test[-1, -1] + np.sum(part * moved, axis=0)
        return np.maximum(result, 0.0) / self.rows[test]

    def _solutions(
        self, normal: np.ndarray, count: int, order: int, priors: Sequence[Prior]
    ) -> Iterator[np.ndarray]:
        """Posterior means (P,) of one order under every prior, residual variance found along."""
        flat = np.flatnonzero(self.order <= 0)
        bent = np.flatnonzero((self.order > 0) & (self.order <= order))
        # Frames, constants and offsets have no prior worth the name: eliminated once for all.
        own = normal[np.ix_(flat, flat)]
        own = own + np.diag(_GAUGE_RIDGE * np.maximum(np.diag(own), own.trace() / max(len(own), 1)))
        sides = np.linalg.solve(own, normal[np.ix_(flat, [*bent, -1])])
        rest = normal[np.ix_(bent, bent)] - normal[np.ix_(bent, flat)] @ sides[:, :-1]
        right = normal[bent, -1] - normal[np.ix_(bent, flat)] @ sides[:, -1]
        cost = normal[-1, -1] - normal[-1, flat] @ sides[:, -1]
        spectra: dict[float, tuple] = {}
        for prior in priors:
            unit = self._prior_std(prior)[bent] / prior.delta_mm
            shape = prior.decay
            if shape not in spectra:
                values, vectors = np.linalg.eigh(rest * np.outer(unit, unit))
                spectra[shape] = np.maximum(values, 0.0), vectors, vectors.T @ (right * unit)
            values, vectors, gradient = spectra[shape]
            own_step = _ridge(values, gradient, cost, count - len(flat), prior.delta_mm)
            solution = np.zeros(len(self.order))
            solution[bent] = unit * (vectors @ own_step)
            solution[flat] = -sides[:, -1] - sides[:, :-1] @ solution[bent]
            yield solution

    def _prior_std(self, prior: Prior) -> np.ndarray:
        frames = len(self.order) - int(self.free.sum())
        return np.concatenate([np.ones(frames), prior.std(self.empty)[self.free]])


def _in(kept: np.ndarray, gram: np.ndarray) -> np.ndarray:
    """A Gram matrix whose first coordinates are those that ``kept`` (E, f) is the derivative by."""
    if np.array_equal(kept, np.eye(len(kept))):
        return gram
    change = block_diag(kept, np.eye(len(gram) - len(kept)))
    return change.T @ gram @ change


def _ridge(
    values: np.ndarray, gradient: np.ndarray, cost: float, freedom: int, std: float
) -> np.ndarray:
    """Step in eigendirections under a prior of ``std``, at the residual variance it leaves."""
    variance = _LEAST_SHARE * cost / max(freedom, 1)
    for _ in range(_VARIANCE_STEPS):
        held = variance / std**2
        step = -gradient / (values + held)
        left = cost + step @ (2.0 * gradient + values * step)
        effective = np.sum(values / (values + held))
        found = max(left, 0.0) / max(freedom - effective, 1.0)
        if abs(found - variance) <= _VARIANCE_TOLERANCE * variance:
            break
        variance = found
    return step
