"""The random streams against numpy's own Philox, and the noise against a normal distribution."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from oracles.worlds import philox_words
from scipy import stats

from kinacc.assess import random_numbers
from kinacc.assess.world import drawn_world

words = st.integers(0, 2**64 - 1)


@given(key0=words, key1=words, visit=st.integers(0, 1000), point=st.integers(0, 10**6))
def test_words_are_those_of_numpy_philox(key0, key1, visit, point):
    mine = random_numbers.philox(
        np.uint64(key0), np.uint64(key1), np.uint64(visit), np.uint64(point)
    )
    assert [int(x) for x in mine] == philox_words([key0, key1], visit, point)


def test_noise_is_standard_normal_and_independent_by_address():
    m, visits = 400, 40
    key = random_numbers.key_of(2024, 3, 17)
    world = drawn_world(np.zeros((m, 3)), 1.0, key, visits).complete()
    noise = np.array([[world.reading_mm(j, v) for v in range(visits)] for j in range(m)])
    # A correct generator fails each of these once in ten thousand keys; the key is fixed.
    assert stats.kstest(noise.ravel(), "norm").pvalue > 1e-4
    assert abs(noise.var() - 1) < 4 * math.sqrt(2 / noise.size)
    bound = 4 / math.sqrt(noise[..., 0].size)
    assert abs(np.corrcoef(noise.reshape(-1, 3).T) - np.eye(3)).max() < bound
    assert abs(np.mean(noise[1:] * noise[:-1])) < bound
    assert abs(np.mean(noise[:, 1:] * noise[:, :-1])) < bound
    squares = noise**2 - 1
    assert abs(np.mean(squares[..., 0] * squares[..., 1])) < 2 * bound * 2


def test_a_reading_belongs_to_its_point_whatever_the_order_and_the_rest():
    rng = np.random.default_rng(0)
    error = rng.normal(size=(12, 3))
    key = random_numbers.key_of(1, 2, 3)
    plain = drawn_world(error, 0.2, key, 9)
    order = rng.permutation(12)
    shuffled = drawn_world(error, 0.2, key, 30, order)
    few = drawn_world(error[:5], 0.2, key, 9)
    for row, point in enumerate(order):
        for visit in (8, 0, 3):
            np.testing.assert_array_equal(
                shuffled.reading_mm(row, visit), plain.reading_mm(point, visit)
            )
    for visit in (2, 7):
        np.testing.assert_array_equal(few.reading_mm(4, visit), plain.reading_mm(4, visit))
    doubled = drawn_world(error, 0.4, key, 9)
    np.testing.assert_allclose(
        doubled.reading_mm(6, 5) - error[6],
        2 * (plain.reading_mm(6, 5) - error[6]),
        rtol=0,
        atol=1e-15,
    )


def test_keys_of_different_simulations_differ():
    keys = {
        tuple(int(x) for x in random_numbers.key_of(seed, level, repetition))
        for seed in range(3)
        for level in range(6)
        for repetition in range(100)
    }
    assert len(keys) == 1800
