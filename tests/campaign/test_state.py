"""Telling an assessor its readings again: same answers as in memory, whatever order they came in"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from campaign_on_disk import entry_of, make_plan, readings_of, world_of
from command_line import call
from scipy.stats import chi2

from kinacc.assess.registry import ADAPTIVE
from kinacc.assess.world import conduct
from kinacc.campaign import folder
from kinacc.campaign.plan import from_json, to_json
from kinacc.campaign.state import Reading, Readings, most_plausible_mm, restore, size_scatter


def entries_of(plan, world, left_out=frozenset(), limit=None):
    """The journal of a campaign, one reading at a time."""
    readings = readings_of(plan, world.reading_mm, left_out, limit)
    return [entry_of([reading]) for reading in readings]


def assert_same(said, wanted):
    assert [each.target for each in said] == [each.target for each in wanted]
    for mine, theirs in zip(said, wanted, strict=True):
        assert mine.withheld == theirs.withheld
        assert mine.assumption == theirs.assumption
        for name in ("value_mm", "lower_mm", "upper_mm", "confidence"):
            np.testing.assert_allclose(getattr(mine, name), getattr(theirs, name), atol=1e-9)


@pytest.mark.parametrize("name", ADAPTIVE)
def test_a_campaign_on_disk_ends_as_in_memory(name):
    plan = make_plan(name)
    world = world_of(plan)
    entries = entries_of(plan, world)
    wanted = conduct(plan.assessor, world)
    state = restore(from_json(to_json(plan), "here"), entries)
    assert len(state.used) == wanted.ledger.taken
    assert_same(state.statements(), wanted.statements())


def test_part_of_a_visit_by_travel_says_nothing_of_the_region():
    plan = make_plan("region_share", points=60, budget=60)
    entries = entries_of(plan, world_of(plan))
    for said in restore(plan, entries[:-1]).statements():
        assert np.isnan(said.upper_mm)
        assert (said.withheld.code, said.withheld.numbers["left"]) == ("first_visit_by_travel", 1)
    assert not any("travel" in str(said.withheld) for said in restore(plan, entries).statements())


def test_readings_taken_ahead_change_nothing():
    plan = make_plan()
    world = world_of(plan)
    entries = entries_of(plan, world)
    shuffled = [entries[i] for i in np.random.default_rng(0).permutation(len(entries))]
    # Readings of one point keep their order: they are different readings.
    for point in range(len(plan.points)):
        places = [i for i, e in enumerate(shuffled) if e["readings"][0]["point"] == point]
        own = [e for e in entries if e["readings"][0]["point"] == point]
        for place, entry in zip(places, own, strict=True):
            shuffled[place] = entry
    state, whole = restore(plan, shuffled), restore(plan, entries)
    assert len(state.used) == len(state.taken)
    assert_same(state.statements(), whole.statements())


def test_a_point_left_out_is_never_asked_for_and_the_visit_stays_random():
    plan = make_plan(points=60, budget=60)
    gone = int(plan.route[4])
    rows = plan.visiting(frozenset([gone]))
    first = plan.assessor.begin(plan.candidates(rows)).first
    kept = [point for point in plan.order if point != gone]
    assert gone not in rows
    assert set(rows[:first]) == set(kept[:first])
    np.testing.assert_array_equal(rows[first:], kept[first:])
    left_out = frozenset([gone])
    entries = [
        {"kind": "leave_out", "point": gone, "reason": "hidden"},
        *entries_of(plan, world_of(plan, left_out), left_out),
    ]
    assert restore(plan, entries[:5]).requested == entries[5]["readings"][0]["point"]
    state = restore(plan, entries)
    assert gone not in {item.reading.point for item in state.used}
    assert len(state.used) == 60


def test_another_instrument_counts_with_its_own_covariance():
    plan = make_plan(texts=("tracker=0.05", "camera=0.5"))
    entries = entries_of(plan, world_of(plan), limit=24)
    by_tracker = restore(plan, entries)
    entries[10]["readings"][0]["instrument"] = "camera"
    with_camera = restore(plan, entries)
    entries[10]["readings"][0] |= {"instrument": "tracker", "std": "0.4"}
    by_itself = restore(plan, entries)
    place = int(np.flatnonzero(by_tracker.rows == by_tracker.used[10].reading.point)[0])
    assert by_tracker.campaign.ledger.noise_mm[place] == pytest.approx(0.05)
    assert with_camera.campaign.ledger.noise_mm[place] == pytest.approx(0.5)
    assert by_itself.campaign.ledger.noise_mm[place] == pytest.approx(0.4)


def test_a_plan_comes_back_to_the_last_bit():
    laser = "laser:range_mm=0.01,angle_um_per_m=15,repeat_mm=0.03"
    plan = make_plan(texts=("a=0.1,0.2,0.3", f"b={laser}"), frame="instrument")
    assert to_json(from_json(to_json(plan), "here")) == to_json(plan)


def test_predictions_recorded_as_readings_bound_nothing(tmp_path):
    plan = make_plan(points=12, budget=14)
    path, name = tmp_path / "check", plan.instruments[0].name
    # Again and again, more than are requested.
    readings = [
        Reading(*each, name) for _ in range(4) for each in enumerate(plan.points.modelled_mm)
    ]
    folder.start(path, plan)
    with folder.writing(path) as opened:
        opened.write(Readings(readings=readings))
    for command in ("status", "report"):
        said = call("campaign", command, path, code=0).output
        assert "equal the predicted positions" in said
        assert " at most " not in said


@pytest.mark.parametrize(
    ("size_mm", "most_mm"), [(0.01, 10.0 * 0.05 * np.sqrt(3.0)), (0.5, 3.0), (4.0, 10.0)]
)
def test_a_plausible_error_is_within_10_standard_deviations_or_6_medians(size_mm, most_mm):
    readings = [SimpleNamespace(error_mm=np.array([0.0, 0.0, size_mm]))] * 10
    state = SimpleNamespace(plan=make_plan(), readings=readings)
    assert most_plausible_mm(state) == pytest.approx(most_mm)
    state.readings = readings[:9]
    assert most_plausible_mm(state) == state.plan.limits.implausible_mm


def test_all_that_is_certain_lists_planned_revisits_in_their_places():
    plan = make_plan(points=30, budget=70, references=20)
    entries = [entry_of([reading]) for reading in readings_of(plan, world_of(plan).reading_mm)]
    ahead = restore(plan, []).ahead()
    assert ahead[:10] == [*plan.route[:5], *plan.route[:5]]
    assert set(ahead) == set(plan.route)
    read = [entry["readings"][0]["point"] for entry in entries]
    assert read[: len(ahead)] == ahead
    for done in (3, 7, 25):
        assert restore(plan, entries[:done]).ahead() == ahead[done:]


def test_sizes_of_readings_are_held_to_the_noise_of_three_axes():
    plan = make_plan()
    state = restore(plan, entries_of(plan, world_of(plan), limit=12))
    squares = np.array([item.error_mm for item in state.readings]) ** 2 / 0.05**2
    found = size_scatter(state)
    assert squares.shape == (12, 3)
    assert found.freedom == 36
    assert found.ratio == pytest.approx(np.sqrt(squares.mean()))
    assert found.probability == pytest.approx(chi2.sf(squares.sum(), 36))
