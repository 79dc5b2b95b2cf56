"""Model invalidation against the plain oracle: single runs, and every search, on random worlds."""

from __future__ import annotations

import functools
import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from oracles import assessors as oracle

from kinacc.assess.invalidation_kernels import chi2_3
from kinacc.assess.model_invalidation import ModelInvalidation, point_probability
from kinacc.assess.random_numbers import key_of
from kinacc.assess.world import drawn_world, measured_world

SWITCHES = list(itertools.product(("squared", "as_printed"), ("r", "sqrt_r")))
DECISION = 1e-11  # a probability this close to alpha may be decided either way by round-off


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


kinds = st.sampled_from(["plain", "own_noise", "tied", "zeros"])
switches_ = st.sampled_from(SWITCHES)
alphas = st.sampled_from([0.05, 0.6, 0.6, 0.95])


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
    expected = oracle.stats.chi2.cdf(x, 3)
    assert chi2_3(x) == pytest.approx(expected, rel=1e-13, abs=1e-300)
    assert point_probability(x, "as_printed") == pytest.approx(expected, rel=1e-13, abs=1e-300)
    assert point_probability(x, "squared") == pytest.approx(
        oracle.stats.chi2.cdf(x * x, 3), rel=1e-13
    )


@settings(max_examples=150)
@given(
    seed=st.integers(0, 2**32 - 1),
    m=st.sampled_from([1, 2, 5, 30, 120]),
    budget=st.sampled_from([1, 2, 7, 40, 120]),
    kind=kinds,
    switches=switches_,
    alpha=alphas,
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
    assert [(s.row, s.repeat) for s in steps] == [(s.point, s.repeat) for s in expected.steps]
    for mine, theirs in zip(steps, expected.steps, strict=True):
        assert mine.measured_mm == pytest.approx(theirs.measured, rel=1e-12, abs=1e-15)
        assert mine.averaged_mm == pytest.approx(theirs.averaged, rel=1e-12, abs=1e-15)
        assert mine.rejection_probability == pytest.approx(theirs.probability, abs=1e-12)


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    m=st.sampled_from([1, 2, 4, 9, 20]),
    budget=st.sampled_from([1, 2, 8, 20]),
    kind=kinds,
    switches=switches_,
    alpha=alphas,
)
def test_every_search_equals_the_full_scan_of_the_oracle(seed, m, budget, kind, switches, alpha):
    case = random_case(seed, m, budget, kind, 0.03)
    chosen = oracle.Switches(*switches, alpha=alpha)
    top = oracle.largest_first_reading(case.reading, case.points, budget)
    clear = True

    def rejects(eta: float) -> bool:
        nonlocal clear
        run = case.run(eta, budget, chosen)
        clear = clear and not undecided(run, alpha)
        return run.rejected

    flags = oracle.decisions(rejects, top)
    halved = oracle.bisection(rejects, top)
    assume(clear)
    assert assessor(chosen, budget, "from_above").assessed_mm(case.world) == pytest.approx(
        oracle.from_above(flags) / 1000, abs=1e-12
    )
    assert assessor(chosen, budget, "from_below").assessed_mm(case.world) == pytest.approx(
        oracle.from_below(flags) / 1000, abs=1e-12
    )
    assert assessor(chosen, budget, "bisection").assessed_mm(case.world) == pytest.approx(
        halved, abs=1e-12
    )


@pytest.mark.parametrize("switches", SWITCHES, ids="-".join)
@pytest.mark.parametrize("noise", [0.05, 0.3])
def test_full_size_searches_equal_a_scan_of_single_runs(switches, noise):
    """200 points, 200 measurements: the runs are held to the oracle above, the searches to a run
    at every single bound."""
    rng = np.random.default_rng(77)
    chosen = oracle.Switches(*switches)
    single = assessor(chosen, 200)
    for repetition in range(6):
        error = rng.normal(size=(200, 3)) * 0.23
        error *= 0.906 / np.linalg.norm(error, axis=1).max()
        world = drawn_world(error, noise, key_of(5, repetition), 201)
        rejects = functools.partial(is_rejected, single, world)
        top = max(oracle.norm(world.reading_mm(j, 0).tolist()) for j in range(200))
        flags = oracle.decisions(rejects, top)
        assert round(single.assessed_mm(world) * 1000) == oracle.from_above(flags)
        below = assessor(chosen, 200, "from_below").assessed_mm(world)
        assert round(below * 1000) == oracle.from_below(flags)
        bisected = assessor(chosen, 200, "bisection").assessed_mm(world)
        assert bisected == pytest.approx(oracle.bisection(rejects, top), abs=1e-12)


def is_rejected(single: ModelInvalidation, world, eta: float) -> bool:
    return single.run(world, eta).rejected


def test_assessment_reports_the_run_at_the_assessed_bound():
    case = random_case(4, 30, 40, "plain", 0.4)
    for search in ("from_above", "from_below", "bisection"):
        single = assessor(oracle.Switches(), 40, search)
        result = single.assess(case.world)
        expected = case.run(result.assessed_mm, 40, oracle.Switches())
        assert not expected.rejected
        assert result.measurements == expected.measurements
        assert result.points_visited == expected.points_visited
        assert (result.lower_mm, result.upper_mm) == (None, None)
