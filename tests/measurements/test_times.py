"""Standstills in a record of joints, and the offset between two clocks, against made-up truth."""

import numpy as np
import pytest

from kinacc.measurements.table import RawTable, frame
from kinacc.measurements.times import offsets, seconds, standstills

BEGIN_S, STEP_S, MOVES_S = 5000.0, 0.01, 0.5


def record(stops_s):
    """Times, one joint that turns by 1 rad/s between stops, begin and end of each stop."""
    turns, stops = [], []
    for stop_s in stops_s:
        turns += [STEP_S] * round(MOVES_S / STEP_S)
        steps = round(stop_s / STEP_S)
        stops.append((len(turns), len(turns) + steps))
        turns += [0.0] * steps
    joint_rad = np.cumsum([0.0, *turns, *([STEP_S] * 50)])
    time_s = BEGIN_S + STEP_S * np.arange(len(joint_rad))
    return time_s, joint_rad[:, None], time_s[np.array(stops)]


def test_short_stops_of_a_record_that_runs_on_are_no_standstills():
    time_s, q_rad, stops = record([1.0, 0.1, 0.6, 0.2, 2.0])
    stands, within_s = standstills(time_s, q_rad)
    np.testing.assert_allclose(stands, stops[[0, 2, 4]])
    assert within_s == pytest.approx(0.05)


def test_the_offset_between_two_clocks_is_found():
    rng = np.random.default_rng(4)
    time_s, q_rad, _ = record(rng.uniform(0.5, 3.0, 40))
    stands, within_s = standstills(time_s, q_rad)
    points_s = stands.mean(axis=1) - 1234.5 + rng.uniform(-0.1, 0.1, 40)
    offset, *_ = offsets(points_s, stands, within_s)
    assert offset == pytest.approx(1234.5, abs=0.25)


def test_of_offsets_that_fit_as_many_points_the_middle_of_the_widest_span_is_taken():
    begin_s = np.array([0.0, 10.0, 21.0, 33.0, 46.0, 60.0])
    # The last but one fits below -0.25 s, the last above: five of six from -0.5 to 0.5 s.
    points_s = begin_s + np.array([0.5, 0.5, 0.5, 0.5, 1.25, 0.25])
    assert offsets(points_s, begin_s[:, None] + [0.0, 1.0], 0.05) == [0.125]


def test_times_go_on_over_midnight_and_milliseconds_are_known_by_their_size():
    columns = {"time": ["30/04/2026 23:59:59,5", "01/05/2026 00:00:01"]}
    columns["stamp"] = ["1767225600000", "1767225601500"]
    table = RawTable("log.csv", frame(columns), np.arange(2))
    for name in table.columns:
        assert np.diff(seconds(table, name)) == pytest.approx(1.5)
