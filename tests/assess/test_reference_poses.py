"""Reference poses that are read again by plan: what they find, how often, and what corrects it."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import beta, chi2, ncf, ncx2
from simulated_campaigns import away, conducted

from kinacc.assess.reference_poses import (
    FALSE_ALARMS,
    Readings,
    _thresholds,
    find_change,
    schedule,
    stages,
)
from kinacc.assess.world import noisy

SLANTED = np.array([[4.0, 1.0, 0.5], [1.0, 2.0, 0.3], [0.5, 0.3, 1.0]]) * 1e-2


def read(plan, rng, change_mm=lambda time: 0.0, covariance=None):
    """Readings of the planned places: errors of poses, a change along a random direction, noise."""
    place = np.array(sorted(plan.row_at))
    row = np.array([plan.row_at[each] for each in place])
    covariance = np.eye(3) if covariance is None else covariance
    (way,) = away(rng, np.ones(1))
    vectors = (rng.normal(size=(plan.poses, 3)) * 5.0)[row]
    vectors = (
        vectors + np.array([change_mm(time) for time in place / plan.measurements])[..., None] * way
    )
    vectors += rng.multivariate_normal(np.zeros(3), covariance, len(place))
    return Readings(place, row, vectors, np.tile(covariance, (len(place), 1, 1)))


def test_simulated_readings_have_the_covariance_of_their_root():
    root = np.array([[1.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.5, 0.3]])
    reading = noisy(np.zeros((1, 3)), root, 4000, 1)
    found = np.cov([reading(0, visit) for visit in range(4000)], rowvar=False)
    assert_allclose(found, root @ root.T, atol=0.3)


@pytest.mark.parametrize("references", range(1, 45))
def test_any_number_of_revisits_finds_its_places(references):
    for measurements in (references + 10, 97, 400):
        plan = schedule(measurements, 60, references)
        assert len(plan.row_at) == references + plan.poses <= measurements
        assert set(plan.row_at) <= set(range(measurements))
        counts = np.bincount(list(plan.row_at.values()))
        assert counts.max() - counts.min() <= 1


def test_revisits_come_first_in_between_and_last_a_pose_after_the_other():
    plan = schedule(100, 80, 22)  # 5 revisits, 11 in steps of 84 / 12, and 6
    assert [*plan.row_at] == [*range(10), *range(17, 94, 7), *range(94, 100)]
    assert [*plan.row_at.values()] == [place % 5 for place in range(27)]
    assert [schedule(100, 80, few).poses for few in (7, 8)] == [1, 2]


@pytest.mark.parametrize("freedom", [math.inf, 60.0])
@pytest.mark.parametrize(
    "shape", [lambda time: time, lambda time: time > 0.4], ids=["drift", "step"]
)
@pytest.mark.parametrize("covariance", [np.eye(3) * 0.04, SLANTED])
def test_a_change_is_what_least_squares_make_of_the_references(covariance, shape, freedom):
    plan, rng = schedule(300, 200, 20), np.random.default_rng(5)
    readings = read(plan, rng, lambda time: 2.0 * shape(time), covariance)
    times = rng.uniform(0.5, 2.0, 25)
    readings = readings._replace(covariance_mm2=times[:, None, None] * covariance)
    found_change = find_change(plan, readings, freedom)
    place, root = readings.place, times[:, None] ** -0.5

    def fitted(shape):
        """A constant for each pose and a change: design, change and variance by the weights."""
        design = root * np.column_stack([readings.row[:, None] == np.arange(5), shape])
        found = np.linalg.lstsq(design, root * readings.vector_mm, rcond=None)[0]
        left = root * readings.vector_mm - design @ found
        return found[5], np.linalg.inv(design.T @ design)[5, 5], left

    there = shape(place / 300)
    changed, variance, left = fitted(there)
    widest, degrees = np.linalg.eigvalsh(covariance)[-1], 60.0 + 3.0 * (25 - 5) - 3.0
    share = 0.6 * 0.8 * FALSE_ALARMS  # of a drift at the last stage
    unseen = found_change.unseen_mm**2 / fitted(place / 300)[1] / widest
    if math.isinf(freedom):
        found = ncx2.cdf(chi2.isf(share, 3), 3, unseen)
    else:
        square = np.einsum("ni,ij,nj->", left, np.linalg.inv(covariance), left)
        factor, least = (square + 60.0) / degrees, beta.isf(share, 1.5, 0.5 * degrees)
        widest *= factor
        found = ncf.cdf(least / (1.0 - least) * degrees / 3.0, 3, degrees, unseen / factor)
    assert found == pytest.approx(0.5, abs=1e-5)
    assert found_change.is_found
    step = None if there.dtype == float else (place[~there].max() + 1, place[there].min() + 1)
    assert found_change.between == step
    assert_allclose(found_change.change_mm, changed, rtol=1e-9)
    assert_allclose(found_change.deviation_mm, math.sqrt(variance * widest), rtol=1e-9)
    # Before the first stage nothing is looked at.
    assert [count for count, _ in stages(plan)] == [15, 20, 25]
    assert find_change(plan, Readings(*(column[:14] for column in readings))) is None


@pytest.mark.parametrize("before", [5, 20])  # of 25 readings: a round of five, all but a round
def test_a_step_beside_a_single_round_is_named(before):
    plan = schedule(300, 200, 20)
    place = np.array(sorted(plan.row_at))
    step = read(plan, np.random.default_rng(5), lambda time: 20.0 * (time >= place[before] / 300))
    between = find_change(plan, step).between
    assert between == (place[before - 1] + 1, place[before] + 1)


@pytest.mark.parametrize("freedom", [math.inf, 0.0, 60.0])
def test_references_without_a_change_alarm_as_rarely_as_stated(freedom):
    plan, rng = schedule(200, 180, 20), np.random.default_rng(11)
    place, row = np.array(sorted(plan.row_at)), np.array([*plan.row_at.values()])
    reps, alarm = 40_000, np.zeros(40_000, dtype=bool)
    vectors = rng.normal(size=(3 * reps, len(place)))
    total = rng.chisquare(freedom, reps) if 0.0 < freedom < math.inf else np.zeros(reps)
    for count, error in stages(plan):
        # explained by each shape, by projections that share nothing with the package
        poses = (row[:count, None] == np.arange(5)).astype(float)
        left = np.eye(count) - poses @ np.linalg.pinv(poses)
        gaps = [np.arange(count) >= gap for gap in range(5, count - 4)]
        apart = np.column_stack([place[:count] / 200.0, *gaps]).T.astype(float) @ left
        apart /= np.linalg.norm(apart, axis=1)[:, None]
        square = ((vectors[:, :count] @ apart.T) ** 2).reshape(3, reps, -1).sum(axis=0)
        degrees = freedom
        if math.isfinite(freedom):
            within = ((vectors[:, :count] @ left) ** 2).sum(axis=1).reshape(3, reps).sum(axis=0)
            square /= (within + total)[:, None]
            degrees += 3.0 * (count - 5)
        alarm |= (square > _thresholds(len(apart), error, degrees)).any(axis=1)
    assert_allclose(sum(error for _, error in stages(plan)), FALSE_ALARMS)
    spread = math.sqrt(FALSE_ALARMS / reps)
    assert 0.6 * FALSE_ALARMS < alarm.mean() < FALSE_ALARMS + 3.0 * spread


def test_a_change_that_went_back_is_still_found():
    plan, rng = schedule(200, 180, 60), np.random.default_rng(3)
    assert find_change(plan, read(plan, rng, lambda time: 9.0 * (0.1 < time < 0.2))).is_found


def test_a_drift_of_three_deviations_is_said():
    plan, rng = schedule(200, 180, 20), np.random.default_rng(3)
    readings = [read(plan, rng, lambda time: 3.0 * time) for _ in range(300)]
    assert np.mean([find_change(plan, each).is_found for each in readings]) >= 0.95


@pytest.mark.parametrize(
    ("change", "code", "size"),
    [(lambda time: 8.0 * time, "drift", 8.0), (lambda time: 9.0 * (time > 0.55), "step", 9.0)],
    ids=["drift", "moved tripod"],
)
def test_a_campaign_that_drifted_or_was_moved_states_no_bounds_and_says_why(change, code, size):
    rng = np.random.default_rng(2)
    errors, (way,) = away(rng, np.r_[12.0, np.abs(rng.normal(size=39))]), away(rng, np.ones(1))
    campaign = conducted(
        rng, errors, 110, lambda number, _: change((number - 1) / 110) * way, references=20
    )
    for answer in campaign.statements():
        assert answer.withheld in campaign.alarms()
        assert math.isnan(answer.upper_mm)
        assert math.isnan(answer.lower_mm)
        assert answer.value_mm > 0.0
    (numbers,) = (alarm.numbers for alarm in campaign.alarms() if alarm.code == code)
    assert abs(numbers["size"] - size) < 3.0 * numbers["deviation"]
    assert code == "drift" or numbers["after"] <= 61 < numbers["before"]
