"""The arm a file is judged by, with the frames split where base or target moved in between."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from kinacc.checks import hand_eye, robust_fit, steps, tails
from kinacc.checks.findings import Finding, finding
from kinacc.checks.robust_fit import Residuals, Seen, Trial
from kinacc.geometry import log_so3
from kinacc.kinematics.dh import DHModel

_FITTED_ROWS = 900
_COARSE_ROWS = 240
_MOST_SPLITS = 8
_TRIED = 3  # places tried for one split
_FEWEST = 5  # poses on either side of a split
_FEW = 30  # poses: with fewer, two more frames explain noise
_RUN = 6  # readings in a row that are far off
_RUN_SHARE = 0.8
_OFF = 8.0  # sigma
_CAP = 10.0  # sigma
_BETTER = 0.85  # of what is left overall: a split of a good file leaves all but a few per cent
_BETTER_THERE = 0.55  # of what is left of the readings after the split
_PLAIN = 0.5  # share at which no other place need be tried

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
    chosen = hand_eye.thinned(np.arange(len(seen.q)), _FITTED_ROWS)
    few = seen.select(chosen)
    found = robust_fit.best(few, hand_eye.found(few, model))
    left = robust_fit.residuals(found.arm, seen)
    left_mm = np.linalg.norm(left.position_mm, axis=1)
    left_rad = np.linalg.norm(left.turn_rad, axis=1)
    left_mm[chosen] = _told_apart(found.left_out[:, :3], found.judged[:, :3])
    left_rad[chosen] = _told_apart(found.left_out[:, 3:], found.judged[:, 3:])
    return Fitted(
        seen,
        found,
        left,
        left_mm,
        np.where(np.isfinite(left_rad), left_rad, -1.0),
        tails.limit(left_mm, 3),
        tails.limit(left_rad, 3),
    )


def _told_apart(left_out: np.ndarray, judged: np.ndarray) -> np.ndarray:
    """How far readings (n, 3) lie where the others put the arm, as far as the others tell.

    A reading that alone determines something lies anywhere without it, however sound it is: it is
    far only where it is so too over what the fit without it leaves open.
    """
    length, over = (np.linalg.norm(each, axis=1) for each in (left_out, judged))
    unknown = (length > tails.limit(length, 3)) & (over <= tails.limit(over, 3))
    return np.where(unknown, over, length)


def with_jumps(seen: Seen, model: DHModel, progress: Progress) -> Fitted:
    """The fit with every jump of base or target taken out, one after the other."""
    fitted, jumps = fit(seen, model), []
    for _ in progress(range(_MOST_SPLITS), "searches for a moved instrument or target"):
        split = _next(fitted, model)
        if split is None:
            break
        jump, fitted = split
        jumps.append(jump)
    return replace(fitted, jumps=tuple(_measured(fitted, jump) for jump in jumps))


def _next(fitted: Fitted, model: DHModel) -> tuple[Jump, Fitted] | None:
    """The next jump and the fit without it; None where there is none."""
    if fitted.trial.sigma_mm < tails.ROUNDING:
        return None
    # Poses of equal joints are one: read often, they make no jump any surer.
    few = len(np.unique(np.round(fitted.seen.q, 6), axis=0)) < _FEW
    best, least = None, _PLAIN if few else 1.0
    tried = set()
    for row, kind in _places(fitted):
        for each in _kinds(fitted.seen, row, kind):
            split = _parted(fitted, row, each, model)
            if split is None or (split[0].row, split[0].target) in tried:
                continue
            tried.add((split[0].row, split[0].target))
            share = _share_left(fitted, split[1], split[0].rows)
            if share < least:
                best, least = split, share
            elif share > 1.1 and each == kind:
                break  # nothing parts here, so nothing of another kind does
        if least < _PLAIN:
            break
    return best


def _kinds(seen: Seen, row: int, first: int | None) -> list[int | None]:
    """What may move at a reading, ``first`` first: base or one of the targets of its base."""
    rows = seen.base == seen.base[row]
    kinds = [None, *(int(each) for each in np.unique(seen.target[rows]))]
    return [first, *(kind for kind in kinds if kind != first)]


def _parted(fitted: Fitted, row: int, target: int | None, model: DHModel):
    """The jump of base or target near a reading and the fit without it; None where none is."""
    again = fit(_split(fitted.seen, row, target)[0], model)
    place = _refined(again, row, target)
    if place is None:
        return None
    seen, rows = _split(fitted.seen, place, target)
    return Jump(target, place, rows, np.zeros(3), 0.0), fit(seen, model)


def _share_left(before: Fitted, after: Fitted, rows: np.ndarray) -> float:
    """What a split leaves, over what it may leave at most to be believed: overall, or where it is.

    The fits' own lengths are compared, each cut at ten sigma so that gross errors do not decide.
    """
    cap = _CAP * before.trial.sigma_mm
    one, other = np.minimum(before.left_mm, cap), np.minimum(after.left_mm, cap)
    near = rows[: steps.WINDOW // 2]
    everywhere = float(np.mean(other) / np.mean(one))
    there = float(np.mean(other[near]) / np.mean(one[near]))
    return min(everywhere / _BETTER, max(there / _BETTER_THERE, everywhere))


def _places(fitted: Fitted) -> list[tuple[int, int | None]]:
    """Where to try a split: reading, and target or None; likely places first."""
    seen = fitted.seen
    far = fitted.left_mm > _OFF * fitted.trial.sigma_mm
    tried: list[tuple[float, int, int | None]] = []
    for base in np.unique(seen.base):
        rows = np.flatnonzero(seen.base == base)
        kinds = [None, *(int(each) for each in np.unique(seen.target[rows]))]
        for begin, size in _runs(far[rows]):
            for row in (begin, begin + size):
                if _FEWEST <= row <= len(rows) - _FEWEST:
                    tried += [(1e3 + size, int(rows[row]), kind) for kind in kinds]
        for step in steps.candidates(seen, fitted.left, rows):
            if step.excess > 2.0:
                tried.append((step.excess, step.row, step.target))
        tried += _coarse(fitted, rows, kinds)
    tried.sort(key=lambda place: -place[0])
    return list(dict.fromkeys((row, kind) for _, row, kind in tried))[:_TRIED]


def _coarse(fitted: Fitted, rows: np.ndarray, kinds: list) -> list[tuple]:
    """Splits at a few places of a base's readings that leave clearly less, by short fits."""
    seen, strength = fitted.seen, fitted.trial.strength
    chosen = hand_eye.thinned(rows, _COARSE_ROWS)
    few = seen.select(chosen)
    if len(few.q) < 4 * _FEWEST:
        return []
    few = Seen(few.cells, few.q, np.zeros_like(few.base), few.target)
    used = np.unique(few.target, return_inverse=True)[1].ravel()
    few = Seen(few.cells, few.q, few.base, used)
    nominal = fitted.trial.nominal
    begin = hand_eye.found(few, nominal)
    here = _typical(few, robust_fit.fit(few, begin, nominal, strength, huber=True))
    found = []
    for share in range(1, 8):
        row = len(chosen) * share // 8
        for kind in kinds:
            split = _split(few, row, None if kind is None else int(few.target[row]))[0]
            arm = hand_eye.found(split, nominal, draws=0, stretches=())
            left = _typical(split, robust_fit.fit(split, arm, nominal, strength, huber=True))
            if left < 0.9 * here:
                found.append((here / left, int(chosen[row]), kind))
            if kind is not None:
                break
    return found


