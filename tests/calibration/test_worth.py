"""Which model to use, where it is biased, which rows it fits worst."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.calibration.residuals import select


def selection(others, configuration, fold):
    """``model_selection`` by model, from position errors (n, 3) of each."""
    held_out = {
        name: np.hstack([vectors, np.full(np.shape(vectors), np.nan)])
        for name, vectors in others.items()
    }
    return select(held_out, configuration, fold).set_index("model")


def best(table):
    return table.index[table["selected"] == 1].item()


def scattered(count, size, seed):
    return size * np.random.default_rng(seed).normal(size=(count, 3))


def test_a_gain_that_may_be_chance_is_none():
    configuration, fold = np.arange(24), np.arange(24) % 6
    by_dh, by_vec = scattered(24, 0.2, 1), scattered(24, 0.198, 2)
    assert best(selection({"dh": by_dh, "vec": by_vec}, configuration, fold)) == "dh"
    table = selection({"dh": by_dh, "vec": 0.5 * by_dh}, configuration, fold)
    assert best(table) == "vec"
    gain = 0.75 * np.mean(np.sum(by_dh**2, axis=1))
    assert table["gain_mm2"]["vec"] == pytest.approx(gain)
    assert table["held_out_rms_mm"]["vec"] == pytest.approx(0.5 * table["held_out_rms_mm"]["dh"])


def test_repeats_of_a_configuration_are_one_witness():
    models = {"dh": scattered(12, 0.2, 4), "vec": scattered(12, 0.15, 5)}
    once = selection(models, np.arange(12), np.arange(12) % 3)
    again = np.repeat(np.arange(12), 50)
    often = selection({k: v[again] for k, v in models.items()}, again, again % 3)
    assert set(often["configurations"]) == {12}
    std_error = once["gain_std_error_mm2"]["vec"]
    assert often["gain_std_error_mm2"]["vec"] == pytest.approx(std_error)


def test_of_two_models_worth_it_the_better_is_selected_wherever_it_stands():
    plain, configuration, fold = scattered(60, 0.2, 8), np.arange(60), np.arange(60) % 5
    for others in ({"a": 0.6 * plain, "b": 0.5 * plain}, {"b": 0.5 * plain, "a": 0.6 * plain}):
        assert best(selection({"dh": plain, **others}, configuration, fold)) == "b"


def test_a_model_that_gains_in_most_rows_and_loses_in_the_mean_of_folds_is_not_selected():
    by_dh, rows = scattered(100, 0.2, 3), np.arange(100)
    by_vec = 0.8 * by_dh
    by_dh[99], by_vec[99] = 1e-3, 0.2  # the only row of its fold
    assert best(selection({"dh": by_dh, "vec": by_vec}, rows, rows // 99)) == "dh"
