"""Where a fit of base and targets starts: closed forms that need no starting value."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kinacc.calibration.frames import Frames, known
from kinacc.calibration.observations import Observations
from kinacc.geometry import Pose, project_so3

_START_RCOND = 1e-3  # weaker directions of the start are left at zero for the fit to find
_LEVER_MM = 100.0  # one radian of orientation counts as much as a point this far away


def closed_form_start(observations: Observations, flange: Pose) -> Frames:
    """Bases and targets from flange poses of a nominal model, without a starting value.

    The session with most rows first, base and targets together; the bases of the others then from
    the targets known by then. What was never measured starts at the identity.

    Parameters
    ----------
    observations : Observations
        n measured points and poses.
    flange : Pose
        Flange poses in the robot base, shape (n, ...), mm.

    Returns
    -------
    Frames
        Bases in the instrument's frame, targets in the flange frame.
    """
    sessions, names = len(observations.session_names), len(observations.target_names)
    start = known(sessions=sessions, targets=names)
    placed = np.zeros(names, dtype=bool)
    sizes = np.bincount(observations.session, minlength=sessions)
    for session in np.argsort(-sizes, kind="stable")[: np.count_nonzero(sizes)]:
        rows = np.flatnonzero(observations.session == session)
        part, at = observations.select(rows), Pose(*(values[rows] for values in flange))
        measured = np.isin(np.arange(names), part.target)
        new = measured & ~placed
        if not placed[measured].any():
            base, points = _one_session(part, at)
            start.targets.position_mm[new] = points[new]
        else:
            base = base_from_targets(part, at, start.targets, placed)
            in_base = (part.position_mm - base.position_mm) @ base.rotation - at.position_mm
            points = np.einsum("nji,nj->ni", at.rotation, in_base)
            for target in np.flatnonzero(new):
                start.targets.position_mm[target] = points[part.target == target].mean(axis=0)
        for target in np.flatnonzero(new):
            turned = part.has_rotation & (part.target == target)
            if turned.any():
                turns = np.swapaxes(at.rotation[turned], 1, 2) @ base.rotation.T
                mean = Rotation.from_matrix(turns @ part.rotation[turned]).mean()
                start.targets.rotation[target] = mean.as_matrix()
        start.bases.rotation[session], start.bases.position_mm[session] = base
        placed |= measured
    return start


def _one_session(observations: Observations, flange: Pose) -> tuple[Pose, np.ndarray]:
    """Base and target positions (T, 3) from the rows of one session.

    Linear solutions for the base rotation, the one that leaves the smallest position error: from
    positions with a free 3x3 matrix, C m - R_flange t + c = p_flange, which fails where they lie in
    a plane; and from orientations of each target, robot-world/hand-eye by the leading singular
    vectors of a sum of Kronecker products (Shah, J. Mechanisms Robotics 5, 2013), which fails where
    the tool turns about one axis only.
    """
    count, targets = len(observations), len(observations.target_names)
    carried = np.eye(targets)[observations.target]
    levers = np.einsum("nij,nt->nitj", flange.rotation, carried).reshape(count, 3, -1)
    centred = observations.position_mm - observations.position_mm.mean(axis=0)
    centred = centred / (np.abs(centred).max() or 1.0)
    free = np.einsum("ab,nj->nabj", np.eye(3), centred).reshape(3 * count, 9)
    constant, system = np.tile(np.eye(3), (count, 1)), -levers.reshape(3 * count, -1)
    system = np.hstack([free, constant, system])
    solution = np.linalg.lstsq(system, flange.position_mm.ravel(), rcond=_START_RCOND)[0]
    rotations = [_nearest_rotation(solution[:9].reshape(3, 3)).T]
    for target in np.unique(observations.target[observations.has_rotation]):
        rows = observations.has_rotation & (observations.target == target)
        # vec(base) is proportional to sum(flange (x) measured) vec(tool'), vec by columns.
        kron = np.einsum("nij,nkl->ikjl", flange.rotation[rows], observations.rotation[rows])
        base = np.linalg.svd(kron.reshape(9, 9))[0][:, 0].reshape(3, 3).T
        rotations.append(_nearest_rotation(base if np.linalg.det(base) > 0 else -base))
    starts = []
    for rotation in rotations:  # once the base is turned, positions are linear
        design = rotation @ levers
        goal = observations.position_mm - flange.position_mm @ rotation.T
        # Centred, so that what the turns cannot show of a target is left at zero.
        system = (design - design.mean(axis=0)).reshape(3 * count, -1)
        points = np.linalg.lstsq(system, (goal - goal.mean(axis=0)).ravel(), rcond=_START_RCOND)[0]
        rest = goal - design @ points
        position = rest.mean(axis=0)
        misfit = float(np.sum((rest - position) ** 2))
        starts.append((misfit, Pose(rotation, position), points.reshape(targets, 3)))
    return min(starts, key=lambda start: start[0])[1:]


def base_from_targets(
    observations: Observations, flange: Pose, targets: Pose, placed: np.ndarray | None = None
) -> Pose:
    """Base that best carries targets onto their measured points.

    Closed form of absolute orientation by singular values (Arun, Huang and Blostein, PAMI 9, 1987),
    where orientations count as points ``_LEVER_MM`` away.

    Parameters
    ----------
    observations : Observations
        n points and poses of one session.
    flange : Pose
        Flange in the robot base, shape (n, ...) in mm.
    targets : Pose
        Targets in the flange frame, shape (T, ...) in mm.
    placed : numpy.ndarray, optional
        True for the targets that are known, shape (T,); all if not given.

    Returns
    -------
    Pose
        Robot base in the instrument's frame, mm.
    """
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


def _nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    left, _, right = np.linalg.svd(matrix)
    left[:, 2] *= np.sign(np.linalg.det(left @ right))
    return project_so3(left @ right)
