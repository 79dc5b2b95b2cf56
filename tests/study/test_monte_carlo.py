"""The Monte Carlo study: tables as promised, the same whatever the order, parts or neighbours."""

from __future__ import annotations

import numpy as np
import pandas as pd
import paper_settings as paper
import pytest

from kinacc.config.records import of_section
from kinacc.study import monte_carlo
from kinacc.study.monte_carlo import (
    StudySettings,
    assessors,
    default_reading,
    readings,
    simulate,
    summary,
)

ERROR = np.random.default_rng(11).normal(size=(40, 3)) * 0.3
TRUE = float(np.linalg.norm(ERROR, axis=1).max())
SECTION = paper.study(noise_mm=[0.1, 0.3], repetitions=4, measurements=40)
SMALL = of_section(StudySettings, SECTION)
POINTS = {
    "point": np.arange(40),
    "ex_mm": ERROR[:, 0],
    "ey_mm": ERROR[:, 1],
    "ez_mm": ERROR[:, 2],
    "true_error_mm": np.linalg.norm(ERROR, axis=1),
}


def configured(**study) -> dict:
    return {"seed": 3, "study": SECTION | study}


def simulated(error, noise_mm, repetitions, seed) -> pd.DataFrame:
    return monte_carlo.ordered(
        simulate(error, noise_mm, repetitions, SMALL, seed, assessors(SECTION))
    ).drop(columns="bounded_mm")


def equal(one, other) -> bool:
    return (
        pd.DataFrame(dict(one))
        .reset_index(drop=True)
        .equals(pd.DataFrame(dict(other)).reset_index(drop=True))
    )


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    return simulated(ERROR, SMALL.noise_mm, range(4), 3)


def test_parts_joined_in_any_order_give_the_same_bytes(rows):
    for of in (1, 3):
        parts = [
            monte_carlo.simulated(
                {"assessment_points": POINTS}, configured() | {"part": {"number": i, "of": of}}
            )["study_chunk"]
            for i in range(of, 0, -1)
        ]
        joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        inputs = {"assessment_points": POINTS, "study_chunk": joined}
        made = monte_carlo.summed_up(inputs, configured())
        assert equal(made["study"], monte_carlo._columns("study", default_reading(rows, SECTION)))
        assert equal(made["study_summary"], summary(default_reading(rows, SECTION), TRUE))
        assert equal(made["readings"], readings(rows, TRUE))


def test_a_simulation_does_not_know_its_neighbours(rows):
    alone = simulated(ERROR, [0.3], [2], 3)
    assert equal(alone, rows[(rows["noise_mm"] == 0.3) & (rows["repetition"] == 2)])
    other = simulated(ERROR, [0.3], [2], 4)
    assert not np.array_equal(other["assessed_mm"], alone["assessed_mm"])
