"""A calibration from the tables of a results folder and the robot they were made with."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from kinacc.calibration import identifiability
from kinacc.calibration.misfit import Misfit, misfit
from kinacc.calibration.noise import UNKNOWN
from kinacc.calibration.observations import from_columns
from kinacc.calibration.uncertainty import Uncertainty
from kinacc.config.error_models import ALWAYS, ERROR_MODELS, PLAINEST
from kinacc.deployment.record import MODELS, Calibration, Residual
from kinacc.errors import InputError, Problem, first_few, gathered, refuse
from kinacc.kinematics import robot as robots
from kinacc.kinematics import tables as model_tables
from kinacc.kinematics.dh import PARAMETERS
from kinacc.kinematics.robot import Robot
from kinacc.tables import store
from kinacc.tables.allowed import SUBSETS
from kinacc.tables.columns import joint_count

Tables = Mapping[str, Mapping[str, np.ndarray]]

_NEEDED = (*(f"{kind}_model" for kind in ALWAYS), "frames")
# Used where they are there.
_WANTED = (
    *(f"{kind}_{what}" for kind in ERROR_MODELS for what in ("model", "fit", "covariance")),
    *("measurements", "dh_identified", "residuals", "model_selection"),
)
_SAME = 1e-9


def read_tables(folder: Path | str, *more: str) -> dict[str, dict[str, np.ndarray]]:
    """The tables of a data set's results folder: columns (rows,) by table and name.

    ``more`` are read where they are there, beside those that every use needs. Units stand in the
    names (_mm, _rad). Raises InputError naming all tables that are missing.
    """
    folder = Path(folder)
    missing = [
        Problem(str(folder / f"{name}.parquet"), "no such file", fix="run the workflow first")
        for name in _NEEDED
        if not (folder / f"{name}.parquet").is_file()
    ]
    refuse(missing, f"{folder} holds no calibration")
    names = dict.fromkeys((*_NEEDED, *_WANTED, *more))
    present = [name for name in names if (folder / f"{name}.parquet").is_file()]
    problems: list[Problem] = []
    tables = {}
    for name in present:
        with gathered(problems):
            tables[name] = _Table(name, folder / f"{name}.parquet")
    refuse(problems, f"{folder} cannot be used")
    return tables


class _Table(dict[str, np.ndarray]):
    """Columns of a table of results; one that is asked for and is not there is a problem."""

    def __init__(self, name: str, path: Path) -> None:
        super().__init__(store.read(path))
        self.path, contract = path, store.artefact_named(name)
        wrong = (
            [] if contract.may_be_empty or len(next(iter(self.values()), ())) else ["has no rows"]
        )
        for column in contract.for_joints(joint_count(contract, self)):
            is_text = self.get(column.name, np.zeros(0)).dtype == object
            if column.name in self and is_text != (column.kind == "text"):
                wrong.append(f"column {column.name} holds {'text' if is_text else 'numbers'}")
        refuse([Problem(str(path), what, fix=store.remake(path)) for what in wrong])

    def __missing__(self, name: str) -> np.ndarray:
        what = f"has no column {name}"
        raise InputError(Problem(str(self.path), what, fix=store.remake(self.path)))


def recorded_robot(folder: Path | str) -> Robot | None:
    """The robot a results folder was made with; None where it does not say.

    Raises InputError where what it says cannot be read.
    """
    path = Path(folder) / "robot.parquet"
    if not path.is_file():
        return None
    return robots.of_text(str(_Table("robot", path)["description"][0]), str(path))


def misfit_of(folder: Path | str, model: str) -> Misfit:
    """What the standard deviations of a model in a results folder are worth."""
    robot = recorded_robot(folder)
    if robot is None:
        return Misfit(model, np.nan, UNKNOWN)
    paths = {name: Path(folder) / f"{name}.parquet" for name in ("measurements", "model_selection")}
    tables = {name: store.read(path) for name, path in paths.items() if path.is_file()}
    return misfit(tables, robot, model)


def calibration(
    tables: Tables,
    robot: Robot,
    model: str | None = None,
    name: str = "",
    session: str | None = None,
) -> Calibration:
    """The calibration in ``tables`` (``read_tables``): ``model``, or the one selected.

    ``session`` chooses the base where several were measured; the first where not given.
    Raises InputError where the robot is not the one the tables were made with.
    """
    choice = selected_model(tables) if model is None else model
    made = model_tables.models(tables, robot.dh)
    if choice not in made:
        what = f"{choice!r} is none of these results"
        raise InputError(Problem("model", what, ", ".join(made)))
    bounded = next(each for each in made.values() if each.domain is not None)
    _require_same_arm(bounded.dh, robot, name)
    frames, told = tables["frames"], tables.get(f"{PLAINEST}_identified")
    number = _session_number(frames, choice, session)
    bases = [model_tables.frame(frames, each, "base", session) for each in (PLAINEST, choice)]
    # A model of the very base of the DH model: neither was fitted with it.
    same_base = all(np.array_equal(one, other) for one, other in zip(*bases, strict=True))
    anchored = made[choice].table is None and not same_base
    measured, fitted, turned = tables.get("measurements"), None, frozenset()
    if measured is not None:
        is_fitted = np.asarray(measured["subset"]) == SUBSETS[0]
        fitted = from_columns(measured, robot).at.select(is_fitted)
        known = np.isfinite(np.asarray(measured["qw"], dtype=float))
        turned = frozenset(map(str, np.asarray(measured["target"])[known]))
    return Calibration(
        name=name,
        robot=robot,
        choice=choice,
        model=made[choice],
        base=bases[1],
        base_name="base" if number == 0 else f"base{number + 1}",
        anchor=calibration(tables, robot, PLAINEST, name, session) if anchored else None,
        left_open=None if told is None else tuple(identifiability.listed(told)),
        targets={
            each: model_tables.frame(frames, choice, each) for each in targets_of(frames, choice)
        },
        known=uncertainty(tables, choice),
        residual=residual(tables, choice),
        fitted_range_rad=bounded.domain,
        fitted=fitted,
        orientation_measured=turned,
    )


def targets_of(frames: Mapping, model: str) -> list[str]:
    """Names of the targets that a model was fitted with, from the table ``frames``."""
    of_model = np.asarray(frames["model"]) == model
    return [str(each) for each in np.asarray(frames["frame"])[of_model] if each != "base"]


def _session_number(frames: Mapping, model: str, session: str | None) -> int:
    """Place of a session among the bases of a model; InputError for one that is not there."""
    if session is None or "session" not in frames:
        return 0
    bases = (np.asarray(frames["model"]) == model) & (np.asarray(frames["frame"]) == "base")
    known = [str(each) for each in np.asarray(frames["session"])[bases] if each is not None]
    if session not in known:
        allowed = ", ".join(known) or "none: the data name no sessions"
        raise InputError(Problem("session", f"{session!r} is not there", allowed))
    return known.index(session)


def selected_model(tables: Tables) -> str:
    """The model the fits selected; where none was recorded, the better one on held-out poses.

    Raises InputError where the tables cannot tell.
    """
    recorded = recorded_model(tables)
    if recorded:
        return recorded
    rms = {each: residual(tables, each, "validation") for each in ALWAYS}
    if any(each is None for each in rms.values()):
        what = "was not selected, and there are no held-out residuals to choose by"
        raise InputError(Problem("model", what, ", ".join(MODELS), "give --model"))
    return min(rms, key=lambda each: rms[each].position_mm)


def recorded_model(tables: Tables) -> str:
    """The model that ``model_selection`` selected; empty where nothing says so."""
    columns = tables.get("model_selection", {})
    chosen = np.flatnonzero(np.asarray(columns.get("selected", [])) == 1)
    return str(columns["model"][chosen[0]]) if len(chosen) else ""


def residual(tables: Tables, choice: str, subset: str | None = None) -> Residual | None:
    """Rms of ``<choice>_vs_measured``: of held-out rows, or of training rows where there are none.

    None where the table does not say.
    """
    names = ("comparison", "subset", "quantity", "fold", "rms")
    table = pd.DataFrame({name: tables.get("residuals", {}).get(name, []) for name in names})
    pooled = table[(table["comparison"] == f"{choice}_vs_measured") & table["fold"].isna()]
    for each in ("validation", "train") if subset is None else (subset,):
        rms = pooled[pooled["subset"] == each].set_index("quantity")["rms"]
        if "position" in rms:
            turn = float(rms.get("orientation", np.nan))
            return Residual(float(rms["position"]), 1e-3 * turn, each)
    return None


def uncertainty(tables: Tables, choice: str) -> Uncertainty | None:
    """Covariance and undetermined directions of a fit; None where the tables lack them."""
    columns, fit = tables.get(f"{choice}_covariance"), tables.get(f"{choice}_fit")
    if columns is None:
        return None
    names = pd.Index(columns["parameter"]).unique()

    def places(parameters: np.ndarray, table: str) -> np.ndarray:
        found = names.get_indexer(parameters)
        unknown = sorted({str(each) for each in parameters[found < 0]})
        what = f"has parameters without a variance: {first_few(unknown)}"
        refuse([Problem(f"table {choice}_{table}", what)] if unknown else [])
        return found

    row, column = (places(columns[each], "covariance") for each in ("parameter", "other"))
    covariance = np.zeros((len(names), len(names)))
    covariance[row, column] = covariance[column, row] = columns["covariance"]
    directions = np.zeros((0, len(names)))
    if fit is not None:
        rows = np.asarray(fit["quantity"]) == "undetermined_direction"
        numbers, direction = np.unique(fit["number"][rows], return_inverse=True)
        directions = np.zeros((len(numbers), len(names)))
        directions[direction, places(fit["parameter"][rows], "fit")] = fit["value"][rows]
    return Uncertainty(tuple(map(str, names)), covariance, directions)


def require_same_robot(recorded: Robot, given: Robot, place: str) -> None:
    """InputError where a robot given is not the one results were made with.

    Limits and tool may differ: they are no part of what was fitted.
    """
    _require_same_arm(recorded.dh, given, place)
    pairs = {
        "which joints slide": (recorded.dh.prismatic, given.dh.prismatic),
        "joint_map or signs": (recorded.joint_map, given.joint_map),
        "base": (np.column_stack(recorded.base), np.column_stack(given.base)),
        "flange": (np.column_stack(recorded.flange), np.column_stack(given.flange)),
    }
    problems = [
        Problem(place, f"{given.name} differs from the recorded {recorded.name} in {what}")
        for what, (one, other) in pairs.items()
        if not np.allclose(one, other, rtol=_SAME, atol=_SAME)
    ]
    refuse(problems, f"The results were made with another robot than {given.name}")


def _require_same_arm(nominal, robot: Robot, name: str) -> None:
    place = f"results {name}".strip()
    if nominal.joints != robot.dh.joints:
        what = f"speak of {nominal.joints} joints, {robot.name} has {robot.dh.joints}"
        raise InputError(Problem(place, what, fix="give the robot they were made with (--robot)"))
    problems = []
    for each in PARAMETERS:
        made, given = getattr(nominal, each), getattr(robot.dh, each)
        for joint in np.flatnonzero(np.abs(made - given) > _SAME * (1.0 + np.abs(given))):
            what = f"joint {joint + 1} was fitted from {each} {made[joint]:.9g}"
            allowed = f"{given[joint]:.9g}, as {robot.name} has it"
            problems.append(Problem(place, what, allowed))
    refuse(problems, f"The results were made with another robot than {robot.name}")
