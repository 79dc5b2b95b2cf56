"""Planning of poses: candidates, their information, D-optimal exchange, and the order of travel.

The arm is linearised at its nominal parameters. Displacements count in mm and mrad; a rotation of
one radian weighs as much as ``rotation_weight_mm_per_rad`` in position.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
import scipy
from scipy.spatial import cKDTree

from kinacc.calibration import frames
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.calibration.fitting import PoseSystem
from kinacc.calibration.identifiability import STRUCTURAL, LeftOpen, joints_anywhere
from kinacc.calibration.observations import full_poses
from kinacc.calibration.uncertainty import scale_of
from kinacc.errors import Problem, input_error, refuse, require_type
from kinacc.geometry import Pose, compose
from kinacc.kinematics import dh
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse.limits import outside
from kinacc.kinematics.region import points
from kinacc.kinematics.robot import Robot

_MOST_DRAWS_PER_POSE = 400
_NEIGHBOURS = 10  # of a measured pose, between which and the pose others are drawn
_REGULAR = 1e-9  # of the mean eigenvalue: makes sets without all directions comparable
_TIE = 1e-6  # of the log determinant: less may be rounding
_MOST_SWEEPS = 100
_SHORTER_RAD = 1e-9
_IMPROVED = 401  # places of a path that 2-opt improves: its time goes with the cube of them


@dataclass(frozen=True)
class Experiment:
    """What is measured; base and tool are fitted with the arm.

    Attributes
    ----------
    tool
        Measured point or frame in the last DH frame.
    orientation
        Whether orientations are measured beside positions.
    hayati_joints
        Joints (1-based) with a beta.
    rotation_weight_mm_per_rad
        Weight of an orientation.
    threshold
        Directions below this share of the largest singular value count as undetermined.
    """

    tool: Pose
    orientation: bool
    hayati_joints: tuple[int, ...]
    rotation_weight_mm_per_rad: float
    threshold: float


@dataclass(frozen=True)
class Information:
    """Rows (n, m, r) that n candidate poses add to the normal equations of r directions.

    The r = ``rank`` directions are those that the candidates determine of the parameters; the
    others are ``left_open``.
    """

    rows: np.ndarray
    rank: int
    left_open: LeftOpen


@dataclass(frozen=True)
class PosePlan:
    """Planned poses in driving order.

    Attributes
    ----------
    chosen
        (N,) rows of the candidates.
    moves_rad
        (N,) largest movement of a joint on the way to each pose.
    index
        (N,) observability index O1 after each added pose, the last one after all swaps: the
        geometric mean of the singular values over the root of the number of poses (Borm and Menq,
        Int. J. Robotics Research 10, 1991).
    candidate_travel_rad
        Travel in the order of the candidates.
    parameters, determined, undetermined
        Number of parameters and of determined directions, and the undetermined ones as text.
    """

    chosen: np.ndarray
    moves_rad: np.ndarray
    index: np.ndarray
    candidate_travel_rad: float
    parameters: int
    determined: int
    undetermined: tuple[str, ...]


def plan_poses(
    robot: Robot, q_rad: np.ndarray, experiment: Experiment, count: int, start_rad: np.ndarray
) -> PosePlan:
    """Choose poses that determine a calibration, in a short order.

    Parameters
    ----------
    robot
        The nominal robot.
    q_rad
        (n, k) candidates: joints as the controller reports them, rad (mm where a joint slides).
    experiment
        Targets, sessions and parameters of the calibration that is planned.
    count
        Number of poses to choose.
    start_rad
        (k,) joints from which the robot starts.

    Raises
    ------
    InputError
        Where so many poses cannot be chosen, the candidates determine no parameter or lie outside
        the robot's limits, and for arrays of another shape.
    """
    require_type("robot", robot, Robot)
    q_rad = robot.finite_joints(q_rad, "candidates")
    start_rad = robot.finite_joints(np.ravel(start_rad), "start_rad")
    if outside(q_rad, (robot.q_min_rad, robot.q_max_rad)).any():
        raise input_error("candidates", f"outside the limits of {robot.name}")
    if unknown := {*experiment.hayati_joints}.difference(range(1, robot.dh.joints + 1)):
        raise input_error("hayati_joints", f"{sorted(unknown)}", f"1 to {robot.dh.joints}")
    shown = information(robot, q_rad, experiment)
    if shown.rank == 0:
        raise input_error("candidates", "determine no parameter")
    chosen, index = choose(shown.rows, count)
    chosen = np.sort(chosen)
    places = np.concatenate([start_rad, q_rad[chosen]]) / robot.dh.travel_unit
    distance, path = distances(places), shortest_path(places)
    return PosePlan(
        chosen[path[1:] - 1],
        distance[path[:-1], path[1:]],
        index,
        float(np.trace(distance, offset=1)),
        len(shown.left_open.names),
        shown.rank,
        tuple(sorted(shown.left_open.sentences)),  # their order is rounding
    )


def spread(
    robot: Robot,
    count: int,
    box_rad: tuple[np.ndarray, np.ndarray] | None = None,
    inside: Callable[[np.ndarray], np.ndarray] | None = None,
    tool: Pose | None = None,
) -> np.ndarray:
    """Reported joints from a Sobol sequence over a box.

    Parameters
    ----------
    count
        Number of configurations.
    box_rad
        (k,), (k,) ends of the box, rad (mm where a joint slides); the limits where not given.
    inside
        Takes tool positions (m, 3) in the robot's base, mm; returns which are allowed, (m,).
    tool
        Tool in the last DH frame, for ``inside``.

    Returns
    -------
    numpy.ndarray
        (count, k) reported joints.

    Raises
    ------
    InputError
        Where too few are inside, or the box lies outside the limits.
    """
    low, high = (robot.q_min_rad, robot.q_max_rad) if box_rad is None else box_rad
    low, high = np.maximum(low, robot.q_min_rad), np.minimum(high, robot.q_max_rad)
    refuse(
        Problem(f"joint {joint + 1}", "its range lies outside the limits")
        for joint in np.flatnonzero(low >= high)
    )
    result, block = np.zeros((0, len(low))), max(count, 1024)
    for draw in range(_MOST_DRAWS_PER_POSE):
        joints = low + points("sobol", block, len(low), 1 + draw * block) * (high - low)
        if inside is not None:
            joints = joints[inside(tool_positions(robot, joints, tool))]
        result = np.concatenate([result, joints])
        if len(result) >= count:
            return result[:count]
    message = (
        f"only {len(result)} of {_MOST_DRAWS_PER_POSE * block} joint values put the tool there"
    )
    raise input_error("region", message, f"{count} candidates", "enlarge the region")


def between(measured: np.ndarray, unit: np.ndarray, count: int, seed: int) -> np.ndarray:
    """``count`` joints (count, k) on the way from one of ``measured`` (n, k) to a neighbour.

    ``unit`` (k,): movements of the joints that count alike. Raises InputError where all of
    ``measured`` are the same.
    """
    different = np.unique(measured, axis=0)
    if len(different) < 2:
        message = "all measured poses are at the same joints"
        raise input_error("region", message, "at least 2 different poses")
    random = np.random.default_rng(seed)
    count_near = min(_NEIGHBOURS + 1, len(different))
    near = np.asarray(cKDTree(different / unit).query(different / unit, count_near)[1])
    start = random.integers(len(different), size=count)
    end = near[start, random.integers(1, near.shape[1], size=count)]
    share = random.random((count, 1))
    return different[start] + share * (different[end] - different[start])


def tool_positions(robot: Robot, joints: np.ndarray, tool: Pose | None) -> np.ndarray:
    """Where the nominal arm puts the tool (m, 3) in its base at reported joints (m, k)."""
    end = compose(robot.base, dh.forward(robot.dh, robot.dh_joints(joints)))
    return end.position_mm if tool is None else compose(end, tool).position_mm


def information(robot: Robot, q_rad: np.ndarray, experiment: Experiment) -> Information:
    """Information of poses at reported joints (n, k), rad and mm."""
    slopes, names = _slopes(robot.dh, robot.dh_joints(np.atleast_2d(q_rad)), experiment)
    flat = slopes.reshape(-1, len(names))
    _, values, right = np.linalg.svd(flat, full_matrices=len(flat) < len(names))
    rank = int(np.sum(values > experiment.threshold * values[0]))
    lost = right[rank:]
    anywhere, _ = _slopes(robot.dh, joints_anywhere(robot.dh), experiment)
    _, everywhere, axes = np.linalg.svd(anywhere.reshape(-1, len(names)))
    hidden = axes[int(np.sum(everywhere > STRUCTURAL * everywhere[0])) :]
    stated = frames.known(tool=experiment.tool)
    left_open = LeftOpen.of(hidden if len(lost) else lost, lost, names, stated)
    return Information(slopes @ right[:rank].T, rank, left_open)


def _slopes(
    model: DHModel, q_dh: np.ndarray, experiment: Experiment
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Movement (n, m, P) of what is measured at DH joints (n, k), per mm or mrad of parameters."""
    observed = full_poses(q_dh, compose(dh.forward(model, q_dh), experiment.tool))
    if not experiment.orientation:
        observed = replace(observed, rotation=np.full_like(observed.rotation, np.nan))
    terms = frames.frame_terms(observed, frames.known(tool=experiment.tool))
    free = free_parameters(model.joints, experiment.hayati_joints).ravel()
    system = PoseSystem(observed, model, free, terms, experiment.rotation_weight_mm_per_rad)
    start = np.concatenate([terms.begin, model.start[free]])
    slopes = np.concatenate([jacobian for _, jacobian in system.blocks(start)])
    names = (*terms.names, *compress(model.names, free))
    units = [scale_of(name) for name in names]
    return slopes.reshape(len(q_dh), -1, len(names)) * units, names


