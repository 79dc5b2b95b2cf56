"""What a report says its bounds rest on, by what the campaign was begun with."""

from __future__ import annotations

import pytest

from kinacc.campaign.report import grounds
from kinacc.campaign.state import restore


@pytest.fixture
def rests_on(make_plan):
    """The grounds of a campaign with settings, as one text."""

    def told(assessor="search_and_confirm", **settings) -> str:
        return "\n".join(grounds(restore(make_plan(assessor, budget=60, **settings), [])))

    return told


def test_who_guards_against_nothing_reads_what_would_go_unseen(rests_on):
    said = rests_on()
    assert "no reading went wrong" in said
    assert "no reference poses are read again" in said
    assert "nothing is allowed for what no repeat sees" in said
    assert "what stays when a pose is measured again" in said


def test_what_is_guarded_against_is_not_assumed(rests_on):
    said = rests_on(wrong_rate=0.01, allowance_mm=0.02)
    assert "no reading went wrong" not in said
    assert "at most 1.0% of the readings are wrong" in said
    assert "frame, tool offset, scale: at most 0.02 mm" in said
    assert "no reference poses are read again" not in rests_on(references=20)


@pytest.mark.parametrize(("arm_mm", "scatter"), [(0.03, "0.03 mm per axis"), (None, "all of the")])
def test_the_error_of_a_visit_names_whose_scatter_is_in_it(rests_on, arm_mm, scatter):
    said = rests_on(error_of="visit", arm_mm=arm_mm)
    assert "95% of future visits to the worst pose" in said
    assert scatter in said
    assert "what stays when" not in said


def test_two_sides_at_95_percent_are_said_to_hold_together_in_90(rests_on):
    assert "each bound holds with 95% confidence, both together with 90%" in rests_on()
    assert "with 94% confidence, both together with 88%" in rests_on(wrong_rate=0.01)


def test_an_assessor_without_a_confidence_claims_none(rests_on):
    assert "both together" not in rests_on("model_invalidation_full")
