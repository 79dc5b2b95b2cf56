"""Where a fit of base and targets starts: closed forms that need no starting value."""

from __future__ import annotations

import numpy as np

from kinacc.calibration.frames import Frames, known
from kinacc.calibration.observations import Observations
from kinacc.geometry import Pose, project_so3

_START_RCOND = 1e-3  # weaker directions of the start are left at zero for the fit to find
_LEVER_MM = 100.0  # one radian of orientation counts as much as a point this far away


def closed_form_start(observations: Observations, flange: Pose) -> Frames:
    """Bases and targets from flange poses (n, ...) of a nominal model, without a starting value.

    The session with most rows first, base and targets together; the bases of the others then from
    the targets known by then. What was never measured starts at the identity.
    """
    sessions, names = len(observations.session_names), len(observations.target_names)
    found = known(sessions=sessions, targets=names)
    placed = np.zeros(names, dtype=bool)
    sizes = np.bincount(observations.session, minlength=sessions)
    for session in np.argsort(-sizes, kind="stable")[: np.count_nonzero(sizes)]:
        rows = np.flatnonzero(observations.session == session)
        part, at = observations.select(rows), Pose(*(each[rows] for each in flange))
        seen = np.unique(part.target)
        if not placed[seen].any():
            alone = _one_session(part, at)
            base, new = alone.base, alone.targets
        else:
            base = base_from_targets(part, at, found.targets, placed)
            new = _targets_from_base(part, at, base)
        found.bases.rotation[session], found.bases.position_mm[session] = base
        for target in seen[~placed[seen]]:
            found.targets.rotation[target] = new.rotation[target]
            found.targets.position_mm[target] = new.position_mm[target]
        placed[seen] = True
    return found


def _one_session(observations: Observations, flange: Pose) -> Frames:
    """Base and targets from the rows of one session.

    Two linear solutions for the base rotation, the one that leaves the smaller position error:
    from orientations, robot-world/hand-eye by the leading singular vectors of a sum of Kronecker
    products (Shah, J. Mechanisms Robotics 5, 2013), which fails where the tool turns about one
    axis only; and from positions with a free 3x3 matrix, which fails where they lie in a plane.
    """
    bases = [_base_rotation_from_points(observations, flange)]
    turned = observations.has_rotation
    for target in np.unique(observations.target[turned]):
        rows = turned & (observations.target == target)
        bases.append(_hand_eye_base(observations.rotation[rows], flange.rotation[rows]))
    starts = [_translations(observations, flange, base) for base in bases]
    best = int(np.argmin([misfit for _, _, misfit in starts]))
    position, points, _ = starts[best]
    rotations = _target_rotations(observations, flange, bases[best])
    return Frames(Pose(bases[best], position), Pose(rotations, points))


def _hand_eye_base(measured: np.ndarray, flange: np.ndarray) -> np.ndarray:
    """Base rotation of ``measured = base flange tool``, each (n, 3, 3)."""
    # vec(base) is proportional to sum(flange (x) measured) vec(tool'), vec by columns.
    kron = np.einsum("nij,nkl->ikjl", flange, measured).reshape(9, 9)
    base = np.linalg.svd(kron)[0][:, 0].reshape(3, 3).T
    return _nearest_rotation(base if np.linalg.det(base) > 0 else -base)


def _target_rotations(observations: Observations, flange: Pose, base: np.ndarray) -> np.ndarray:
    """Mean target rotations (T, 3, 3) in the flange; identity where none was measured."""
    rotations = np.broadcast_to(np.eye(3), (len(observations.target_names), 3, 3)).copy()
    turned = observations.has_rotation
    for target in np.unique(observations.target[turned]):
        rows = turned & (observations.target == target)
        seen = np.swapaxes(flange.rotation[rows], 1, 2) @ base.T @ observations.rotation[rows]
        rotations[target] = _nearest_rotation(seen.sum(axis=0))
    return rotations


