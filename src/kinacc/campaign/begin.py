"""Start a campaign: model the candidates, draw their order, route the first visit, list doubts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from kinacc import __version__
from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.calibration.noise import Noise, of_measurements
from kinacc.campaign import folder as folders
from kinacc.campaign.instrument import Instrument
from kinacc.campaign.plan import Arm, Limits, Plan, Points
from kinacc.config.names import not_in_a_line
from kinacc.deployment.applicability import LIKE_FITTED, is_measured_there, position_std_mm
from kinacc.deployment.folder import read_tables, robot_of
from kinacc.deployment.planning import shortest_path
from kinacc.deployment.record import Calibration
from kinacc.errors import Problem, first_few, input_error, refuse
from kinacc.geometry import compose, invert
from kinacc.kinematics.inverse.limits import outside
from kinacc.kinematics.model import JointState

_MUCH_NOISE = 2.0  # times what the calibration left unexplained, noise included
_MUCH_NOISE_MM = 1.0  # where nothing is known of the calibration
_LITTLE_NOISE = 0.8  # of the scatter that was measured
_FEWEST_FREEDOM = 10  # degrees of freedom that show a noise
_FAR_SHARE = 0.1  # of the candidates
_SURE = "--sure takes it as it is"
WAYS_TO_NOISE = """give it in one of three ways:
      a test (the surest): visit 20 poses three times each, leaving them between,
        run kinacc repeatability FILE -o noise.json, then --repeatability noise.json
      an estimate: --noise-mm MM --noise estimate (MM is a guess)
      a number: --noise-mm MM, or --instrument NAME=MM"""


def points_of(
    arm: Calibration,
    joints: np.ndarray,
    label: Sequence[object] | np.ndarray,
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
    label : sequence
        Names of the candidates, or numbers.
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
        raise input_error("candidates", message, "at least 2 different points")
    joints, names = joints[rows], [str(label[i]).strip() for i in rows]
    directions = None if directions is None else directions[rows]
    robot, limits = arm.robot, (arm.robot.q_min_rad, arm.robot.q_max_rad)
    beyond = {
        f"the limits of {robot.name}": outside(joints, limits),
        "the joint range of the data": outside(robot.dh_joints(joints), arm.model.domain),
    }
    problems = [
        Problem(f"candidates {first_few([*compress(names, far)])}", f"joint {joint} outside {what}")
        for what, rows_beyond in beyond.items()
        for joint, far in enumerate(rows_beyond.T, 1)
        if far.any()
    ]
    problems += [fault for name in names for fault in not_in_a_line("candidates, pose", name)]
    if doubled := sorted(name for name, count in Counter(names).items() if count > 1):
        message = f"names given to different joints: {', '.join(doubled[:5])}"
        problems.append(Problem("candidates", message, "one name per point"))
    refuse(problems, "These candidates cannot be measured against the model")
    state = JointState(robot.dh_joints(joints), directions)
    where = arm.pose(state, "base", point).position_mm
    slope = arm.joint_jacobian(state, "base", point)[:, :3] @ robot.joint_map
    return Points(tuple(names), joints, where, slope, directions)


def plan_of(
    arm: Calibration,
    points: Points,
    assessor: AdaptiveAssessor,
    instruments: Sequence[Instrument],
    limits: Limits,
    point: str | None,
    source: str,
    seed: int = 0,
) -> Plan:
    """Return the plan of a campaign; the order of the candidates follows from ``seed`` alone.

    The first visit is ordered for little travel.

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
    point : str or None
        Target that is measured, the tool for None.
    source : str
        Where the candidates come from.
    seed : int
        Seed of the random order.

    Returns
    -------
    Plan
    """
    order = np.random.default_rng(seed).permutation(len(points))
    to_base = compose(arm.origin("base"), invert(arm.origin("instrument")))
    used = tuple(device.placed(to_base, points.modelled_mm) for device in instruments)
    if not np.isfinite(limits.implausible_mm):
        # Beyond it a reading is more likely to be of another pose; 50 mm for a model never fitted.
        noise = max(np.sqrt(np.linalg.eigvalsh(item.covariance_mm2)[-1]) for item in used)
        left_mm = _unexplained_mm(arm)
        usual_mm = 50.0 if math.isnan(left_mm) else max(5.0, 20.0 * left_mm)
        limits = replace(limits, implausible_mm=float(f"{usual_mm + 10.0 * noise:.3g}"))
    noise = used[0].in_base(to_base, points.modelled_mm)
    begun = assessor.begin(Candidates(noise[order]))
    route = order[: begun.first]
    count = begun.reference_poses
    places = points.joints[route] / arm.robot.dh.travel_unit
    here = np.zeros(places.shape[1])
    first = _short_path(places[:count], here)
    here = places[first[-1]] if count else here
    route = route[np.concatenate([first, count + _short_path(places[count:], here)])]
    about = {
        "robot": arm.robot.name,
        "calibration": arm.name,
        "model": arm.choice,
        "point": point or arm.default_point,
        "candidates": source,
        "kinacc_version": __version__,
    }
    return Plan(
        about=about, assessor=assessor, instruments=used, to_base=to_base, limits=limits,
        arm=Arm(prismatic=arm.robot.dh.prismatic.tolist()), seed=seed, order=order, route=route,
        points=points,
    )  # fmt: skip


def _short_path(places: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Rows (n,) of places (n, k) in an order with little travel from ``start`` (k,)."""
    return shortest_path(np.concatenate([start[None], places]))[1:] - 1


