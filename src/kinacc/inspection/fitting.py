"""The arm a file is judged by, with the frames split where base or target moved in between."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from kinacc.geometry import log_so3
from kinacc.inspection import start, steps, tails, trial
from kinacc.inspection.steps import Step
from kinacc.inspection.trial import Residuals, Seen, Trial
from kinacc.models.dh import DHModel

_FITTED_ROWS = 900
_MOST_SPLITS = 8
_RUN = 6  # readings in a row that are all off
_RUN_SHARE = 0.8

Progress = Callable[[Iterable, str], Iterable]


@dataclass(frozen=True)
class Jump:
    """Base (``target`` None) or target that is elsewhere from reading ``row`` on.

    ``rows`` are the readings it holds for; ``shift_mm`` and ``turn_rad`` how far the points in the
    middle of them moved.
    """

    target: int | None
    row: int
    rows: np.ndarray
    shift_mm: np.ndarray
    turn_rad: float


@dataclass(frozen=True)
class Fitted:
    """The fit of all readings: ``seen`` with frames split at ``jumps``, and what is left.

    ``left_mm`` and ``left_rad`` (n,): lengths of the residuals, configurations left out where they
    were fitted; ``limit_mm`` and ``limit_rad`` what they may be.
    """

    seen: Seen
    trial: Trial
    left: Residuals
    left_mm: np.ndarray
    left_rad: np.ndarray
    limit_mm: float
    limit_rad: float
    jumps: tuple[Jump, ...] = ()

    @property
    def bad(self) -> np.ndarray:
        """True (n,) where a reading is further out than it may be."""
        return (self.left_mm > self.limit_mm) | (self.left_rad > self.limit_rad)


def fit(seen: Seen, model: DHModel) -> Fitted:
    """The robust fit of at most ``_FITTED_ROWS`` readings, and what it leaves of all."""
    chosen = start.thinned(np.arange(len(seen.q)), _FITTED_ROWS)
    few = seen.select(chosen)
    found = trial.best(few, start.found(few, model))
    left = trial.residuals(found.arm, seen)
    left_mm = np.linalg.norm(left.position_mm, axis=1)
    left_rad = np.linalg.norm(left.turn_rad, axis=1)
    left_mm[chosen] = np.linalg.norm(found.left_out_mm, axis=1)
    left_rad[chosen] = np.linalg.norm(found.left_out_rad, axis=1)
    return Fitted(
        seen,
        found,
        left,
        left_mm,
        np.where(np.isfinite(left_rad), left_rad, -1.0),
        tails.limit(left_mm, 3),
        tails.limit(left_rad, 3),
    )


def with_jumps(seen: Seen, model: DHModel, progress: Progress) -> Fitted:
    """The fit with every jump of base or target taken out, one after the other."""
    fitted, jumps = fit(seen, model), []
    for _ in progress(range(_MOST_SPLITS), "jumps looked for"):
        split = _next(fitted, model)
        if split is None:
            break
        jump, fitted = split
        jumps.append(jump)
    return replace(fitted, jumps=tuple(_measured(fitted, jump) for jump in jumps))


def _next(fitted: Fitted, model: DHModel) -> tuple[Jump, Fitted] | None:
    """The next jump and the fit without it; None where there is none."""
    here = _cost(fitted, fitted)
    for row, target in _places(fitted):
        seen, rows = _split(fitted.seen, row, target)
        again = fit(seen, model)
        # A jump that is one leaves fewer readings off, or explains what it promised.
        if _cost(again, fitted) < here:
            return Jump(target, row, rows, np.zeros(3), 0.0), again
    return None


def _places(fitted: Fitted) -> list[tuple[int, int | None]]:
    """Places to split at: beginnings of runs of bad readings, then the steps beyond reference."""
    seen = fitted.seen
    places: list[tuple[float, int, int | None]] = []
    for base in np.unique(seen.base):
        rows = np.flatnonzero(seen.base == base)
        for begin, size in _runs(fitted.bad[rows]):
            for row in (begin, begin + size):
                if 0 < row < len(rows):
                    kinds = [None, *np.unique(seen.target[rows])]
                    places += [(1e3 + size, int(rows[row]), kind) for kind in kinds]
        for step in steps.candidates(seen, fitted.left, rows):
            if step.excess > 1.0:
                places.append((step.excess, step.row, step.target))
    places.sort(key=lambda place: -place[0])
    best: list[tuple[int, int | None]] = []
    for _, row, target in places:
        kind = None if target is None else int(target)
        if (row, kind) not in best:
            best.append((row, kind))
    return best[:6]


def _runs(bad: np.ndarray) -> list[tuple[int, int]]:
    """Begin and size of stretches of which most readings are bad."""
    runs = []
    row = 0
    while row < len(bad):
        if not bad[row]:
            row += 1
            continue
        end, count, reach = row, 0, row
        while reach < len(bad):
            count += bad[reach]
            if count < _RUN_SHARE * (reach - row + 1):
                break
            if bad[reach]:
                end = reach
            reach += 1
        if end - row + 1 >= _RUN:
            runs.append((row, end - row + 1))
        row = end + 1
    return runs


def _split(seen: Seen, row: int, target: int | None) -> tuple[Seen, np.ndarray]:
    """Frames split before reading ``row``: a new base for the rest of its session, or target."""
    after = np.arange(len(seen.q)) >= row
    if target is None:
        rows = after & (seen.base == seen.base[row])
        base = np.where(rows, seen.base.max() + 1, seen.base)
        return Seen(seen.cells, seen.q, base, seen.target), np.flatnonzero(rows)
    rows = after & (seen.target == target)
    index = np.where(rows, seen.target.max() + 1, seen.target)
    return Seen(seen.cells, seen.q, seen.base, index), np.flatnonzero(rows)


def _cost(fitted: Fitted, reference: Fitted) -> float:
    """What is left, each reading counted up to the limit of ``reference``."""
    return float(np.sum(np.minimum(fitted.left_mm / reference.limit_mm, 1.0)))


def _measured(fitted: Fitted, jump: Jump) -> Jump:
    """How far base or target of the jump's readings are from those before it."""
    arm, seen = fitted.trial.arm, fitted.seen
    after = jump.rows[-1] if jump.target is None else jump.rows[-1]
    middle = fitted.left.predicted.position_mm[jump.rows].mean(axis=0)
    if jump.target is None:
        before = _before(seen.base, jump.row, seen.cells.session)
        one = arm.base.rotation[before], arm.base.position_mm[before]
        other = arm.base.rotation[seen.base[after]], arm.base.position_mm[seen.base[after]]
        at_arm = other[0].T @ (middle - other[1])
        shift = middle - (one[0] @ at_arm + one[1])
        turn = float(np.linalg.norm(log_so3(other[0] @ one[0].T)))
        return replace(jump, shift_mm=shift, turn_rad=turn)
    same = np.flatnonzero(seen.cells.target == seen.cells.target[jump.row])
    before = seen.target[same[same < jump.row][-1]]
    shift = arm.targets.position_mm[seen.target[jump.row]] - arm.targets.position_mm[before]
    return replace(jump, shift_mm=shift)


def _before(base: np.ndarray, row: int, session: np.ndarray) -> int:
    same = np.flatnonzero(session[:row] == session[row])
    return int(base[same[-1]])
