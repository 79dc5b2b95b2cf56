"""A calibration held to readings that it was not fitted to: later ones, or of another set-up.

The arm is taken as it was fitted. Base and tool are kept where they did not move, and fitted anew
where they did, for every model alike. Their errors after that are compared: among models, and with
those that handfuls of held-out poses leave after the same fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple

import numpy as np

from kinacc.calibration import dh_fit, robust
from kinacc.calibration.constrained import FrameTerms
from kinacc.calibration.constraints import frame_terms
from kinacc.calibration.frames import ANGLE_UNIT_RAD, MOTIONS, Frames, known, stacked
from kinacc.calibration.models import Fit
from kinacc.calibration.observations import Observations, from_columns
from kinacc.calibration.residuals import Errors, errors
from kinacc.calibration.summary import LARGE_SHARE
from kinacc.calibration.system import FlangeModel
from kinacc.calibration.tables import frames_of
from kinacc.config.error_models import MEASURED, Comparison
from kinacc.deployment import handful
from kinacc.deployment.handful import BASE, TOOL, Held, HeldOut, Places, Seen
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose
from kinacc.kinematics.model import ErrorModel
from kinacc.kinematics.robot import Robot, carried
from kinacc.kinematics.tables import frame, models
from kinacc.measurements.folds import configurations

Tables = Mapping[str, Mapping[str, np.ndarray]]
PASSES, FAILS, OPEN = "passes", "fails", "cannot be told"
FEW_HELD_OUT, FEW = "too few held-out poses", "too few configurations where it was measured"
NOWHERE = "no configuration where it was measured"
SEVERAL = "several sessions, each with a base of its own"
TAKEN_UP = "base and tool take up all that these poses show"
TABLE = (5, 8, 12, 20, 40)  # numbers of poses that it is said what they would show of
_SLACK = 1e-9  # rad and mm beyond the fitted range that are rounding


@dataclass(frozen=True)
class Trial:
    """Errors (m, 3) of models by name, all at the m readings that ``rows`` (n,) marks."""

    rows: np.ndarray
    errors: dict[str, Errors]


class Level(NamedTuple):
    """Position errors of a model at readings: how many, of how many configurations, how large."""

    readings: int
    configurations: int
    mean_mm: float
    quantile_99_mm: float


@dataclass(frozen=True)
class Verdict:
    """Whether new poses pass a model: PASSES, FAILS or OPEN, and why it cannot be told.

    ``here`` are the errors that count, ``held_out`` those held out; ``held`` compares them with
    ``handful.LEVEL``; ``least`` is the number of configurations that a pass needs, None where no
    number would do; ``seen`` what these show and ``table`` what other numbers would.
    """

    says: str
    reason: str
    here: Level | None = None
    held_out: Level | None = None
    held: Held | None = None
    least: int | None = None
    seen: Seen | None = None
    table: tuple[Seen, ...] = ()


def verdict(
    tables: Tables,
    robot: Robot,
    model: str,
    observations: Observations,
    there: np.ndarray,
    moved: Sequence[str],
    rotation_weight_mm_per_rad: float,
) -> Verdict:
    """Hold ``model`` to the readings where it was measured, ``there`` (n,).

    The first reading of every target of a configuration counts. ``moved``: what of base and tool is
    fitted to these anew. Raises InputError where a frame that is kept is not there, and FitError.
    """
    kinds = len(observations.target_names)
    held = _held_out(tables, robot, model, observations, moved, rotation_weight_mm_per_rad)
    if held is None or len(held) < handful.LEAST_HELD_OUT:
        return Verdict(OPEN, FEW_HELD_OUT, held_out=held and _level(held.errors))
    held_out, own = _level(held.errors), models(tables, robot.dh)[model]
    rows = _first(observations, there & says_there(own, observations.q_rad).all(axis=1))
    several = BASE in moved and len(observations.session_names) > 1
    if several or not len(rows):
        return Verdict(OPEN, SEVERAL if several else NOWHERE, held_out=held_out)
    new, turned = observations.select(rows.ravel()), held.errors.shape[2] > 3
    if not turned:
        new = replace(new, rotation=np.full_like(new.rotation, np.nan))
    frames = frames_at(tables, model, own, new, robot, moved, rotation_weight_mm_per_rad)
    off = errors({model: Fit(own, frames)}, new)[Comparison(MEASURED, model).name]
    here = _level(off.position_mm.reshape(*rows.shape, 3))
    at = _places(
        own,
        new.select(slice(None, None, kinds)),
        frames.targets,
        moved,
        rotation_weight_mm_per_rad if turned else None,
    )
    least, table = handful.least(held), _table(held)
    if len(rows) * held.numbers <= at.unknowns:
        return Verdict(OPEN, TAKEN_UP, here, held_out, least=least, table=table)
    left = np.zeros((*rows.shape, held.errors.shape[2]))
    left[..., :3] = off.position_mm.reshape(*rows.shape, 3)
    if turned:
        left[..., 3:] = rotation_weight_mm_per_rad * off.rotation_rad.reshape(*rows.shape, 3)
    found = handful.held_to(held, HeldOut(left, at))
    says = PASSES if least is not None and len(rows) >= least else OPEN
    says = FAILS if found.probability <= handful.LEVEL else says
    seen = handful.seen(held, len(rows), at)
    return Verdict(says, FEW if says == OPEN else "", here, held_out, found, least, seen, table)


def _table(held: HeldOut) -> tuple[Seen, ...]:
    """What other numbers of poses would show."""
    told = [each for each in TABLE if each * held.numbers > held.places.unknowns]
    return tuple(handful.seen(held, each) for each in told if 2 * each <= len(held))


def _first(observations: Observations, said: np.ndarray) -> np.ndarray:
    """Rows (m, K) of configurations with all K targets: the first of each where it is ``said``."""
    own = np.flatnonzero(said)
    part, kinds = observations.select(own), len(observations.target_names)
    of = configurations(part.pose, part.q_rad)
    _, first = np.unique(of * kinds + part.target, return_index=True)
    number, count = np.unique(of[first], return_counts=True)
    whole = np.isin(of[first], number[count == kinds])
    return own[first[whole]].reshape(-1, kinds)


def _held_out(
    tables: Tables,
    robot: Robot,
    model: str,
    seen: Observations,
    moved: Sequence[str],
    rotation_weight_mm_per_rad: float,
) -> HeldOut | None:
    """Held-out errors of configurations with as many targets as ``seen``; None where none are.

    At poses where every model was held out, as ``kinacc summary`` states them. Orientations take
    part where they were measured there and are ``seen``, and something is fitted to them.
    """
    if not {"pose_errors", "measurements"} <= set(tables):
        return None
    measured, names = from_columns(tables["measurements"], robot), seen.target_names
    if TOOL in moved:
        names = measured.target_names[: len(names)]
    if len(names) < len(seen.target_names):
        return None
    vectors = _held_out_vectors(tables["pose_errors"], model, len(measured))
    numbers = [measured.target_names.index(name) for name in names]
    place = np.full(len(measured.target_names), -1)
    place[numbers] = np.arange(len(numbers))
    named = replace(measured, target=place[measured.target], target_names=names)
    rows = _first(named, np.isfinite(vectors[:, :3]).all(axis=1) & (named.target >= 0))
    if not len(rows):
        return None
    errors_there = vectors[rows]
    turned = bool(moved) and np.isfinite(errors_there).all() and seen.has_rotation.all()
    weight = rotation_weight_mm_per_rad if turned else None
    frames = frames_of(tables["frames"], model, names, measured.session_names)
    own = models(tables, robot.dh)[model]
    at = _places(own, measured.select(rows[:, 0]), frames.targets, moved, weight)
    errors_there[..., 3:] *= 1e-3 * rotation_weight_mm_per_rad
    return HeldOut(errors_there[..., : 6 if turned else 3], at)


def _held_out_vectors(errors: Mapping[str, np.ndarray], model: str, count: int) -> np.ndarray:
    """Held-out errors (count, 6) of measured rows, mm and mrad; NaN where a model has none."""
    held = np.asarray(errors["estimate"]) == "cross_validated"
    kind, row = np.asarray(errors["comparison"])[held], np.asarray(errors["row"])[held]
    tried = [row[kind == each] for each in dict.fromkeys(kind)]
    common = reduce(np.intersect1d, tried) if tried else row
    ours = (kind == Comparison(MEASURED, model).name) & np.isin(row, common)
    names = [f"e{axis}_mm" for axis in "xyz"] + [f"r{axis}_mrad" for axis in "xyz"]
    found = np.full((count, 6), np.nan)
    found[row[ours]] = np.stack([np.asarray(errors[name])[held] for name in names], axis=1)[ours]
    return found


def _places(
    model: ErrorModel,
    seen: Observations,
    targets: Pose,
    moved: Sequence[str],
    weight: float | None,
) -> Places:
    steps = np.where(model.dh.prismatic, 1.0, ANGLE_UNIT_RAD)  # mm and mrad
    jacobian = steps * model.joint_jacobian(seen.at)
    return handful.places(model.pose(seen.at), targets, jacobian, tuple(moved), weight)


def _level(vectors: np.ndarray) -> Level | None:
    """Of errors (n, K, c) of n configurations, mm."""
    sizes = np.linalg.norm(vectors[..., :3], axis=-1)
    if not sizes.size:
        return None
    return Level(
        sizes.size, len(sizes), float(sizes.mean()), float(np.quantile(sizes, LARGE_SHARE))
    )


def trials(
    tables: Tables,
    robot: Robot,
    observations: Observations,
    moved: Sequence[str],
    rotation_weight_mm_per_rad: float,
) -> list[Trial]:
    """Every model of a results folder at ``observations``, ``moved`` frames fitted to these anew.

    First at the readings where all models say something, then, where these are not all, of the
    models that do so everywhere. What poses do not show of base and tool stays as ``robot`` has it.
    Raises InputError where a target or a session that is kept is another, or there are too few
    readings, and FitError.
    """
    if BASE not in moved:
        _require_sessions(tables, observations.session_names)
    own = models(tables, robot.dh)
    said = {kind: says_there(each, observations.q_rad).all(axis=1) for kind, each in own.items()}
    everywhere = [kind for kind, rows in said.items() if rows.all()]
    parts: list[tuple[np.ndarray, Sequence[str]]] = [(np.all([*said.values()], axis=0), [*own])]
    if len(everywhere) < len(own):
        parts.append((np.ones(len(observations), dtype=bool), everywhere))
    found = []
    for rows, kinds in parts:
        if not rows.any():
            continue
        there = observations.select(rows)
        at = {
            kind: frames_at(
                tables, kind, own[kind], there, robot, moved, rotation_weight_mm_per_rad
            )
            for kind in kinds
        }
        of = errors({kind: Fit(own[kind], at[kind]) for kind in kinds}, there)
        by_kind = {kind: of[Comparison(MEASURED, kind).name] for kind in kinds}
        found.append(Trial(rows, by_kind))
    return found


def _require_sessions(tables: Tables, sessions: Sequence[str | None]) -> None:
    bases = np.asarray(tables["frames"]["frame"]) == BASE
    named = np.asarray(tables["frames"].get("session", np.full(len(bases), None)))
    measured = {str(each) for each in named[bases]}
    if tuple(sessions) == (None,) and len(measured) > 1:
        what = "do not say in which session they were read, and each has a base of its own"
        raise InputError(Problem("the readings", what, f"one of {', '.join(sorted(measured))}"))


def frames_at(
    tables: Tables,
    kind: str,
    model: ErrorModel,
    seen: Observations,
    robot: Robot,
    moved: Sequence[str],
    rotation_weight_mm_per_rad: float,
) -> Frames:
    """Base and targets of ``seen``: as the table ``frames`` has them, fitted anew what ``moved``.

    The arm is held at ``model``, which the table calls ``kind``.
    """
    sessions, targets = seen.session_names, seen.target_names
    stated = known(robot.base, carried(robot), len(sessions), len(targets))
    if BASE not in moved:
        kept = [frame(tables["frames"], kind, BASE, each) for each in sessions]
        stated = replace(stated, bases=stacked(kept))
    if TOOL not in moved:
        kept = [frame(tables["frames"], kind, each) for each in targets]
        stated = replace(stated, targets=stacked(kept))
    if not moved:
        return stated
    terms = frame_terms(seen, stated)
    of_base = np.arange(len(terms.names)) < len(MOTIONS) * len(sessions)  # these stand first
    terms = replace(terms, free=np.where(of_base, BASE in moved, TOOL in moved))
    return frames_under(model, seen, terms, rotation_weight_mm_per_rad)


def frames_under(
    model: ErrorModel, seen: Observations, terms: FrameTerms, rotation_weight_mm_per_rad: float
) -> Frames:
    """Base and targets of ``seen`` under ``terms``, the arm held at ``model``, of whatever kind."""
    nothing, held = np.zeros(0), FlangeModel(0, lambda x, at: model.pose(at))
    unknowns = dh_fit.Unknowns("fit of base and tool", held, nothing, nothing, nothing, nothing)
    coordinates, solution, _ = dh_fit.solved(
        seen,
        unknowns,
        model.dh,
        rotation_weight_mm_per_rad=rotation_weight_mm_per_rad,
        threshold=0.0,
        frames=None,
        frame_terms=terms,
        loss=robust.SQUARES,
    )
    return coordinates.frames(solution.x)


def says_there(model: ErrorModel, q_rad: np.ndarray) -> np.ndarray:
    """True (n, k) where DH joints lie in the range a model says something about."""
    if model.domain is None:
        return np.ones(q_rad.shape, dtype=bool)
    low, high = model.domain
    return (q_rad >= low - _SLACK) & (q_rad <= high + _SLACK)
