"""Every assessor by its name: one line each, imported when it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import NamedTuple


class Entry(NamedTuple):
    """``module:Class`` of an assessor, and its interface (see :mod:`kinacc.assess.assessor`)."""

    place: str
    looks_back: bool = False


class Registry(Mapping[str, type]):
    """Classes by name; looking one up imports its module."""

    def __init__(self, entries: Mapping[str, Entry]) -> None:
        self._entries = dict(entries)

    def __getitem__(self, name: str) -> type:
        module, _, own = self._entries[name].place.partition(":")
        return getattr(import_module(module), own)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def places(self) -> dict[str, str]:
        """``module:Class`` by name."""
        return {name: each.place for name, each in self._entries.items()}

    def only(self, *, looks_back: bool) -> Registry:
        """Those of one interface."""
        kept = {name: each for name, each in self._entries.items() if each.looks_back == looks_back}
        return Registry(kept)


ASSESSORS = Registry(
    {
        "maximum": Entry("kinacc.assess.maximum:Maximum", looks_back=True),
        "outlier_rejection": Entry(
            "kinacc.assess.outlier_rejection:OutlierRejection", looks_back=True
        ),
        "model_invalidation": Entry(
            "kinacc.assess.model_invalidation:ModelInvalidation", looks_back=True
        ),
        "gamma_quantile": Entry("kinacc.assess.gamma_quantile:GammaQuantile"),
        "region_share": Entry("kinacc.assess.region_share:RegionShare"),
        "single_shot": Entry("kinacc.assess.single_shot:SingleShot"),
        "two_stage": Entry("kinacc.assess.two_stage:TwoStage"),
        "sequential": Entry("kinacc.assess.sequential:Sequential"),
        "model_invalidation_full": Entry("kinacc.assess.invalidation_full:ModelInvalidationFull"),
        "invalidation_calibrated": Entry(
            "kinacc.assess.invalidation_calibrated:InvalidationCalibrated"
        ),
        "kinematic": Entry("kinacc.assess.kinematic:Kinematic"),
        "search_and_confirm": Entry("kinacc.assess.search_and_confirm:SearchAndConfirm"),
    }
)
PLACES = ASSESSORS.places  # what code hashes go by
ADAPTIVE = ASSESSORS.only(looks_back=False)
RECOMMENDED = "search_and_confirm"
