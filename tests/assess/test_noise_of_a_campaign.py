"""What a campaign says where its noise is not known, or not as stated."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest

from kinacc.assess.adaptive import Candidates
from kinacc.assess.limits import visit_mm
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.simulate import carry_on
from kinacc.errors import InputError

POINTS, NOISE_MM = 40, 0.1
LONE = np.array([[1.0, 0.0, 0.0]] + [[0.1, 0.0, 0.0]] * (POINTS - 1))


def carried_on(seed, measurements=70, times=1.0, stated_mm=NOISE_MM, limit=None, **settings):
    """A campaign on candidates one of which is far off; noise ``times`` 0.1 mm."""
    rng = np.random.default_rng(seed)
    errors = rng.permutation(LONE)
    candidates = Candidates.with_equal_noise(np.full(POINTS, stated_mm))
    campaign = SearchAndConfirm(measurements, **settings).begin(candidates)
    noise_mm = times * NOISE_MM
    carry_on(campaign, lambda row, _: errors[row] + noise_mm * rng.normal(size=3), limit=limit)
    return campaign


def said(seed, measurements=70, **given):
    """What such a campaign states on all candidates."""
    return carried_on(seed, measurements, **given).statements()[1]


def scatter_within_blocks(campaign):
    """Root of the pooled variance of readings of the same block, over the noise stated."""
    of_block = defaultdict(list)
    for block, (_, reading, _) in zip(
        campaign.reading_blocks(), campaign.ledger.readings, strict=True
    ):
        of_block[block].append(reading)
    apart = sum(((np.array(each) - np.mean(each, axis=0)) ** 2).sum() for each in of_block.values())
    return math.sqrt(apart / sum(3 * (len(each) - 1) for each in of_block.values())) / NOISE_MM


def test_without_knowing_the_noise_bounds_follow_the_noise_there_is():
    """What is stated is only planned with: ten times as much, or a tenth, changes little."""
    width = {}
    for stated_mm in (0.03, 0.4):
        found = [said(seed, 90, stated_mm=stated_mm, noise="estimated") for seed in range(8)]
        assert sum(each.upper_mm < 1.0 or each.lower_mm > 1.0 for each in found) <= 2
        width[stated_mm] = np.mean([each.upper_mm - each.lower_mm for each in found])
        factor = np.mean([each.noise.numbers["factor"] for each in found])
        assert factor * stated_mm == pytest.approx(NOISE_MM, rel=0.1)
    assert max(width.values()) < 1.6 * min(width.values())


def test_nothing_is_bounded_before_the_noise_is_estimated():
    early, late = (said(1, 90, limit=limit, noise="estimated") for limit in (45, None))
    assert early.withheld.code == "noise_unknown"
    assert early.withheld.numbers["freedom"] < early.withheld.numbers["needed"]
    assert np.isnan([early.lower_mm, early.value_mm, early.upper_mm]).tolist() == [
        True,
        False,
        True,
    ]
    assert late.noise.code == "noise_estimated"


def test_a_repeatability_test_before_serves_at_once():
    early = said(1, 90, limit=40, noise="estimated", noise_freedom=60)
    assert early.withheld is None
    assert early.noise.code == "noise_tested"
    known = said(1, 90, limit=40, noise_margin=1.0)
    assert known.upper_mm < early.upper_mm < 1.1 * known.upper_mm
    assert 0.6 * known.lower_mm < early.lower_mm < known.lower_mm
    wrong = said(1, 90, times=2.0, noise="estimated", noise_freedom=60).withheld
    assert wrong.code in ("scatter", "wrong_readings")


def test_one_reading_of_each_pose_bounds_noise_and_error_together():
    found = [said(seed, POINTS, noise="estimated", stated_mm=0.01) for seed in range(40)]
    assert all(each.noise.code == "noise_bounded" for each in found)
    assert sum(each.upper_mm < 1.0 for each in found) <= 5
    assert sum(each.lower_mm > 1.0 for each in found) <= 5


def test_noise_far_above_the_one_stated_is_said_and_nothing_bounded():
    found = [said(seed, 160, times=1.6) for seed in range(20)]
    alarmed = [each for each in found if each.withheld]
    assert len(alarmed) >= 18
    assert {each.withheld.code for each in alarmed} <= {"scatter", "wrong_readings"}
    assert all(math.isnan(each.upper_mm) and each.value_mm > 0.5 for each in alarmed)


def test_noise_that_hardly_anything_checks_is_taken_larger():
    taken, as_stated = said(3, POINTS), said(3, POINTS, noise_margin=1.0)
    assert taken.noise.numbers == {"margin": 1.2}
    assert as_stated.noise is None
    assert taken.upper_mm > as_stated.upper_mm
    assert taken.lower_mm < as_stated.lower_mm


def test_noise_is_taken_as_stated_or_as_repeats_show_it_where_that_is_more():
    more = 0
    for campaign in (carried_on(seed, 200, times=1.04) for seed in range(12)):
        shown, told, ones = (
            scatter_within_blocks(campaign),
            campaign.statements()[1],
            np.ones(POINTS),
        )
        upper_mm = campaign.looks.limits_mm(campaign.looks.boundary, ones).max()
        lower_mm = campaign.average.bound_mm(ones)
        if shown <= 1.0:
            assert (told.noise, told.upper_mm, told.lower_mm) == (None, upper_mm, lower_mm)
            continue
        more += 1
        assert told.noise.code == "noise_shown"
        assert told.noise.numbers["factor"] == pytest.approx(shown)
        assert told.upper_mm > upper_mm
        assert told.lower_mm < lower_mm
    assert 0 < more < 12


@pytest.mark.parametrize("noise", ["known", "estimated"])
def test_a_bound_on_a_future_visit_is_that_on_the_mean_and_the_arms_own_scatter(noise):
    of_mean = said(4, 90, noise=noise)
    visit = said(4, 90, noise=noise, error_of="visit", arm_mm=0.05)
    assert visit.error_of == "visit"
    for name in ("lower_mm", "value_mm", "upper_mm"):
        assert getattr(visit, name) == pytest.approx(visit_mm(getattr(of_mean, name), 0.05))
    wide = said(4, 90, noise=noise, error_of="visit")
    assert wide.upper_mm > visit.upper_mm
    assert wide.upper_mm > visit_mm(of_mean.upper_mm, 0.9 * NOISE_MM)


def test_the_worst_pose_of_a_noisy_arm_is_bounded_with_its_noise_estimated():
    truth_mm = visit_mm(1.0, NOISE_MM)
    found = [said(seed, 90, noise="estimated", error_of="visit") for seed in range(40)]
    assert sum(each.upper_mm < truth_mm for each in found) <= 5
    assert sum(each.lower_mm > truth_mm for each in found) <= 5


def test_what_no_repeat_sees_widens_both_bounds():
    without, within = said(5, 90), said(5, 90, allowance_mm=0.03)
    assert within.upper_mm == pytest.approx(without.upper_mm + 0.03)
    assert within.lower_mm == pytest.approx(without.lower_mm - 0.03)
    assert within.value_mm == without.value_mm


def test_settings_of_the_noise_that_cannot_be_are_all_told_at_once():
    with pytest.raises(InputError) as told:
        SearchAndConfirm(90, noise="estimated", noise_freedom=20, arm_mm=0.1)
    for part in (
        "noise_freedom",
        "at least 30; 60 are asked for",
        "arm_mm",
        "error_of is not visit",
    ):
        assert part in str(told.value)
    with pytest.raises(InputError, match="noise_freedom"):
        SearchAndConfirm(90, noise_freedom=60)
    with pytest.raises(InputError, match="arm_mm"):
        SearchAndConfirm(90, error_of="visit", arm_mm=-0.1)
