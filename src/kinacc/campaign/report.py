"""Tables of a campaign's report."""

from __future__ import annotations

import math

import numpy as np

from kinacc.assess.adaptive import Campaign
from kinacc.campaign.folder import Opened
from kinacc.campaign.state import State, covariance_mm2, sayable, unplanned_mm2
from kinacc.campaign.status import reason
from kinacc.tables.columns import Columns, Tables
from kinacc.tables.contract import columns_of

_MOMENTS = 150  # of a campaign at which bounds are stated, at most


def tables(opened: Opened) -> Tables:
    """Return the tables of a campaign.

    Parameters
    ----------
    opened : Opened
        The campaign as read.

    Returns
    -------
    dict
        Columns of campaign_points, campaign_readings and campaign_bounds, in mm.
    """
    plan, state = opened.plan, opened.state
    total = len(state.used)
    pause = max(-(-total // _MOMENTS), 1)
    rows: list[tuple[object, ...]] = []
    campaign = plan.assessor.begin(plan.candidates(state.rows))
    for count, item in enumerate(state.used, start=1):
        row = campaign.next()
        assert row is not None  # it requested this reading
        campaign.record(row, item.error_mm, unplanned_mm2(plan, item.reading))
        if count % pause == 0 or count == total:
            rows += _bounds(campaign)
    return {
        "campaign_points": _points(state),
        "campaign_readings": _readings(state),
        "campaign_bounds": columns_of("campaign_bounds", rows or _bounds(state.campaign)),
    }


def _bounds(campaign: Campaign) -> list[tuple[object, ...]]:
    taken, visited = campaign.ledger.taken, len(campaign.ledger.visited)
    return [
        (
            *(taken, visited, item.target, item.share, item.value_mm, item.lower_mm),
            *(item.upper_mm, item.excepted, item.confidence),
            *(reason(code) or None for code in (item.assumption, item.withheld)),
        )
        for item in sayable(campaign)
    ]


def _points(state: State) -> Columns:
    points, ledger, limits = state.plan.points, state.campaign.ledger, state.campaign.point_limits()
    travel = np.zeros(points.joints.shape) if points.directions is None else points.directions
    rows = []
    for row, point in enumerate([*state.rows.tolist(), *state.left_out]):
        is_used = point not in state.left_out
        count = ledger.count.item(row) if is_used else 0
        error_mm = ledger.mean_mm[row] if count else np.full(3, math.nan)
        lower_mm, upper_mm = limits.get(row, (None, None))
        rows.append(
            {
                "point": points.label[point],
                "visit": row + 1 if is_used else None,
                **{f"q{joint}": value for joint, value in enumerate(points.joints[point], 1)},
                **{f"s{joint}": value for joint, value in enumerate(travel[point], 1)},
                **dict(zip(("x_mm", "y_mm", "z_mm"), points.modelled_mm[point], strict=True)),
                "readings": count,
                **dict(zip(("ex_mm", "ey_mm", "ez_mm"), error_mm, strict=True)),
                "error_mm": np.linalg.norm(error_mm),
                "noise_mm": ledger.noise_mm[row] if count else None,
                "lower_mm": lower_mm,
                "upper_mm": upper_mm,
                "left_out": state.left_out.get(point),
            }
        )
    return columns_of("campaign_points", rows)


def _readings(state: State) -> Columns:
    plan = state.plan
    used = {item.number: place for place, item in enumerate(state.used, start=1)}
    rows = [
        (
            item.number,
            plan.points.label[item.reading.point],
            used.get(item.number, math.nan),
            item.reading.instrument,
            plan.instrument(item.reading.instrument).frame,
            *item.reading.position_mm,
            *item.error_mm,
            float(np.linalg.norm(item.error_mm)),
            math.sqrt(float(np.trace(covariance_mm2(plan, item.reading))) / 3.0),
            item.struck,
        )
        for item in state.taken
    ]
    return columns_of("campaign_readings", rows)
