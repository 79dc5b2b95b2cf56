"""Every assessor that states what it knows: one line each.

Apart from :data:`kinacc.assess.ASSESSORS`, the paper's three, so that the study of the paper does
not depend on what is added here.
"""

from __future__ import annotations

from kinacc.assess.adaptive import AdaptiveAssessor
from kinacc.assess.gamma_quantile import GammaQuantile
from kinacc.assess.invalidation_calibrated import InvalidationCalibrated
from kinacc.assess.invalidation_full import ModelInvalidationFull
from kinacc.assess.kinematic import Kinematic
from kinacc.assess.region_share import RegionShare
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.sequential import Sequential
from kinacc.assess.single_shot import SingleShot
from kinacc.assess.two_stage import TwoStage

ADAPTIVE: dict[str, type[AdaptiveAssessor]] = {
    each.name: each
    for each in (
        GammaQuantile,
        RegionShare,
        SingleShot,
        TwoStage,
        Sequential,
        ModelInvalidationFull,
        InvalidationCalibrated,
        Kinematic,
        SearchAndConfirm,
    )
}
RECOMMENDED = SearchAndConfirm.name
