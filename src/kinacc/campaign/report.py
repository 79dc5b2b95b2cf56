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


def tables(opened: Opened) -> tuple[State, dict[str, Columns]]:
    """Return the state of a campaign, and its tables campaign_points, _readings and _bounds."""
    total = len(opened.state().told)
    pause = max(-(-total // _MOMENTS), 1)
    rows: list[tuple] = []

    def watch(campaign: Campaign, _) -> None:
        count = campaign.ledger.taken
        if count % pause == 0 or count == total:
            rows.extend(_bounds(opened, campaign))

    state = opened.state(watch)
    return state, {
        "campaign_points": _points(state),
        "campaign_readings": _readings(state),
        "campaign_bounds": columns_of("campaign_bounds", rows or _bounds(opened, state.campaign)),
    }


def _bounds(opened: Opened, campaign: Campaign) -> list[tuple]:
    taken, visited = campaign.ledger.taken, len(campaign.ledger.visited)
    return [
        (
            *(taken, visited, said.target, said.share, said.value_mm, said.lower_mm, said.upper_mm),
            *(said.excepted, said.confidence),
            *(reason(each) or None for each in (said.assumption, said.withheld)),
        )
        for said in sayable(opened.plan, campaign)
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
        "point": np.array([points.label[each] for each in order], dtype=object),
        "visit": np.where(np.arange(len(order)) < used, np.arange(len(order)) + 1.0, math.nan),
        **{f"q{i + 1}": each for i, each in enumerate(points.joints[order].T)},
        **{f"s{i + 1}": each for i, each in enumerate(directions[order].T)},
        **{f"{axis}_mm": points.modelled_mm[order, i] for i, axis in enumerate("xyz")},
        "readings": count,
        **dict(zip(names, values.T, strict=True)),
        "left_out": np.array([*[None] * used, *state.left_out.values()], dtype=object),
    }


def _readings(state: State) -> Columns:
    plan = state.plan
    used = {each.number: place for place, each in enumerate(state.told, start=1)}
    void = {each.number: why for each, why in state.struck}
    every = (*state.told, *state.in_hand, *(each for each, _ in state.struck))
    rows = [
        (
            each.number,
            plan.points.label[each.reading.point],
            used.get(each.number, math.nan),
            each.reading.instrument,
            plan.instrument(each.reading.instrument).frame,
            *each.reading.position_mm,
            *each.error_mm,
            float(np.linalg.norm(each.error_mm)),
            math.sqrt(float(np.trace(covariance_mm2(plan, each.reading))) / 3.0),
            void.get(each.number),
        )
        for each in sorted(every, key=lambda known: known.number)
    ]
    return columns_of("campaign_readings", rows)
