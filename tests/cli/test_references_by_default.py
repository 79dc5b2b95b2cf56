"""Campaigns revisit reference points unless told otherwise, where the budget has room for it."""

import pytest

from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.campaign.plan import with_references


@pytest.mark.parametrize(
    ("budget", "candidates", "given", "planned"),
    [
        (280, 200, None, 20),
        (279, 200, None, 0),
        (300, 200, 0, 0),
        (300, 200, 40, 40),
        (100, 20, None, 20),
        (99, 20, None, 0),
    ],
)
def test_references_that_a_campaign_plans(budget, candidates, given, planned):
    own = SearchAndConfirm(measurements=budget, references=given or 0)
    assert with_references(own, candidates, given).references == planned
