"""A campaign on disk whose reference poses are read again by plan."""

import numpy as np
from campaign_on_disk import entry_of

from kinacc.campaign.state import Reading, restore

PLANNED = {"points": 30, "budget": 70, "references": 20}


def entries_of(plan, world, drift_mm=(0.0, 0.0, 0.0)):
    """The journal of a whole campaign whose frame drifts by so much."""
    rows = plan.visiting(frozenset())
    campaign, reads, entries = plan.assessor.begin(plan.candidates(rows)), {}, []
    while (row := campaign.next()) is not None:
        part = len(entries) / plan.assessor.measurements
        error = world.reading_mm(row, reads.get(row, 0)) + part * np.array(drift_mm)
        reads[row] = reads.get(row, 0) + 1
        campaign.record(row, error)
        point = int(rows[row])
        position = plan.points.modelled_mm[point] + error
        reading = Reading(point, position, plan.instruments[0].name)
        entries.append(entry_of([reading]))
    return entries


def test_all_that_is_certain_lists_planned_revisits_in_their_places(make_plan, make_world):
    plan = make_plan(**PLANNED)
    entries = entries_of(plan, make_world(plan))
    ahead = restore(plan, []).ahead()
    assert ahead[:10] == [*plan.route[:5], *plan.route[:5]]
    assert set(ahead) == set(plan.route)
    read = [entry["readings"][0]["point"] for entry in entries]
    assert read[: len(ahead)] == ahead
    for done in (3, 7, 25):
        assert restore(plan, entries[:done]).ahead() == ahead[done:]
