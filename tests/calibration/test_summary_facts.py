"""Facts of the summary, worked out by hand from tables of a few rows."""

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


def told(facts):
    return {(each.topic, each.item, each.statistic): (each.value, each.unit) for each in facts}


def test_rows_left_out_come_by_line_with_the_length_of_their_error():
    table = {
        "comparison": np.array(["dh_vs_measured", "vec_vs_measured", "dh_vs_measured",
                                "dh_vs_measured"]),
        "line": np.array([9, 4, 4, 7]),
        "reason": np.array(["a jump", "other", "doubled", "no position"]),
        "ex_mm": np.array([3.0, 1.0, 0.0, np.nan]),
        "ey_mm": np.array([4.0, 1.0, -6.0, 0.0]),
        "ez_mm": np.array([12.0, 1.0, 8.0, 0.0]),
    }  # fmt: skip
    (four, seven, nine) = summary.excluded_errors(table, "dh")
    assert four == (4, "doubled", pytest.approx(10.0))
    assert seven[:2] == (7, "no position")
    assert np.isnan(seven[2])
    assert nine == (9, "a jump", pytest.approx(13.0))


def findings(*rows):
    names = ("finding", "level", "what", "lines", "accepted", "rows")
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def test_findings_tell_their_lines_once_and_notes_come_last():
    table = findings(
        ("sparse", "note", "few poses near the limits", "", "", 0),
        ("jump", "warning", "an error of 5 mm in row 12", "row 12", "", 1),
        ("outlier", "warning", "rows far off", "row 1", "the lamp was hit", 2),
        ("number", "warning", "something in row 12", "row 1", "", 1),
        ("left_out", "note", "column 3 is not used", "", "", 0),
    )
    assert summary.findings(table) == [
        "jump: an error of 5 mm in row 12",
        "outlier: rows far off; row 1; accepted: the lamp was hit",
        "number: something in row 12; row 1",
        "sparse: few poses near the limits",
    ]
    assert summary.left_out(table) == ["column 3 is not used"]
    assert summary.left_out(None) == summary.findings(None) == []


def test_models_are_compared_at_rows_that_all_of_them_were_tried_on():
    nan = np.nan
    facts = told(summary.of_errors(pose_errors(
        *[("dh_vs_measured", "cross_validated", row, size, nan)
          for row, size in ((1, 1.0), (2, 3.0), (3, 90.0))],
        *[("vec_vs_measured", "cross_validated", row, size, turn)
          for row, size, turn in ((1, 0.5, 2.0), (2, 0.7, nan), (4, 80.0, 70.0))],
        ("dh_vs_measured", "train", 1, 0.25, nan),
    )))  # fmt: skip
    assert facts["held_out_error", "dh", "n"] == (2.0, "1")
    assert facts["held_out_error", "dh", "mean"] == (2.0, "mm")
    assert facts["held_out_error", "dh", "largest"] == (3.0, "mm")
    # Two rows: the 99 % quantile lies 99 hundredths of the way from the smaller to the larger.
    assert facts["held_out_error", "dh", "quantile_99"] == (pytest.approx(2.98), "mm")
    assert facts["held_out_error", "vec", "mean"] == (pytest.approx(0.6), "mm")
    assert facts["held_out_orientation_error", "vec", "n"] == (1.0, "1")
    assert facts["held_out_orientation_error", "vec", "mean"] == (2.0, "mrad")
    assert ("held_out_orientation_error", "dh", "n") not in facts
    assert facts["training_error", "dh", "mean"] == (0.25, "mm")
    assert ("training_error", "vec", "mean") not in facts


def test_differences_between_models_have_topics_of_their_own():
    facts = told(summary.of_errors(pose_errors(
        ("dh_vs_vec", "cross_validated", 1, 2.0, 5.0),
        ("dh_vs_vec", "train", 1, 1.0, 5.0),
    )))  # fmt: skip
    assert facts["held_out_model_difference", "dh_vs_vec", "mean"] == (2.0, "mm")
    assert facts["model_difference", "dh_vs_vec", "mean"] == (1.0, "mm")
    assert {topic for topic, _, _ in facts} == {"held_out_model_difference", "model_difference"}


