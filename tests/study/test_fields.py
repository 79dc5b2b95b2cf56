"""Error fields that simulated campaigns draw from: synthetic families, measured arms, points."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.study.fields import FAMILIES, ErrorField, of_measurements, of_points, synthetic


@pytest.mark.parametrize("name", FAMILIES)
def test_synthetic_fields_are_the_size_of_a_calibrated_arms_errors(name):
    made = synthetic(name, 0)
    size = np.linalg.norm(made.error_mm, axis=1)
    assert made.points == 1000
    assert 0.05 < size.mean() < 2.0
    assert 0.3 < size.max() < 5.0
    assert np.array_equal(made.error_mm, synthetic(name, 0).error_mm)


def test_a_defect_and_rare_poses_make_a_heavier_tail_than_smooth_errors():
    def tail(name):
        size = np.linalg.norm(synthetic(name, 0).error_mm, axis=1)
        return size.max() / np.median(size)

    assert tail("defect") > 1.2 * tail("smooth")
    assert tail("rare") > 3.0 * tail("smooth")


def test_measured_fields_average_the_readings_of_a_pose_and_leave_out_what_was_fitted():
    errors = {
        "comparison": np.array(["dh_vs_measured"] * 4 + ["vec_vs_measured"], object),
        "estimate": np.array(["cross_validated"] * 3 + ["train"] * 2, object),
        "pose": np.array([7, 7, 8, 9, 9]),
        "target": np.array(["tool"] * 5, object),
        "ex_mm": np.array([1.0, 3.0, 5.0, 50.0, 50.0]),
        "ey_mm": np.zeros(5),
        "ez_mm": np.zeros(5),
    }
    measurements = {"pose": np.array([9, 8, 7, 7]), "q1": np.array([0.9, 0.8, 0.7, 0.71])}
    made = of_measurements("arm", None, errors, measurements)
    assert made.error_mm[:, 0].tolist() == [2.0, 5.0]
    assert made.q_rad[:, 0].tolist() == [0.7, 0.8]


def test_a_field_without_cross_validated_errors_says_what_to_do():
    columns = {name: np.array(["train"], object) for name in ("comparison", "estimate")}
    with pytest.raises(InputError, match=r"measurements\.folds"):
        of_measurements("arm", None, columns, {})


def test_points_of_the_paper_become_its_field():
    points = {f"q{i}": np.arange(3.0) for i in range(1, 7)}
    points |= {f"e{axis}_mm": np.arange(3.0) for axis in "xyz"} | {"true_error_mm": np.zeros(3)}
    assert of_points("mh180", robot.load("mh180"), points).error_mm.shape == (3, 3)


def test_errors_that_are_not_finite_are_refused():
    with pytest.raises(InputError, match="not finite"):
        ErrorField("bad", np.full((2, 3), np.nan), np.zeros((2, 6)))
