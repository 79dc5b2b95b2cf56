"""Make a plan: model the candidates, draw their order, route the first visit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from kinacc import __version__
from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.campaign.instrument import Instrument
from kinacc.campaign.plan import Limits, Plan, Points
from kinacc.config.names import not_in_a_line
from kinacc.deployment.planning import distances, shortest_path
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.geometry import Pose, compose, invert
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
    """Candidates at reported joints (m, k), modelled in the robot's base.

    Candidates at the same joints become one. Raises InputError where fewer than two are left, or
    where the model says nothing of a candidate's joints.
    """
    places = joints if directions is None else np.hstack([joints, directions])
    kept = np.sort(np.unique(places, axis=0, return_index=True)[1])
    if len(kept) < 2:
        what = "only one" if len(joints) == 1 else f"all {len(joints)} are at the same joints"
        raise InputError(Problem("candidates", what, "at least 2 different points"))
    joints, label = joints[kept], [str(label[i]).strip() for i in kept]
    directions = None if directions is None else directions[kept]
    problems = _outside(arm, joints, label)
    problems += [fault for each in label for fault in not_in_a_line("candidates, pose", each)]
    if doubled := sorted(each for each, count in Counter(label).items() if count > 1):
        what = f"names given to different joints: {', '.join(doubled[:5])}"
        problems.append(Problem("candidates", what, "one name per point"))
    refuse(problems, "These candidates cannot be measured against the model")
    at = JointState(arm.robot.dh_joints(joints), directions)
    where = arm.pose(at, "base", point).position_mm
    slope = arm.joint_jacobian(at, "base", point)[:, :3] @ arm.robot.joint_map
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
    """The plan of a campaign: the candidates' order follows from ``seed`` alone.

    ``start`` (k,): reported joints the arm stands at. Without ``by_travel`` the first visit keeps
    the random order.
    """
    order = np.random.default_rng(seed).permutation(len(points))
    to_base = _to_base(arm)
    instruments = [each.placed(to_base, points.modelled_mm) for each in instruments]
    noise = instruments[0].in_base(to_base, points.modelled_mm)
    begun = assessor.begin(Candidates(noise[order]))
    route = order[: begun.first]
    if by_travel:
        unit = travel_unit(arm.robot)
        route = route[_visit_path(points.joints[route] / unit, start / unit, begun.reference_poses)]
    return Plan(
        points, order, route, assessor, tuple(instruments), to_base,
        arm.robot.dh.prismatic, limits, seed, about,
    )  # fmt: skip


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


def plausible_mm(arm: Calibration, instruments: Sequence[Instrument], points: Points) -> float:
    """Size of an error beyond which a reading is more likely to be of another pose, mm.

    Twenty times what the calibration left unexplained, and ten standard deviations of the
    noisiest instrument; at least 5 mm, and 50 mm for a model that was never fitted.
    """
    used = [each.placed(_to_base(arm), points.modelled_mm) for each in instruments]
    noise = max(np.sqrt(np.linalg.eigvalsh(each.covariance_mm2)[-1]) for each in used)
    left = unexplained_mm(arm)
    usual = 50.0 if not np.isfinite(left) else max(5.0, 20.0 * left)
    return float(f"{usual + 10.0 * noise:.3g}")


def _to_base(arm: Calibration) -> Pose:
    """The instrument's frame in the robot's base."""
    return compose(arm.origin("base"), invert(arm.origin("instrument")))


def _visit_path(places: np.ndarray, start: np.ndarray, references: int) -> np.ndarray:
    """Rows (n,) of places (n, k): the reference poses, then the others, each with little travel."""
    if not references:
        return _short_path(places, start)
    early = _short_path(places[:references], start)
    later = _short_path(places[references:], places[early[-1]])
    return np.concatenate([early, references + later])


def _short_path(places: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Rows (n,) of places (n, k) in an order with little travel from ``start`` (k,)."""
    whole = np.concatenate([start[None], places])
    if len(places) <= _ROUTED:
        return shortest_path(distances(whole))[1:] - 1
    # Improving a path takes time with the cube of its length: go by nearest neighbour first.
    left, path, here = list(range(len(places))), [], start
    while left:
        nearest = int(np.argmin(np.abs(places[left] - here).max(axis=1)))
        path.append(left.pop(nearest))
        here = places[path[-1]]
    return np.array(path)


def _outside(arm: Calibration, joints: np.ndarray, label: list[str]) -> list[Problem]:
    robot = arm.robot
    problems = [
        _said(each.rows, label, f"joint {each.joint} outside the limits of {robot.name}")
        for each in outside_limits(robot, joints, 1e-9)
    ]
    if arm.model.domain is not None:
        outside = arm.outside_range(robot.dh_joints(joints))
        for joint in np.flatnonzero(outside.any(axis=0)):
            words = f"joint {joint + 1} outside the range the data cover: no prediction"
            problems.append(_said(np.flatnonzero(outside[:, joint]), label, words))
    return problems


def _said(rows: np.ndarray, label: list[str], words: str) -> Problem:
    return Problem(f"candidates {first_few([label[i] for i in rows])}", words)
