"""Figures of the summary, worked out by hand from tables of a few rows."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from kinacc.calibration import summary
from kinacc.kinematics import robot


def pose_errors(*rows):
    """A table of (comparison, estimate, row, position error along x, orientation error)."""
    table = pd.DataFrame(rows, columns=["comparison", "estimate", "row", "ex_mm", "rx_mrad"])
    return table.assign(**dict.fromkeys(["ey_mm", "ez_mm", "ry_mrad", "rz_mrad"], 0.0))


def test_models_are_compared_at_rows_that_all_of_them_were_tried_on():
    nan = np.nan
    table = summary.error_statistics(pose_errors(
        *[("dh_vs_measured", "cross_validated", row, size, nan)
          for row, size in ((1, 1.0), (2, 3.0), (3, 90.0))],
        *[("vec_vs_measured", "cross_validated", row, size, turn)
          for row, size, turn in ((1, 0.5, 2.0), (2, 0.7, nan), (4, 80.0, 70.0))],
        ("dh_vs_vec", "cross_validated", 1, 2.0, 5.0),
        ("dh_vs_vec", "cross_validated", 2, 4.0, nan),
        ("dh_vs_measured", "train", 1, 0.25, nan),
    ), np.arange(5))  # fmt: skip
    found = table.set_index(["comparison", "estimate", "quantity"])
    dh = found.loc["dh_vs_measured", "cross_validated", "position"]
    # Two rows: the 99 % quantile lies 99 hundredths of the way from the smaller to the larger.
    assert dh[["n", "mean", "largest"]].tolist() == [2, 2.0, 3.0]
    assert dh["quantile_99"] == pytest.approx(2.98)
    vec = found.loc["vec_vs_measured", "cross_validated", "position"]
    assert vec["mean"] == pytest.approx(0.6)
    turned = found.loc["vec_vs_measured", "cross_validated", "orientation"]
    assert turned[["n", "mean", "unit"]].tolist() == [1, 2.0, "mrad"]
    assert found.loc["dh_vs_vec", "cross_validated", "position"]["mean"] == 3.0
    assert found.loc["dh_vs_measured", "train", "position"]["mean"] == 0.25
    assert ("dh_vs_measured", "cross_validated", "orientation") not in found.index


def test_the_standard_error_is_that_of_the_means_of_configurations():
    """Cochran 1977, eq. 6.13: configurations count by the number of their readings."""
    sizes, counts = np.array([1.0, 1.2, 1.4, 2.0, 2.6, 0.4]), np.array([3, 2, 1])
    rows = [("dh_vs_measured", "cross_validated", row, size, np.nan)
            for row, size in enumerate(sizes)]  # fmt: skip
    table = summary.error_statistics(pose_errors(*rows), np.repeat([5, 3, 9], counts))
    (found,) = table.itertuples()
    apart = counts / 2.0 * (np.array([1.2, 2.3, 0.4]) - sizes.mean())
    assert found.configurations == 3
    assert found.std_error == pytest.approx(np.sqrt(np.sum(apart**2) / 2.0 / 3.0), rel=1e-12)
    assert found.rms == pytest.approx(np.sqrt(np.mean(sizes**2)), rel=1e-12)
    (alone,) = summary.error_statistics(pose_errors(*rows), np.zeros(6, dtype=int)).itertuples()
    assert np.isnan(alone.std_error)


@pytest.mark.parametrize("tilt_deg", [0.0, 4.0, 6.0])
def test_a_flange_that_keeps_its_axis_is_told_with_how_far_it_turns(tilt_deg):
    """Joint 5 of an arm with parallel axes 2, 3 and 4 tilts the flange; joint 6 turns it."""
    arm = robot.load("ur10")
    tilts = np.deg2rad([-tilt_deg, tilt_deg, 0.0])
    q_rad = np.array([[0.3, -1, 1, -2, 0.7 + tilt, n] for n, tilt in enumerate(tilts)])
    columns = {f"q{n}": column for n, column in enumerate(q_rad.T, 1)}
    found = summary.flange_spread_deg(columns, arm)
    assert found is None if tilt_deg > 5.0 else found == pytest.approx(tilt_deg, abs=1e-6)
