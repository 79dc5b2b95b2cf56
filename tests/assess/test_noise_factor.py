"""The noise is estimated from readings that belong together, and contradicted where it is wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import binom, chi2, f, kstest, ncx2, norm, t

from kinacc.assess.adaptive import Candidates, Ledger
from kinacc.assess.limits import visit_mm
from kinacc.assess.noise_alarms import (
    BESIDE_REFERENCES,
    SCATTER,
    heavy_over_normal,
    larger_over_stated,
    scatter_alarm,
    tails_alarm,
)
from kinacc.assess.noise_factor import (
    Contrasts,
    contrasts,
    estimated_factor,
    estimating_freedom,
    known_factor,
    largest_factor,
    planned_freedom,
)
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.simulate import carry_on


def equal(points, sigma_mm=0.1):
    return Candidates.with_equal_noise(np.full(points, sigma_mm))


def of_normal(numbers, rng, factor=1.0):
    return of_values(factor * rng.normal(size=(numbers // 3, 3)))


def of_values(values, rows=None):
    """Contrasts at one point, or at rows."""
    places = np.arange(len(values))
    return Contrasts(0 * places if rows is None else rows, places, values)


def told(candidates, rows, readings, unplanned=()):
    """A ledger with readings, of which those at places ``unplanned`` have another covariance."""
    ledger = Ledger(candidates)
    for at, (row, reading) in enumerate(zip(rows, readings, strict=True)):
        ledger.record(row, reading, dict(unplanned).get(at))
    return ledger


def by_hand(ledger, blocks):
    """Chi-square within every block about its weighted mean, and its degrees of freedom."""
    members = {}
    for block, (row, reading, own) in zip(blocks, ledger.readings, strict=True):
        covariance = ledger.candidates.covariance_mm2[row] if own is None else own
        members.setdefault(block, []).append((np.linalg.inv(covariance), np.array(reading)))
    total, freedom = 0.0, 0
    for of_block in members.values():
        weight = sum(each for each, _ in of_block)
        mean = np.linalg.solve(weight, sum(each @ x for each, x in of_block))
        total += sum((x - mean) @ each @ (x - mean) for each, x in of_block)
        freedom += 3 * (len(of_block) - 1)
    return total, freedom


@pytest.mark.parametrize("own", [(), (4, 7, 8, 30)])
def test_readings_of_a_block_differ_by_what_a_fit_of_its_mean_leaves(own):
    rng = np.random.default_rng(2)
    roots = rng.normal(size=(5, 3, 3)) + 2.0 * np.eye(3)
    candidates = Candidates(roots @ np.swapaxes(roots, 1, 2))
    blocks = rng.permutation(np.repeat(np.arange(12), [1, 1, 1, 2, 2, 2, 3, 4, 4, 5, 7, 8]))
    rows = blocks % 5
    readings = rng.normal(size=(40, 3)) + 10.0 * rows[:, None]
    unplanned = {at: np.diag(rng.uniform(0.5, 2.0, 3)) for at in own}
    found = contrasts(ledger := told(candidates, rows, readings, unplanned), blocks)
    total, freedom = by_hand(ledger, blocks)
    assert found.freedom == freedom
    assert np.sum(found.values**2) == pytest.approx(total, rel=1e-9)
    # What was told first stays as it was, whatever is read later.
    early = {at: each for at, each in unplanned.items() if at < 21}
    before = contrasts(told(candidates, rows[:21], readings[:21], early), blocks[:21])
    if not set(own) - set(early):
        assert found.values[: len(before.values)] == pytest.approx(before.values, abs=1e-9)
    assert contrasts(Ledger(candidates), []).freedom == 0


def test_a_factor_is_student_distributed_with_means_that_decided_where_to_read():
    """Blocks go to the larger of two block means: an allocation that runs after noise."""
    rng = np.random.default_rng(3)
    candidates, errors, last = equal(2), 0.2 * np.eye(2, 3), []
    for _ in range(2000):
        rows, readings, means = [0, 1], list(errors + 0.1 * rng.normal(size=(2, 3))), [[], []]
        for row, first in enumerate(readings):
            means[row].append(first)
        for _ in range(3):
            row = int(np.argmax([np.linalg.norm(np.mean(each, axis=0)) for each in means]))
            block = errors[row] + 0.1 * rng.normal(size=(2, 3))
            rows += [row, row]
            readings += list(block)
            means[row].append(block.mean(axis=0))
        found = contrasts(told(candidates, rows, readings), [0, 1, 2, 2, 3, 3, 4, 4])
        factor = estimated_factor(found, 9, 2, 9)
        # The newest block was decided on all before it, its mean is free of its differences.
        last.append((means[row][-1] - errors[row])[0] / (0.1 * factor.value / math.sqrt(2.0)))
    assert kstest(last, t(9).cdf).pvalue > 0.01
    far = int(np.sum(np.abs(last) > 3.0))
    assert binom.sf(far, 2000, 2.0 * t(9).sf(3.0)) > 0.01
    assert binom.sf(far - 1, 2000, 2.0 * norm.sf(3.0)) < 1e-4


@pytest.mark.parametrize("spare", [0, 1, 9, 10, 11, 40, 41, 100, 101])
def test_how_much_a_plan_is_sure_to_tell_of_the_noise(spare):
    """Any campaign has as many contrasts, whatever its readings made it do."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        errors = rng.normal(size=(30, 3)) * rng.choice([0.0, 0.1, 1.0])
        campaign = SearchAndConfirm(30 + spare).begin(equal(30))
        carry_on(campaign, lambda row, _: errors[row] + 0.1 * rng.normal(size=3))  # noqa: B023
        told_of = contrasts(campaign.ledger, campaign.blocks).freedom
        assert planned_freedom(spare) <= told_of <= 3 * spare


