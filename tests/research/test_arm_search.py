"""The shipped draws: made again from their seeds, and no earlier seed would have done."""

from __future__ import annotations

import math

import numpy as np
import pytest

from kinacc.config.schema import defaults
from kinacc.synthetic import accepted
from research import arm_acceptance as acceptance
from research import arm_search as search

EARLIER = 3  # seeds before the shipped one that are tried again here


@pytest.fixture(scope="module")
def config() -> dict:
    return {"robot": "mh180", **defaults()}


@pytest.fixture(scope="module")
def bench(config):
    return search.bench_of(config)


def seeds() -> list[int]:
    return [int(row["seed"]) for row in accepted.rows()]


@pytest.mark.parametrize("number", [0, 1])
def test_a_draw_comes_out_of_its_seed_again(bench, number):
    row = accepted.rows()[number]
    again = search.trial(bench, int(row["seed"]))
    shipped = accepted.accepted_draw(number)
    assert again.accepted
    assert np.allclose(again.draw.scales, shipped.scales, rtol=1e-3)
    for name in accepted.GEOMETRY:
        ours, theirs = getattr(again.draw.geometry, name), getattr(shipped.geometry, name)
        assert np.allclose(ours, theirs, rtol=0.0, atol=1e-3 if name.endswith("_mm") else 1e-6)


@pytest.mark.parametrize("number", [0, 20])
def test_the_shipped_numbers_are_those_of_the_workflow_and_meet_the_paper(bench, number):
    row = accepted.rows()[number]
    found = search.judged(bench, accepted.accepted_draw(number)).numbers
    claims = {claim.id: claim for claim in acceptance.judged()}
    assert set(found) == set(claims)
    for name, value in found.items():
        assert value == pytest.approx(float(row[name]), rel=1e-4, abs=1e-6)
        assert abs(value - claims[name].paper) <= claims[name].tolerance


def test_earlier_seeds_were_rejected(bench):
    for seed in range(min(EARLIER, seeds()[0])):
        assert not search.trial(bench, seed).accepted


def test_one_number_out_of_tolerance_rejects():
    exact = {claim.id: claim.paper for claim in acceptance.judged()}
    assert acceptance.accepted(exact)
    for claim in acceptance.judged():
        assert not acceptance.accepted({**exact, claim.id: claim.paper + 1.01 * claim.tolerance})
        assert not acceptance.accepted({**exact, claim.id: math.nan})
