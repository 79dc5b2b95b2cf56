"""A robot's history: whether the arm changed since the calibration in force was made.

The last calibration holds unless the arm moved, over the poses of a later series, by more than an
arm shows that did not change: see ``history_model`` for what that is taken to be. Where most of the
later series lies outside the joint ranges of the one in force,
that is no test of the arm but of the model, and nothing can be told.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from kinacc.calibration.fitting import fit_frames
from kinacc.calibration.frames import frame_terms, known
from kinacc.calibration.least_squares import one_thread
from kinacc.calibration.observations import Observations, from_columns
from kinacc.calibration.summary import held_out_errors
from kinacc.config.error_models import PLAINEST
from kinacc.deployment import folder, history_model
from kinacc.deployment.history_model import joined
from kinacc.deployment.record import Calibration
from kinacc.deployment.shared_readings import known_readings
from kinacc.deployment.verify import (
    BASE,
    LEAST_HELD_OUT,
    STATISTICS,
    TOOL,
    errors_of,
    frames_at,
    statistics,
)
from kinacc.errors import FitError, InputError
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse.limits import outside
from kinacc.kinematics.robot import carried
from kinacc.measurements.folds import SAME_CONFIGURATION_RAD, configurations
from kinacc.tables.allowed import FIRST, HOLDS, OPEN, RECALIBRATE, SAME
from kinacc.tables.columns import Columns, Tables
from kinacc.tables.contract import ARTEFACTS, columns_of

LEVEL = 0.005 / 12  # of a decision: monthly calibrations raise a false alarm in 1 year of 200
ENOUGH = 0.5  # of the readings, in the joint ranges of the series in force
MOST = 1500  # configurations of a series: what more would add is small beside the misfit


@dataclass(frozen=True)
class Session:
    """One line of a series: what was measured, and the calibration it gave.

    ``calibration``: the selected model of this line's data set. ``dh``: its fitted DH model, about
    which series are compared. ``observations``: all its rows in the order they were measured.
    ``held_out_mm`` (m,): position errors of the selected model at held-out rows, empty without
    folds. ``base``, ``tool``: SAME or MOVED since the line before (of the first: whatever is
    written there). ``facts``: further columns of its row in the history.
    """

    name: str
    date: str
    base: str
    tool: str
    calibration: Calibration
    dh: DHModel
    observations: Observations
    held_out_mm: np.ndarray
    facts: Mapping[str, Any] = field(default_factory=dict)


def session_of(tables: Tables, name: str, date: str, base: str, tool: str, **facts: Any) -> Session:
    """A line of a series from the tables of its results."""
    calibration, measured = folder.calibration(tables, name=name), tables["measurements"]
    # A VEC model holds the nominal DH parameters: too far from the arm for a linear comparison.
    dh = folder.calibration(tables, PLAINEST, name=name).model.dh
    observed = from_columns(measured, calibration.robot)
    held_out = held_out_errors(tables["pose_errors"], calibration.choice)
    held_out_mm = np.linalg.norm(held_out[["ex_mm", "ey_mm", "ez_mm"]], axis=1)
    temperature_c = pd.Series(measured.get("temperature_c", []), dtype=float).mean()
    facts = {"temperature_c": temperature_c} | facts
    return Session(name, date, base, tool, calibration, dh, observed, held_out_mm, facts)


def history(
    sessions: Sequence[Session],
    rotation_weight_mm_per_rad: float,
    level: float = LEVEL,
) -> Columns:
    """The history of one robot: a verdict on every series, in the order of their dates.

    A row is the same whatever comes after it.

    Parameters
    ----------
    sessions
        The series, in any order.
    rotation_weight_mm_per_rad
        Weight of an orientation.
    level
        Share of decisions on an unchanged arm that may be false alarms.

    Returns
    -------
    Columns
        The table ``history``: one row a session.
    """
    rows: list[dict[str, Any]] = []
    force, moved = None, set[str]()
    for session in sorted(sessions, key=lambda session: session.date):
        moved |= {frame for frame in (BASE, TOOL) if getattr(session, frame) != SAME}
        row: dict[str, Any] = dict.fromkeys(column.name for column in ARTEFACTS["history"].columns)
        row |= session.facts
        row |= {
            "series": session.name,
            "date": session.date,
            "base": session.base,
            "tool": session.tool,
            "rows": len(session.observations),
            "configurations": _count(session.observations),
            "model": session.calibration.choice,
            "verdict": FIRST,
            **_sizes("held_out", session.held_out_mm),
        }
        if force is not None:
            row |= {"in_force": force.name} | _compared(
                force, session, moved, rotation_weight_mm_per_rad, level
            )
        rows.append(row)
        if row["verdict"] in (FIRST, RECALIBRATE):
            force, moved = session, set()
    return columns_of("history", rows)


def _compared(
    force: Session, session: Session, moved: Set[str], weight: float, level: float
) -> dict[str, Any]:
    """What a row says of ``session`` while the calibration of ``force`` was in force.

    Readings that the session in force holds as well are left out.
    """
    series = (session.observations, force.observations)
    shared = known_readings(*([item.q_rad, item.position_mm] for item in series))
    session = replace(session, observations=session.observations.select(~shared))
    row: dict[str, Any] = {}
    try:
        row |= _sizes("in_force", _errors_mm(force, session, moved, weight))
        for item in (force, session):
            if _count(item.observations) < LEAST_HELD_OUT:
                message = (
                    f"fewer than {LEAST_HELD_OUT} configurations in {item.name}: measure more, or "
                    "take it out of the series"
                )
                return row | {"verdict": OPEN, "reason": message}
        return row | _change(force, session, moved, weight, level)
    except (FitError, InputError) as problem:
        return row | {"verdict": OPEN, "reason": str(problem)}


@one_thread
def _change(
    force: Session, session: Session, moved: Set[str], weight: float, level: float
) -> dict[str, Any]:
    """What moved, what chance shows, and the verdict. Raises FitError."""
    prismatic = session.calibration.robot.dh.prismatic
    first, second = _thinned(force.observations), _thinned(session.observations)
    pair, misfit = _pair(force, first, second, moved, weight), 1.0
    if not pair.in_both.all():
        misfit = history_model.misfit_factor(
            _pair(item, *half, moved, weight)
            for item, series in ((force, first), (session, second))
            for half in history_model.halves(series)
        )
    movement = history_model.moved(pair, misfit)
    moved_mm = movement.moved_mm
    probability, chance_mm = movement.test(level)
    row = {
        "moved_mm": moved_mm,
        "chance_mm": chance_mm,
        "beyond_mm": max(0.0, moved_mm - chance_mm),
        "probability": probability,
    }
    inside = _share_inside(session.observations.q_rad, force.observations.q_rad, prismatic)
    if inside < ENOUGH:
        message = f"only {inside:.0%} of the readings lie in the joint ranges of {force.name}"
        return row | {"verdict": OPEN, "reason": message}
    if moved_mm > chance_mm:
        joint = history_model.joint_of(movement, prismatic)
        return row | {"verdict": RECALIBRATE, "joint": joint}
    held_out_mm = float(np.mean(force.held_out_mm)) if len(force.held_out_mm) else np.inf
    if chance_mm > held_out_mm:
        message = (
            f"a change below {chance_mm:.2f} mm would not be seen; the mean held-out error of "
            f"the calibration in force is {held_out_mm:.2f} mm"
        )
        return row | {"verdict": OPEN, "reason": message}
    return row | {"verdict": HOLDS}


def _pair(
    session: Session, first: Observations, second: Observations, moved: Set[str], weight: float
) -> history_model.Pair:
    """Two series about the fitted DH model of a session, with their bases and targets."""
    robot, both = session.calibration.robot, joined(first, second, moved)
    counts = len(both.session_names), len(both.target_names)
    terms = frame_terms(both, known(robot.base, carried(robot), *counts))
    frames = fit_frames(both, session.dh, rotation_weight_mm_per_rad=weight, frames=terms)
    return history_model.about(session.dh, frames, both, len(first), weight)


def _errors_mm(force: Session, session: Session, moved: Set[str], weight: float) -> np.ndarray:
    """Position errors (n,) of the calibration in force where its model covers the joints.

    Base and tool that were moved are fitted.
    """
    calibration, observed = force.calibration, session.observations
    beyond = outside(observed.q_rad, calibration.model.domain)
    observed = observed.select(~np.any(beyond, axis=1))
    if not len(observed):
        return np.zeros(0)
    if len(observed.session_names) > 1:
        moved = {*moved, BASE}
    if not {*observed.target_names} <= {*calibration.targets}:
        moved = {*moved, TOOL}
    frames = frames_at(calibration, observed, moved, weight)
    return np.linalg.norm(errors_of(calibration, frames, observed)[:, :3], axis=1)


def _thinned(observations: Observations) -> Observations:
    """At most ``MOST`` configurations, evenly over the order they were measured in."""
    configuration = configurations(observations.pose, observations.q_rad)
    count = configuration.max() + 1
    retained = np.linspace(0, count - 1, min(MOST, count)).round().astype(int)
    return observations.select(np.isin(configuration, retained))


def _share_inside(q_rad: np.ndarray, ranged_rad: np.ndarray, prismatic: np.ndarray) -> float:
    """Share of joints (n, k) that lie in the ranges of others (m, k), but for full turns."""
    low = ranged_rad.min(axis=0) - SAME_CONFIGURATION_RAD
    above = np.where(prismatic, q_rad - low, np.mod(q_rad - low, 2.0 * np.pi))
    wide = ranged_rad.max(axis=0) + SAME_CONFIGURATION_RAD - low
    return float(np.mean(np.all((above >= 0.0) & (above <= wide), axis=1)))


def _sizes(kind: str, errors_mm: np.ndarray) -> dict[str, float]:
    """Mean, 99 % and largest of errors (n,), NaN of none."""
    names = [f"{kind}_{name}_mm" for name in STATISTICS[:3]]
    return dict(zip(names, statistics(errors_mm), strict=False))


def _count(observations: Observations) -> int:
    return len(np.unique(configurations(observations.pose, observations.q_rad)))