def base_from_targets(
    observations: Observations, flange: Pose, targets: Pose, placed: np.ndarray | None = None
) -> Pose:
    """Base that best carries targets onto their measured points; ``placed`` (T,): those known."""
    rows = np.ones(len(observations), bool) if placed is None else placed[observations.target]
    at = targets.position_mm[observations.target[rows]]
    by_arm = flange.position_mm[rows] + (flange.rotation[rows] @ at[..., None])[..., 0]
    measured = observations.position_mm[rows]
    arm_centre, centre = by_arm.mean(axis=0), measured.mean(axis=0)
    # Orientations, where measured, decide what few or collinear points leave open.
    spread = (measured - centre).T @ (by_arm - arm_centre)
    turned = rows & observations.has_rotation
    by_flange = flange.rotation[turned] @ targets.rotation[observations.target[turned]]
    turns = np.einsum("nij,nkj->ik", observations.rotation[turned], by_flange)
    rotation = _nearest_rotation(spread + _LEVER_MM**2 * turns)
    return Pose(rotation, centre - rotation @ arm_centre)


def _targets_from_base(observations: Observations, flange: Pose, base: Pose) -> Pose:
    """Every target where the base puts it in the flange, averaged over its rows."""
    names = len(observations.target_names)
    position = np.zeros((names, 3))
    in_base = (observations.position_mm - base.position_mm) @ base.rotation
    reach = (np.swapaxes(flange.rotation, 1, 2) @ (in_base - flange.position_mm)[..., None])[..., 0]
    for target in np.unique(observations.target):
        position[target] = reach[observations.target == target].mean(axis=0)
    return Pose(_target_rotations(observations, flange, base.rotation), position)


def _nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    left, _, right = np.linalg.svd(matrix)
    left[:, 2] *= np.sign(np.linalg.det(left @ right))
    return project_so3(left @ right)


def _base_rotation_from_points(observations: Observations, flange: Pose) -> np.ndarray:
    """Base rotation of positions alone: C m - R_flange t + c = p_flange, linear in C, t and c."""
    count, targets = len(observations), len(observations.target_names)
    mean = observations.position_mm.mean(axis=0)
    spread = np.abs(observations.position_mm - mean).max() or 1.0
    design = np.zeros((count, 3, 12 + 3 * targets))
    for axis in range(3):
        design[:, axis, 3 * axis : 3 * axis + 3] = (observations.position_mm - mean) / spread
        design[:, axis, 9 + axis] = 1.0
    for target in range(targets):
        rows = observations.target == target
        columns = slice(12 + 3 * target, 15 + 3 * target)
        design[rows, :, columns] = -flange.rotation[rows]
    system = design.reshape(3 * count, -1)
    solution = np.linalg.lstsq(system, flange.position_mm.ravel(), rcond=_START_RCOND)[0]
    return _nearest_rotation(solution[:9].reshape(3, 3)).T


def _translations(
    observations: Observations, flange: Pose, base_rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Base position, target points (linear once the base is turned) and the squared misfit."""
    count, targets = len(observations), len(observations.target_names)
    design = np.zeros((count, 3, 3 * targets))
    for target in range(targets):
        rows = observations.target == target
        design[rows, :, 3 * target : 3 * target + 3] = base_rotation @ flange.rotation[rows]
    goal = observations.position_mm - flange.position_mm @ base_rotation.T
    # Centred, so that what the turns cannot show of a target is left at zero, not shared with base.
    centred = (design - design.mean(axis=0)).reshape(3 * count, -1)
    solution = np.linalg.lstsq(centred, (goal - goal.mean(axis=0)).ravel(), rcond=_START_RCOND)[0]
    rest = goal - design @ solution
    base_position = rest.mean(axis=0)
    misfit = float(np.sum((rest - base_position) ** 2))
    return base_position, solution.reshape(targets, 3), misfit
