"""Whether errors are worse than before, by more than chance makes of it."""

import numpy as np
import pytest

from kinacc.distributions import gamma99
from kinacc.gate.chance import STATISTICS, Sample, change, statistic_of


def sizes(seed, count, scale=1.0):
    return scale * np.linalg.norm(np.random.default_rng(seed).normal(size=(count, 3)), axis=1)


def sample(values, configuration=None):
    places = np.arange(len(values)) if configuration is None else configuration
    return Sample(np.asarray(values), places)


@pytest.mark.parametrize("statistic", STATISTICS)
def test_the_same_errors_are_not_worse_however_few(statistic):
    found = change(statistic, sample(sizes(1, 5)), sample(sizes(1, 5)), True, 0.99)
    assert (found.difference, found.least, found.open) == (0.0, 0.0, "")


@pytest.mark.parametrize("statistic", ["mean", "rms", "p99_gamma", "p99"])
@pytest.mark.parametrize("paired", [True, False])
def test_errors_twice_as_large_are_worse_and_the_least_is_below_what_is_seen(statistic, paired):
    before, now = sizes(1, 300), sizes(2, 300, 2.0)
    found = change(statistic, sample(now), sample(before), paired, 0.99)
    of = statistic_of(statistic, now) - statistic_of(statistic, before)
    assert found.difference == pytest.approx(of)
    assert 0.0 < found.least < found.difference
    less_sure = change(statistic, sample(now), sample(before), paired, 0.9)
    assert found.least < less_sure.least < found.difference


def test_the_same_poses_show_a_change_that_others_hide():
    before = sizes(1, 300)
    noise = np.random.default_rng(3).normal(scale=0.01, size=300)
    now = before + 0.03 + noise
    together = change("mean", sample(now), sample(before), True, 0.99)
    apart = change("mean", sample(now), sample(before), False, 0.99)
    assert together.least > 0.02
    assert apart.least < 0.0


def test_readings_of_one_pose_count_as_one():
    poses = np.repeat(np.arange(30), 20)
    before, now = np.repeat(sizes(1, 30), 20), np.repeat(sizes(2, 30, 1.4), 20)
    together = change("mean", sample(now, poses), sample(before, poses), False, 0.99)
    as_if = change("mean", sample(now), sample(before), False, 0.99)
    once = change("mean", sample(now[::20]), sample(before[::20]), False, 0.99)
    assert together.least == pytest.approx(once.least, abs=0.02)
    assert as_if.least > together.least + 0.2


def test_the_gamma_quantile_is_that_of_the_tables():
    now, before = sizes(2, 60), sizes(1, 60)
    found = change("p99_gamma", sample(now), sample(before), False, 0.99)
    assert found.difference == pytest.approx(gamma99(now) - gamma99(before), rel=1e-9)


def test_a_largest_error_is_held_against_one_of_as_many_only():
    found = change("largest", sample(sizes(1, 400)), sample(sizes(2, 200)), False, 0.99)
    assert np.isnan(found.least)
    assert found.open == "a maximum of 400 errors says nothing beside one of 200; use p99"
    assert not change("largest", sample(sizes(1, 50)), sample(sizes(2, 50)), True, 0.99).open
    assert (
        "by chance"
        in change("largest", sample(sizes(1, 50)), sample(sizes(2, 50)), False, 0.99).open
    )


def test_a_largest_error_that_grew_at_the_same_poses_is_no_chance():
    before = sizes(1, 50)
    now = np.where(np.arange(50) == np.argmax(before), before + 3.0, before)
    found = change("largest", sample(now), sample(before), True, 0.99)
    assert found.least == found.difference == pytest.approx(3.0)


@pytest.mark.parametrize(("statistic", "count"), [("mean", 19), ("rms", 8), ("p99", 199)])
def test_too_few_poses_leave_it_undecided(statistic, count):
    found = change(statistic, sample(sizes(1, count, 9.0)), sample(sizes(2, 500)), False, 0.99)
    assert np.isnan(found.least)
    assert f"{count} poses are too few" in found.open


def test_an_arm_that_is_worse_by_what_is_allowed_seldom_fails():
    """A few of the runs of benchmarks/gate_chance.py: 1 of 100 is asked for."""
    draw, failed = np.random.default_rng(7), 0
    allowed = 0.1 * np.sqrt(8.0 / np.pi)  # of the mean of a tenth more
    for _ in range(200):
        before = np.linalg.norm(draw.normal(size=(20, 3)), axis=1)
        now = 1.1 * np.linalg.norm(draw.normal(size=(20, 3)), axis=1)
        failed += change("mean", sample(now), sample(before), False, 0.99).least > allowed
    assert failed <= 7  # at 1 of 100, more come in 1 of 1,000 series