def _typical(seen: Seen, fitted: Trial) -> float:
    return float(np.median(np.linalg.norm(fitted.left_out[:, :3], axis=1)))


def _refined(fitted: Fitted, row: int, target: int | None) -> int | None:
    """The reading that parts the two frames of a split best; None where it parts none."""
    seen, arm = fitted.seen, fitted.trial.arm
    if target is None:
        one, other = _before(seen.base, row, seen.cells.session), int(seen.base[row])
        rows = np.flatnonzero((seen.base == one) | (seen.base == other))
        change = "base"
    else:
        other = int(seen.target.max())
        rows = np.flatnonzero((seen.target == target) | (seen.target == other))
        one, change = target, "target"
    costs = []
    for index in (one, other):
        part = seen.select(rows)
        frames = {"base": part.base, "target": part.target} | {change: np.full(len(rows), index)}
        left = robust_fit.residuals(arm, Seen(part.cells, part.q, **frames)).position_mm
        length = np.linalg.norm(left, axis=1)
        costs.append(np.minimum(length, _CAP * fitted.trial.sigma_mm))
    before = np.concatenate([[0.0], np.cumsum(costs[0])])
    after = np.concatenate([[0.0], np.cumsum(costs[1][::-1])])[::-1]
    place = int(np.argmin(before + after))
    poses = [np.unique(seen.cells.pose[side]).size for side in (rows[:place], rows[place:])]
    return int(rows[place]) if min(poses) >= _FEWEST else None


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


