"""The noise: estimated from readings that belong together, and contradicted where it is wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binom, chi2, f, kstest, multivariate_t, norm, t
from simulated_campaigns import away, conducted, equal

from kinacc.assess.adaptive import Candidates, Ledger
from kinacc.assess.limits import visit_mm
from kinacc.assess.noise import (
    BESIDE_REFERENCES,
    FALSE_ALARM,
    SCATTER,
    CampaignNoise,
    Contrasts,
    contrasts,
    estimated_factor,
    largest_factor,
    scatter_alarm,
    suspicious_readings,
    tails_alarm,
)
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.world import carry_on


def of_values(values):
    """Contrasts at one point."""
    places = np.arange(len(values))
    return Contrasts(0 * places, places, values)


def told(candidates, rows, readings, unplanned):
    """A ledger with readings, of which those at places ``unplanned`` have another covariance."""
    ledger = Ledger(candidates)
    for at, (row, reading) in enumerate(zip(rows, readings, strict=True)):
        ledger.record(row, reading, unplanned.get(at))
    return ledger


def test_readings_of_a_block_differ_by_what_a_fit_of_its_mean_leaves():
    rng = np.random.default_rng(2)
    roots = rng.normal(size=(5, 3, 3)) + 2.0 * np.eye(3)
    candidates = Candidates(roots @ np.swapaxes(roots, 1, 2))
    blocks = rng.permutation(np.repeat(np.arange(12), [1, 1, 1, 2, 2, 2, 3, 4, 4, 5, 7, 8]))
    rows = blocks % 5
    readings = rng.normal(size=(40, 3)) + 10.0 * rows[:, None]
    unplanned = {at: np.diag(rng.uniform(0.5, 2.0, 3)) for at in (4, 7, 8, 30)}
    found = contrasts(told(candidates, rows, readings, unplanned), blocks)
    weights = np.linalg.inv([unplanned.get(at, candidates.covariance_mm2[row])
                             for at, row in enumerate(rows)])  # fmt: skip
    total = 0.0
    for block in range(12):
        own, weight = readings[blocks == block], weights[blocks == block]
        mean = np.linalg.solve(weight.sum(axis=0), np.einsum("nij,nj->i", weight, own))
        total += np.einsum("ni,nij,nj->", own - mean, weight, own - mean)
    assert found.freedom == 3 * (40 - 12)
    assert np.sum(found.values**2) == pytest.approx(total, rel=1e-9)
    # What was told first stays as it was, whatever is read later.
    before = contrasts(told(candidates, rows[:21], readings[:21], unplanned), blocks[:21])
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
        found = contrasts(told(candidates, rows, readings, {}), [0, 1, 2, 2, 3, 3, 4, 4])
        factor, _ = estimated_factor(found, 9, 2)
        # The newest block was decided on all before it, its mean is free of its differences.
        last.append((means[row][-1] - errors[row])[0] / (0.1 * factor / math.sqrt(2.0)))
    assert kstest(last, t(9).cdf).pvalue > 0.01
    far = int(np.sum(np.abs(last) > 3.0))
    assert binom.sf(far, 2000, 2.0 * t(9).sf(3.0)) > 0.01
    assert binom.sf(far - 1, 2000, 2.0 * norm.sf(3.0)) < 1e-4


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


def test_a_pose_read_often_has_its_own_factor_where_that_is_larger():
    rng = np.random.default_rng(9)
    rows, values = np.repeat([0, 1, 2], [40, 40, 4]), rng.normal(size=(84, 3))
    values[:40] *= 2.0
    value, by_point = estimated_factor(Contrasts(rows, np.arange(84), values), 252, 4)
    own = math.sqrt(np.mean(values[:40] ** 2))
    assert value == pytest.approx(math.sqrt(np.mean(values**2)))
    np.testing.assert_allclose(by_point, [own, value, value, value])


@pytest.mark.parametrize("freedom", [12.0, math.inf])
@pytest.mark.parametrize(("beyond", "named"), [(0.99, 0), (1.01, 1)])
@pytest.mark.parametrize(("number", "looks"), [(4, 5), (1, 2)])
def test_a_reading_is_suspicious_from_the_distance_on_that_noise_seldom_has(
    freedom, beyond, named, number, looks
):
    # The chance is shared out over the readings planned, or over the points.
    chance, factor = 0.5 * FALSE_ALARM / looks, 1.4
    square = chi2.isf(chance, 3) if math.isinf(freedom) else 3.0 * f.isf(chance, 3.0, freedom)
    readings = np.zeros((4, 3))
    # The last of a block, or the first of all, is compared with the mean of the next two.
    readings[number - 1, 1] = beyond * 0.1 * factor * math.sqrt(1.5 * square)
    ledger = told(equal(2), [0] * 4, readings, {})
    suspicious = suspicious_readings(ledger, [1] * 4, (1, 9), 5, factor, freedom)
    found = [(reading.number, reading.deviations) for reading in suspicious]
    assert found == [(number, pytest.approx(beyond * math.sqrt(square)))] * named


@pytest.mark.parametrize(
    ("tested", "larger", "false"), [(math.inf, 1.2, SCATTER), (60, 1.5, BESIDE_REFERENCES)]
)
def test_scatter_is_an_alarm_from_a_ratio_of_likelihoods_on(tested, larger, false):
    values, settings = np.zeros((12, 3)), {"tested": tested, "margin": 1.1, "false": false}
    values[:8] = np.random.default_rng(1).normal(size=(8, 3))

    def log(scale):
        """Log likelihood of noise so many times as large, over all that a test may have told."""
        spread = (1.1 * scale) ** 2 * np.eye(24)
        return multivariate_t.logpdf(values[:8].ravel(), shape=spread, df=tested)

    for _ in range(200):
        values[7] *= 1.01
        said = scatter_alarm(of_values(values), **settings)  # whatever comes later
        assert bool(said) == (log(larger) - log(1.0) >= -math.log(false))
    assert said.numbers["ratio"] == pytest.approx(math.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("tested", [math.inf, 60])
def test_scatter_as_stated_is_hardly_ever_an_alarm_at_any_time(tested):
    rng, false = np.random.default_rng(8), 0
    for _ in range(4000):
        # A noise that a test told is off by what its degrees of freedom leave open.
        off = 1.0 if math.isinf(tested) else math.sqrt(tested / rng.chisquare(tested))
        values = off * rng.normal(size=(100, 3))
        false += scatter_alarm(of_values(values), tested=tested) is not None
    assert binom.sf(false - 1, 4000, SCATTER) > 0.005


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
    drawn = student_triples(rng, 200, joint)
    found = [tails_alarm(each) for each in drawn]
    assert np.mean([each is not None for each in found]) >= least
    size = np.abs(drawn[0].values)
    farthest = norm.ppf(0.75) * size.max() / np.median(size)
    assert found[0].numbers["farthest"] == pytest.approx(farthest, rel=1e-4)


@pytest.mark.parametrize("noise", ["known", "estimated"])
def test_a_bound_on_a_future_visit_is_that_on_the_mean_and_the_arms_own_scatter(noise):
    lone = np.r_[1.0, np.full(39, 0.1)][:, None] * np.eye(3)[0]

    def stated(**settings):
        rng = np.random.default_rng(4)
        settings = {"noise": noise, **settings}
        return conducted(rng, rng.permutation(lone), 90, noise_mm=0.1, **settings).statements()[1]

    of_mean, visit = stated(), stated(error_of="visit", arm_mm=0.05)
    assert visit.error_of == "visit"
    for name in ("lower_mm", "value_mm", "upper_mm"):
        assert getattr(visit, name) == pytest.approx(visit_mm(getattr(of_mean, name), 0.05))


@pytest.mark.parametrize(
    ("measurements", "settings", "code", "least", "most"),
    [
        # The noise is stated half as large as it is, but for a test that is right.
        (60, {"stated": 0.5}, "noise_bounded", 2.0, 4.0),
        (100, {"stated": 0.5}, "noise_estimated", 1.7, 2.4),
        (60, {"noise_freedom": 60}, "noise_tested", 1.0, 1.0),
        # The upper limit of a factor from 60 degrees of freedom, for a fifth of 5 %.
        (60, {"noise_freedom": 60, "wrong_rate": 0.02}, "noise_limited",
         *[math.sqrt(60.0 / chi2.ppf(0.01, 60))] * 2),
    ],
)  # fmt: skip
@pytest.mark.parametrize("error_of", ["mean", "visit"])
def test_a_noise_that_is_not_known_is_taken_from_where_it_can_be_had(
    measurements, settings, code, least, most, error_of
):
    rng, settings = np.random.default_rng(5), {**settings, "noise": "estimated"}
    errors = away(rng, np.r_[8.0, rng.uniform(0.0, 2.0, 39)])
    campaign = conducted(rng, errors, measurements, error_of=error_of, **settings)
    largest = 8.0 if error_of == "mean" else visit_mm(8.0, 1.0)
    for stated in campaign.statements():
        assert stated.noise.code == code
        assert least - 1e-9 <= stated.noise.numbers["factor"] <= most + 1e-9
        assert stated.lower_mm <= largest <= stated.upper_mm
    lower, upper = np.max([*campaign.point_limits().values()], axis=0)
    assert lower <= 8.0 <= upper
    assert (lower > 0.0) != ("wrong_rate" in settings)  # any single reading may be wrong


def test_lower_limits_of_points_spend_half_their_error_on_the_limit_of_a_tested_noise():
    """As with known noise (1.2 times what is stated) as large as that limit, and half the error."""
    rng = np.random.default_rng(5)
    readings = away(rng, np.full(20, 8.0)) + rng.normal(size=(20, 3))
    largest = math.sqrt(60.0 / chi2.ppf(0.5 * 0.05 * 0.05, 60))  # single points: 5 % of 5 %

    def lower(noise_mm, **settings):
        begun = SearchAndConfirm(60, **settings).begin(equal(20, noise_mm))
        carry_on(begun, lambda row, _: readings[row], limit=20)
        return [begun.point_limits()[row][0] for row in range(20)]

    tested = lower(1.0, noise="estimated", noise_freedom=60)
    assert max(tested) > 3.0
    assert_allclose(tested, lower(largest / 1.2, confidence=0.975), rtol=1e-9)


def test_a_noise_that_is_not_estimated_yet_withholds_bounds_and_limits():
    rng = np.random.default_rng(5)
    errors = away(rng, np.full(20, 4.0))
    begun = SearchAndConfirm(100, noise="estimated").begin(equal(20))
    carry_on(begun, lambda row, _: errors[row] + 0.1 * rng.normal(size=3), limit=30)
    assert {stated.withheld.code for stated in begun.statements()} == {"noise_unknown"}
    assert set(begun.point_limits().values()) == {(0.0, math.inf)}
    assert begun.suspicious() == ()


@pytest.mark.parametrize(
    ("spare", "margin", "estimating"),
    [(27, 1.2, 0), (28, 1.2, 30), (87, 1.2, 117), (88, 1.0, 120), (200, 1.0, 120)],
)
def test_of_the_readings_after_the_visit_but_nine_half_tell_of_the_noise(spare, margin, estimating):
    def begun(noise, **settings):
        settings = SearchAndConfirm(24 + spare, references=4, noise=noise, **settings)
        return CampaignNoise(settings, Ledger(equal(20)), [], 20)

    assert begun("known").margin == margin
    assert begun("estimated").estimating == estimating
    # Where the noise itself is bounded that has a fifth of the error.
    assert begun("estimated").mean_share == (1.0 if estimating else 0.8)
    assert begun("estimated", error_of="visit").mean_share == 0.8