def measurements(q):
    return {f"q{number + 1}": column for number, column in enumerate(np.asarray(q, float).T)}


def test_the_range_of_a_joint_is_told_in_degrees_with_its_share_of_the_travel():
    low, high = np.deg2rad([-90, -60, -30, 0, 10, 20]), np.deg2rad([90, 30, 0, 45, 20, 50])
    columns = measurements([low, high, 0.5 * (low + high)])
    assert np.array_equal(summary.covered(columns, ARM), [low, high])
    facts = told(summary._range(columns, ARM))
    assert facts["range", "joint 2", "low"] == (pytest.approx(-60.0), "deg")
    assert facts["range", "joint 2", "high"] == (pytest.approx(30.0), "deg")
    travel = np.rad2deg(ARM.q_max_rad - ARM.q_min_rad)
    assert facts["range", "joint 1", "share"] == (pytest.approx(180.0 / travel[0]), "1")
    assert facts["range", "joint 6", "share"] == (pytest.approx(30.0 / travel[5]), "1")


def test_a_flange_that_always_points_one_way_is_told_with_how_far_it_strays():
    """Joint 1 of this arm stands upright: turning it alone tilts a level flange axis with it."""
    pointing = np.array([0.0, -1.2, 1.4, -0.3, -np.pi / 2, 0.0])
    still = np.tile(pointing, (5, 1))
    still[:, 5] = np.linspace(-1.0, 1.0, 5)  # about its own axis: the direction stays
    (fact,) = summary.of_pointing(measurements(still), ARM)
    assert (fact.topic, fact.item, fact.statistic, fact.unit) == (
        "one_way", "flange", "farthest_off", "deg")  # fmt: skip
    assert fact.value == pytest.approx(0.0, abs=1e-4)
    anywhere = np.random.default_rng(1).uniform(-2.0, 2.0, (20, 6))
    assert list(summary.of_pointing(measurements(anywhere), ARM)) == []
    both = np.stack([pointing, pointing])
    both[:, 4] += np.deg2rad([-3.0, 3.0])
    (fact,) = summary.of_pointing(measurements(both), ARM)
    assert fact.value == pytest.approx(3.0, rel=1e-6)
    both[:, 4] += np.deg2rad([-3.0, 3.0])
    assert list(summary.of_pointing(measurements(both), ARM)) == []


def test_facts_come_back_from_their_table():
    table = {
        "topic": ["data", "range"], "item": ["measurements", "joint 1"],
        "statistic": ["source", "low"], "value": np.array([np.nan, -90.0]),
        "unit": [None, "deg"], "text": ["file", None],
    }  # fmt: skip
    source, low = summary.facts_in(table)
    assert (source.topic, source.item, source.statistic, source.text) == (
        "data", "measurements", "source", "file")  # fmt: skip
    assert np.isnan(source.value)
    assert low == summary.Fact("range", "joint 1", "low", -90.0, "deg", None)


def test_a_joint_bends_where_either_of_its_coefficients_was_fitted():
    nan = np.nan
    table = {
        "joint": np.array([1, 2, 3]),
        "compliance_rad_per_nm": np.array([nan, 1e-6, nan]),
        "std_compliance_rad_per_nm": np.array([nan, nan, nan]),
        "lever_coefficient_rad_per_mm": np.array([nan, nan, 2e-6]),
        "std_lever_coefficient_rad_per_mm": np.array([nan, nan, 1e-7]),
    }
    two, three = summary.bending(table)
    assert (two["joint"], two["compliance_rad_per_nm"]) == (2, 1e-6)
    assert two["std_compliance_rad_per_nm"] is None
    assert two["lever_coefficient_rad_per_mm"] is None
    assert (three["joint"], three["lever_coefficient_rad_per_mm"]) == (3, 2e-6)
    assert three["compliance_rad_per_nm"] is None
    assert summary.bending(None) == []
