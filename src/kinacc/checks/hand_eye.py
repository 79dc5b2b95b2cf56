"""Base frames and targets to start from, found although part of the readings is wrong."""

from __future__ import annotations

import numpy as np

from kinacc.checks.cells import nearest_rotation
from kinacc.checks.robust_fit import Arm, Seen, residuals
from kinacc.geometry import Pose
from kinacc.kinematics import dh
from kinacc.kinematics.dh import DHModel

_DRAWS = 24  # with a third of the readings wrong, 8 of 24 draws of two are free of them, or more
_DRAWN = 12  # configurations per draw
_KEPT = 0.5  # share of the readings a refinement trusts
_JUDGED = 0.4  # share of the readings that must fit: the rest may be of another base
_STRETCHES = (2, 3, 5)
_REFINEMENTS = 4
_ASTRAY = 5.0  # times what the others leave: a target whose place was not found
_ROWS = 600  # readings judged by
_RCOND = 1e-3  # weaker directions of the start are left at zero for the fit to find


def found(
    seen: Seen, model: DHModel, draws: int = _DRAWS, stretches: tuple[int, ...] = _STRETCHES
) -> Arm:
    """Closed forms on all readings, on stretches of the file and on random draws; the best of them.

    The best fits the better two fifths of the readings best.
    """
    bases, targets = seen.base.max() + 1, seen.target.max() + 1
    largest = np.argmax(np.bincount(seen.base))
    rows = np.flatnonzero(seen.base == largest)
    part = seen.select(thinned(rows, _ROWS))
    arm = _one_base(part, model, draws, stretches, targets)
    base = Pose(
        np.repeat(arm.base.rotation, bases, axis=0), np.repeat(arm.base.position_mm, bases, axis=0)
    )
    for other in range(bases):
        if other != largest:
            one = _rigid(seen.select(np.flatnonzero(seen.base == other)), arm)
            base.rotation[other], base.position_mm[other] = one
    return Arm(model, base, arm.targets)


def thinned(rows: np.ndarray, most: int) -> np.ndarray:
    """At most ``most`` of ``rows``, spread evenly."""
    if len(rows) <= most:
        return rows
    return rows[np.linspace(0, len(rows) - 1, most).astype(int)]


def _one_base(part: Seen, model: DHModel, draws: int, stretches, targets: int) -> Arm:
    flange = dh.forward(model, part.q)
    best, least = None, np.inf
    for rows in _draws(part, draws, stretches):
        for _ in range(_REFINEMENTS):
            arm = _closed_form(part, flange, model, rows, targets)
            misfit = _misfit(arm, part, flange)
            middle = float(np.quantile(misfit, _JUDGED))
            if middle >= least:
                break
            best, least = arm, middle
            rows = np.argsort(misfit)[: max(int(_KEPT * len(misfit)), _DRAWN)]
    return best if targets == 1 else _placed(best, part, flange, least)


def _placed(arm: Arm, part: Seen, flange: Pose, usual_mm: float) -> Arm:
    """The arm with targets that were in none of the readings chosen put where theirs have them."""
    misfit = _misfit(arm, part, flange)
    there = (part.cells.position_mm - arm.base.position_mm[0]) @ arm.base.rotation[0]
    there = np.einsum("nji,nj->ni", flange.rotation, there - flange.position_mm)
    points, turns = arm.targets.position_mm.copy(), arm.targets.rotation.copy()
    for each in np.unique(part.target):
        of = part.target == each
        if np.median(misfit[of]) <= _ASTRAY * usual_mm:
            continue
        points[each] = np.median(there[of], axis=0)
        of &= part.cells.turned
        if of.any():
            turned = arm.base.rotation[0] @ flange.rotation[of]
            seen = np.swapaxes(turned, 1, 2) @ part.cells.rotation[of]
            turns[each] = nearest_rotation(np.median(seen, axis=0))
    return Arm(arm.model, arm.base, Pose(turns, points))


def _draws(part: Seen, draws: int, stretches: tuple[int, ...]):
    """All readings, stretches of the file, and random configurations."""
    count = len(part.q)
    yield np.arange(count)
    for parts in stretches:
        for piece in np.array_split(np.arange(count), parts):
            if len(np.unique(part.cells.pose[piece])) >= _DRAWN:
                yield piece
    rng = np.random.default_rng(0)
    poses = np.unique(part.cells.pose)
    if len(poses) <= _DRAWN:
        return
    for _ in range(draws):
        chosen = rng.choice(poses, _DRAWN, replace=False)
        yield np.flatnonzero(np.isin(part.cells.pose, chosen))


def _misfit(arm: Arm, part: Seen, flange: Pose) -> np.ndarray:
    zero = Seen(part.cells, part.q, np.zeros_like(part.base), part.target)
    return np.linalg.norm(residuals(arm, zero, flange).position_mm, axis=1)


