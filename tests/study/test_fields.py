"""Error fields that simulated campaigns draw from: synthetic families, measured arms, points."""

from __future__ import annotations

import numpy as np

from kinacc.study.fields import of_measurements, synthetic


def test_a_defect_makes_a_heavier_tail_than_smooth_errors():
    def tail(name):
        size = np.linalg.norm(synthetic(name, 0).error_mm, axis=1)
        return size.max() / np.median(size)

    assert tail("defect") > 1.2 * tail("smooth")


def test_measured_fields_average_the_readings_of_a_pose_and_leave_out_what_was_fitted():
    errors = {
        "comparison": np.array(["dh_vs_measured"] * 4 + ["vec_vs_measured"], object),
        "estimate": np.array(["cross_validated"] * 3 + ["train"] * 2, object),
        "pose": np.array([7, 7, 8, 9, 9]),
        "row": np.array([2, 3, 1, 0, 0]),
        "target": np.array(["tool"] * 5, object),
        "ex_mm": np.array([1.0, 3.0, 5.0, 50.0, 50.0]),
        "ey_mm": np.zeros(5),
        "ez_mm": np.zeros(5),
    }
    made = of_measurements("arm", errors)
    assert made.error_mm[:, 0].tolist() == [2.0, 5.0]
