"""How well a model fits beside the noise: what the standard deviations of its parameters are worth.

A standard deviation by the covariance of a fit is valid given the model. Errors that the model
cannot follow, as those of eccentric gears, are shared by neighbouring poses, and the fit counts
them as independent noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from kinacc.calibration.noise import UNKNOWN, Noise, of_measurements
from kinacc.config.error_models import model_name
from kinacc.kinematics.robot import Robot
from kinacc.tables.columns import Tables

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


def misfit(tables: Tables, robot: Robot, model: str) -> Misfit:
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
    noise = of_measurements(tables["measurements"], robot) if "measurements" in tables else UNKNOWN
    table = pd.DataFrame(tables.get("model_selection", {"model": [], "held_out_rms_mm": []}))
    rms_mm = table.set_index("model")["held_out_rms_mm"].get(model, math.nan)
    return Misfit(model, float(rms_mm) / math.sqrt(3.0), noise)


def misfits(tables: Tables, robot: Robot) -> list[Misfit]:
    """Misfit of every model of the table ``model_selection``, in its order; see ``misfit``."""
    return [misfit(tables, robot, str(model)) for model in tables["model_selection"]["model"]]


def in_words(misfits: Sequence[Misfit]) -> str:
    """What standard deviations of one or more models of one calibration are worth, in words."""
    noise_mm, ratios = misfits[0].noise.per_axis_mm, []
    if not noise_mm > 0.0:
        return f"{GIVEN}; noise unknown (no configuration was read twice)"
    for item in misfits:
        ratio = f"{item.ratio:.3g}" if math.isfinite(item.ratio) else "unknown"
        ratios.append(f"{model_name(item.model)} {ratio}")
    return f"{GIVEN}; held-out error over noise ({noise_mm:.3g} mm): {', '.join(ratios)}"
