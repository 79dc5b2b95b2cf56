"""Assessors beside each other: the study's own rows, honest bounds, and bounds that are too low."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import paper_settings as paper
import pytest

from kinacc.assess.adaptive import Campaign
from kinacc.assess.maximum import Maximum
from kinacc.assess.single_shot import SingleShot
from kinacc.assess.statement import Statement
from kinacc.errors import InputError
from kinacc.study import monte_carlo
from kinacc.study.monte_carlo import evaluate_assessors

ERRORS = np.random.default_rng(11).normal(size=(40, 3)) * 0.3
TRUE = float(np.linalg.norm(ERRORS, axis=1).max())


@dataclass(frozen=True)
class LargestReading:
    """The paper's maximum as one would write it in a notebook, with a bound on what it measured."""

    upper_mm: float = math.nan
    name = "largest_reading"

    def begin(self, candidates):
        return LargestCampaign(self, candidates)


class LargestCampaign(Campaign):
    def next(self):
        taken = self.ledger.taken
        return taken if taken < self.ledger.candidates.points else None

    def statements(self):
        largest_mm = float(self.ledger.sizes_mm().max())
        return (Statement("measured", value_mm=largest_mm, upper_mm=self.settings.upper_mm),)


@dataclass(frozen=True)
class Shrunk:
    """Bounds of another assessor less a fifth."""

    measurements: int
    name: str = "shrunk"

    def begin(self, candidates):
        campaign = SingleShot(self.measurements).begin(candidates)
        stated = campaign.statements
        campaign.statements = lambda: [
            replace(each, upper_mm=0.8 * each.upper_mm) for each in stated()
        ]
        return campaign


def test_a_maximum_of_ones_own_gives_the_rows_of_the_study():
    section = paper.study(measurements=40)
    visits = monte_carlo.Visits(40, section["visiting_order"])
    study = monte_carlo.simulate(ERRORS, [0.1, 0.3], range(5), visits, 3, [Maximum(40)])
    own = monte_carlo.simulate(ERRORS, [0.1, 0.3], range(5), visits, 3, [LargestReading()])
    for name in ("noise_mm", "repetition", "measurements", "points_visited"):
        assert own[name].tolist() == study[name].tolist()
    assert own["assessed_mm"].to_numpy() == pytest.approx(study["assessed_mm"], rel=1e-12)
    table = evaluate_assessors(ERRORS, [LargestReading()], [0.1, 0.3], 40, 5, 3)
    summary = monte_carlo.summary(study, TRUE)
    for name in ("mean_mm", "min_mm", "max_mm", "bias_mm", "rmse_mm", "repetitions"):
        assert table[name].to_numpy() == pytest.approx(summary[name], rel=1e-9)
    assert table["stated"].tolist() == [0.0, 0.0]
    assert table["coverage"].isna().all()


def test_honest_bounds_cover_and_bounds_shrunk_by_a_fifth_are_shown_to_fail():
    table = evaluate_assessors(ERRORS[:8], [SingleShot(1), Shrunk(1), Maximum(1)], 0.1, 8, 300, 1)
    honest, shrunk, maximum = table.to_dict("records")
    assert honest["coverage"] >= 0.91
    assert honest["lower_coverage"] >= 0.91
    assert 0.1 < shrunk["coverage"] < 0.8  # 300 campaigns, each with a bound that holds or not
    assert (honest["stated"], maximum["stated"]) == (1.0, 0.0)
    # One world for all: the same readings have the same largest.
    assert honest["mean_mm"] == pytest.approx(maximum["mean_mm"], rel=1e-9)
    assert honest["width_mm"] > shrunk["width_mm"] > 0.0


@pytest.mark.parametrize(("budget", "coverage"), [(2, 1.0), (3, 0.0)])
def test_a_bound_on_measured_points_is_held_to_these_alone(budget, coverage):
    errors_mm = np.diag([0.1, 0.2, 5.0])
    table = evaluate_assessors(errors_mm, [LargestReading(1.0)], 0.01, budget, 4, 1)
    assert table["coverage"].tolist() == [coverage]


@pytest.mark.parametrize(
    ("noise", "budget", "repetitions", "where"),
    [(0.0, 40, 3, "noise_mm"), (0.1, 0, 3, "budget"), (0.1, 40, 0, "repetitions")],
)
def test_what_cannot_be_simulated_is_refused(noise, budget, repetitions, where):
    with pytest.raises(InputError, match=where):
        evaluate_assessors(ERRORS, [Maximum(1)], noise, budget, repetitions, 1)
    for errors in (ERRORS[:, :2], ERRORS * np.nan):
        with pytest.raises(InputError, match="true errors"):
            evaluate_assessors(errors, [Maximum(1)], 0.1, 40, 3, 1)
    with pytest.raises(InputError, match="twice"):
        evaluate_assessors(ERRORS, [Maximum(1), Maximum(2)], 0.1, 40, 3, 1)