def start(
    folder: Path | str,
    arm: Calibration,
    plan: Plan,
    doubts: Sequence[Problem] = (),
    known: Noise | None = None,
    sure: bool = True,
) -> Plan:
    """Put a plan on disk with what speaks against it: the one way to start, here and in commands.

    Parameters
    ----------
    folder : path
        New folder.
    arm : Calibration
        Calibrated model whose errors are bounded.
    plan : Plan
        Plan to start (:func:`plan_of`).
    doubts : sequence of Problem
        Doubts about the noise of a test (:func:`kinacc.campaign.instrument.read_repeatability`).
    known : Noise, optional
        Noise of the readings of the calibration.
    sure : bool
        Overrule all doubts; the plan lists them.

    Returns
    -------
    Plan
        The plan with the overruled doubts.

    Raises
    ------
    InputError
        Where something speaks against the plan, unless ``sure``; where the folder has a campaign.
    """
    noise = noise_doubts(plan.instruments, _unexplained_mm(arm), known)
    problems = [*noise, *doubts, *_candidate_doubts(arm, plan.points, plan.about["point"])]
    if not sure:
        refuse(problems, "The campaign was not begun")
    overruled = tuple(f"{item.where}: {item.what}" for item in problems)
    plan = plan.model_copy(update={"overruled": overruled})
    folders.start(folder, plan)
    return plan


def _unexplained_mm(arm: Calibration) -> float:
    """The rms position error that the calibration left, noise included; NaN where not known."""
    return arm.residual.position_mm if arm.residual else math.nan


def noise_doubts(
    instruments: Sequence[Instrument], left_mm: float = math.nan, known: Noise | None = None
) -> list[Problem]:
    """Return a problem for each instrument with improbable noise.

    Parameters
    ----------
    instruments : sequence of Instrument
        Instruments with the noise that is stated.
    left_mm : float
        Rms error that the calibration left: a noise above twice as much is improbable (above 1 mm
        where it is NaN).
    known : Noise, optional
        Scatter of the calibration's readings at equal joints: less noise is improbable.

    Returns
    -------
    list of Problem
    """
    most_mm = _MUCH_NOISE * left_mm if left_mm > 0.0 else _MUCH_NOISE_MM
    problems = []
    for device in instruments:
        where, size = f"noise of {device.name}", math.sqrt(np.trace(device.covariance_mm2))
        if size > most_mm:
            text = f"{device.noise}: readings would scatter by {size:.3g} mm"
            in_mm = 1e-3 * np.sqrt(np.diag(device.covariance_mm2)).max()
            fix = f"are micrometres meant? Then it is {in_mm:g} mm. {_SURE}"
            problems.append(Problem(where, text, f"at most {most_mm:.3g} mm", fix))
        if known is None or known.freedom < _FEWEST_FREEDOM:
            continue
        if size / math.sqrt(3.0) < _LITTLE_NOISE * known.per_axis_mm:
            text = (
                f"{device.noise}: readings of the calibration at equal joints scatter by "
                f"{known.per_axis_mm:.3g} mm per axis ({known.freedom} degrees of freedom)"
            )
            fix = f"include how the arm repeats a pose: {known.per_axis_mm:.2g} mm or more; {_SURE}"
            problems.append(Problem(where, text, fix=fix))
    return problems


def noise_of(results: Path) -> Noise | None:
    """Return the noise of the readings in a results folder; None where it has no readings."""
    if not (results / "measurements.parquet").is_file():
        return None
    tables = read_tables(results, needed=("measurements", "robot"), optional=())
    return of_measurements(tables["measurements"], robot_of(tables))


def _candidate_doubts(arm: Calibration, points: Points, point: str | None) -> list[Problem]:
    """A problem where more than a tenth of the candidates lie far from measured poses."""
    if arm.known is None or math.isnan(_unexplained_mm(arm)):
        return []
    at = JointState(arm.robot.dh_joints(points.joints), points.directions)
    far = int(np.sum(~is_measured_there(arm, at, point)))
    if far <= _FAR_SHARE * len(points):
        return []
    largest_mm = float(np.max(position_std_mm(arm, at, point)))
    message = (
        f"{far} of {len(points)} lie outside the joint ranges of the calibration, or have a larger "
        f"standard deviation than {LIKE_FITTED:.0%} of its poses (up to {largest_mm:.3g} mm)"
    )
    fix = "without --joints-deg they are drawn between measured poses; --sure takes them"
    return [Problem("candidates", message, f"at most {_FAR_SHARE:.0%} of them", fix)]