def _measured(fitted: Fitted, jump: Jump) -> Jump:
    """How far base or target of the jump's readings are from those before it."""
    arm, seen = fitted.trial.arm, fitted.seen
    after = jump.rows[-1]
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


def drift_mm(fitted: Fitted, session: float) -> np.ndarray | None:
    """How far the base of a session drifted (3,), mm; None where it jumped or stayed.

    A jump leaves no trend on either side of it. A steady drift that is split leaves one in every
    part: together as far as the frame drifted, which is more than the parts are apart.
    """
    seen, arm = fitted.seen, fitted.trial.arm
    rows = np.flatnonzero(seen.cells.session == session)
    parts = list(dict.fromkeys(seen.base[rows].tolist()))
    if len(parts) < 2:
        return None
    within = np.zeros(3)
    for part in parts:
        own = rows[(seen.base[rows] == part) & ~fitted.bad[rows]]
        if len(own) >= _FEWEST:
            time = np.linspace(-0.5, 0.5, len(own))
            within -= time @ fitted.left.position_mm[own] / np.sum(time**2)
    middle = fitted.left.predicted.position_mm[rows].mean(axis=0)
    first, last = ((arm.base.rotation[each], arm.base.position_mm[each]) for each in
                   (parts[0], parts[-1]))  # fmt: skip
    apart = last[0] @ (first[0].T @ (middle - first[1])) + last[1] - middle
    return within if within @ apart > 0.5 * (apart @ apart) else None


def _before(base: np.ndarray, row: int, session: np.ndarray) -> int:
    same = np.flatnonzero(session[:row] == session[row])
    return int(base[same[-1]])


def moved_frames(fitted: Fitted) -> Iterator[Finding]:
    """Jumps of base and targets; a drift in place of the jumps of a base that drifts."""
    seen = fitted.seen.cells
    drifts = {session: drift_mm(fitted, session) for session in np.unique(seen.session)}
    for session, drifted in drifts.items():
        if drifted is not None:
            own = seen.line[seen.session == session]
            yield finding("drift", own, by=_signed(drifted), drift_mm=drifted.tolist())
    for jump in fitted.jumps:
        base, line = jump.target is None, int(seen.line[jump.row])
        if not base or drifts[seen.session[jump.row]] is None:
            yield finding(
                "base_jump" if base else "target_moved",
                seen.lines(jump.rows),
                row=seen.row_names.one(line),
                target="" if base else seen.target_names[seen.target[jump.row]],
                by=_signed(jump.shift_mm),
                first_line=line,
                shift_mm=jump.shift_mm.tolist(),
                turn_mrad=1e3 * jump.turn_rad,
            )


def _signed(vector: np.ndarray) -> str:
    return ", ".join(f"{value:+.3g}" for value in vector)
