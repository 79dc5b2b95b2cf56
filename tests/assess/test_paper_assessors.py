"""The paper's three assessors against plain oracles, and the worlds that they are shown."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import paper_settings as paper
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from oracles import assessors as oracle
from oracles.worlds import philox_words

from kinacc.assess.invalidation_kernels import chi2_3_above, philox
from kinacc.assess.model_invalidation import ModelInvalidation
from kinacc.assess.world import World, drawn_world, key_of
from kinacc.errors import InputError

kinds = st.sampled_from(["plain", "own_noise", "tied", "zeros"])
words = st.integers(0, 2**64 - 1)


SWITCHES = list(itertools.product(("squared", "as_printed"), ("r", "sqrt_r")))
DECISION = 1e-11  # a probability this close to alpha may be decided either way by round-off


def measured_world(first_mm, repeats_mm, sigma_mm) -> World:
    """World of first readings (m, 3) and repeats (m, V, 3), noise a number or (m,), mm."""
    first = np.asarray(first_mm, dtype=float)
    readings = np.concatenate([first[:, None, :], np.asarray(repeats_mm, dtype=float)], axis=1)
    points, visits = readings.shape[:2]
    sums = np.cumsum(readings, axis=1)
    sizes = np.sqrt(np.sum((sums / np.arange(1.0, visits + 1)[:, None]) ** 2, axis=2))
    sigma = np.broadcast_to(np.asarray(sigma_mm, dtype=float), points).copy()
    known, index = np.full(points, visits), np.arange(points)
    return World(readings, known, sigma, first, np.zeros(2, np.uint64), index, sums[:, -1], sizes)


class Case:
    """A world in both shapes: arrays for kinacc, a reading function for the oracle."""

    def __init__(self, first, repeats, sigma):
        self.first, self.repeats = first, repeats
        self.sigma = np.broadcast_to(np.asarray(sigma, float), len(first)).copy()
        self.world = measured_world(first, repeats, self.sigma)
        self.points = range(len(first))

    def reading(self, j: int, v: int) -> list[float]:
        return (self.first[j] if v == 1 else self.repeats[j, v - 2]).tolist()

    def run(self, eta, budget, switches) -> oracle.Run:
        return oracle.invalidation_run(
            self.reading, self.points, self.sigma.tolist(), eta, budget, switches
        )

    @property
    def top(self) -> float:
        return max(oracle.norm(row) for row in self.first.tolist())


def random_case(seed: int, m: int, budget: int, kind: str, size: float) -> Case:
    """Errors of about ``size`` mm under noise of a tenth to twice that; kinds with exact ties,
    with readings of exactly zero, and with a noise of its own at every point."""
    rng = np.random.default_rng(seed)
    error = rng.normal(size=(m, 3)) * size
    noise = size * rng.uniform(0.1, 2)
    sigma = np.full(m, noise)
    if kind == "own_noise":
        sigma = noise * rng.uniform(0.3, 3, m)
    first = error + rng.normal(size=(m, 3)) * sigma[:, None]
    repeats = error[:, None] + rng.normal(size=(m, budget, 3)) * sigma[:, None, None]
    if kind == "tied":
        same = rng.integers(0, max(1, m // 3), m)
        first, repeats, sigma = first[same], repeats[same], sigma[same]
    if kind == "zeros":
        first[rng.random(m) < 0.3] = 0.0
    return Case(first, repeats, sigma)


def assessor(switches: oracle.Switches, budget: int, search: str = "from_above"):
    return ModelInvalidation(
        measurements=budget,
        alpha=switches.alpha,
        distance=switches.distance,
        covariance=switches.covariance,
        search=search,
    )


def undecided(run: oracle.Run, alpha: float) -> bool:
    return any(abs(step.probability - alpha) < DECISION for step in run.steps)


@given(x=st.one_of(st.floats(0, 0.05), st.floats(0, 60)))
def test_chi_square_equals_scipy(x):
    expected = oracle.stats.chi2.sf(x, 3)
    assert chi2_3_above(x) == pytest.approx(expected, rel=1e-13, abs=1e-300)


@settings(max_examples=80)
@given(
    seed=st.integers(0, 2**32 - 1),
    m=st.sampled_from([1, 2, 5, 30, 120]),
    budget=st.sampled_from([1, 2, 7, 40, 120]),
    kind=kinds,
    switches=st.sampled_from(SWITCHES),
    alpha=st.sampled_from([0.05, 0.6, 0.95]),
    where=st.floats(0, 1.1),
)
def test_one_run_equals_the_oracle(seed, m, budget, kind, switches, alpha, where):
    case = random_case(seed, m, budget, kind, 0.4)
    chosen = oracle.Switches(*switches, alpha=alpha)
    eta = case.top * where
    expected = case.run(eta, budget, chosen)
    assume(not undecided(expected, alpha))
    run = assessor(chosen, budget).run(case.world, eta)
    assert run.rejected == expected.rejected
    assert run.measurements == expected.measurements
    assert run.points_visited == expected.points_visited
    assert run.rejection_probability == pytest.approx(expected.steps[-1].probability, abs=1e-12)
    steps = assessor(chosen, budget).history(case.world, eta)
    wanted = np.array(
        [(s.point, s.repeat, s.measured, s.averaged, s.probability) for s in expected.steps]
    )
    np.testing.assert_allclose(steps, wanted, rtol=1e-12, atol=1e-12)


def check(world, distance: str, covariance: str, **more) -> np.ndarray:
    """Hold the searches, and the scans between any two changes of decision, to single runs."""
    plain = paper.assessor("model_invalidation", distance=distance, covariance=covariance, **more)
    bounds = np.arange(plain.top(world) + 1) / 1000
    flags = np.array([plain.run(world, bound).rejected for bound in bounds])
    highest = int(np.max(np.flatnonzero(flags), initial=-1))
    lowest = int(np.flatnonzero(~flags)[0])
    for search, k in (("from_above", highest + 1), ("from_below", lowest)):
        assert replace(plain, search=search).assess(world).assessed_mm == k / 1000
    # The searches stop at one change of the decision; these ask for all of them.
    changes = np.flatnonzero(flags[1:] != flags[:-1]).tolist()
    for k, below in zip(changes, [-1, *changes][:-1], strict=True):
        if flags[k]:
            assert plain._scan(world, bounds[below + 1 :], False)[0] == k - below
        else:
            assert plain._scan(world, bounds[k::-1].copy(), True)[0] == k - below
    return flags


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32),
    points=st.sampled_from([1, 2, 7, 40]),
    budget=st.sampled_from([1, 2, 9, 40, 90]),
    noise_mm=st.sampled_from([1e-3, 0.05, 0.3, 1.0]),
    switches=st.sampled_from(SWITCHES),
    alpha=st.sampled_from([0.6, 0.05, 0.95, 1e-9, 1 - 1e-9]),
    kind=st.sampled_from(["drawn", "own_noise", "equal", "ties"]),
)
def test_scans_of_any_world_equal_every_single_run(
    seed, points, budget, noise_mm, switches, alpha, kind
):
    rng = np.random.default_rng(seed)
    error = rng.choice([0.05, 0.4]) * rng.normal(size=(points, 3))
    if kind == "equal":
        error[:] = error[0]
    if kind == "ties":
        # Readings on a coarse grid, so that scores and probabilities coincide exactly.
        readings = error[:, None] + noise_mm * rng.normal(size=(points, budget, 3))
        readings = np.round(readings, 1)
        world = measured_world(readings[:, 0], readings[:, 1:], noise_mm)
    else:
        sigma = noise_mm * rng.uniform(0.3, 2, points) if kind == "own_noise" else noise_mm
        world = drawn_world(error, sigma, key_of(seed), budget)
    check(world, *switches, alpha=alpha, measurements=budget)


@given(key0=words, key1=words, visit=st.integers(0, 1000), point=st.integers(0, 10**6))
def test_words_are_those_of_numpy_philox(key0, key1, visit, point):
    mine = philox(np.uint64(key0), np.uint64(key1), np.uint64(visit), np.uint64(point))
    assert [int(x) for x in mine] == philox_words([key0, key1], visit, point)


def test_a_world_with_fewer_readings_of_a_point_than_the_budget_is_refused():
    world = drawn_world(np.ones((2, 3)), 0.1, key_of(1), 5)
    with pytest.raises(InputError, match="5 readings a point for 6 measurements"):
        assessor(oracle.Switches(), 6).run(world, 0.1)