def test_the_noise_is_estimated_from_what_is_sure_to_be_read():
    planned = [estimating_freedom(spare) for spare in (0, 20, 28, 40, 60, 100, 200, 900)]
    assert planned == [0, 0, 30, 48, 78, 120, 120, 120]


def test_limits_of_a_factor_are_those_of_a_chi_square():
    rng = np.random.default_rng(4)
    factor = estimated_factor(of_normal(600, rng, 1.3), 60, 1, 60)
    assert factor.freedom == 60
    assert chi2.cdf(60 * (factor.value / factor.at_most(0.02)) ** 2, 60) == pytest.approx(0.02)
    assert chi2.sf(60 * (factor.value / factor.at_least(0.02)) ** 2, 60) == pytest.approx(0.02)
    assert known_factor(2).at_most(0.01) == known_factor(2).at_least(0.01) == 1.0
    tested = estimated_factor(of_normal(27, rng, 1.3), 0, 1, 60)
    assert (tested.value, tested.freedom) == (1.0, 60)
    assert tested.at_most(0.02) == pytest.approx(factor.at_most(0.02) / factor.value)


def test_a_pose_with_larger_noise_that_was_read_often_keeps_its_own():
    rng = np.random.default_rng(5)
    rows = np.repeat([0, 1, 2], [20, 20, 4])
    values = rng.normal(size=(44, 3)) * np.array([1.0, 2.0, 2.0])[rows, None]
    factor = estimated_factor(of_values(values, rows), 60, 4, 60)
    assert factor.own[1] == pytest.approx(np.sqrt(np.mean(values[20:40] ** 2)))
    assert factor.own[[2, 3]].tolist() == [factor.value] * 2
    assert factor.own[0] >= factor.value


