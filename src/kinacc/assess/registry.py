"""Every assessor by its name: one line each."""

from __future__ import annotations

from kinacc.assess.maximum import Maximum
from kinacc.assess.model_invalidation import ModelInvalidation
from kinacc.assess.outlier_rejection import OutlierRejection
from kinacc.assess.region_share import RegionShare
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.single_shot import SingleShot
from kinacc.assess.world import Assessor

# These look back at a world (kinacc.assess.world).
PAPER: dict[str, type[Assessor]] = {
    each.name: each for each in (Maximum, OutlierRejection, ModelInvalidation)
}
# These choose as they go (kinacc.assess.adaptive).
ADAPTIVE: dict[str, type] = {
    each.name: each for each in (RegionShare, SingleShot, SearchAndConfirm)
}
ASSESSORS: dict[str, type] = PAPER | ADAPTIVE
RECOMMENDED = SearchAndConfirm.name
