"""Which model to use, where it is biased, which rows it fits worst."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.calibration import model_comparison
from kinacc.calibration.residuals import Errors


def errors(vectors):
    return Errors(np.asarray(vectors, dtype=float), np.full(np.shape(vectors), np.nan))


def selection(by_dh, by_vec, configuration, fold):
    held_out = {"dh": errors(by_dh), "vec": errors(by_vec)}
    return model_comparison.select(held_out, configuration, fold)


def scattered(count, size, seed):
    return size * np.random.default_rng(seed).normal(size=(count, 3))


def test_a_gain_that_may_be_chance_is_none():
    configuration, fold = np.arange(24), np.arange(24) % 6
    by_dh, by_vec = scattered(24, 0.2, 1), scattered(24, 0.198, 2)
    assert selection(by_dh, by_vec, configuration, fold).selected == "dh"
    found = selection(by_dh, 0.5 * by_dh, configuration, fold)
    assert found.selected == "vec"
    assert found.standings["vec"].gain_mm2 == pytest.approx(
        0.75 * np.mean(np.sum(by_dh**2, axis=1))
    )
    dh, vec = found.standings["dh"], found.standings["vec"]
    assert vec.rms_mm == pytest.approx(0.5 * dh.rms_mm)


def test_repeats_of_a_configuration_are_one_witness():
    by_dh, by_vec = scattered(12, 0.2, 4), scattered(12, 0.15, 5)
    once = selection(by_dh, by_vec, np.arange(12), np.arange(12) % 3)
    again = np.repeat(np.arange(12), 50)
    often = selection(by_dh[again], by_vec[again], again, again % 3)
    assert often.configurations == 12
    errors_mm2 = [each.standings["vec"].std_error_mm2 for each in (often, once)]
    assert errors_mm2[0] == pytest.approx(errors_mm2[1])


def test_of_two_models_worth_it_the_better_is_selected_wherever_it_stands():
    plain, configuration, fold = scattered(60, 0.2, 8), np.arange(60), np.arange(60) % 5
    better, best = errors(0.6 * plain), errors(0.5 * plain)
    for others in ({"a": better, "b": best}, {"b": best, "a": better}):
        held_out = {"dh": errors(plain), **others}
        assert model_comparison.select(held_out, configuration, fold).selected == "b"
