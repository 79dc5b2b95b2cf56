"""Error models and frames from their tables."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.config.error_models import MODELS, NOMINAL, OWN, loaded
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, rotation_from_quaternion
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.model import ErrorModel
from kinacc.tables.columns import Columns

_ROUNDING = 1e-9


def models(tables: Mapping[str, Columns], nominal: DHModel) -> dict[str, ErrorModel]:
    """Every model of an arm by name: those of tables ``<kind>_model``, and its ``nominal`` one.

    Raises InputError where a table lacks rows of a model, or has some twice.
    """
    made: dict[str, ErrorModel] = {}
    for kind in MODELS:
        if f"{kind}_model" not in tables:
            continue
        if kind in OWN:
            value = np.asarray(tables[f"{kind}_model"]["value"], dtype=float)
            made[kind] = OWN[kind](nominal).with_parameters(value)
            continue
        try:
            made[kind] = of_kind(kind).from_columns(tables[f"{kind}_model"], nominal.prismatic)
        except (LookupError, TypeError, ValueError) as error:
            what = f"holds no whole model: {error}"
            raise InputError(Problem(f"table {kind}_model", what)) from None
    return {**made, NOMINAL: nominal}


def of_kind(kind: str) -> type[ErrorModel]:
    """The class of models of one kind."""
    return loaded(MODELS[kind])


def frame(columns: Columns, model: str, name: str, session: str | None = None) -> Pose:
    """One frame of a ``frames`` table: ``base``, ``tool`` or a target of ``model``.

    ``session`` chooses among the bases of several sessions; without it the first is taken.
    Raises InputError naming the frames there are.
    """
    models, names = np.asarray(columns["model"]), np.asarray(columns["frame"])
    chosen = (models == model) & (names == name)
    if session is not None:
        chosen &= np.asarray(columns["session"]) == session
    rows = np.flatnonzero(chosen)
    if len(rows) == 0:
        known = ", ".join(str(other) for other in names[models == model]) or "none"
        raise InputError(Problem("table frames", f"has no frame {name!r} of model {model}", known))
    row = rows[0]
    parts = ("qw", "qx", "qy", "qz", "x_mm", "y_mm", "z_mm")
    values = np.array([columns[part][row] for part in parts], dtype=float)
    return Pose(rotation_from_quaternion(values[:4]), values[4:])


def fitted_tool(columns: Columns | None, model: str, own: Pose) -> Pose | None:
    """The tool a ``frames`` table has for ``model``; None where it is the arm's ``own``, or none.

    A tool that was not estimated stands in the table as the arm's own.
    """
    if columns is None or not (np.asarray(columns["frame"]) == "tool").any():
        return None
    tool = frame(columns, model, "tool")
    apart = max(np.abs(a - b).max() for a, b in zip(tool, own, strict=True))
    return tool if apart > _ROUNDING else None
