"""How well a model fits beside the noise: what the standard deviations of its parameters are worth.

A standard deviation by the covariance of a fit is valid given the model. Errors that the model
cannot follow, as those of eccentric gears, are shared by neighbouring poses, and the fit counts
them as independent noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from kinacc.calibration.noise import UNKNOWN, Noise, of_measurements
from kinacc.config.error_models import model_name
from kinacc.kinematics.robot import Robot
from kinacc.tables.columns import Columns

GIVEN = "valid given the model"


@dataclass(frozen=True)
class Misfit:
    """Error of a model at held-out poses beside the noise of one reading.

    Attributes
    ----------
    model : str
        Kind of the model.
    held_out_mm : float
        Root mean square of the position error per axis, NaN where nothing was held out.
    noise : Noise
        Of one reading, per axis.
    """

    model: str
    held_out_mm: float
    noise: Noise

    @property
    def ratio(self) -> float:
        """Held-out error over noise; NaN where one of the two is unknown."""
        noise_mm = self.noise.per_axis_mm
        return self.held_out_mm / noise_mm if noise_mm > 0.0 else math.nan

    def as_facts(self) -> dict[str, object]:
        """For JSON, unknown numbers null."""
        numbers = {
            "held_out_rms_per_axis_mm": self.held_out_mm,
            "noise_per_axis_mm": self.noise.per_axis_mm,
            "held_out_over_noise": self.ratio,
        }
        known = {name: value if math.isfinite(value) else None for name, value in numbers.items()}
        return {"valid": "given the model", **known, "noise_freedom": self.noise.freedom}


def misfit(tables: Mapping[str, Columns], robot: Robot, model: str) -> Misfit:
    """Misfit of one model.

    Parameters
    ----------
    tables : mapping
        Tables ``model_selection`` and ``measurements``; what is missing is unknown.
    robot : Robot
        The arm that was measured.
    model : str
        Kind of the model.

    Returns
    -------
    Misfit
        Held-out error and noise in mm, per axis.
    """
    return Misfit(model, _held_out_mm(tables, model), _noise_of(tables, robot))


def misfits(tables: Mapping[str, Columns], robot: Robot) -> list[Misfit]:
    """Misfit of every model of the table ``model_selection``.

    Parameters
    ----------
    tables, robot
        See ``misfit``.

    Returns
    -------
    list of Misfit
        In the order of the table.
    """
    noise = _noise_of(tables, robot)
    models = [str(model) for model in tables["model_selection"]["model"]]
    return [Misfit(model, _held_out_mm(tables, model), noise) for model in models]


def in_words(misfits: Sequence[Misfit]) -> str:
    """What standard deviations of models of one calibration are worth, in words.

    Parameters
    ----------
    misfits : sequence of Misfit
        One or more.

    Returns
    -------
    str
        Held-out error over noise of each model.
    """
    return f"{GIVEN}; {over_noise(misfits)}"


def over_noise(misfits: Sequence[Misfit]) -> str:
    """Held-out errors of models over the noise of their readings, in words."""
    noise = misfits[0].noise
    if not noise.per_axis_mm > 0.0:
        return "noise unknown (no configuration was read twice)"
    ratios = (
        f"{misfit.ratio:.3g}" if math.isfinite(misfit.ratio) else "unknown" for misfit in misfits
    )
    pairs = zip((model_name(misfit.model) for misfit in misfits), ratios, strict=True)
    listed = ", ".join(map(" ".join, pairs))
    return f"held-out error over noise ({noise.per_axis_mm:.3g} mm): {listed}"


def _held_out_mm(tables: Mapping[str, Columns], model: str) -> float:
    if "model_selection" not in tables:
        return math.nan
    table = tables["model_selection"]
    rms = dict(zip(map(str, table["model"]), table["held_out_rms_mm"], strict=True))
    return float(rms.get(model, math.nan)) / math.sqrt(3.0)


def _noise_of(tables: Mapping[str, Columns], robot: Robot) -> Noise:
    return of_measurements(tables["measurements"], robot) if "measurements" in tables else UNKNOWN
