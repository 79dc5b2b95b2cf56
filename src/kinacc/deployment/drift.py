"""A robot's history: whether the arm changed since the calibration in force was made.

The last calibration holds unless the arm moved, over the poses of a later series, by more than an
arm shows that did not change: see ``drift_chance`` for what that is taken to be. The level is that
of a year of monthly calibrations. Where most of the later series lies outside the joint ranges of
the one in force, that is no test of the arm but of the model, and nothing can be told.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from kinacc.calibration.constraints import frame_terms
from kinacc.calibration.frames import Frames, stacked
from kinacc.calibration.observations import Observations, from_columns
from kinacc.calibration.summary import LARGE_SHARE
from kinacc.config.error_models import MEASURED, Comparison
from kinacc.deployment import drift_chance, drift_pairs, folder
from kinacc.deployment.drift_joint import joint_of
from kinacc.deployment.drift_pairs import Setup
from kinacc.deployment.record import Calibration
from kinacc.deployment.shared_readings import known_readings
from kinacc.deployment.verify import LEAST_HELD_OUT, frames_under, says_there
from kinacc.errors import FitError, InputError
from kinacc.geometry import Pose, compose
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import carried
from kinacc.measurements.folds import configurations
from kinacc.tables.allowed import FIRST, HOLDS, OPEN, RECALIBRATE, SAME
from kinacc.tables.columns import Columns

LEVEL = 0.05 / 12  # of a decision: monthly calibrations raise a false alarm in 1 year of 20
ENOUGH = 0.5  # of the readings, in the joint ranges of the series in force
_TEXT = ("series", "date", "digest", "base", "tool", "model", "in_force", "verdict", "reason")
_WHOLE = ("rows", "configurations")


@dataclass(frozen=True)
class Session:
    """One line of a series: what was measured, and the calibration it gave.

    ``calibration``: the selected model of this line's data set. ``observations``: all its rows in
    the order they were measured. ``held_out_mm`` (m,): position errors of that model at held-out
    rows, empty without folds. ``base``, ``tool``: SAME or MOVED since the line before (of the
    first: whatever is written there). ``temperature_c``, ``bound_mm``, ``tolerance_mm``: NaN where
    not known.
    """

    name: str
    date: str
    digest: str
    base: str
    tool: str
    calibration: Calibration
    observations: Observations
    held_out_mm: np.ndarray
    temperature_c: float
    bound_mm: float
    tolerance_mm: float


def session_of(
    tables: Mapping[str, Columns], name: str, date: str, base: str, tool: str
) -> Session:
    """A line of a series from the tables of its results."""
    arm = robots.of_text(str(tables["robot"]["description"][0]), "robot.parquet")
    calibration, measured = folder.calibration(tables, arm, name=name), tables["measurements"]
    warmth = np.asarray(measured.get("temperature_c", ()), dtype=float)
    warmth = warmth[np.isfinite(warmth)]
    return Session(
        name=name,
        date=date,
        digest="",
        base=base,
        tool=tool,
        calibration=calibration,
        observations=from_columns(measured, arm),
        held_out_mm=_held_out_mm(tables["pose_errors"], calibration.choice),
        temperature_c=float(warmth.mean()) if len(warmth) else np.nan,
        bound_mm=np.nan,
        tolerance_mm=np.nan,
    )


def _held_out_mm(errors: Mapping, model: str) -> np.ndarray:
    """Position errors (m,) of a model where every one was tried, as ``kinacc summary`` has them."""
    held = np.asarray(errors["estimate"]) == "cross_validated"
    kind, row = np.asarray(errors["comparison"])[held], np.asarray(errors["row"])[held]
    tried = [row[kind == each] for each in dict.fromkeys(kind)]
    common = reduce(np.intersect1d, tried) if tried else row
    ours = (kind == Comparison(MEASURED, model).name) & np.isin(row, common)
    return np.linalg.norm([np.asarray(errors[f"e{axis}_mm"])[held][ours] for axis in "xyz"], axis=0)


def history(sessions: Sequence[Session], rotation_weight_mm_per_rad: float, seed: int) -> Columns:
    """The table ``history``: one row a session, in the order of their dates.

    The same whatever order they are given in, and a row the same whatever comes after it: all
    chance follows from ``seed`` and the names of the two series compared.
    """
    comparison = _Comparison(rotation_weight_mm_per_rad, seed, {})
    rows: list[dict[str, Any]] = []
    for session, force, setup in _in_force(sessions, rows):
        row = _stated(session)
        if force is None:
            row |= {"verdict": FIRST}
        else:
            row |= {"in_force": force.name} | comparison.row(force, session, setup)
        rows.append(row)
    return {name: _column(name, [row[name] for row in rows]) for name in _NAMES}


def _in_force(
    sessions: Sequence[Session], rows: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[Session, Session | None, Setup]]:
    """Every session, the one in force before it, and what both have in common.

    ``rows`` of the sessions before say which calibration is in force.
    """
    force, same_base, same_tool = None, True, True
    for session in sorted(sessions, key=lambda each: each.date):
        same_base &= session.base == SAME
        same_tool &= session.tool == SAME
        yield session, force, Setup(same_base, same_tool)
        if rows[-1]["verdict"] in (FIRST, RECALIBRATE):
            force, same_base, same_tool = session, True, True


@dataclass(frozen=True)
class _Comparison:
    """How sessions are compared; ``known``: what halves of a series showed, by name and setup."""

    rotation_weight_mm_per_rad: float
    seed: int
    known: dict[tuple[str, Setup], float]

    def row(self, force: Session, session: Session, setup: Setup) -> dict[str, Any]:
        """What a row says of ``session`` while the calibration of ``force`` was in force."""
        row: dict[str, Any] = {}
        series = (session.observations, force.observations)
        known = known_readings(*([each.q_rad, each.position_mm] for each in series))
        session = replace(session, observations=session.observations.select(~known))
        try:
            row |= _sizes("in_force", self.errors_mm(force, session, setup))
            few = [each for each in (force, session) if _count(each.observations) < LEAST_HELD_OUT]
            if few:
                what = f"fewer than {LEAST_HELD_OUT} configurations in {few[0].name}"
                return row | {"verdict": OPEN, "reason": what}
            return row | self.moved(force, session, setup)
        except (FitError, InputError) as problem:
            return row | {"verdict": OPEN, "reason": str(problem)}

    def moved(self, force: Session, session: Session, setup: Setup) -> dict[str, Any]:
        """What moved, what chance shows, and the verdict. Raises FitError."""
        robot = session.calibration.robot
        first, second = force.observations, session.observations
        pair = drift_pairs.of_observations(
            first, second, setup, force.calibration, self.rotation_weight_mm_per_rad
        )
        misfit = 1.0
        if not drift_pairs.all_shared(pair):
            misfit = factor(self.understated(force, setup), self.understated(session, setup))
        found = drift_chance.moved(pair, misfit, self._rng(force.name, session.name))
        moved_mm, chance_mm = found.moved_mm, found.chance_mm(LEVEL)
        row = {
            "moved_mm": moved_mm,
            "chance_mm": chance_mm,
            "beyond_mm": max(0.0, moved_mm - chance_mm),
            "probability": found.probability,
            "verdict": HOLDS,
        }
        there = drift_pairs.share_inside(second.q_rad, first.q_rad, robot.dh.prismatic)
        if there < ENOUGH:
            what = (
                f"only {there:.0%} of the readings lie in the joint ranges of {force.name}: what "
                "a calibration says where nothing was measured tells of no change"
            )
            return row | {"verdict": OPEN, "reason": what}
        if moved_mm > chance_mm:
            rng = self._rng(force.name, session.name, "joint")
            whole = drift_chance.moved(pair, misfit, rng, with_growth=True)
            joint = joint_of(whole, robot.dh.prismatic)
            return row | {"verdict": RECALIBRATE, "joint": np.nan if joint is None else joint}
        held_out = force.held_out_mm
        if len(held_out) and chance_mm > np.mean(held_out):
            what = (
                f"chance alone shows up to {chance_mm:.2f} mm, more than the held-out error of the "
                f"calibration in force ({np.mean(held_out):.2f} mm on average)"
            )
            return row | {"verdict": OPEN, "reason": what}
        return row

    def understated(self, session: Session, setup: Setup) -> float:
        """What halves of a series say of the misfit (``drift_chance.understated``)."""
        key = session.name, setup
        if key not in self.known:
            cuts = drift_pairs.cut(
                session.observations,
                setup,
                session.calibration,
                self.rotation_weight_mm_per_rad,
            )
            self.known[key] = drift_chance.understated(cuts, self._rng(session.name))
        return self.known[key]

    def errors_mm(self, force: Session, session: Session, setup: Setup) -> np.ndarray:
        """Position errors (n,) of the calibration in force on rows of another session.

        NaN where its model says nothing. Base and tool that were moved are fitted to the rows
        outside each fold, to all where there are no folds.
        """
        calibration, seen = force.calibration, session.observations
        found = np.full(len(seen), np.nan)
        said = says_there(calibration.model, seen.q_rad).all(axis=1)
        for fold in np.unique(seen.fold):
            tried = said & (seen.fold == fold)
            train = said & (seen.fold != fold) if fold >= 0 else said
            if not tried.any() or not train.any():
                continue
            frames = self._frames(calibration, seen.select(train), setup)
            found[tried] = _errors_mm(calibration, frames, seen.select(tried))
        return found[np.isfinite(found)]

    def _frames(self, calibration: Calibration, seen: Observations, setup: Setup) -> Frames:
        """Base and targets by the calibration, what was moved as ``seen`` shows it."""
        robot, targets = calibration.robot, calibration.targets
        stated = Frames(
            stacked([calibration.base] * len(seen.session_names)),
            stacked([targets.get(name, carried(robot)) for name in seen.target_names]),
        )
        terms = frame_terms(seen, stated)
        kept = {name for name in seen.target_names if setup.same_tool and name in targets}
        if setup.same_base and len(seen.session_names) == 1:
            kept.add("base")
        free = np.array([name.rpartition(".")[0] not in kept for name in terms.names])
        if not free.any():
            return stated
        weight = self.rotation_weight_mm_per_rad
        return frames_under(calibration.model, seen, replace(terms, free=free), weight)

    def _rng(self, *names: str) -> np.random.Generator:
        words = hashlib.sha256("\n".join(names).encode()).digest()
        return np.random.default_rng([self.seed, *words])


def factor(first: float, second: float) -> float:
    """On deviations of misfit that is not shared, by what halves of both series showed."""
    return float(np.sqrt(max(1.0, 0.5 * (first + second))))


def _errors_mm(calibration: Calibration, frames: Frames, seen: Observations) -> np.ndarray:
    bases, targets = (
        Pose(each.rotation[rows], each.position_mm[rows])
        for each, rows in ((frames.bases, seen.session), (frames.targets, seen.target))
    )
    pose = compose(bases, compose(calibration.model.pose(seen.at), targets))
    return np.linalg.norm(seen.position_mm - pose.position_mm, axis=1)


def _stated(session: Session) -> dict[str, Any]:
    """What a row says of its session alone."""
    nothing: dict[str, Any] = dict.fromkeys(_NAMES, np.nan) | dict.fromkeys(_TEXT)
    return nothing | {
        "series": session.name,
        "date": session.date,
        "digest": session.digest,
        "base": session.base,
        "tool": session.tool,
        "rows": len(session.observations),
        "configurations": _count(session.observations),
        "temperature_c": session.temperature_c,
        "model": session.calibration.choice,
        **_sizes("held_out", session.held_out_mm),
        "bound_mm": session.bound_mm,
        "tolerance_mm": session.tolerance_mm,
    }


def _sizes(kind: str, errors_mm: np.ndarray) -> dict[str, float]:
    """Mean, 99 % and largest of errors (n,), NaN of none."""
    if not len(errors_mm):
        errors_mm = np.array([np.nan])
    return {
        f"{kind}_mean_mm": float(np.mean(errors_mm)),
        f"{kind}_quantile_99_mm": float(np.quantile(errors_mm, LARGE_SHARE)),
        f"{kind}_largest_mm": float(np.max(errors_mm)),
    }


def _count(observations: Observations) -> int:
    return len(np.unique(configurations(observations.pose, observations.q_rad)))


def _column(name: str, values: list) -> np.ndarray:
    kind = object if name in _TEXT else np.int64 if name in _WHOLE else float
    return np.array(values, dtype=kind)


_NAMES = (
    *("series", "date", "digest", "base", "tool", "rows", "configurations", "temperature_c"),
    *("model", "held_out_mean_mm", "held_out_quantile_99_mm", "held_out_largest_mm", "in_force"),
    *("in_force_mean_mm", "in_force_quantile_99_mm", "in_force_largest_mm", "moved_mm"),
    *("chance_mm", "beyond_mm", "probability", "joint", "bound_mm", "tolerance_mm"),
    *("verdict", "reason"),
)
