"""A campaign on disk whose reference poses are read again by plan."""

from campaign_on_disk import entry_of, readings_of, world_of

from kinacc.campaign.state import restore

PLANNED = {"points": 30, "budget": 70, "references": 20}


def test_all_that_is_certain_lists_planned_revisits_in_their_places(make_plan):
    plan = make_plan(**PLANNED)
    entries = [entry_of([reading]) for reading in readings_of(plan, world_of(plan).reading_mm)]
    ahead = restore(plan, []).ahead()
    assert ahead[:10] == [*plan.route[:5], *plan.route[:5]]
    assert set(ahead) == set(plan.route)
    read = [entry["readings"][0]["point"] for entry in entries]
    assert read[: len(ahead)] == ahead
    for done in (3, 7, 25):
        assert restore(plan, entries[:done]).ahead() == ahead[done:]
