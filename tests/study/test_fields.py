"""Error fields that simulated campaigns draw from: made up, and of measured arms."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.study.fields import FAMILIES, made_up, of_measurements


def test_made_up_errors_have_their_size_and_a_defect_a_heavier_tail():
    for name, (std_mm, times) in FAMILIES.items():
        error_mm = made_up(name).error_mm
        assert np.std(error_mm[20:]) == pytest.approx(std_mm, rel=0.03)
        assert np.std(error_mm[:20]) == pytest.approx(times * std_mm, rel=0.3)


def test_measured_fields_average_the_readings_of_a_pose_and_leave_out_what_was_fitted():
    errors = {
        "comparison": np.array(["dh_vs_measured"] * 4 + ["vec_vs_measured"], object),
        "estimate": np.array(["cross_validated"] * 3 + ["train"] * 2, object),
        "pose": np.array([7, 7, 8, 9, 9]),
        "row": np.array([2, 3, 1, 0, 0]),
        "target": np.array(["tool"] * 2 + ["probe"] + ["tool"] * 2, object),
        "ex_mm": np.array([1.0, 3.0, 5.0, 50.0, 50.0]),
        "ey_mm": np.zeros(5),
        "ez_mm": np.zeros(5),
    }
    for target, sizes in ((None, [2.0, 5.0]), ("tool", [2.0])):
        made = of_measurements("arm", errors, target=target)
        assert made.error_mm[:, 0].tolist() == sizes
