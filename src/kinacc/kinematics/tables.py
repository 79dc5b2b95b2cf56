"""Models from the columns of their tables (``vec_model``, ``dh_model``, ``frames``)."""

from __future__ import annotations

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, rotation_from_quaternion
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.vec import ERRORS, VECModel

_ROUNDING = 1e-9


def dh_model(columns: Columns, prismatic: np.ndarray | None = None) -> DHModel:
    """DH model of a ``dh_model`` table; ``prismatic`` (k,) is the robot's to say."""
    order = np.argsort(columns["joint"], kind="stable")
    values = (np.asarray(columns[name], dtype=float)[order] for name in PARAMETERS)
    return DHModel(*values, prismatic)


def vec_model(columns: Columns, prismatic: np.ndarray | None = None) -> VECModel:
    """VEC model of a ``vec_model`` table; coefficients it does not list are zero.

    ``prismatic`` (k,): joints that slide, which is the robot's to say.
    """
    joint = np.asarray(columns["joint"]).astype(int) - 1
    order = np.asarray(columns["order"]).astype(int)
    direction = np.asarray(columns["direction"]).astype(int)
    error = np.array([ERRORS.index(name) for name in columns["error"]])
    value = np.asarray(columns["coefficient"], dtype=float)
    joints = joint.max() + 1
    first = [np.flatnonzero(joint == number)[0] for number in range(joints)]

    def per_joint(name: str) -> np.ndarray:
        return np.asarray(columns[name], dtype=float)[first]

    both = direction == 0
    coefficients = np.zeros((joints, len(ERRORS), order.max() + 1))
    coefficients[joint[both], error[both], order[both]] = value[both]
    offsets = np.zeros((joints, 2))
    offsets[joint[~both], (direction[~both] + 1) // 2] = value[~both]
    return VECModel(
        DHModel(*(per_joint(name) for name in PARAMETERS), prismatic),
        per_joint("q_min_rad"),
        per_joint("q_max_rad"),
        coefficients,
        offsets,
    )


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
    quaternion = np.array([columns[part][row] for part in ("qw", "qx", "qy", "qz")], dtype=float)
    position = np.array([columns[part][row] for part in ("x_mm", "y_mm", "z_mm")], dtype=float)
    return Pose(rotation_from_quaternion(quaternion), position)


def fitted_tool(columns: Columns | None, model: str, own: Pose) -> Pose | None:
    """The tool a ``frames`` table has for ``model``; None where it is the arm's ``own``, or none.

    A tool that was not estimated stands in the table as the arm's own.
    """
    if columns is None or not (np.asarray(columns["frame"]) == "tool").any():
        return None
    tool = frame(columns, model, "tool")
    apart = max(np.abs(a - b).max() for a, b in zip(tool, own, strict=True))
    return tool if apart > _ROUNDING else None
