"""Tables of a campaign's report."""

from __future__ import annotations

import math

import numpy as np

from kinacc.assess.adaptive import Campaign
from kinacc.campaign.folder import Opened
from kinacc.campaign.state import State, covariance_mm2, sayable
from kinacc.campaign.status import reason
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

_MOMENTS = 150  # of a campaign at which bounds are stated, at most


def tables(opened: Opened) -> dict[str, Columns]:
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
    total = len(opened.state.used)
    pause = max(-(-total // _MOMENTS), 1)
    rows: list[tuple[object, ...]] = []

    def watch(campaign: Campaign) -> None:
        count = campaign.ledger.taken
        if count % pause == 0 or count == total:
            rows.extend(_bounds(opened, campaign))

    opened.watched(watch)
    state = opened.state
    return {
        "campaign_points": _points(state),
        "campaign_readings": _readings(state),
        "campaign_bounds": columns_of("campaign_bounds", rows or _bounds(opened, state.campaign)),
    }


def _bounds(opened: Opened, campaign: Campaign) -> list[tuple[object, ...]]:
    taken, visited = campaign.ledger.taken, len(campaign.ledger.visited)
    return [
        (
            *(taken, visited, item.target, item.share, item.value_mm, item.lower_mm),
            *(item.upper_mm, item.excepted, item.confidence),
            *(reason(code) or None for code in (item.assumption, item.withheld)),
        )
        for item in sayable(opened.plan, campaign)
    ]


def _points(state: State) -> Columns:
    points, ledger, used = state.plan.points, state.campaign.ledger, len(state.rows)
    order = np.array([*state.rows, *state.left_out], dtype=int)
    values = np.full((len(order), 7), math.nan)  # error x, y, z, size; noise; limits
    read = np.flatnonzero(ledger.count)
    values[read, :3], values[read, 4] = ledger.mean_mm[read], ledger.noise_mm[read]
    values[:, 3] = np.linalg.norm(values[:, :3], axis=1)
    for row, limits in state.campaign.point_limits().items():
        values[row, 5:] = limits
    directions = points.directions
    if directions is None:
        directions = np.zeros(points.joints.shape, np.int8)
    count = np.zeros(len(order), dtype=int)
    count[:used] = ledger.count
    names = ("ex_mm", "ey_mm", "ez_mm", "error_mm", "noise_mm", "lower_mm", "upper_mm")
    return {
        "point": np.array([points.label[column] for column in order], dtype=object),
        "visit": np.where(np.arange(len(order)) < used, np.arange(len(order)) + 1.0, math.nan),
        **{f"q{i + 1}": column for i, column in enumerate(points.joints[order].T)},
        **{f"s{i + 1}": column for i, column in enumerate(directions[order].T)},
        **{f"{axis}_mm": points.modelled_mm[order, i] for i, axis in enumerate("xyz")},
        "readings": count,
        **dict(zip(names, values.T, strict=True)),
        "left_out": np.array([*[None] * used, *state.left_out.values()], dtype=object),
    }


def _readings(state: State) -> Columns:
    plan = state.plan
    used = {item.number: place for place, item in enumerate(state.used, start=1)}
    void = {item.number: why for item, why in state.struck}
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
            void.get(item.number),
        )
        for item in state.taken
    ]
    return columns_of("campaign_readings", rows)
