"""Campaigns revisit reference points unless told otherwise, where the budget has room for it."""

import pytest

from kinacc.campaign.plan import assessor_of


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
    settings = {"measurements": budget} | ({} if given is None else {"references": given})
    assert assessor_of("search_and_confirm", settings, candidates).references == planned
