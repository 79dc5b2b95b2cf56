"""A calibration from the tables of a results folder and the robot they were made with."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from kinacc.calibration import identifiability
from kinacc.calibration.misfit import misfit
from kinacc.calibration.observations import from_columns
from kinacc.calibration.summary import selected
from kinacc.calibration.uncertainty import Uncertainty
from kinacc.config.error_models import ALWAYS, ERROR_MODELS, PLAINEST
from kinacc.deployment.record import MODELS, Calibration, Residual
from kinacc.errors import Problem, gathered, input_error, refuse
from kinacc.kinematics import robot as robots
from kinacc.kinematics import tables as model_tables
from kinacc.kinematics.robot import Robot
from kinacc.tables import store
from kinacc.tables.allowed import SUBSETS
from kinacc.tables.columns import Tables

NEEDED = (*(f"{kind}_model" for kind in ALWAYS), "frames", "robot")
# Used where they are there, beside those of every kind of model.
_WANTED = ("measurements", "dh_identified", "residuals", "model_selection")
_SAME = 1e-9


def read_tables(
    folder: Path | str,
    *more: str,
    needed: Sequence[str] = NEEDED,
    optional: Sequence[str] | None = None,
) -> Tables:
    """The tables of a data set's results folder: columns (rows,) by table and name.

    Parameters
    ----------
    folder
        Results folder. Units stand in the names of its columns (_mm, _rad).
    needed
        Tables without which it holds no calibration.
    more, optional
        Tables that are read where they are there.

    Raises
    ------
    InputError
        Naming all ``needed`` tables that are missing, and damaged ones.
    """
    folder = Path(folder)
    if optional is None:
        parts = ("model", "fit", "covariance")
        optional = (*(f"{kind}_{part}" for kind in ERROR_MODELS for part in parts), *_WANTED)
    paths = {name: folder / f"{name}.parquet" for name in (*needed, *optional, *more)}
    missing = [name for name in needed if not paths[name].is_file()]
    if len(missing) == len(needed):
        message = "holds no calibration" if folder.is_dir() else "no such folder"
        raise input_error(str(folder), message, fix="kinacc calibrate FILE.yaml makes one")
    problems: list[Problem] = []
    if missing:
        message = f"the calibration is not finished: no {', '.join(missing)}"
        problems = [Problem(str(folder), message, fix="kinacc calibrate FILE.yaml finishes it")]
    tables = {}
    for name, path in paths.items():
        with gathered(problems):
            if path.is_file():
                tables[name] = store.read(path)
    refuse(problems)
    return tables


def robot_of(tables: Tables) -> Robot:
    """The robot that the table ``robot`` describes; InputError where it describes none."""
    described = [*tables["robot"].get("description", ())]
    if not described or not isinstance(described[0], str):
        raise input_error("robot.parquet", "has no description", fix="run kinacc calibrate")
    return robots.of_text(described[0], "robot.parquet")


def calibration(
    tables: Tables,
    model: str | None = None,
    name: str = "",
    session: str | None = None,
) -> Calibration:
    """The calibration in the tables of a results folder.

    Parameters
    ----------
    tables
        As of ``read_tables``.
    model
        Kind of the model; the selected one where not given.
    name
        Name of the data set.
    session
        Session whose base is meant; the first where not given.

    Raises
    ------
    InputError
        For another model or session, and where the tables cannot be used.
    """
    try:
        return _calibration(tables, model, name, session)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        message = f"tables cannot be used: {error}"
        raise input_error(f"results {name}", message, fix="run kinacc calibrate") from None


def _calibration(tables: Tables, model: str | None, name: str, session: str | None) -> Calibration:
    robot = robot_of(tables)
    choice = selected_model(tables) if model is None else model
    created = model_tables.models(tables, robot.dh)
    if choice not in created:
        message = f"{choice!r} is none of these results"
        raise input_error("model", message, ", ".join(created))
    bounded = next(item for item in created.values() if item.domain is not None)
    frames, identified = tables["frames"], tables.get(f"{PLAINEST}_identified")
    of_model = pd.DataFrame(dict(frames)).set_index("frame")
    of_model = of_model[of_model["model"] == choice]
    number = _session_number(of_model, session)
    bases = [model_tables.frame(frames, kind, "base", session) for kind in (PLAINEST, choice)]
    # A model with the base of the DH model: neither was fitted with it.
    same_base = all(np.array_equal(first, two) for first, two in zip(*bases, strict=True))
    anchored = created[choice].table is None and not same_base
    fitted, turned = None, frozenset[str]()
    if "measurements" in tables:
        measured = from_columns(tables["measurements"], robot)
        fitted = measured.at.select(np.asarray(tables["measurements"]["subset"]) == SUBSETS[0])
        if not len(fitted):
            raise ValueError("measurements without fitted rows")
        known = np.unique(measured.target[measured.has_rotation])
        turned = frozenset(measured.target_names[target] for target in known)
    return Calibration(
        name=name,
        robot=robot,
        choice=choice,
        model=created[choice],
        base=bases[1],
        base_name="base" if number == 0 else f"base{number + 1}",
        anchor=_calibration(tables, PLAINEST, name, session) if anchored else None,
        left_open=None if identified is None else tuple(identifiability.listed(identified)),
        targets={
            target: model_tables.frame(frames, choice, target)
            for target in of_model.index.drop("base")
        },
        known=uncertainty(tables, choice),
        residual=_residual(tables, choice),
        fitted_range_rad=bounded.domain,
        fitted=fitted,
        orientation_measured=turned,
        misfit=misfit(tables, robot, choice),
    )


def _session_number(frames: pd.DataFrame, session: str | None) -> int:
    """Place of a session among the bases of a model; InputError for one that is not there."""
    if session is None or "session" not in frames:
        return 0
    known = [*frames.loc[["base"], "session"].dropna()]
    if session not in known:
        allowed = ", ".join(known) or "none: the data name no sessions"
        raise input_error("session", f"{session!r} is not there", allowed)
    return known.index(session)


def selected_model(tables: Tables) -> str:
    """The model that ``model_selection`` selected; InputError without that table."""
    if "model_selection" not in tables:
        message, fix = "was not selected", "run kinacc calibrate, or give --model"
        raise input_error("model", message, ", ".join(MODELS), fix)
    return selected(tables["model_selection"])


def _residual(tables: Tables, choice: str) -> Residual | None:
    """Rms of ``<choice>_vs_measured``: of held-out rows, or of training rows where there are none.

    None where the table does not say.
    """
    names = ["comparison", "subset", "quantity", "fold", "rms"]
    table = pd.DataFrame(dict(tables.get("residuals", {})), columns=names)
    pooled = table[(table["comparison"] == f"{choice}_vs_measured") & table["fold"].isna()]
    for item in reversed(SUBSETS):
        rms = pooled[pooled["subset"] == item].set_index("quantity")["rms"]
        if "position" in rms:
            turn = float(rms.get("orientation", np.nan))
            return Residual(float(rms["position"]), 1e-3 * turn, item)
    return None


def uncertainty(tables: Tables, choice: str) -> Uncertainty | None:
    """Covariance and undetermined directions of a fit; None where the tables lack them."""
    if f"{choice}_covariance" not in tables:
        return None
    table = pd.DataFrame(dict(tables[f"{choice}_covariance"]))
    parameters = table["parameter"].unique()
    half = table.pivot(index="parameter", columns="other", values="covariance")
    half = half.reindex(index=parameters, columns=parameters).to_numpy()
    covariance = np.nan_to_num(np.where(np.isnan(half), half.T, half))
    names = ["quantity", "number", "parameter", "value"]
    fit = pd.DataFrame(dict(tables.get(f"{choice}_fit", {})), columns=names)
    fit = fit[fit["quantity"] == "undetermined_direction"]
    directions = fit.pivot(index="number", columns="parameter", values="value")
    directions = directions.reindex(columns=parameters).fillna(0.0).to_numpy(float)
    return Uncertainty(tuple(map(str, parameters)), covariance, directions)


def require_same_robot(recorded: Robot, robot: Robot, place: str) -> None:
    """InputError where a robot given is not the one results were made with.

    Limits and tool may differ: they are no part of what was fitted.
    """
    pairs = list(zip(_fitted_on(recorded), _fitted_on(robot), strict=True))
    same_shape = recorded.dh.joints == robot.dh.joints
    if not (same_shape and all(np.allclose(*pair, rtol=_SAME, atol=_SAME) for pair in pairs)):
        message = f"was made with another robot than {robot.name}"
        raise input_error(place, message, fix="give readings of its robot")


def _fitted_on(robot: Robot) -> list[np.ndarray]:
    """The parts of a robot that a fit takes as they are."""
    return [robot.dh.start, robot.dh.prismatic, robot.joint_map, *robot.base, *robot.flange]
