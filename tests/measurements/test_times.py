"""Standstills in a record of joints, and the offset between two clocks, against made-up truth."""

import numpy as np
import pytest

from kinacc.measurements.times import offsets, standstills

BEGIN_S, STEP_S, MOVES_S = 5000.0, 0.01, 0.5


def record(stops_s):
    """Times, one joint that turns by 1 rad/s between the stops, begin and end of the stops."""
    turns, stands = [], []
    for stop_s in stops_s:
        turns += [STEP_S] * round(MOVES_S / STEP_S)
        still = round(stop_s / STEP_S)
        stands.append((len(turns), len(turns) + still))
        turns += [0.0] * still
    now = np.cumsum([0.0, *turns, *([STEP_S] * 50)])
    time = BEGIN_S + STEP_S * np.arange(len(now))
    return time, now[:, None], time[np.array(stands)]


def test_short_stops_of_a_record_that_runs_on_are_no_standstills():
    time, q, stands = record([1.0, 0.1, 0.6, 0.2, 2.0])
    found, within_s = standstills(time, q)
    np.testing.assert_allclose(found, stands[[0, 2, 4]])
    assert within_s == pytest.approx(0.05)


def test_the_offset_between_two_clocks_is_found():
    rng = np.random.default_rng(4)
    time, q, _ = record(rng.uniform(0.5, 3.0, 40))
    found, within_s = standstills(time, q)
    points = found.mean(axis=1) - 1234.5 + rng.uniform(-0.1, 0.1, 40)
    offset, *_ = offsets(points, found, within_s)
    assert offset == pytest.approx(1234.5, abs=0.25)
