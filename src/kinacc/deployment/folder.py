"""A calibration from the tables of a results folder and the robot they were made with."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from kinacc.calibration import blind_words
from kinacc.calibration.misfit import Misfit, misfit
from kinacc.calibration.noise import UNKNOWN
from kinacc.calibration.observations import from_columns
from kinacc.calibration.uncertainty import Uncertainty
from kinacc.config.error_models import ALWAYS, ERROR_MODELS, PLAINEST
from kinacc.deployment.record import MODELS, Calibration, Residual
from kinacc.errors import InputError, Problem, first_few, gathered, refuse
from kinacc.geometry import Pose
from kinacc.kinematics import tables as model_tables
from kinacc.kinematics.dh import PARAMETERS
from kinacc.kinematics.model import JointState
from kinacc.kinematics.robot import Robot
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
            tables[name] = _Table.of(name, folder / f"{name}.parquet")
    refuse(problems, f"{folder} cannot be used")
    return tables


class _Table(dict[str, np.ndarray]):
    """Columns of a table of results; one that is asked for and is not there is a problem."""

    path: Path

    @classmethod
    def of(cls, name: str, path: Path) -> _Table:
        """The table of a file. InputError where it has no rows, or words in place of numbers."""
        from kinacc.tables import store

        table = cls(store.read(path))
        table.path = path
        contract = store.artefact_named(name)
        rows = len(next(iter(table.values()), ()))
        problems = [Problem(str(path), "has no rows", fix=store.remake(path))]
        problems = problems if not rows and not contract.may_be_empty else []
        for column in contract.for_joints(joint_count(contract, table)):
            values = table.get(column.name)
            if values is None or (column.kind == "text") == (values.dtype == object):
                continue
            kind, other = ("text", "numbers") if column.kind == "text" else ("numbers", "text")
            where = f"{path}, column {column.name}"
            problems.append(Problem(where, f"holds {other}", kind, store.remake(path)))
        refuse(problems)
        return table

    def __missing__(self, name: str) -> np.ndarray:
        from kinacc.tables import store

        raise InputError(
            Problem(str(self.path), f"has no column {name}", fix=store.remake(self.path))
        )


def recorded_robot(folder: Path | str) -> Robot | None:
    """The robot a results folder was made with; None where it does not say.

    Raises InputError where what it says cannot be read.
    """
    from kinacc.kinematics import robot

    path = Path(folder) / "robot.parquet"
    if not path.is_file():
        return None
    return robot.of_text(str(_Table.of("robot", path)["description"][0]), str(path))


def misfit_of(folder: Path | str, model: str) -> Misfit:
    """What the standard deviations of a model in a results folder are worth."""
    from kinacc.tables import store

    robot = recorded_robot(folder)
    if robot is None:
        return Misfit(model, np.nan, UNKNOWN)
    paths = {name: Path(folder) / f"{name}.parquet" for name in ("measurements", "model_selection")}
    return misfit(
        {name: store.read(at) for name, at in paths.items() if at.is_file()}, robot, model
    )


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
    frames = tables["frames"]
    of_model = np.asarray(frames["model"]) == choice
    number = _session_number(frames, of_model, session)
    anchored = made[choice].table is None and not _same_base(frames, choice, session)
    told = tables.get(f"{PLAINEST}_identified")
    return Calibration(
        name=name,
        robot=robot,
        choice=choice,
        model=made[choice],
        base=model_tables.frame(frames, choice, "base", session),
        base_name="base" if number == 0 else f"base{number + 1}",
        anchor=calibration(tables, robot, PLAINEST, name, session) if anchored else None,
        left_open=None if told is None else tuple(blind_words.listed(told)),
        targets={
            each: model_tables.frame(frames, choice, each) for each in targets_of(frames, choice)
        },
        known=uncertainty(tables, choice),
        residual=residual(tables, choice),
        fitted_range_rad=bounded.domain,
        fitted=_fitted(tables, robot),
        orientation_measured=_with_orientation(tables),
    )


def targets_of(frames: Mapping, model: str) -> list[str]:
    """Names of the targets that a model was fitted with, from the table ``frames``."""
    of_model = np.asarray(frames["model"]) == model
    return [str(each) for each in np.asarray(frames["frame"])[of_model] if each != "base"]


def _with_orientation(tables: Tables) -> frozenset[str]:
    """Targets of which any orientation was measured."""
    if "measurements" not in tables:
        return frozenset()
    turned = np.isfinite(np.asarray(tables["measurements"]["qw"], dtype=float))
    return frozenset(map(str, np.asarray(tables["measurements"]["target"])[turned]))


def _fitted(tables: Tables, robot: Robot) -> JointState | None:
    """How the arm stood at the readings that were fitted."""
    if "measurements" not in tables:
        return None
    fitted = np.asarray(tables["measurements"]["subset"]) == SUBSETS[0]
    return from_columns(tables["measurements"], robot).at.select(fitted)


def _same_base(frames: Mapping, choice: str, session: str | None) -> bool:
    """Whether a model has the very base of the DH model, so that neither was fitted with it."""
    bases = [model_tables.frame(frames, each, "base", session) for each in (PLAINEST, choice)]
    return all(np.array_equal(one, other) for one, other in zip(*bases, strict=True))


def _session_number(frames: Mapping, of_model: np.ndarray, session: str | None) -> int:
    """Place of a session among the bases of a model; InputError for one that is not there."""
    if session is None or "session" not in frames:
        return 0
    bases = of_model & (np.asarray(frames["frame"]) == "base")
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
    columns = tables.get("residuals")
    if columns is None:
        return None
    ours = np.asarray(columns["comparison"]) == f"{choice}_vs_measured"
    ours &= np.isnan(np.asarray(columns["fold"], dtype=float))
    for each in ("validation", "train") if subset is None else (subset,):
        rows = ours & (np.asarray(columns["subset"]) == each)
        of = {str(columns["quantity"][i]): float(columns["rms"][i]) for i in np.flatnonzero(rows)}
        if "position" in of:
            return Residual(of["position"], 1e-3 * of.get("orientation", np.nan), each)
    return None


def uncertainty(tables: Tables, choice: str) -> Uncertainty | None:
    """Covariance and undetermined directions of a fit; None where the tables lack them."""
    columns = tables.get(f"{choice}_covariance")
    if columns is None:
        return None
    names = list(dict.fromkeys(str(each) for each in columns["parameter"]))
    place = {name: number for number, name in enumerate(names)}
    row, column = (
        _places(columns[each], place, f"table {choice}_covariance")
        for each in ("parameter", "other")
    )
    covariance = np.zeros((len(names), len(names)))
    covariance[row, column] = covariance[column, row] = columns["covariance"]
    return Uncertainty(tuple(names), covariance, _undetermined(tables, choice, place))


def _undetermined(tables: Tables, choice: str, place: Mapping[str, int]) -> np.ndarray:
    fit = tables.get(f"{choice}_fit")
    if fit is None:
        return np.zeros((0, len(place)))
    rows = np.asarray(fit["quantity"]) == "undetermined_direction"
    numbers, direction = np.unique(fit["number"][rows], return_inverse=True)
    directions = np.zeros((len(numbers), len(place)))
    column = _places(fit["parameter"][rows], place, f"table {choice}_fit")
    directions[direction, column] = fit["value"][rows]
    return directions


def _places(names: np.ndarray, place: Mapping[str, int], table: str) -> np.ndarray:
    """Places (n,) of parameters; InputError where the covariance has none of a name."""
    unknown = sorted({str(each) for each in names if each not in place})
    what = f"has parameters without a variance: {first_few(unknown)}"
    refuse([Problem(table, what)] if unknown else [])
    return np.array([place[each] for each in names], dtype=int)


def require_same_robot(recorded: Robot, given: Robot, place: str) -> None:
    """InputError where a robot given is not the one results were made with.

    Limits and tool may differ: they are no part of what was fitted.
    """
    _require_same_arm(recorded.dh, given, place)
    differs = {
        "which joints slide": recorded.dh.prismatic != given.dh.prismatic,
        "joint_map or signs": np.abs(recorded.joint_map - given.joint_map) > _SAME,
        "base": ~_close(recorded.base, given.base),
        "flange": ~_close(recorded.flange, given.flange),
    }
    problems = [
        Problem(place, f"{given.name} differs from the recorded {recorded.name} in {what}")
        for what, there in differs.items()
        if np.any(there)
    ]
    refuse(problems, f"The results were made with another robot than {given.name}")


def _close(one: Pose, other: Pose) -> np.ndarray:
    pairs = zip(one, other, strict=True)
    return np.array([np.allclose(a, b, rtol=_SAME, atol=_SAME) for a, b in pairs])


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
