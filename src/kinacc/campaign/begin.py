"""Make a plan: model the candidates, draw their order, route the first visit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinacc import __version__
from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.calibration.noise import Noise
from kinacc.campaign import folder as folders
from kinacc.campaign.doubts import of_candidates, of_little_noise, of_noise
from kinacc.campaign.instrument import Instrument
from kinacc.campaign.plan import Limits, Plan, Points
from kinacc.config.names import not_in_a_line
from kinacc.deployment.planning import distances, shortest_path
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.geometry import compose, invert
from kinacc.kinematics.inverse.limits import travel_unit
from kinacc.kinematics.model import JointState
from kinacc.kinematics.robot import outside_limits

_ROUTED = 400  # points beyond which the route is built in stretches of so many


def points_of(
    arm: Calibration,
    joints: np.ndarray,
    label: Sequence[str],
    directions: np.ndarray | None = None,
    point: str | None = None,
) -> Points:
    """Model candidates in the robot's base; candidates at the same joints become one.

    Parameters
    ----------
    arm : Calibration
        Calibrated model whose errors are bounded.
    joints : (m, k) array
        Reported joints, rad (mm where a joint slides).
    label : sequence of str
        Names of the candidates.
    directions : (m, k) array, optional
        Directions of travel on arrival: -1, 0 (unknown), 1.
    point : str, optional
        Target that is measured, the tool by default.

    Returns
    -------
    Points
        Positions in mm, robot base frame, with their derivatives by the joints.

    Raises
    ------
    InputError
        Where fewer than two candidates differ, or joints lie outside the robot's limits or the
        range of the model.
    """
    places = joints if directions is None else np.hstack([joints, directions])
    rows = np.sort(np.unique(places, axis=0, return_index=True)[1])
    if len(rows) < 2:
        message = "only one" if len(joints) == 1 else f"all {len(joints)} are at the same joints"
        raise InputError(Problem("candidates", message, "at least 2 different points"))
    joints, label = joints[rows], [str(label[i]).strip() for i in rows]
    directions = None if directions is None else directions[rows]
    problems = _outside(arm, joints, label)
    problems += [fault for each in label for fault in not_in_a_line("candidates, pose", each)]
    if doubled := sorted(name for name, count in Counter(label).items() if count > 1):
        message = f"names given to different joints: {', '.join(doubled[:5])}"
        problems.append(Problem("candidates", message, "one name per point"))
    refuse(problems, "These candidates cannot be measured against the model")
    state = JointState(arm.robot.dh_joints(joints), directions)
    where = arm.pose(state, "base", point).position_mm
    slope = arm.joint_jacobian(state, "base", point)[:, :3] @ arm.robot.joint_map
    return Points(tuple(label), joints, directions, where, slope)


def plan_of(
    arm: Calibration,
    points: Points,
    assessor: AdaptiveAssessor,
    instruments: Sequence[Instrument],
    limits: Limits,
    seed: int,
    start: np.ndarray,
    about: dict[str, str],
    by_travel: bool = True,
) -> Plan:
    """Return the plan of a campaign; the order of the candidates follows from ``seed`` alone.

    Parameters
    ----------
    arm : Calibration
        Calibrated model whose errors are bounded.
    points : Points
        Candidates (:func:`points_of`).
    assessor : AdaptiveAssessor
        Method and budget.
    instruments : sequence of Instrument
        The first is planned with.
    limits : Limits
        Plausible size (infinite: by the residual of the calibration), tolerance and wanted width.
    seed : int
        Seed of the random order.
    start : (k,) array
        Reported joints the arm stands at, rad (mm where a joint slides).
    about : dict
        Robot, calibration, model, point and source of the candidates (:func:`about`).
    by_travel : bool
        Order the first visit for little travel, else keep the random order.

    Returns
    -------
    Plan
    """
    order = np.random.default_rng(seed).permutation(len(points))
    to_base = compose(arm.origin("base"), invert(arm.origin("instrument")))
    instruments = [device.placed(to_base, points.modelled_mm) for device in instruments]
    if not np.isfinite(limits.implausible_mm):
        limits = replace(limits, implausible_mm=_plausible_mm(arm, instruments))
    noise = instruments[0].in_base(to_base, points.modelled_mm)
    begun = assessor.begin(Candidates(noise[order]))
    route = order[: begun.first]
    if by_travel:
        unit, count = travel_unit(arm.robot), begun.reference_poses
        places = points.joints[route] / unit
        path = _short_path(places[:count], start / unit) if count else np.array([], dtype=int)
        here = places[path[-1]] if count else start / unit
        route = route[np.concatenate([path, count + _short_path(places[count:], here)])]
    return Plan(
        points, order, route, assessor, tuple(instruments), to_base,
        arm.robot.dh.prismatic, limits, seed, about,
    )  # fmt: skip


def start(
    folder: Path | str,
    arm: Calibration,
    plan: Plan,
    known: Noise | None = None,
    doubts: Sequence[Problem] = (),
    sure: bool = True,
) -> Plan:
    """Put a plan on disk with what speaks against it; returns the plan.

    ``known``: noise of readings of the calibration; ``doubts``: further ones. Raises InputError
    where there is one, unless ``sure``, and where the folder holds a campaign.
    """
    point = plan.about["point"]
    problems = [
        *of_noise(plan.instruments, unexplained_mm(arm)),
        *doubts,
        *of_little_noise(plan.instruments, known),
        *of_candidates(arm, plan.points, point),
    ]
    if not sure:
        refuse(problems, "The campaign was not begun")
    plan = replace(plan, overruled=tuple(f"{item.where}: {item.what}" for item in problems))
    folders.start(folder, plan)
    return plan


def about(arm: Calibration, point: str | None, source: str) -> dict[str, str]:
    """What a campaign is about; ``source`` of its candidates."""
    return {
        "robot": arm.robot.name,
        "calibration": arm.name,
        "model": arm.choice,
        "point": point or arm.default_point,
        "candidates": source,
        "kinacc_version": __version__,
    }


def unexplained_mm(arm: Calibration) -> float:
    """The rms position error that the calibration left, noise included; NaN where not known."""
    return arm.residual.position_mm if arm.residual else np.nan


def _plausible_mm(arm: Calibration, instruments: Sequence[Instrument]) -> float:
    """Size of an error beyond which a reading is more likely to be of another pose, mm.

    Twenty times what the calibration left unexplained, and ten standard deviations of the
    noisiest instrument; at least 5 mm, and 50 mm for a model that was never fitted.
    """
    noise = max(np.sqrt(np.linalg.eigvalsh(item.covariance_mm2)[-1]) for item in instruments)
    left_mm = unexplained_mm(arm)
    usual_mm = 50.0 if not np.isfinite(left_mm) else max(5.0, 20.0 * left_mm)
    return float(f"{usual_mm + 10.0 * noise:.3g}")


def _short_path(places: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Rows (n,) of places (n, k) in an order with little travel from ``start`` (k,)."""
    whole = np.concatenate([start[None], places])
    if len(places) <= _ROUTED:
        return shortest_path(distances(whole))[1:] - 1
    # Improving a path takes time with the cube of its length: go by nearest neighbour first.
    remaining, path, here = list(range(len(places))), [], start
    while remaining:
        nearest = int(np.argmin(np.abs(places[remaining] - here).max(axis=1)))
        path.append(remaining.pop(nearest))
        here = places[path[-1]]
    return np.array(path)


def _outside(arm: Calibration, joints: np.ndarray, label: list[str]) -> list[Problem]:
    robot = arm.robot
    beyond = [
        (fault.rows, f"joint {fault.joint} outside the limits of {robot.name}")
        for fault in outside_limits(robot, joints, 1e-9)
    ]
    if arm.model.domain is not None:
        outside = arm.outside_range(robot.dh_joints(joints))
        beyond += [
            (rows, f"joint {joint} outside the range the data cover: no prediction")
            for joint, column in enumerate(outside.T, 1)
            if len(rows := np.flatnonzero(column))
        ]
    return [
        Problem(f"candidates {first_few([label[row] for row in rows])}", text)
        for rows, text in beyond
    ]
