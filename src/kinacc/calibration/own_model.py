"""Error models of one's own, registered from a notebook: one class and one line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np

from kinacc.calibration.fitting import Fit, ModelFit
from kinacc.calibration.models import Common, Estimator
from kinacc.calibration.observations import Observations
from kinacc.config import error_models
from kinacc.config.records import Settings
from kinacc.errors import input_error
from kinacc.kinematics.model import ErrorModel
from kinacc.kinematics.robot import Robot
from kinacc.tables.columns import Artefact, Column
from kinacc.tables.contract import ARTEFACTS


def register_error_model(model: type[ErrorModel]) -> type[ErrorModel]:
    """Fit models of a class of one's own beside DH and VEC, in this process.

    Fits, folds, residuals and the selection of a model go by it from then on: table
    ``<kind>_model`` (parameter, value, std, unit), ``<kind>_covariance``, ``<kind>_fit``,
    comparison ``<kind>_vs_measured``.

    Parameters
    ----------
    model
        A frozen dataclass that inherits :class:`kinacc.kinematics.model.ErrorModel`: ``model(dh)``
        is the arm before a fit, at DH parameters ``dh``. Where all of ``prior_std`` are finite,
        priors hold the fit; else directions that the data do not determine stay at ``start``.

    Returns
    -------
    type
        The class, so that this serves as a decorator.

    Raises
    ------
    InputError
        For a class that lacks parts of a model.
    """
    stated = getattr(model, "__dataclass_fields__", ())
    missing = [
        name
        for name in _NEEDED
        if name not in stated and getattr(model, name, None) is getattr(ErrorModel, name, None)
    ]
    if missing:
        allowed = "a dataclass that inherits ErrorModel"
        raise input_error(f"{model}", f"lacks {', '.join(missing)}", allowed)
    own = type(f"{model.__name__}Estimator", (OwnEstimator,), {"kind": model.kind, "model": model})
    error_models.register(model.kind, model, own)
    of_dh = ARTEFACTS["dh_covariance"]
    for table in (
        replace(of_dh, name=f"{model.kind}_covariance"),
        replace(ARTEFACTS["vec_frames"], name=f"{model.kind}_frames"),
        replace(ARTEFACTS["vec_fit"], name=f"{model.kind}_fit"),
        Artefact(f"{model.kind}_model", of_dh.topic, "Parameters.", _COLUMNS, ("parameter",)),
    ):
        ARTEFACTS[table.name] = table
    return model


class OwnEstimator(Estimator):
    """How models of a registered class are fitted: to the measurements."""

    model: ClassVar[Any]

    @classmethod
    def of(cls, calibration: Settings, arm: Robot, every: Observations) -> Self:
        """By the ``calibration`` settings."""
        return cls(Common.of(calibration, arm))

    def fit(self, observations: Observations, others: Mapping[str, Fit]) -> ModelFit:
        """The model closest to the measurements, whatever the units of its parameters.

        What of a parameter moves the poses by one mm, rms, counts as much as one mm of another.
        """
        nominal = self.model(self.common.arm.dh)
        moved = nominal.linearised(observations.at)[1]
        moved[:, 3:] *= self.common.rotation_weight_mm_per_rad
        size_mm = np.sqrt(np.mean(np.sum(moved**2, axis=1), axis=0))
        return self.common.fit(
            observations,
            nominal,
            free=np.ones(len(nominal.start), dtype=bool),
            std=nominal.prior_std,
            held=bool(np.isfinite(nominal.prior_std).all()),
            scale=np.divide(1.0, size_mm, out=np.ones_like(size_mm), where=size_mm > 0.0),
            threshold=THRESHOLD,
            name=f"{self.kind} fit",
        )


THRESHOLD = 0.01
_NEEDED = ("kind", "dh", "names", "units", "start", "prior_std", "with_parameters", "pose")
_COLUMNS = (
    Column("parameter", "text", "", "a parameter of the model"),
    Column("value", "float", "see unit", "its value"),
    Column("std", "float", "see unit", "its standard deviation", nullable=True),
    Column("unit", "text", "", "unit of value and standard deviation"),
)
