"""The acceptance rule: an arm is like the paper's when Tables I to III and the 0.906 mm are met.

Judged by the claims on the paper's numbers, on tables made by the stages of the workflow. Nothing
else of the paper is looked at.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from kinacc.config.error_models import ALWAYS
from kinacc.study import in_memory
from kinacc.study.claims.claim import Claim, number_claims, number_values

# Numbers may differ in the last digits between machines: accepted arms keep off the edge.
SHARE_OF_TOLERANCE = 0.97
STAGES = (*ALWAYS, "residuals", "assessment_points")


def judged() -> list[Claim]:
    """The claims an arm is accepted by: those on numbers that have a tolerance."""
    return [claim for claim in number_claims() if not math.isnan(claim.tolerance)]


def numbers(config: Mapping, measurements: Mapping) -> dict[str, float]:
    """Reproduced number of every judged claim, by claim id, for ``measurements`` columns."""
    start = {"measurements": in_memory.without_folds(measurements)}
    values = number_values(in_memory.run(STAGES, config, start))
    return {claim.id: values[claim.id] for claim in judged()}


def excess(found: Mapping[str, float]) -> dict[str, float]:
    """Difference from the paper over the tolerance, by claim id."""
    return {claim.id: (found[claim.id] - claim.paper) / claim.tolerance for claim in judged()}


def accepted(found: Mapping[str, float]) -> bool:
    """Whether every number is within its tolerance, with a small margin."""
    return all(abs(value) <= SHARE_OF_TOLERANCE for value in excess(found).values())
