"""Error models and frames from their tables."""

from __future__ import annotations

import numpy as np

from kinacc.config.error_models import ERROR_MODELS, NOMINAL, loaded
from kinacc.errors import input_error
from kinacc.geometry import Pose, rotation_from_quaternion
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.model import ErrorModel
from kinacc.tables.columns import Columns, Tables

_ROUNDING = 1e-9
_FRAME = ("qw", "qx", "qy", "qz"), ("x_mm", "y_mm", "z_mm")


def models(tables: Tables, nominal: DHModel) -> dict[str, ErrorModel]:
    """Read every error model of an arm.

    Parameters
    ----------
    tables : mapping of Columns
        Tables by name; those named ``<kind>_model`` are read.
    nominal : DHModel
        Nominal arm.

    Returns
    -------
    dict of ErrorModel
        Models by name, the nominal one last.

    Raises
    ------
    InputError
        For a table that lacks rows of a model, or has some twice.
    """
    models: dict[str, ErrorModel] = {}
    for kind in ERROR_MODELS:
        if f"{kind}_model" not in tables:
            continue
        try:
            models[kind] = of_kind(kind).from_columns(tables[f"{kind}_model"], nominal)
        except (LookupError, TypeError, ValueError) as error:
            what = f"holds no whole model: {error}"
            raise input_error(f"table {kind}_model", what) from None
    return {**models, NOMINAL: nominal}


def of_kind(kind: str) -> type[ErrorModel]:
    """Class of the models of a kind, such as ``dh`` or ``vec``."""
    return loaded(ERROR_MODELS[kind].model)


def frame(columns: Columns, model: str, name: str, session: str | None = None) -> Pose:
    """Read one frame of a ``frames`` table.

    Parameters
    ----------
    columns : Columns
        The table.
    model : str
        Name of the model.
    name : str
        ``base``, ``tool`` or the name of a target.
    session : str, optional
        Session of the base; the first one when not given.

    Returns
    -------
    Pose
        Pose (3, 3), (3,) of the frame, mm: the robot base in the instrument frame, tools and
        targets in the last DH frame.

    Raises
    ------
    InputError
        For a frame that the table lacks; the message lists those it has.
    """
    frames, of_model = np.asarray(columns["frame"]), np.asarray(columns["model"]) == model
    rows = of_model & (frames == name)
    if session is not None:
        rows &= np.asarray(columns["session"]) == session
    if not rows.any():
        known = ", ".join(frames[of_model]) or "none"
        raise input_error("table frames", f"has no frame {name!r} of model {model}", known)
    first = np.argmax(rows)
    quaternion, place = ([float(columns[each][first]) for each in names] for names in _FRAME)
    return Pose(rotation_from_quaternion(np.array(quaternion)), np.array(place))


def fitted_tool(columns: Columns | None, model: str, own: Pose) -> Pose | None:
    """Read the tool that was estimated with a model.

    Parameters
    ----------
    columns : Columns or None
        A ``frames`` table.
    model : str
        Name of the model.
    own : Pose
        Tool of the robot description in the last DH frame, mm.

    Returns
    -------
    Pose or None
        The tool in the last DH frame, mm; None where the table has none or only ``own``, which it
        holds where no tool was estimated.

    Raises
    ------
    InputError
        For a table with tools but none of ``model``.
    """
    if columns is None or not (np.asarray(columns["frame"]) == "tool").any():
        return None
    tool = frame(columns, model, "tool")
    apart = max(np.abs(a - b).max() for a, b in zip(tool, own, strict=True))
    return tool if apart > _ROUNDING else None
