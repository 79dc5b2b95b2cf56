"""``kinacc plan-campaign``: simulated widths and power are those of campaigns run one by one."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
from command_line import call
from scipy.stats import ncx2

from kinacc.assess.attainable import width_limits
from kinacc.assess.counts import binomial_interval
from kinacc.assess.random_numbers import key_of
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.simulate import conduct
from kinacc.assess.single_shot import SingleShot
from kinacc.assess.statement import CANDIDATES, MEASURED, Statement
from kinacc.assess.world import drawn_world
from kinacc.campaign.power import Aim, Row, repetitions_to_show, rows, smallest_budget
from kinacc.campaign.simulate import Outcome, outcomes
from kinacc.cli.campaign_plans import Simulation, as_sheet, in_words
from kinacc.errors import InputError
from kinacc.study.fields import ErrorField


def field(count=100, seed=0):
    return ErrorField("normal", np.random.default_rng(seed).normal(size=(count, 3)) * 0.2)


def test_a_simulated_campaign_is_one_run_in_memory():
    errors, sigma = field(), 0.05
    budgets = (SearchAndConfirm(measurements=30), SearchAndConfirm(measurements=50))
    found = outcomes([errors], 40, sigma**2 * np.eye(3), budgets, 3, 9)
    assert len(found) == 2 * 3 * 2
    for each in found:
        chosen = np.random.default_rng([9, 0, each.repetition]).permutation(100)[:40]
        world = drawn_world(errors.error_mm[chosen], sigma, key_of(9, 0, each.repetition), 60)
        campaign = conduct(SearchAndConfirm(measurements=each.budget), world)
        wanted = next(s for s in campaign.statements() if s.target == each.said.target)
        np.testing.assert_allclose(each.said.upper_mm, wanted.upper_mm, rtol=1e-9)
        np.testing.assert_allclose(each.said.lower_mm, wanted.lower_mm, rtol=1e-9)
        assert each.readings == campaign.ledger.taken
        sizes = np.linalg.norm(errors.error_mm[chosen], axis=1)
        if each.said.target == CANDIDATES:
            assert each.truth_mm == np.sort(sizes)[-1 - each.said.excepted]
        else:
            assert each.truth_mm == sizes[campaign.ledger.visited].max()


def test_a_plan_for_single_visits_is_held_to_what_95_percent_of_visits_keep():
    errors, sigma = field(), 0.2
    visits, arm = (
        SearchAndConfirm(measurements=60, error_of="visit", **own) for own in ({}, {"arm_mm": 0.1})
    )
    found = outcomes([errors], 40, sigma**2 * np.eye(3), (visits, arm), 2, 9)
    truths = [each.truth_mm for each in found if each.said.target == CANDIDATES]
    rows = [np.random.default_rng([9, 0, each]).permutation(100)[:40] for each in (0, 1)]
    wanted = [
        scale * math.sqrt(ncx2.ppf(0.95, 3, (errors.size_mm[chosen].max() / scale) ** 2))
        for chosen in rows
        for scale in (sigma, 0.1)
    ]
    assert truths == pytest.approx(wanted, rel=1e-6)


def test_a_plan_tells_how_near_bounds_could_come_with_the_errors_known():
    errors, noise = field(), 0.05**2 * np.eye(3)
    budgets = (SearchAndConfirm(measurements=30), SearchAndConfirm(measurements=60))
    found = outcomes([errors], 40, noise, budgets, 2, 9, limits_on=CANDIDATES)
    few, enough = rows(found, Aim(CANDIDATES))
    chosen = [np.random.default_rng([9, 0, each]).permutation(100)[:40] for each in range(2)]
    sizes = [np.linalg.norm(errors.error_mm[each], axis=1) for each in chosen]
    known = [width_limits(each, 0.05, 60, 0.05) for each in sizes]
    assert enough.attainable_mm == pytest.approx(np.mean([each.attainable_mm for each in known]))
    assert enough.proven_mm == pytest.approx(np.mean([each.proven_mm for each in known]))
    assert enough.proven_mm < enough.attainable_mm
    # Nothing can be said of all of them by fewer readings than candidates.
    assert math.isnan(few.attainable_mm)
    assert math.isnan(few.proven_mm)
    asked = Simulation((errors,), 40, noise, budgets, Aim(CANDIDATES), 2, 9)
    sheet = {each.name: each.values for each in as_sheet(asked, [few, enough]).fields}
    assert np.isnan(sheet["attainable_mm"][0])
    assert sheet["proven_mm"][1] == enough.proven_mm
    head, *lines = in_words(asked, [few, enough]).splitlines()[-4:]
    assert head.startswith("how near upper bounds are after 60 readings")
    sizes = (enough.excess_mm, enough.attainable_mm, enough.proven_mm)
    for line, size_mm in zip(lines, sizes, strict=True):
        assert re.findall(r"[\d.]+ mm", line) == [f"{size_mm:.2g} mm"]


def test_a_plan_fits_a_screen(errors_file):
    words = ("plan-campaign", "--noise-mm", "0.05", "--poses", 30, "--errors", errors_file,
             "--width-mm", "0.2", "--tolerance-mm", 1, "--repetitions", 2)  # fmt: skip
    shown = call(*words, "--budget", 30)
    table = shown.stdout.splitlines()[1:3]
    assert max(map(len, table)) <= 140
    assert {"excess_mm", "attainable_mm", "proven_mm"} <= set(table[0].split())


def test_the_single_shot_bound_holds_as_often_as_it_says():
    noise = 0.1**2 * np.eye(3)
    found = outcomes([field()], 30, noise, [SingleShot(measurements=30)], 200, 4)
    (row,) = rows(found, Aim(MEASURED))
    assert row.holds >= 0.95 - 3.0 * math.sqrt(0.95 * 0.05 / 200)
    assert row.stated == 1.0


def outcome(budget, lower, upper, repetition=0, truth=1.0):
    said = Statement(CANDIDATES, lower_mm=lower, upper_mm=upper, confidence=0.95)
    return Outcome("x", budget, repetition, budget, said, truth)


def test_rows_count_what_is_stated_wanted_held_and_decided():
    found = [
        outcome(10, 0.9, 1.1, 0),
        outcome(10, 0.5, 0.9, 1),
        outcome(10, 1.3, 2.0, 2, truth=1.5),
        outcome(10, 0.9, math.nan, 3),
    ]
    (row,) = rows(found, Aim(CANDIDATES, width_mm=0.5, tolerance_mm=1.2))
    assert row.stated == 0.75
    assert row.within == 0.5
    assert row.holds == pytest.approx(2.0 / 3.0)
    assert (row.holding, row.judged) == (2, 3)
    # Clopper, Pearson: 3 p^2 - 2 p^3 = 0.025 below; p^3 = 0.975 above
    assert row.holds_interval == pytest.approx((0.09430, 0.99160), abs=1e-5)
    assert row.excess_mm == pytest.approx(0.5 / 3.0)
    assert row.decisions == {"accept": 0.5, "reject": 0.25, "undecided": 0.25}
    assert row.width_mm[0] == pytest.approx(0.2)
    assert row.width_mm[2] == math.inf


def test_bounds_that_contradict_each_other_are_no_width_below_zero():
    (row,) = rows([outcome(10, 1.1, 0.9, 0), outcome(10, 0.9, 1.2, 1)], Aim(CANDIDATES))
    assert row.width_mm[0] == 0.0
    assert row.width_mm[2] == pytest.approx(0.3)


def test_repetitions_named_are_the_fewest_that_show_the_share():
    # All of n hold: the lower limit is 0.025 ** (1 / n), 0.7941 for 16 and 0.8049 for 17.
    assert repetitions_to_show(1.0, 0.8) == 17
    assert repetitions_to_show(0.8, 0.8) is None


def test_the_budget_named_is_enough_on_all_errors_and_beyond():
    aim = Aim(CANDIDATES, width_mm=0.5, power=0.8)

    def row(errors, budget, within):
        return Row(errors, budget, 1.0, 10, 1.0, (0.1, 0.2, 0.3), 0.0, 1.0, 1.0, within,
                   (0.0, 1.0), {})  # fmt: skip

    a = [row("a", 10, 0.9), row("a", 20, 0.9), row("a", 30, 0.9)]
    assert smallest_budget([*a, row("b", 10, 0.1), row("b", 20, 0.8), row("b", 30, 1.0)], aim) == 20
    assert smallest_budget([*a, row("b", 10, 0.9), row("b", 20, 0.1), row("b", 30, 1.0)], aim) == 30
    assert smallest_budget([row("b", 10, 0.9), row("b", 20, 0.7)], aim) is None


def test_fewer_errors_than_poses_are_refused():
    with pytest.raises(InputError, match="only 100"):
        outcomes([field()], 101, np.eye(3), [SingleShot(measurements=200)], 1, 0)


@pytest.fixture
def errors_file(tmp_path):
    path = tmp_path / "errors.csv"
    np.savetxt(path, field(60).error_mm, delimiter=",", header="ex_mm,ey_mm,ez_mm", comments="")
    return path


def test_the_command_answers_with_table_picture_and_budget(errors_file, tmp_path):
    picture = tmp_path / "width.svg"
    words = ("plan-campaign", "--noise-mm", "0.05", "--poses", 30, "--errors", errors_file,
             "--width-mm", "0.2", "--repetitions", 6, "--budget", 15, "--budget", 60)  # fmt: skip
    shown = call(*words, "--picture", picture)
    assert shown.exit_code == 0, shown.output
    assert "60 readings gave bounds at most 0.2 mm apart in 6 of 6 simulated" in shown.output
    # Six of six leave room for a share of 0.025 ** (1 / 6) = 54 %.
    assert "at least 54% of campaigns with 97.5 % confidence, not yet 80%" in shown.output
    assert "--repetitions 17 would" in shown.output
    assert picture.stat().st_size > 1000
    content = json.loads(call(*words, "--json").stdout)
    assert content["budget"] == 60
    assert content["noise_mm"] == [0.05] * 3
    assert [row["budget"] for row in content["rows"]] == [15, 60]
    assert content["units"]["width_median_mm"] == "mm"
    assert call(*words, "--json").stdout == call(*words, "--json").stdout


def test_the_budget_named_first_is_the_smallest_that_is_shown_to_be_enough():
    def row(budget, hits):
        share = hits / 30
        interval = binomial_interval(hits, 30)
        return Row("a", budget, 1.0, 30, 1.0, (0.1, 0.2, 0.3), 0.0, 1.0, 1.0, share, interval,
                   {})  # fmt: skip

    found = [row(72, 10), row(108, 26), row(144, 30), row(216, 30)]
    aim = Aim(CANDIDATES, width_mm=0.5, power=0.8)
    asked = Simulation((field(),), 72, np.eye(3), (SingleShot(measurements=72),), aim, 30, 0)
    first, then = in_words(asked, found).splitlines()
    assert first.startswith("144 readings give bounds at most 0.5 mm apart in at least 80%")
    assert "30 of 30" in first
    assert then.startswith("108 readings may be enough: 26 of 30")
    (only,) = in_words(asked, found[:2]).splitlines()
    assert only.startswith("108 readings gave bounds")
    assert "not yet 80%" in only
    facts = as_sheet(asked, found).facts
    assert (facts["budget"], facts["budget_shown"]) == (108, 144)


def test_errors_can_be_scaled(errors_file):
    words = ("plan-campaign", "--noise-mm", "0.01", "--poses", 60, "--errors", errors_file,
             "--largest-mm", "3", "--repetitions", 2, "--budget", 60, "--json")  # fmt: skip
    content = json.loads(call(*words).stdout)
    assert content["rows"][0]["true_mm"] == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--noise-mm", "0"), "no instrument is without noise"),
        ((), "--noise-mm MM, or --covariance-mm2"),
        (("--covariance-mm2", "1,2,0,2,1,0,0,0,1"), "not positive definite"),
        (("--noise-mm", "0.1", "--errors", "nowhere"), "smooth, gravity"),
        (("--noise-mm", "0.1", "--width-mm", "-1"), "--width-mm"),
        (("--noise-mm", "0.1", "--largest-mm", "nan"), "--largest-mm"),
    ],
)
def test_what_cannot_be_simulated_is_said(words, said):
    done = call("plan-campaign", *words)
    assert done.exit_code == 2
    assert said in done.output
    assert "Traceback" not in done.output


def test_help_has_an_example():
    assert "kinacc plan-campaign " in call("plan-campaign", "--help").output.split("Example:")[1]
