"""Which rows the validation fold holds out, and how readings of a configuration are averaged."""

from __future__ import annotations

import numpy as np

from kinacc.measurements import folds
from kinacc.study import operating_points


def test_the_validation_fold_is_the_part_of_the_time_it_names():
    columns = {"pose": np.arange(9), "q1": np.arange(9) * 0.3}
    section = {"folds": 3, "fold_by": folds.TIME_BLOCK, "validation_fold": 2}
    found = folds.split(columns, {"measurements": section, "seed": 1})
    assert found["fold"].tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    assert np.flatnonzero(found["subset"] == "validation").tolist() == [6, 7, 8]


def test_the_largest_configurations_are_dealt_first():
    fold = folds.assign(np.repeat(np.arange(5), [1, 1, 1, 1, 4]), 2, 3)
    assert np.bincount(fold).tolist() == [4, 4]


def test_an_error_is_the_mean_of_the_readings_of_one_pose_and_target():
    errors = {
        "pose": [5, 5, 5, 2],
        "target": ["a", "b", "a", None],
        "row": [7, 8, 9, 3],
        "ex_mm": [1.0, 10.0, 2.0, 4.0],
        "ey_mm": [0.0, 1.0, 0.0, 5.0],
        "ez_mm": [9.0, 2.0, 0.0, 6.0],
    }
    rows, error_mm = operating_points.measured_errors(errors, np.ones(4, dtype=bool))
    assert rows.tolist() == [7, 8, 3]
    assert error_mm.tolist() == [[1.5, 0, 4.5], [10, 1, 2], [4, 5, 6]]
