"""The one list of error models: where each kind is written, and what it is compared with.

A kind names its tables (``<kind>_model``, ``<kind>_covariance``), its stage and its section of the
calibration settings. Modules are named, not imported: a data set depends on the kinds it has.
"""

from __future__ import annotations

from collections.abc import Collection
from importlib import import_module
from typing import Any, NamedTuple

from kinacc.config.records import Settings

MEASURED, NOMINAL = "measured", "nominal"  # nominal: the maker's, which nothing was fitted for


class Kind(NamedTuple):
    """``module:Class`` of model and estimator, or these themselves; the references of its errors.

    ``asked_by`` is the key of ``calibration.<kind>`` that has to say something for a data set to
    have such a model; empty where every data set has one.
    """

    model: Any
    estimator: Any
    compared_with: tuple[str, ...] = (MEASURED,)
    asked_by: str = ""


# The plainest first: others have to be worth it. They are fitted from the last to the first, so
# that a plainer one may follow those after it.
ERROR_MODELS = {
    "dh": Kind(
        "kinacc.kinematics.dh:DHModel",
        "kinacc.calibration.dh_estimator:DHEstimator",
        ("vec", MEASURED),
    ),
    "compliance": Kind(
        "kinacc.kinematics.compliance:ComplianceModel",
        "kinacc.calibration.compliance_fit:ComplianceEstimator",
        asked_by="joints",
    ),
    "vec": Kind(
        "kinacc.kinematics.vec:VECModel",
        "kinacc.calibration.vec_estimator:VECEstimator",
    ),
}
PLAINEST = next(iter(ERROR_MODELS))
FITTED = tuple(reversed(ERROR_MODELS))  # in this order
ALWAYS = tuple(kind for kind in FITTED if not ERROR_MODELS[kind].asked_by)


class Comparison(NamedTuple):
    """Whose error is meant: that of ``reference``, a model or the measurement, minus ``model``."""

    reference: str
    model: str

    @property
    def name(self) -> str:
        """As artefacts name it."""
        return f"{self.model}_vs_{self.reference}"


COMPARISONS = (
    *(Comparison(of, kind) for kind in FITTED for of in ERROR_MODELS[kind].compared_with),
    Comparison(MEASURED, NOMINAL),
)
OWN: dict[str, type] = {}  # registered in this process, by kind


def register(kind: str, model: type, estimator: type) -> None:
    """Fit a ``model`` of one's own in this process as those of the list are."""
    OWN[kind] = model
    ERROR_MODELS[kind] = Kind(model, estimator)


def comparisons(models: Collection[str]) -> tuple[Comparison, ...]:
    """What is compared with what where there are these ``models``, in the order of the tables."""
    there = {*models, MEASURED}
    subset = tuple(Comparison(MEASURED, kind) for kind in OWN)
    return tuple(item for item in (*subset, *COMPARISONS) if there >= set(item))


def model_name(model: str) -> str:
    """A model as people write it: DH, VEC."""
    return model if len(model) > 3 else model.upper()


def loaded(place: Any) -> Any:
    """The object at ``module:name``; what is no text is the object itself."""
    if not isinstance(place, str):
        return place
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def asked_for(calibration: Settings) -> tuple[str, ...]:
    """Kinds of models that the ``calibration`` settings ask for, in the order they are fitted."""
    return *OWN, *(
        kind
        for kind in FITTED
        if kind in calibration
        and (kind in ALWAYS or calibration[kind][ERROR_MODELS[kind].asked_by])
    )
