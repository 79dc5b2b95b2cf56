"""The Monte Carlo study recomputed row by row from the seed, and its summaries in plain Python."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import paper_settings as paper
import pytest
from oracles import assessors as oracle
from oracles import worlds

from kinacc.assess.model_invalidation import ModelInvalidation
from kinacc.config.records import of_section
from kinacc.study import monte_carlo
from kinacc.study.histories import histories

NOISE = (0.01, 0.03)
SMALL = paper.study(noise_mm=NOISE, repetitions=3, measurements=12)


def simulated(error, noise_mm, repetitions, section, seed):
    visits = of_section(monte_carlo.Visits, section)
    made = monte_carlo.assessors(section)
    return monte_carlo.simulate(error, noise_mm, repetitions, visits, seed, made)


def small_errors() -> np.ndarray:
    return np.random.default_rng(31).normal(size=(9, 3)) * 0.02


def text(table, name, i):
    value = table[name][i]
    return None if value is None or value != value else str(value)


def expected_row(table, i, error, seed, study, order=None):
    """Assessed accuracy, measurements and points of one row, from its address alone."""
    noise, repetition = float(table["noise_mm"][i]), int(table["repetition"][i])
    reading = worlds.simulation(error.tolist(), noise, repetition, seed)
    order = list(range(len(error)) if order is None else order)
    budget = study["measurements"]
    sizes = [oracle.norm(reading(j, 1)) for j in order[:budget]]
    assessor = text(table, "assessor", i)
    if assessor == "maximum":
        return max(sizes), len(sizes), len(sizes)
    if assessor == "outlier_rejection":
        rule = text(table, "outlier_rule", i)
        return oracle.outlier_rejection(sizes, rule), len(sizes), len(sizes)
    switches = oracle.Switches(
        text(table, "distance", i), text(table, "covariance", i), study["alpha"]
    )

    def run(eta):
        return oracle.invalidation_run(reading, order, [noise] * len(error), eta, budget, switches)

    top = max(sizes)
    search = text(table, "search", i)
    if search == "bisection":
        assessed = oracle.bisection(lambda eta: run(eta).rejected, top)
    else:
        flags = oracle.decisions(lambda eta: run(eta).rejected, top)
        pick = {"from_above": oracle.from_above, "from_below": oracle.from_below}[search]
        assessed = pick(flags) / 1000
    at = run(assessed)
    return assessed, at.measurements, at.points_visited


@pytest.fixture(scope="module")
def rows():
    return simulated(small_errors(), NOISE, range(3), SMALL, seed=99)


def assert_are_the_oracles(table, study, order=None):
    for i in range(len(table)):
        assessed, *counts = expected_row(table, i, small_errors(), 99, study, order)
        assert table["assessed_mm"][i] == pytest.approx(assessed, rel=1e-9, abs=1e-12)
        assert [table["measurements"][i], table["points_visited"][i]] == counts


def test_every_row_of_a_small_study_equals_the_oracle(rows):
    # One row of the maximum, three of outlier rejection, twelve of model invalidation.
    assert len(rows) == 2 * 3 * 16
    assert_are_the_oracles(rows, SMALL)


def test_a_shuffled_visit_takes_the_same_readings_in_another_order():
    study = {**SMALL, "measurements": 5, "visiting_order": "shuffled"}
    shuffled = simulated(small_errors(), NOISE[:1], range(1), study, seed=99)
    order = np.random.default_rng([99, 10000, 0, 1]).permutation(9)
    assert_are_the_oracles(shuffled, study, order)


def same(one, other) -> bool:
    """Whether two tables are the same to the last bit, rows numbered anew."""
    tables = [pd.DataFrame(dict(each)).reset_index(drop=True) for each in (one, other)]
    return tables[0].equals(tables[1])


def test_parts_joined_in_any_order_give_the_same_bytes(rows):
    rows = monte_carlo.ordered(rows).drop(columns="bounded_mm")
    sizes = np.linalg.norm(small_errors(), axis=1)
    components = dict(zip(("ex_mm", "ey_mm", "ez_mm"), small_errors().T, strict=True))
    points = {"point": np.arange(9), **components, "true_error_mm": sizes}
    inputs, config = {"assessment_points": points}, {"seed": 99, "study": SMALL}
    for of in (1, 3):
        parts = [
            monte_carlo.simulated(inputs, config | {"part": {"number": i, "of": of}})["study_chunk"]
            for i in range(of, 0, -1)
        ]
        joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        made = monte_carlo.summed_up(inputs | {"study_chunk": joined}, config)
        usual = monte_carlo.default_reading(rows, SMALL)
        assert same(made["study"], monte_carlo.columns_from("study", usual))
        assert same(made["study_summary"], monte_carlo.summary(usual, sizes.max()))
        assert same(made["readings"], monte_carlo.readings(rows, sizes.max()))


def test_summary_and_readings_are_plain_statistics_of_the_rows(rows):
    """Six rows of three values; thirty of the readings, three and twelve a noise and assessor."""
    switches = {"outlier_rule": "normal", "distance": "squared", "covariance": "r"}
    usual = switches | {"search": "from_above"}
    summary = monte_carlo.summary(monte_carlo.default_reading(rows, SMALL), 0.07)
    readings = monte_carlo.readings(rows, 0.07)
    assert (len(summary["assessor"]), len(readings["assessor"])) == (6, 30)
    for table, every in ((summary, usual), (readings, {})):
        for row in pd.DataFrame(table).to_dict("records"):
            of = rows[(rows["assessor"] == row["assessor"]) & (rows["noise_mm"] == row["noise_mm"])]
            for name in usual:
                of = of[of[name].isna() | (of[name] == every.get(name, row.get(name)))]
            values = of["assessed_mm"].tolist()
            assert len(values) == 3
            mean = math.fsum(values) / 3
            assert row["mean_mm"] == pytest.approx(mean, rel=1e-13)
            assert row["bias_mm"] == pytest.approx(mean - 0.07, abs=1e-14)
            assert (row["min_mm"], row["max_mm"]) == (min(values), max(values))
            rmse = math.sqrt(math.fsum((value - 0.07) ** 2 for value in values) / 3)
            assert row.get("rmse_mm", rmse) == pytest.approx(rmse, rel=1e-12)


HISTORY_RATIOS = {
    "rejected": 0.834 / 0.906,
    "rejected_larger_eta": 0.844 / 0.906,
    "not_rejected": 1.023 / 0.906,
}


def history_runs(error, seed, repetition):
    """Runs of one simulation at the three bounds of Figs. 5 and 6."""
    reading = worlds.simulation(error.tolist(), 0.3, repetition, seed)
    top = max(oracle.norm(row) for row in error.tolist())
    count = len(error)
    return {
        name: oracle.invalidation_run(
            reading, range(count), [0.3] * count, top * ratio, count, oracle.Switches()
        )
        for name, ratio in HISTORY_RATIOS.items()
    }


def first_simulations(error, seed, searched):
    """First simulation of each figure's rule: rejected at eta, not at the slightly larger one, and
    ending with another measurement of the worst point; not rejected, though some point was
    measured again."""
    worst = int(np.argmax([oracle.norm(row) for row in error.tolist()]))
    found: dict[str, int] = {}
    for repetition in range(searched):
        runs = history_runs(error, seed, repetition)
        low, larger, kept = (runs[name] for name in HISTORY_RATIOS)
        last = low.steps[-1]
        if low.rejected and not larger.rejected and last.point == worst and last.repeat > 1:
            found.setdefault("rejected", repetition)
        if not kept.rejected and any(step.repeat > 1 for step in kept.steps):
            found.setdefault("not_rejected", repetition)
        if len(found) == 2:
            break
    return found


def test_histories_are_the_first_runs_of_the_studys_worlds_that_satisfy_the_rules():
    # Most errors well inside and one at the limit, as on the paper's arm.
    rng = np.random.default_rng(14)
    error = rng.normal(size=(60, 3)) * 0.2
    error *= 0.75 / np.linalg.norm(error, axis=1).max()
    error[41] *= 0.906 / np.linalg.norm(error[41])
    true = [oracle.norm(row) for row in error.tolist()]
    found = first_simulations(error, 3, 200)
    assert len(found) == 2
    found["rejected_larger_eta"] = found["rejected"]
    keys = ("eta_ratio_rejected", "eta_ratio_larger", "eta_ratio_kept")
    ratios = dict(zip(keys, HISTORY_RATIOS.values(), strict=True))
    study = paper.study(measurements=60)
    table = histories(
        error,
        paper.histories(simulations_searched=200, **ratios),
        of_section(monte_carlo.Visits, study),
        of_section(ModelInvalidation, study),
        seed=3,
        point=np.arange(60) + 500,
    )
    assert {str(x) for x in table["example"]} == set(HISTORY_RATIOS)
    for name, ratio in HISTORY_RATIOS.items():
        run = history_runs(error, 3, found[name])[name]
        assert run.rejected == (name == "rejected")
        expected = [
            (0.906 * ratio, 0.3, 0.6, step.iteration, step.point + 500, step.repeat, step.measured,
             step.averaged, true[step.point], step.probability)
            for step in run.steps
        ]  # fmt: skip
        where = table["example"] == name
        columns = ("eta_mm", "noise_mm", "alpha", "iteration", "point", "repeat", "measured_mm",
                   "averaged_mm", "true_mm", "rejection_probability")  # fmt: skip
        rows = np.transpose([np.asarray(table[each][where], dtype=float) for each in columns])
        np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-11)
