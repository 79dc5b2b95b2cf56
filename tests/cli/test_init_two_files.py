"""Joints in one file and tracker points in another: joined by a key or by time, asked, refused."""

import numpy as np
import pytest
from tracked_arm import XYZ, Q, assert_read, looked, refused, table, tracked, written

from kinacc.kinematics import robot
from kinacc.measurements.reader import read

IT = tracked()
COUNT = len(IT.q)
ORDER = np.random.default_rng(7).permutation(COUNT)
# Poses are not taken at regular times.
START_S = np.cumsum(np.random.default_rng(3).uniform(20.0, 60.0, COUNT))


def named(pattern, rows):
    return [pattern.format(row + 1) for row in rows]


@pytest.mark.parametrize(
    ("there", "here"),
    [("P{}", "P{}"), ("P{:03d}", "p{}"), ("{}", "Punkt {}"), ("P[{}]", "P{}"), ("pose_{}", "{}")],
)
def test_a_name_joins_whatever_the_order(there, here, tmp_path):
    joints = table(["Name", *Q], named(there, range(COUNT)), IT.q)
    points = table(["Point", *XYZ], named(here, ORDER), IT.point[ORDER], mark=";")
    files = written(tmp_path, joints_csv=joints, tracker_csv=points)
    section, _ = looked(files)
    assert_read(section, IT, ORDER)
    assert section["path"].endswith("tracker.csv")
    assert read(section, robot.load("ur10")).columns["row"].tolist() == list(range(2, COUNT + 2))


def test_what_stays_unmatched_is_printed_with_its_lines(tmp_path):
    rows = np.arange(COUNT)
    joints = table(["Name", *Q], named("P{}", rows[3:]), IT.q[3:])
    points = table(["Name", *XYZ], named("P{}", rows[1:8]), IT.point[1:8])
    files = written(tmp_path, joints_csv=joints, tracker_csv=points)
    section, _ = looked(files)
    assert_read(section, IT, rows[3:8])
    assert "lines 2-3" in "\n".join(read(section, robot.load("ur10")).notes)


def test_as_many_rows_without_a_key_are_asked_about(tmp_path):
    files = written(tmp_path, joints_csv=table(Q, IT.q), tracker_csv=table(XYZ, IT.point))
    assert "--join order" in refused(files)
    section, _ = looked(files, join="order")
    assert_read(section, IT)


def test_a_count_of_rows_is_no_name(tmp_path):
    # The tracker missed the fifth pose; its count goes on all the same.
    rows = np.delete(np.arange(COUNT), 4)
    joints = table(["No", *Q], np.arange(1, COUNT + 1), IT.q)
    points = table(["No", *XYZ], np.arange(1, COUNT), IT.point[rows])
    said = refused(written(tmp_path, joints_csv=joints, tracker_csv=points))
    assert "--join" in said
    assert "No=No" in said


def test_one_name_for_two_poses_is_refused(tmp_path):
    names = named("P{}", range(COUNT))
    names[7] = names[3]
    joints = table(["Name", *Q], names, IT.q * [0, 0, 0, 0, 0, 1])  # joint 6 alone differs
    points = table(["Name", *XYZ], named("P{}", range(COUNT)), IT.point)
    files = written(tmp_path, joints_csv=joints, tracker_csv=points)
    assert "lines 5, 9" in refused(files, "--join", "Name")


def dense_log():
    """A controller's record: a pose is held for eight seconds, then left joint by joint in six."""
    time = np.arange(0.0, 14.0, 0.2)
    share = np.clip((time[:, None] - 7.8 - np.arange(6)) / 1.2, 0.0, 1.0)
    after = np.roll(IT.q, -1, axis=0)
    q = (1.0 - share) * IT.q[:, None] + share * after[:, None]
    return np.ravel(START_S[:, None] + time), q.reshape(-1, 6)


def test_a_point_taken_while_the_arm_moved_is_left_out_and_said(tmp_path):
    time, q = dense_log()
    reading = START_S + np.random.default_rng(5).uniform(2.0, 6.0, COUNT)
    reading[6] = START_S[6] + 10.0
    joints = table(["timestamp", *Q], time - 20.0, q)
    clock = np.datetime64("2026-03-02") + (1e3 * reading).astype("timedelta64[ms]")
    points = table(["Time", *XYZ], clock.astype(str), IT.point)
    section, notes = looked(written(tmp_path, joints_csv=joints, tracker_csv=points))
    assert_read(section, IT, np.delete(np.arange(COUNT), 6))
    assert "the arm was moving: line 8" in " ".join(notes)
    assert section["joints"]["clock_offset_s"] == pytest.approx(-20.0, abs=1.0)


def test_regular_times_leave_the_offset_open(tmp_path):
    time = 30.0 * np.arange(COUNT)
    joints = table(["time", *Q], time, IT.q)
    points = table(["time", *XYZ], time + 3.0, IT.point)
    files = written(tmp_path, joints_csv=joints, tracker_csv=points)
    assert "--clock-offset" in refused(files)
    section, _ = looked(files, clock_offset="-3")
    assert_read(section, IT)
