"""Figures of the summary, worked out by hand from tables of a few rows."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.calibration import summary
from kinacc.kinematics import robot

ARM = robot.load("ur10")


def pose_errors(*rows):
    """A table of (comparison, estimate, row, position error along x, orientation error)."""
    comparison, estimate, row, ex, rx = zip(*rows, strict=True)
    zero = np.zeros(len(rows))
    columns = {"ex_mm": ex, "ey_mm": zero, "ez_mm": zero}
    columns |= {"rx_mrad": rx, "ry_mrad": zero, "rz_mrad": zero}
    return {
        "comparison": np.array(comparison),
        "estimate": np.array(estimate),
        "row": np.array(row),
        **{name: np.array(values, dtype=float) for name, values in columns.items()},
    }


def test_excluded_rows_come_by_line_with_the_length_of_their_error():
    table = {
        "comparison": np.array(["dh_vs_measured", "vec_vs_measured", "dh_vs_measured",
                                "dh_vs_measured"]),
        "line": np.array([9, 4, 4, 7]),
        "reason": np.array(["a jump", "other", "doubled", "no position"]),
        "ex_mm": np.array([3.0, 1.0, 0.0, np.nan]),
        "ey_mm": np.array([4.0, 1.0, -6.0, 0.0]),
        "ez_mm": np.array([12.0, 1.0, 8.0, 0.0]),
    }  # fmt: skip
    four, seven, nine = summary.excluded_errors(table, "dh")
    assert four == (4, "doubled", pytest.approx(10.0))
    assert seven[:2] == (7, "no position")
    assert np.isnan(seven[2])
    assert nine == (9, "a jump", pytest.approx(13.0))


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
    ))  # fmt: skip
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


def measurements(q):
    return {f"q{number + 1}": column for number, column in enumerate(np.asarray(q, float).T)}


def test_the_range_of_the_joints_covers_all_poses():
    low, high = np.deg2rad([-90, -60, -30, 0, 10, 20]), np.deg2rad([90, 30, 0, 45, 20, 50])
    columns = measurements([low, high, 0.5 * (low + high)])
    assert np.array_equal(summary.covered(columns, ARM), [low, high])


def test_a_flange_that_always_points_one_way_is_found_with_its_spread():
    """Joint 1 of this arm stands upright: turning it alone tilts a level flange axis with it."""
    pointing = np.array([0.0, -1.2, 1.4, -0.3, -np.pi / 2, 0.0])
    still = np.tile(pointing, (5, 1))
    still[:, 5] = np.linspace(-1.0, 1.0, 5)  # about its own axis: the direction stays
    assert summary.flange_spread_deg(measurements(still), ARM) == pytest.approx(0.0, abs=1e-4)
    anywhere = np.random.default_rng(1).uniform(-2.0, 2.0, (20, 6))
    assert summary.flange_spread_deg(measurements(anywhere), ARM) is None
    both = np.stack([pointing, pointing])
    both[:, 4] += np.deg2rad([-3.0, 3.0])
    assert summary.flange_spread_deg(measurements(both), ARM) == pytest.approx(3.0, rel=1e-6)
    both[:, 4] += np.deg2rad([-3.0, 3.0])
    assert summary.flange_spread_deg(measurements(both), ARM) is None