def choose(rows: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """A D-optimal set by exchange (Fedorov 1972): candidates (count,), and O1 (count,).

    Of candidates with ``rows`` (n, m, r) the best one is added until there are ``count``; then
    each is swapped for the best in its place, until a round finds nothing better. Of equals the
    first is taken. Raises InputError for too few candidates, or too few poses for r directions.
    """
    _, components, directions = rows.shape
    least = -(-directions // components)
    if count not in range(least, len(rows) + 1):
        allowed = f"a whole number, at least {least}, at most {len(rows)} (candidates)"
        raise input_error("poses", f"{count}, to determine {directions} directions", allowed)
    floor = _REGULAR * float(np.sum(rows**2)) / (len(rows) * directions) * np.eye(directions)
    chosen: list[int] = []
    index = np.zeros(count)
    for number in range(count):
        chosen.append(_best_addition(rows, chosen, floor))
        index[number] = observability(rows[chosen])
    for _ in range(_MOST_SWEEPS):
        before = index[-1]
        for place in range(count):
            others = chosen[:place] + chosen[place + 1 :]
            changed = [*others[:place], _best_addition(rows, others, floor), *others[place:]]
            value = observability(rows[changed])
            if value > index[-1] * (1.0 + _TIE):
                chosen, index[-1] = changed, value
        if index[-1] == before:
            break
    return np.array(chosen), index


def observability(rows: np.ndarray) -> float:
    """Index O1 of poses with ``rows`` (N, m, r); 0 where they do not show every direction."""
    values = np.linalg.svd(rows.reshape(-1, rows.shape[2]), compute_uv=False)
    if len(values) < rows.shape[2] or values[-1] <= 0.0:
        return 0.0
    return float(scipy.stats.gmean(values) / np.sqrt(len(rows)))


def _best_addition(rows: np.ndarray, chosen: list[int], floor: np.ndarray) -> int:
    """The candidate that makes the determinant of the normal matrix of ``chosen`` largest."""
    flat = rows[chosen].reshape(-1, rows.shape[2])
    inverse = np.linalg.inv(flat.T @ flat + floor)
    gains = np.linalg.slogdet(np.eye(rows.shape[1]) + rows @ inverse @ np.swapaxes(rows, 1, 2))[1]
    gains[chosen] = -np.inf
    return int(np.argmax(gains >= gains.max() - _TIE))


def distances(places: np.ndarray) -> np.ndarray:
    """Distances (n, n) between ``places`` (n, k): the largest movement of a joint, which sets the
    time of a move.
    """
    return np.abs(places[:, None] - places[None]).max(axis=2)


def shortest_path(places: np.ndarray) -> np.ndarray:
    """A short open path (n,) from the first of the ``places`` (n, k): nearest neighbour, then 2-opt
    where they are few.
    """
    count, path, remaining = len(places), [0], np.arange(1, len(places))
    while len(remaining):
        nearest = np.argmin(np.abs(places[remaining] - places[path[-1]]).max(axis=1))
        path.append(remaining[nearest])
        remaining = np.delete(remaining, nearest)
    if not 2 < count <= _IMPROVED:
        return np.array(path)
    # The end is free: behind it stands a place that is at no distance from any other.
    order, distance = np.array([*path, count]), np.pad(distances(places), (0, 1))
    first, last = 1 + np.array(np.triu_indices(count - 1, 1))
    while True:
        ordered = distance[np.ix_(order, order)]
        gain = ordered[first - 1, first] - ordered[first - 1, last]
        gain += ordered[last, last + 1] - ordered[first, last + 1]
        best = int(np.argmax(gain))
        if gain[best] <= _SHORTER_RAD:
            return order[:-1]
        part = slice(first[best], last[best] + 1)
        order[part] = order[part][::-1]
