"""Every assessor by its name: one line each, imported when it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module

# These look back at a world (kinacc.assess.assessor).
LOOKING_BACK = {
    "maximum": "kinacc.assess.maximum:Maximum",
    "outlier_rejection": "kinacc.assess.outlier_rejection:OutlierRejection",
    "model_invalidation": "kinacc.assess.model_invalidation:ModelInvalidation",
}
# These choose as they go (kinacc.assess.adaptive).
CHOOSING = {
    "gamma_quantile": "kinacc.assess.gamma_quantile:GammaQuantile",
    "region_share": "kinacc.assess.region_share:RegionShare",
    "single_shot": "kinacc.assess.single_shot:SingleShot",
    "model_invalidation_full": "kinacc.assess.invalidation_full:ModelInvalidationFull",
    "invalidation_calibrated": "kinacc.assess.invalidation_calibrated:InvalidationCalibrated",
    "search_and_confirm": "kinacc.assess.search_and_confirm:SearchAndConfirm",
}
PLACES = LOOKING_BACK | CHOOSING
RECOMMENDED = "search_and_confirm"
IN_RESEARCH = ("two_stage", "sequential", "kinematic")  # no better anywhere, and not shipped


class Registry(Mapping[str, type]):
    """Classes by name; looking one up imports its module."""

    def __init__(self, places: Mapping[str, str]) -> None:
        self._places = places

    def __getitem__(self, name: str) -> type:
        module, _, own = self._places[name].partition(":")
        return getattr(import_module(module), own)

    def __contains__(self, name: object) -> bool:
        return name in self._places

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


ASSESSORS = Registry(PLACES)
ADAPTIVE = Registry(CHOOSING)
