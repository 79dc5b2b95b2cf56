"""Readings that noise does not explain are named, and hardly ever one that it does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from kinacc.assess.suspicious_readings import Noise, PointReadings, suspicious_readings

COUNTS = (1, 3, 5, 7, 9, 11, 14, 18, 22, 28, 35, 44, 55, 69, 86)
POINTS, BEYOND = 40, 60
STATED = Noise()


def campaign(seed, factor=1.0, wrong=None):
    """Visit 40 points, then read again whatever looks largest; ``wrong``: {number: shift}."""
    rng = np.random.default_rng(seed)
    error = rng.normal(size=(POINTS, 3))
    root = np.diag([1.0, 0.5, 2.0])
    values, numbers, blocks, taken = {}, {}, {}, 0

    def read(point):
        nonlocal taken
        taken += 1
        value = error[point] + factor * root @ rng.normal(size=3)
        values.setdefault(point, []).append(value + (wrong or {}).get(taken, 0.0))
        numbers.setdefault(point, []).append(taken)
        blocks.setdefault(point, []).append(done[point])

    done = [0] * POINTS
    for point in range(POINTS):
        read(point)
    while True:
        point = max(values, key=lambda row: np.linalg.norm(np.mean(values[row], axis=0)))
        block = COUNTS[done[point] + 1] - COUNTS[done[point]]
        if taken + block > POINTS + BEYOND:
            break
        done[point] += 1
        for _ in range(block):
            read(point)
    even = {row: np.repeat((root @ root)[None], len(each), axis=0) for row, each in values.items()}
    return {
        row: PointReadings(*map(np.array, (numbers[row], blocks[row], values[row])), even[row])
        for row in values
    }


def named(readings, noise=STATED, **more):
    return suspicious_readings(readings, BEYOND, POINTS, noise, **more)


def point_of(readings, number):
    return next(row for row, each in readings.items() if number in each.numbers)


@pytest.mark.parametrize(
    ("factor", "noise"), [(1.0, Noise()), (1.3, Noise(1.3)), (1.0, Noise(1.0, 60.0))]
)
def test_nothing_is_named_where_all_is_noise_although_points_were_chosen_for_being_large(
    factor, noise
):
    alarms = sum(bool(named(campaign(s, factor), noise, false_alarm=0.2)) for s in range(50))
    assert alarms <= 0.2 * 50 + 3.0 * math.sqrt(50 * 0.2 * 0.8)
    # Shared among readings of which not all are taken, but no wider than that.
    assert noise.freedom < math.inf or alarms >= 2


@pytest.mark.parametrize("number", [60, 75, 90])
def test_a_reading_far_off_is_named_by_its_number_and_its_point(number):
    readings = campaign(7, wrong={number: (20.0, 0.0, 0.0)})
    (found,) = named(readings)
    assert (found.number, found.row) == (number, point_of(readings, number))
    assert found.deviations > 5.0


def test_a_first_reading_that_later_ones_deny_is_named():
    readings = campaign(7, wrong={13: (20.0, 0.0, 0.0)})
    (found,) = named(readings)
    assert (found.number, found.row) == (13, 12)


def test_noise_estimated_from_few_readings_makes_suspicion_harder():
    readings = campaign(7, wrong={75: (7.0, 0.0, 0.0)})
    assert named(readings)
    assert not named(readings, Noise(1.0, 8.0))


def test_points_read_once_are_no_ground_for_suspicion():
    once = PointReadings(*map(np.array, ([1], [0], [[99.0] * 3])), np.eye(3)[None])
    assert named({3: once}) == ()
