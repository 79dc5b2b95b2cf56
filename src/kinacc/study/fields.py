"""Error fields: true errors of many poses, made up and measured.

A field holds the deterministic error of the model at each of many configurations. Simulated
campaigns draw their candidates from it at random.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kinacc.assess.world import checked_errors
from kinacc.config.error_models import PLAINEST, model_name
from kinacc.errors import input_error
from kinacc.study.operating_points import measured_errors, rows_of
from kinacc.tables.columns import Columns

POINTS = 1000
_DEFECT_SHARE = 0.02
# Standard deviation of an error per axis, mm, and how many times as large it is at the share of the
# poses with a defect: about those of simulated arms under a DH model (research/made_up_fields.py).
FAMILIES = {
    "smooth": (0.2, 1.0),  # errors that depend smoothly on single joints
    "workshop": (0.55, 1.0),  # gravity, gears, backlash and warming up as well
    "defect": (0.25, 2.5),  # a worn spot
}


@dataclass(frozen=True)
class ErrorField:
    """True errors ``error_mm`` (n, 3) of a model, robot base frame."""

    name: str
    error_mm: np.ndarray

    def __post_init__(self) -> None:
        checked_errors(self.error_mm)

    @property
    def points(self) -> int:
        """Number of configurations."""
        return len(self.error_mm)

    @cached_property
    def size_mm(self) -> np.ndarray:
        """Sizes of the errors (n,)."""
        return np.linalg.norm(self.error_mm, axis=1)


def of_measurements(
    name: str, errors: Columns, model: str = PLAINEST, target: str | None = None
) -> ErrorField:
    """Return held-out errors of a model at measured configurations, readings averaged.

    The errors include the noise of the instrument, which counts as truth here.

    Parameters
    ----------
    name : str
        Name of the field.
    errors : mapping
        Columns of the table ``pose_errors``.
    model : str
        Model whose errors are taken.
    target : str, optional
        Target, all of them by default.

    Returns
    -------
    ErrorField
        Errors in mm, robot base frame.

    Raises
    ------
    InputError
        Where no errors are held out.
    """
    wanted = rows_of(errors, model)[1]
    if target is not None:
        wanted &= np.asarray(errors["target"]).astype(str) == target
    if not wanted.any():
        message = f"pose_errors holds no held-out errors of the {model_name(model)} model"
        raise input_error(f"field {name}", message, fix="set measurements.folds")
    return ErrorField(name, measured_errors(errors, wanted)[1])


def made_up(name: str) -> ErrorField:
    """Return normal errors at 1000 poses: one of :data:`FAMILIES`, always the same.

    Candidates are drawn from a field at random: where in the space the errors lie does not matter.
    """
    std_mm, times = FAMILIES[name]
    error_mm = std_mm * np.random.default_rng(1).normal(size=(POINTS, 3))
    error_mm[: round(_DEFECT_SHARE * POINTS)] *= times
    return ErrorField(name, error_mm)
