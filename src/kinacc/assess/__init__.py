"""Assessors of accuracy: each a small frozen record with ``assess(world)``, listed in ASSESSORS."""

from __future__ import annotations

from kinacc.assess.assessor import Assessment, Assessor, every_reading
from kinacc.assess.maximum import Maximum
from kinacc.assess.model_invalidation import ModelInvalidation
from kinacc.assess.outlier_rejection import OutlierRejection
from kinacc.assess.world import World, drawn_world, measured_world

ASSESSORS: dict[str, type[Assessor]] = {
    each.name: each for each in (Maximum, OutlierRejection, ModelInvalidation)
}

__all__ = [
    "ASSESSORS",
    "Assessment",
    "Assessor",
    "Maximum",
    "ModelInvalidation",
    "OutlierRejection",
    "World",
    "drawn_world",
    "every_reading",
    "measured_world",
]
