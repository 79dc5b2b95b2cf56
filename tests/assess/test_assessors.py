"""The common interface of the assessors, what they refuse, and what is known about them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import paper_settings as paper
import pytest

from kinacc.assess.assessor import Assessment, Assessor, every_reading
from kinacc.assess.maximum import Maximum
from kinacc.assess.model_invalidation import ModelInvalidation
from kinacc.assess.random_numbers import key_of
from kinacc.assess.registry import ASSESSORS
from kinacc.assess.world import drawn_world, measured_world
from kinacc.config import schema
from kinacc.errors import InputError
from kinacc.study import monte_carlo


def shell(points: int, size_mm: float = 1.0) -> np.ndarray:
    """Errors of one magnitude in random directions."""
    error = np.random.default_rng(5).normal(size=(points, 3))
    return size_mm * error / np.linalg.norm(error, axis=1)[:, None]


PAPER = monte_carlo.ASSESSORS


def test_registry_names_each_assessor_as_its_tables_do():
    assert list(PAPER) == ["maximum", "outlier_rejection", "model_invalidation"]
    for name, cls in PAPER.items():
        assert cls.name == name
        assert ASSESSORS[name] is cls
        for switch, choices in cls.switches.items():
            assert getattr(paper.assessor(name), switch) in choices
            assert set(choices) == set(schema.key(f"study.{switch}")["enum"])


def test_readings_of_an_assessor_are_all_combinations_and_keep_its_other_settings():
    counts = [len(set(every_reading(cls, paper.study()))) for cls in PAPER.values()]
    assert counts == [1, 3, 12]
    assert {each.alpha for each in every_reading(ModelInvalidation, paper.study(alpha=0.3))} == {
        0.3
    }


def test_another_assessor_needs_nothing_but_the_interface():
    @dataclass(frozen=True)
    class Median(Assessor):
        measurements: int
        name: ClassVar[str] = "median"

        def assess(self, world):
            sizes = world.magnitudes_mm(self.measurements)
            return Assessment(float(np.median(sizes)), sizes.size, sizes.size, 0.0, 2.0)

    world = drawn_world(shell(9), 0.01, key_of(1), 5)
    (only,) = every_reading(Median, paper.study())
    assert only.assess(world).assessed_mm == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("cls", PAPER.values())
@pytest.mark.parametrize(("points", "budget"), [(1, 1), (1, 50), (6, 1), (6, 4), (6, 50)])
def test_budget_and_points_of_any_size(cls, points, budget):
    world = drawn_world(shell(points), 0.1, key_of(points), budget)
    for assessor in every_reading(cls, paper.study(measurements=budget)):
        found = assessor.assess(world)
        assert 0 <= found.assessed_mm < 2
        assert 1 <= found.points_visited <= min(points, budget)
        assert found.points_visited <= found.measurements <= budget


@pytest.mark.parametrize("cls", PAPER.values())
def test_with_hardly_any_noise_every_assessor_finds_the_truth(cls):
    error = shell(30) * np.linspace(0.98, 1.0, 30)[:, None]
    world = drawn_world(error, 1e-7, key_of(2), 40)
    for assessor in every_reading(cls, paper.study(measurements=40)):
        assert assessor.assess(world).assessed_mm == pytest.approx(1.0, abs=1.1e-3)


def test_a_bound_well_above_every_error_is_hardly_ever_rejected_and_one_well_below_always():
    error, assessor = shell(50), paper.assessor("model_invalidation", measurements=60)
    worlds = [drawn_world(error, 0.02, key_of(9, r), 60) for r in range(50)]
    assert not any(assessor.run(world, 1.2).rejected for world in worlds)
    assert all(assessor.run(world, 0.8).rejected for world in worlds)


def test_rejection_at_one_point_and_one_measurement_has_the_rate_eq_22_gives():
    # At the true bound one measurement rejects when its excess beyond eta passes the alpha quantile
    # of chi(3). For sigma much smaller than eta the excess is one-dimensional normal.
    median_of_chi_square_3 = 2.365974
    assessor = paper.assessor("model_invalidation", measurements=1, alpha=0.5)
    worlds = (drawn_world(shell(1), 1e-4, key_of(4, r), 1) for r in range(4000))
    rate = np.mean([assessor.run(world, 1.0).rejected for world in worlds])
    expected = 0.5 * math.erfc(math.sqrt(median_of_chi_square_3 / 2))
    assert rate == pytest.approx(expected, abs=4 * math.sqrt(expected / 4000))


@pytest.mark.parametrize(
    ("first", "repeats", "sigma", "where"),
    [
        (np.zeros((0, 3)), np.zeros((0, 1, 3)), 0.1, "first readings"),
        (np.zeros((4, 2)), np.zeros((4, 1, 3)), 0.1, "first readings"),
        (np.full((4, 3), np.nan), np.zeros((4, 1, 3)), 0.1, "first readings"),
        (np.ones((4, 3)), np.ones((3, 1, 3)), 0.1, "repeats"),
        (np.ones((4, 3)), np.full((4, 1, 3), np.inf), 0.1, "repeats"),
        (np.ones((4, 3)), np.ones((4, 1, 3)), 0.0, "noise"),
        (np.ones((4, 3)), np.ones((4, 1, 3)), [0.1, 0.1], "noise"),
    ],
)
def test_readings_that_make_no_world_are_refused(first, repeats, sigma, where):
    with pytest.raises(InputError) as caught:
        measured_world(first, repeats, sigma)
    assert [problem.where for problem in caught.value.problems] == [where]


def test_a_world_with_too_few_repeats_is_refused_by_the_method_that_repeats():
    world = measured_world(shell(4), np.ones((4, 2, 3)), 0.1)
    assert Maximum(measurements=10).assess(world).measurements == 4
    with pytest.raises(InputError, match="10 readings a point"):
        paper.assessor("model_invalidation", measurements=10).assess(world)


def test_drawn_worlds_refuse_orders_that_are_not_permutations():
    with pytest.raises(InputError, match="visiting order"):
        drawn_world(shell(3), 0.1, key_of(1), 2, [0, 1, 1])
