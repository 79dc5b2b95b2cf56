"""The scans over bounds equal a run at every bound of the grid, on every simulation tried."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import paper_settings as paper
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinacc.assess import invalidation_kernels as kernels
from kinacc.assess.model_invalidation import ModelInvalidation
from kinacc.assess.random_numbers import key_of
from kinacc.assess.world import drawn_world, measured_world

SWITCHES = list(product(("squared", "as_printed"), ("r", "sqrt_r")))


def field(seed: int, points: int, largest_mm: float = 0.906) -> np.ndarray:
    """Errors (points, 3) with gamma magnitudes of the shape of the paper's Table III."""
    rng = np.random.default_rng(seed)
    error = rng.normal(size=(points, 3))
    error *= (rng.gamma(5.36, 1.0, points) / np.linalg.norm(error, axis=1))[:, None]
    return error * largest_mm / np.linalg.norm(error, axis=1).max()


def arguments(assessor: ModelInvalidation) -> tuple:
    power = {"r": 0.5, "sqrt_r": 0.25}[assessor.covariance]
    return assessor.alpha, assessor.distance == "squared", power, assessor.measurements


def check(world, distance: str, covariance: str, **more) -> np.ndarray:
    """Hold the searches, and the scans between any two changes of decision, to single runs."""
    plain = paper.assessor("model_invalidation", distance=distance, covariance=covariance, **more)
    top, settings = plain.top(world), arguments(plain)
    flags = np.array([kernels.run(world.arrays, k / 1000, *settings)[0] for k in range(top + 1)])
    highest = int(np.max(np.flatnonzero(flags), initial=-1))
    lowest = int(np.flatnonzero(~flags)[0])
    for search, k in (("from_above", highest + 1), ("from_below", lowest)):
        assessor = replace(plain, search=search)
        assert assessor.assess(world).assessed_mm == k / 1000
    # The searches stop at one change of the decision; these ask for all of them.
    changes = np.flatnonzero(flags[1:] != flags[:-1]).tolist()
    for k, below in zip(changes, [-1, *changes][:-1], strict=True):
        if flags[k]:
            found, _ = kernels.scan(world.arrays, below + 1, top, True, *settings)
            assert found == k + 1
        else:
            found, _ = kernels.scan(world.arrays, 0, k, False, *settings)
            assert found == below
    return flags


@pytest.mark.parametrize("noise_mm", [0.05, 0.15, 0.3])
@pytest.mark.parametrize(("distance", "covariance"), SWITCHES)
def test_scans_of_the_study_equal_every_single_run(noise_mm, distance, covariance):
    flips = []
    for repetition in range(3):
        error = field(repetition, 200)
        world = drawn_world(error, noise_mm, key_of(7, repetition), 200)
        flags = check(world, distance, covariance)
        flips.append(np.count_nonzero(flags[1:] != flags[:-1]))
    # The decision is not monotone in the bound: a bisection could not have found the same.
    assert noise_mm < 0.3 or max(flips) > 2


@pytest.mark.parametrize(("distance", "covariance"), SWITCHES)
def test_scans_of_many_noisy_worlds_equal_every_single_run(distance, covariance):
    # Few points, much noise, a long budget: much measuring again, at points that change places.
    rng = np.random.default_rng(0)
    for case in range(150):
        points, budget = int(rng.integers(3, 25)), int(rng.integers(20, 90))
        world = drawn_world(field(case, points), rng.uniform(0.2, 0.6), key_of(case), budget)
        alpha = float(rng.choice([0.3, 0.6, 0.8]))
        check(world, distance, covariance, alpha=alpha, measurements=budget)


@settings(max_examples=60)
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
    error = field(seed, points, rng.choice([0.1, 0.9]))
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
    plain = dict(zip(("distance", "covariance"), switches, strict=True))
    single = paper.assessor("model_invalidation", alpha=alpha, measurements=budget, **plain)
    for eta_mm in (0.0, 0.2, *rng.uniform(0.0, 1.2, 3)):
        run, steps = single.run(world, eta_mm), single.history(world, eta_mm)
        assert run.measurements == len(steps)
        assert run.points_visited == len({step.row for step in steps})
        assert run.rejection_probability == pytest.approx(
            steps[-1].rejection_probability, abs=1e-12
        )


@pytest.mark.parametrize("squared", [True, False])
def test_the_table_of_a_scan_is_as_near_as_its_guard_takes_it_to_be(squared):
    sizes = np.concatenate([np.linspace(-0.1, 11.0, 5003), np.geomspace(1e-12, 200.0, 3001)])
    about = [kernels._about(size, 1.0, 0.0, squared) for size in sizes]
    exact = [kernels._miss(size, 1.0, 0.0, squared) for size in sizes]
    assert np.max(np.abs(np.subtract(about, exact))) < kernels._ABOUT / 2


def test_bisection_ends_within_a_micrometre_of_a_change_of_decision():
    for repetition in range(5):
        world = drawn_world(field(3, 60), 0.2, key_of(repetition), 80)
        assessor = paper.assessor("model_invalidation", measurements=80, search="bisection")
        found = assessor.assessed_mm(world)
        assert not assessor.run(world, found).rejected
        below = [found - step for step in np.linspace(0, 1e-3, 200)]
        assert any(assessor.run(world, max(eta, 0.0)).rejected for eta in below)


def test_a_scan_follows_far_fewer_paths_than_there_are_bounds():
    world = drawn_world(field(0, 200), 0.05, key_of(1), 200)
    top = paper.assessor("model_invalidation").top(world)
    _, pieces = kernels.scan(world.arrays, 0, top, False, 0.6, True, 0.5, 200)
    assert pieces < top / 10
