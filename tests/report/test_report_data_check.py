"""The section on the data says what was measured, what is wrong with it and what to do."""

import numpy as np
from made_up_results import (
    TRAVEL_RAD,
    check,
    everything,
    measurements,
    robot,
    selection,
    table,
)

from kinacc.report import fit_sections


def section(slides=False, **tables):
    return fit_sections.data(everything() | tables, robot(slides))


def measured(found) -> dict[str, str]:
    return dict(table(found, "What was measured").rows)


def test_findings_stand_the_gravest_first_with_what_to_do_and_why_they_were_accepted():
    told = check(
        ("thin_coverage", "note", "joint 4 hardly moves", None, "move it", None, 0),
        ("base_jump", "stops", "the base moved", "lines 9-12", "say so", "moved on purpose", 4),
        ("outliers", "warning", "1 row is off", "line 3", None, None, 1),
        ("left_out", "note", "column temp is not read", None, None, None, 0),
    )
    found = table(section(data_check=told), "Findings of the check: 3 findings")
    assert [row[0] for row in found.rows] == ["stops", "warning", "note"]
    assert found.rows[0] == (
        *("stops", "base_jump", "the base moved", "lines 9-12", "say so"),
        "moved on purpose",
    )
    assert found.rows[1][-1] == "–"
    left_out = table(section(data_check=told), "Not used of the measured file")
    assert left_out.rows == (("column temp is not read",),)


def test_rows_left_out_are_told_with_their_reason_and_the_selected_models_error():
    rows = {
        "comparison": ["vec_vs_measured", "dh_vs_measured", "vec_vs_measured"],
        "line": np.array([9, 9, 4]),
        "reason": ["slip", "slip", "no number"],
        "ex_mm": np.array([3.0, 9.0, np.nan]),
        "ey_mm": np.array([4.0, 9.0, np.nan]),
        "ez_mm": np.array([0.0, 9.0, np.nan]),
    }
    rows = {name: np.array(each, dtype=object if name in ("comparison", "reason") else None)
            for name, each in rows.items()}  # fmt: skip
    found = table(section(excluded_rows=rows), "Rows left out")
    assert found.rows == (("line 4", "could not be read", "no number"), ("line 9", "5.000", "slip"))
    of_dh = section(excluded_rows=rows, model_selection=selection(selected="dh"))
    assert "error of DH, mm" in table(of_dh, "Rows left out").heads


def test_repeats_show_the_noise_with_its_degrees_of_freedom():
    readings = measurements(np.zeros((3, 4)) + 0.1 * np.arange(3)[:, None], repeats=2)
    readings["x_mm"] = np.array([-0.01, 0.01, 5.01, 4.99, 7.01, 6.99])
    told = measured(section(measurements=readings))["noise of a reading"]
    # Each of three pairs leaves 2 (0.01 mm)^2 to one degree of freedom.
    assert "x 0.014, y 0, z 0 mm" in told
    assert "3 configurations with 6 readings (3 degrees of freedom)" in told


def test_a_configuration_the_arm_came_back_to_is_one_of_repeated_readings():
    there = np.array([[0.0] * 4, [0.5] * 4, [0.0] * 4, [0.0] * 4])
    readings = measurements(there, x_mm=np.array([0.31, 9.0, 0.29, 0.30]))
    told = measured(section(measurements=readings))["noise of a reading"]
    # 2 (0.01 mm)^2 on two degrees of freedom along x, nothing along y and z.
    assert "x 0.01, y 0, z 0 mm" in told
    assert "1 configuration with 3 readings (2 degrees of freedom)" in told


def test_the_ranges_of_joints_stand_beside_their_limits_deg_and_mm():
    joints = np.array([[-0.5 * TRAVEL_RAD, 0, 0, -20.0], [0.5 * TRAVEL_RAD, 0, 0, 30.0]])
    found = section(slides=True, measurements=measurements(joints))
    rows = table(found, "Range of every joint").rows
    assert rows[0] == ("1", "deg", "-45.0 to 45.0", "-90.0 to 90.0", "50%")
    assert rows[1][4] == "0%"
    assert rows[3] == ("4", "mm", "-20.0 to 30.0", "-100.0 to 100.0", "25%")
