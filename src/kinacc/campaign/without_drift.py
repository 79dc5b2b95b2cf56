"""Sizes of mean readings without the drift that the bounds of a campaign are corrected for."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from kinacc.assess.adaptive import Ledger
from kinacc.assess.reference_poses import awaited, correction, planned_readings
from kinacc.campaign.state import State


def sizes_mm(state: State) -> np.ndarray | None:
    """Sizes (m,) in the order of ``campaign_points``, NaN where unread; None where not corrected.

    Limits and bounds of such a campaign are on these, and not on what was read.
    """
    if not getattr(state.plan.assessor, "correct_drift", False):
        return None
    campaign: Any = state.campaign  # of an assessor that plans reference poses
    own, schedule = campaign.ledger, campaign.plan
    if awaited(schedule, own.taken):
        return None
    drift = correction(schedule, planned_readings(schedule, own))
    if drift is None:
        return None
    told = Ledger(own.candidates)
    for place, (row, reading, covariance) in enumerate(own.readings):
        told.record(row, np.array(reading) - schedule.time(place) * drift.slope_mm, covariance)
    sizes = np.full(len(state.rows) + len(state.left_out), math.nan)
    sizes[told.visited] = told.sizes_mm()
    return sizes