def _closed_form(part: Seen, flange: Pose, model: DHModel, rows, targets: int) -> Arm:
    """Base and targets of ``rows``: of several base rotations the one that fits best."""
    turn, place = flange.rotation[rows], flange.position_mm[rows]
    measured, target = part.cells.position_mm[rows], part.target[rows]
    by_target = _by_target(turn, target, targets)
    rotations = [nearest_rotation(_free_matrix(by_target, place, measured)).T]
    rotations.append(rigid_motion(place, measured)[0])
    turned = part.cells.turned[rows]
    for each in np.unique(target[turned]):
        of = turned & (target == each)
        rotations.append(_hand_eye(part.cells.rotation[rows][of], turn[of]))
    solved = [_translations(each, by_target, place, measured) for each in rotations]
    chosen = int(np.argmin([median for _, _, median in solved]))
    base, points, _ = solved[chosen]
    rotation = rotations[chosen]
    turns = np.broadcast_to(np.eye(3), (targets, 3, 3)).copy()
    for each in np.unique(target[turned]):
        of = turned & (target == each)
        seen = np.swapaxes(turn[of], 1, 2) @ rotation.T @ part.cells.rotation[rows][of]
        turns[each] = nearest_rotation(seen.sum(axis=0))
    return Arm(model, Pose(rotation[None], base[None]), Pose(turns, points))


def _free_matrix(by_target: np.ndarray, place, measured) -> np.ndarray:
    """C (3, 3) of C m - R t + c = p, linear in a free matrix C, points t and c."""
    count = len(measured)
    centred = measured - measured.mean(axis=0)
    spread = np.abs(centred).max() or 1.0
    design = np.zeros((count, 3, 12 + by_target.shape[2]))
    for axis in range(3):
        design[:, axis, 3 * axis : 3 * axis + 3] = centred / spread
        design[:, axis, 9 + axis] = 1.0
    design[:, :, 12:] = -by_target
    solution = np.linalg.lstsq(design.reshape(3 * count, -1), place.ravel(), rcond=_RCOND)[0]
    return solution[:9].reshape(3, 3) / spread


def _by_target(turn: np.ndarray, target: np.ndarray, targets: int) -> np.ndarray:
    columns = np.zeros((len(turn), 3, 3 * targets))
    for each in range(targets):
        columns[target == each, :, 3 * each : 3 * each + 3] = turn[target == each]
    return columns


def _hand_eye(measured: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Base rotation of measured = base turn tool, each (n, 3, 3) (Shah 2013)."""
    kron = np.einsum("nij,nkl->ikjl", turn, measured).reshape(9, 9)
    base = np.linalg.svd(kron)[0][:, 0].reshape(3, 3).T
    return nearest_rotation(base if np.linalg.det(base) > 0 else -base)


def _translations(rotation, by_target: np.ndarray, place, measured):
    """Base position, target points and the median misfit, linear once the base is turned."""
    count = len(measured)
    design = np.einsum("ij,njk->nik", rotation, by_target)
    goal = measured - place @ rotation.T
    centred = (design - design.mean(axis=0)).reshape(3 * count, -1)
    points = np.linalg.lstsq(centred, (goal - goal.mean(axis=0)).ravel(), rcond=_RCOND)[0]
    rest = goal - design @ points
    base = rest.mean(axis=0)
    median = float(np.median(np.linalg.norm(rest - base, axis=1)))
    return base, points.reshape(-1, 3), median


def _rigid(part: Seen, arm: Arm) -> tuple[np.ndarray, np.ndarray]:
    """Base frame of readings whose arm is known: rigid motion onto the measured points."""
    at_origin = Arm(arm.model, Pose(np.eye(3)[None], np.zeros((1, 3))), arm.targets)
    zero = Seen(part.cells, part.q, np.zeros_like(part.base), part.target)
    points = residuals(at_origin, zero).predicted.position_mm
    rows = np.arange(len(points))
    for _ in range(_REFINEMENTS):
        rotation, position = rigid_motion(points[rows], part.cells.position_mm[rows])
        misfit = np.linalg.norm(points @ rotation.T + position - part.cells.position_mm, axis=1)
        rows = np.argsort(misfit)[: max(int(_KEPT * len(misfit)), min(len(misfit), 4))]
    return rotation, position


def rigid_motion(points: np.ndarray, onto: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and shift (3,) that bring ``points`` (n, 3) nearest to ``onto`` (Kabsch)."""
    centre, centre_onto = points.mean(axis=0), onto.mean(axis=0)
    rotation = nearest_rotation((onto - centre_onto).T @ (points - centre))
    return rotation, centre_onto - rotation @ centre
