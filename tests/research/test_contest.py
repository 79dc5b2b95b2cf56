"""Sums of the tournament: counted right."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from research import verdicts


def verdict_of(rows: pd.DataFrame) -> pd.Series:
    """The verdict on campaigns that came out so again and again."""
    (found,) = verdicts.judged(verdicts.cells(pd.concat([rows] * 200))).to_dict("records")
    return found


def graded(**columns) -> pd.DataFrame:
    """Rows of one cell, five campaigns."""
    row = {
        "assessor": "a",
        "target": "measured",
        "field": "f",
        "candidates": 20,
        "noise_mm": 0.1,
        "budget": 10,
        "setup": "plain",
        "world": "stated",
        "true_mm": 1.0,
        "bounded_mm": columns.get("true_mm", 1.0),
        "value_mm": 1.1,
        "lower_mm": 0.9,
        "upper_mm": 1.2,
        "confidence": 0.95,
        "excepted": 0,
        "alarmed": False,
        "assumption": "none",
        "measurements": 10,
        "points_visited": 8,
        "attainable_mm": np.nan,
        "proven_mm": np.nan,
        **columns,
    }
    return pd.DataFrame(row, index=range(5))


def test_a_cell_is_summed_up_as_by_hand():
    said = graded(
        upper_mm=[1.2, 0.8, 1.4, np.nan, 9.0],
        assumption=["holds", "holds", "none", "none", "broken"],
        value_mm=[1.1, 0.9, 1.1, 0.9, 1.3],
        lower_mm=[0.9, 1.1, 0.9, np.nan, 0.9],
    )
    (cell,) = verdicts.cells(said).to_dict("records")
    assert (cell["repetitions"], cell["stated"], cell["broken"]) == (5, 4, 1)
    assert cell["sound"] == 4
    assert cell["upper_holds"] == pytest.approx(2 / 3)
    assert cell["excess_mm"] == pytest.approx((0.2 - 0.2 + 0.4) / 3)
    assert cell["lower_holds"] == pytest.approx(3 / 4)
    assert cell["bias_mm"] == pytest.approx(0.06)
    assert cell["rmse_mm"] == pytest.approx(np.sqrt((4 * 0.01 + 0.09) / 5))
    exact = binomtest(2, 3).proportion_ci(0.95, "exact")
    assert (cell["upper_low"], cell["upper_high"]) == pytest.approx((exact.low, exact.high))


def test_an_assessor_that_claims_too_much_is_caught():
    assert verdict_of(graded())["rejected"] == 0
    found = verdict_of(graded(upper_mm=[1.2, 1.2, 1.2, 1.2, 0.9]))
    assert (found["rejected"], found["below"]) == (1, 1)
    assert found["worst_holds"] == pytest.approx(0.8)
