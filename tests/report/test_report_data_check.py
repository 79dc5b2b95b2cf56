"""The section on the data says what was measured, what is wrong with it and what to do."""

import numpy as np
from made_up_results import (
    TRAVEL_RAD,
    check,
    everything,
    measurements,
    pose_errors,
    robot,
    selection,
    table,
    words,
)
from parsed import read

from kinacc.report import fit_sections


def section(slides=False, **tables):
    return fit_sections.data(everything() | tables, robot(slides))


def measured(found) -> dict[str, str]:
    return dict(table(found, "What was measured").rows)


def test_a_file_without_findings_is_said_to_be_clean():
    assert "nothing suspicious" in words(section())


def test_a_synthetic_arm_has_no_file_to_check():
    tables = everything()
    del tables["data_check"]
    tables["measurements"]["row"][:] = np.nan
    found = fit_sections.data(tables, robot())
    assert "no measured file to check" in words(found)
    assert "of a synthetic arm" in read(found).population


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


def test_nobody_accepted_anything_and_no_column_says_so():
    told = check(("outliers", "warning", "1 row is off", "line 3", None, None, 1))
    assert len(table(section(data_check=told), "Findings of the check").heads) == 5


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


def test_nothing_measured_twice_shows_no_noise_and_a_file_may_state_some():
    readings = measurements([[0.0] * 4, [0.1] * 4], std_x_mm=np.array([0.02, np.nan]))
    readings["std_y_mm"] = readings["std_z_mm"] = np.array([0.03, 0.03])
    told = measured(section(measurements=readings))
    assert told["noise of a reading"].startswith("unknown")
    stated = told["noise as the file states it"]
    assert stated == "standard deviation x 0.02, y 0.03, z 0.03 mm (median of 1 reading)"


def test_positions_only_say_that_the_turn_of_the_tool_is_judged_nowhere():
    readings = measurements([[0.0] * 4, [0.1] * 4])
    for part in "wxyz":
        readings[f"q{part}"][:] = np.nan
    assert "not measured" in measured(section(measurements=readings))["orientation"]
    readings["qw"][0] = 1.0
    told = measured(section(measurements=readings))["orientation"]
    assert told == "measured in 1 of 2 readings"


def test_rows_held_out_targets_and_sessions_are_counted():
    readings = measurements([[0.0] * 4, [0.1] * 4, [0.2] * 4])
    readings["subset"][2] = "validation"
    readings["target"] = np.array(["A", "B", "A"], dtype=object)
    readings["session"] = np.array(["Monday", "Monday", "Tuesday"], dtype=object)
    told = measured(section(measurements=readings))
    assert told["targets"] == "A (2 readings), B (1 reading)"
    assert told["sessions"] == "Monday (2 readings), Tuesday (1 reading)"
    assert told["fitted by the delivered models"].startswith("2 of 3; 1 held out")


def test_the_ranges_of_joints_stand_beside_their_limits_deg_and_mm():
    joints = np.array([[-0.5 * TRAVEL_RAD, 0, 0, -20.0], [0.5 * TRAVEL_RAD, 0, 0, 30.0]])
    found = section(slides=True, measurements=measurements(joints))
    rows = table(found, "Range of every joint").rows
    assert rows[0] == ("1", "deg", "-45.0 to 45.0", "-90.0 to 90.0", "50%")
    assert rows[1][4] == "0%"
    assert rows[3] == ("4", "mm", "-20.0 to 30.0", "-100.0 to 100.0", "25%")


def test_one_row_is_enough_for_a_section():
    found = section(measurements=measurements([[0.0] * 4]), pose_errors=pose_errors(rows=1))
    assert read(found).population.startswith("1 reading of 1 target at 1 pose of a measured arm")