def test_one_reading_of_each_pose_bounds_the_noise_whatever_the_errors_are():
    rng = np.random.default_rng(6)
    below = []
    for _ in range(4000):
        factor = largest_factor(equal(21), np.arange(21), 0.13 * rng.normal(size=(21, 3)), 0.05)
        below.append(factor < 1.3)
    # Exact where there are no errors: the 11th of 21 chi-squares.
    assert binom.cdf(sum(below), 4000, 0.05) > 0.005
    assert binom.sf(sum(below), 4000, 0.05) > 0.005
    one = np.array([[0.3, 0.0, 0.0]])
    assert chi2.cdf((3.0 / largest_factor(equal(1), [0], one, 0.05)) ** 2, 3) == pytest.approx(0.05)
    readings = 0.1 * rng.normal(size=(21, 3))
    more = readings * rng.uniform(1.0, 9.0, 21)[:, None]
    assert largest_factor(equal(21), np.arange(21), more, 0.05) >= largest_factor(
        equal(21), np.arange(21), readings, 0.05
    )


def test_noise_20_percent_larger_than_stated_is_said_by_80_triples():
    rng = np.random.default_rng(7)
    said = [scatter_alarm(of_normal(480, rng, 1.2)) is not None for _ in range(1000)]
    assert np.mean(said) >= 0.95
    found = scatter_alarm(of_normal(480, rng, 1.3))
    assert found.code == "scatter"
    assert found.numbers["freedom"] == 480
    assert found.numbers["ratio"] == pytest.approx(1.3, abs=0.15)
    assert scatter_alarm(of_normal(0, rng)) is None


def test_scatter_as_stated_is_hardly_ever_an_alarm_at_any_time():
    rng = np.random.default_rng(8)
    false = sum(scatter_alarm(of_normal(900, rng)) is not None for _ in range(8000))
    assert binom.sf(false - 1, 8000, SCATTER) > 0.005
    false = sum(
        scatter_alarm(of_normal(900, rng, 1.2), margin=1.2) is not None for _ in range(4000)
    )
    assert binom.sf(false - 1, 4000, SCATTER) > 0.005
    rare = sum(
        scatter_alarm(of_normal(300, rng), false=BESIDE_REFERENCES) is not None for _ in range(8000)
    )
    assert binom.sf(rare - 1, 8000, BESIDE_REFERENCES) > 0.005


def test_scatter_is_held_to_a_repeatability_test_with_its_own_uncertainty():
    rng, false, said = np.random.default_rng(14), 0, 0
    for _ in range(4000):
        # What a test of 30 degrees of freedom says of the noise is off by 13 %.
        test = math.sqrt(rng.chisquare(30) / 30.0)
        false += scatter_alarm(of_normal(300, rng, 1.0 / test), tested=30) is not None
        said += scatter_alarm(of_normal(300, rng, 1.0 / test)) is not None
    assert binom.sf(false - 1, 4000, SCATTER) > 0.005
    assert said > 100
    assert scatter_alarm(of_normal(300, rng, 2.5), tested=30) is not None


@pytest.mark.parametrize(("tested", "larger"), [(12.0, 1.5), (math.inf, 1.2)])
def test_the_ratio_for_larger_noise_is_that_of_two_densities(tested, larger):
    squares = np.random.default_rng(15).chisquare(3, 7)
    if math.isinf(tested):
        expected = np.sum(chi2(3, scale=larger**2).logpdf(squares) - chi2(3).logpdf(squares))
    else:
        mean = squares.mean() / 3.0
        expected = f(21, 12, scale=larger**2).logpdf(mean) - f(21, 12).logpdf(mean)
    assert larger_over_stated(squares, tested)[-1] == pytest.approx(expected)


def student_triples(rng, campaigns, joint):
    """Contrasts of 100 triples of Student's t with four degrees of freedom and variance 1."""
    z = rng.normal(size=(campaigns, 100, 3, 3))
    z /= np.sqrt(rng.chisquare(4, (*z.shape[:-1], 1 if joint else 3)) / 4.0) * math.sqrt(2.0)
    pair = (z[:, :, 1] - z[:, :, 0]) / math.sqrt(2.0)
    third = (z[:, :, 2] - z[:, :, :2].mean(axis=2)) * math.sqrt(2.0 / 3.0)
    values = np.stack([pair, third], axis=2).reshape(campaigns, 200, 3)
    return [of_values(each) for each in values]


