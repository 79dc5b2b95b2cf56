"""Which rows the validation fold holds out."""

from __future__ import annotations

import numpy as np

from kinacc.measurements import folds


def test_the_validation_fold_is_the_part_of_the_time_it_names():
    columns = {"pose": np.arange(9), "q1": np.arange(9) * 0.3}
    section = {"folds": 3, "fold_by": folds.TIME_BLOCK, "validation_fold": 2}
    found = folds.split(columns, {"measurements": section, "seed": 1})
    assert found["fold"].tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    assert np.flatnonzero(found["subset"] == "validation").tolist() == [6, 7, 8]


def test_the_largest_configurations_are_dealt_first():
    fold = folds.assign(np.repeat(np.arange(5), [1, 1, 1, 1, 4]), 2, 3)
    assert np.bincount(fold).tolist() == [4, 4]
