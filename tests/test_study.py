"""The Monte Carlo study: tables as promised, the same whatever the order, parts or neighbours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import paper_settings as paper
import pytest
import yaml

from kinacc.checks.contradictions import load
from kinacc.config.records import of_section
from kinacc.errors import InputError
from kinacc.study import monte_carlo
from kinacc.study.monte_carlo import (
    StudySettings,
    assessors,
    default_reading,
    part_of,
    readings,
    simulate,
    summary,
    true_accuracy_mm,
)

ROOT = Path(__file__).parents[1]
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


def simulated(error, noise_mm, repetitions, seed, progress=None, **changes) -> dict:
    section = SECTION | changes
    visits = of_section(StudySettings, section)
    return simulate(error, noise_mm, repetitions, visits, seed, assessors(section), progress)


def equal(one: dict, other: dict) -> bool:
    assert list(one) == list(other)
    return all(
        one[name].tobytes() == other[name].tobytes()
        if one[name].dtype != object
        else one[name].tolist() == other[name].tolist()
        for name in one
    )


@pytest.fixture(scope="module")
def rows() -> dict:
    return simulated(ERROR, SMALL.noise_mm, range(4), 3)


def test_every_noise_repetition_assessor_and_reading_has_one_row(rows):
    names = ("noise_mm", "repetition", "assessor", "outlier_rule", "distance", "covariance")
    keys = list(zip(*(rows[name].tolist() for name in (*names, "search")), strict=True))
    assert len(keys) == len(set(keys)) == 2 * 4 * 16


def test_parts_joined_in_any_order_give_the_same_bytes(rows):
    for of in (1, 2, 3, 4):
        parts = [
            monte_carlo.simulated(
                {"assessment_points": POINTS}, configured() | {"part": {"number": i, "of": of}}
            )["study_chunk"]
            for i in range(of, 0, -1)
        ]
        joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        inputs = {"assessment_points": POINTS, "study_chunk": joined}
        made = monte_carlo.summed_up(inputs, configured())
        assert equal(made["study"], default_reading(rows, SECTION))
        assert equal(made["study_summary"], summary(default_reading(rows, SECTION), TRUE))
        assert equal(made["readings"], readings(rows, TRUE))


def test_a_simulation_does_not_know_its_neighbours(rows):
    alone = simulated(ERROR, [0.3], [2], 3)
    mine = (rows["noise_mm"] == 0.3) & (rows["repetition"] == 2)
    assert equal(alone, {name: column[mine] for name, column in rows.items()})
    other = simulated(ERROR, [0.3], [2], 4)
    assert not np.array_equal(other["assessed_mm"], alone["assessed_mm"])


def test_all_conventional_assessors_see_the_same_first_readings():
    table = simulated(np.full((40, 3), 0.5), [0.2], range(20), 1)
    study = default_reading(table, paper.study(outlier_rule="iqr"))
    largest = study["assessed_mm"][study["assessor"] == "maximum"]
    kept = study["assessed_mm"][study["assessor"] == "outlier_rejection"]
    # Where nothing is an outlier the two agree to the last bit; else rejection is smaller.
    assert np.all(kept <= largest)
    assert np.any(kept == largest)


def test_shapes_of_the_tables(rows):
    assert default_reading(rows, SECTION)["noise_mm"].size == 2 * 4 * 3
    assert summary(default_reading(rows, SECTION), TRUE)["assessor"].tolist() == [
        *["maximum"] * 2,
        *["outlier_rejection"] * 2,
        *["model_invalidation"] * 2,
    ]
    table = readings(rows, TRUE)
    assert table["assessor"].tolist() == ["outlier_rejection"] * 6 + ["model_invalidation"] * 24
    outlier = table["assessor"] == "outlier_rejection"
    assert all(value is None for value in table["distance"][outlier])
    assert all(value is None for value in table["outlier_rule"][~outlier])


@pytest.mark.parametrize("switch", ["outlier_rule", "distance", "covariance", "search"])
def test_the_default_reading_follows_the_configuration(rows, switch):
    values = sorted({value for value in rows[switch] if value is not None})
    means = set()
    for value in values:
        study = default_reading(rows, paper.study(**{switch: value}))
        assert study["noise_mm"].size == 2 * 4 * 3
        means.add(float(study["assessed_mm"].mean()))
    assert len(means) == len(values)


def test_summary_against_the_truth(rows):
    study = default_reading(rows, SECTION)
    table = summary(study, TRUE)
    mine = (study["assessor"] == "maximum") & (study["noise_mm"] == 0.3)
    sample = study["assessed_mm"][mine]
    row = {name: column[1] for name, column in table.items()}
    assert row["mean_mm"] == pytest.approx(np.mean(sample), rel=1e-15)
    assert (row["min_mm"], row["max_mm"]) == (sample.min(), sample.max())
    assert row["bias_mm"] == pytest.approx(sample.mean() - TRUE, abs=1e-15)
    assert row["rmse_mm"] ** 2 == pytest.approx(sample.var() + row["bias_mm"] ** 2, rel=1e-12)
    assert row["repetitions"] == 4


@pytest.mark.parametrize(("points", "budget"), [(1, 1), (1, 30), (40, 1), (40, 15), (15, 40)])
@pytest.mark.parametrize("order", ["sequence", "shuffled"])
def test_any_number_of_points_and_any_budget(points, budget, order):
    spent = {"measurements": budget, "visiting_order": order}
    table = simulated(ERROR[:points], [0.2], range(2), 1, **spent)
    assert np.all(table["measurements"] <= budget)
    assert np.all(table["points_visited"] <= min(points, budget))
    assert np.all(np.isfinite(table["assessed_mm"]))


def test_order_of_points_changes_only_what_depends_on_it():
    plain = simulated(ERROR, [0.3], range(3), 1)
    other = simulated(ERROR, [0.3], range(3), 1, visiting_order="shuffled")
    once = plain["assessor"] != "model_invalidation"
    np.testing.assert_allclose(
        plain["assessed_mm"][once], other["assessed_mm"][once], rtol=1e-12, atol=0
    )
    assert not np.array_equal(plain["assessed_mm"][~once], other["assessed_mm"][~once])


def test_progress_counts_simulations():
    seen = []

    def progress(items, what, total):
        seen.append((what, total))
        return items

    simulated(ERROR, [0.1, 0.3], range(2), 1, progress)
    assert seen == [("simulations", 4)]


def test_parts_share_out_every_repetition_once():
    for of in (1, 3, 7):
        shared = [r for number in range(1, of + 1) for r in part_of(10, number, of)]
        assert sorted(shared) == list(range(10))
    for number, of in ((0, 3), (4, 3)):
        with pytest.raises(InputError):
            part_of(10, number, of)


def test_settings_are_refused_together(tmp_path):
    wrong = {"repetitions": 0, "measurements": 0, "alpha": 1.0}
    words = ("outlier_rule", "distance", "covariance", "search", "visiting_order")
    sections = {
        "study": {"noise_mm": [0.1, 0.1], **wrong, **dict.fromkeys(words, "sideways")},
        "histories": {"noise_mm": 0.0, "eta_ratio_kept": float("nan"), "simulations_searched": 0},
    }
    path = tmp_path / "wrong.yaml"
    path.write_text(yaml.safe_dump({**sections, "datasets": {"mh180": {"robot": "mh180"}}}))
    with pytest.raises(InputError) as caught:
        load([path])
    told = (problem.where.partition(", ")[2] for problem in caught.value.problems)
    where = {each.partition(" (data set")[0] for each in told}
    assert where == {f"{name}.{key}" for name, keys in sections.items() for key in keys}


@pytest.mark.parametrize("noise", [[], [0.0], [-0.1], [np.nan], [1e-8], [0.3, 0.1]])
def test_noise_that_means_nothing_is_refused(noise):
    with pytest.raises(InputError, match=r"study\.noise_mm"):
        load([ROOT / "config.yaml"], {"study": {"noise_mm": noise}}, ROOT)


@pytest.mark.parametrize("error", [np.zeros((0, 3)), np.zeros(3), np.full((2, 3), np.nan)])
def test_errors_that_cannot_be_used_are_refused(error):
    with pytest.raises(InputError, match="true errors"):
        simulated(error, [0.1], range(1), 1)


def test_true_accuracy_is_the_largest_error():
    assert true_accuracy_mm(POINTS["true_error_mm"]) == TRUE
    with pytest.raises(InputError):
        true_accuracy_mm([])