@pytest.mark.parametrize(("joint", "least"), [(False, 0.9), (True, 0.94)])
def test_heavy_tails_are_said_by_100_triples(joint, least):
    rng = np.random.default_rng(9)
    found = [tails_alarm(each) for each in student_triples(rng, 200, joint)]
    assert np.mean([each is not None for each in found]) >= least
    assert all(each.numbers["farthest"] > 3.2 for each in found if each)


def test_normal_readings_of_any_size_have_no_heavy_tails():
    rng = np.random.default_rng(10)
    assert not any(tails_alarm(of_normal(150, rng, 5.0)) for _ in range(1000))
    values = of_normal(150, rng).values
    assert heavy_over_normal(3.7 * values) == pytest.approx(heavy_over_normal(values), abs=1e-6)


def test_the_ratio_for_heavy_tails_is_that_of_two_integrals():
    values = np.random.default_rng(11).normal(size=(12, 3))
    scale = np.exp(np.linspace(-2.0, 2.0, 401))

    def integral(log_density):
        log = [log_density(values / each) - values.size * math.log(each) for each in scale]
        return np.sum(np.exp(np.array(log) + 30.0)) * (4.0 / 400)

    root = math.sqrt(6.0 / 8.0)
    by_axis = integral(lambda x: np.sum(t(8, scale=root).logpdf(x)))

    def at_once(x):
        from scipy.stats import multivariate_t

        return np.sum(multivariate_t(np.zeros(3), 0.75 * np.eye(3), df=8).logpdf(x))

    ratio = 0.5 * (by_axis + integral(at_once)) / integral(lambda x: np.sum(norm.logpdf(x)))
    assert heavy_over_normal(values) == pytest.approx(math.log(ratio), abs=0.02)


def false_tails(steps, campaigns, rng):
    """Probability that normal readings ever have heavy tails by so many contrasts, by drawing the
    heavy-tailed ones and weighing each by the ratio at which it is stopped."""
    total = 0.0
    for campaign in range(campaigns):
        z = rng.normal(size=(steps, 3))
        z /= np.sqrt(rng.chisquare(8, (steps, 1 if campaign % 2 else 3)) / 6.0)
        for read in range(10, steps + 1, 4):
            if (ratio := heavy_over_normal(z[:read])) > 5.5:
                total += math.exp(-ratio)
                break
    return total / campaigns


def test_heavy_tails_are_false_in_a_quarter_of_a_percent_at_most():
    assert false_tails(240, 60, np.random.default_rng(12)) < 0.0025


def test_a_future_visit_is_noncentral_chi_and_grows_with_error_and_noise():
    for size, arm in [(0.0, 0.1), (0.05, 0.1), (0.3, 0.02), (4.0, 0.001)]:
        quantile = visit_mm(size, arm)
        assert ncx2.cdf((quantile / arm) ** 2, 3, (size / arm) ** 2) == pytest.approx(0.95)
        assert quantile < visit_mm(size + 0.01, arm) < quantile + 0.01 + 1e-12
        assert quantile < visit_mm(size, 1.1 * arm)
    assert visit_mm(0.3, 0.0) == 0.3
    assert math.isnan(visit_mm(math.nan, 0.1))


def test_a_future_visit_of_unequal_noise_stays_within_that_of_the_largest_in_all_axes():
    rng = np.random.default_rng(13)
    for _ in range(20):
        spread, towards = rng.uniform(0.01, 0.1, 3), rng.normal(size=3)
        size = rng.uniform(0.0, 0.4)
        visits = size * towards / np.linalg.norm(towards) + spread * rng.normal(size=(4000, 3))
        reach = np.quantile(np.linalg.norm(visits, axis=1), 0.94)
        assert reach <= visit_mm(size, spread.max())
