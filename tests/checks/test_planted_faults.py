"""Every known fault, planted in a good file, is named with its rows; good files raise none.

Measured files are used where real errors of an arm could hide or feign a fault.
"""

from dataclasses import replace

import numpy as np
import plants
import pytest
from good_files import File, measured, simulated

from kinacc.checks.findings import STOPPING
from kinacc.config.schema import key
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import forward


def good(name: str) -> File:
    """A good file: measured (every fourth pose of a series will do), or of a simulated arm."""
    if name == "fanuc":
        return measured("fanuc")
    if name == "ur10":
        return measured("ur10_d").rows(slice(0, 632, 4))
    return simulated("irb120", poses=80, turned=True)


def lines(rows):
    """Lines of the file that rows (from 0) stand on, under one line of names."""
    return tuple(int(row) + 2 for row in rows)


def only(report, kind, rows, unsure=0):
    """The one suspicion there is, of the kind and rows wanted, but for ``unsure`` of them."""
    told = [f"{each.kind}: {each.what} ({each.where})" for each in report.suspicions]
    assert [each.kind for each in report.suspicions] == [kind], told
    assert len(set(report.suspicions[0].lines) ^ set(lines(rows))) <= unsure, told
    assert report.code == 1
    return report.suspicions[0]


QUICK = ("fanuc", "arm")


@pytest.mark.parametrize("name", ["ur10_a", "ur10_c", "ur10_d", "fanuc"])
def test_measured_files_raise_no_suspicion(name, tmp_path):
    report = measured(name).check(tmp_path)
    assert report.suspicions == ()
    assert report.code == 0


def test_a_measured_file_whose_largest_error_hangs_on_three_rows(tmp_path):
    """UR10 B: line 534 repeats 533 at other joints, and three rows make the maximum."""
    report = measured("ur10_b").check(tmp_path)
    found = {each.kind: each for each in report.suspicions}
    assert set(found) == {"repeated_reading", "largest_rows"}
    assert found["repeated_reading"].lines == (534, 1065)
    assert "line 534 repeats 533" in found["repeated_reading"].what
    assert found["largest_rows"].lines == (534, 856, 857)
    assert not report.stopping
    assert report.code == 1


@pytest.mark.parametrize(
    ("robot", "kind"),
    [
        ("ur10", {"poses": 100}),
        ("tx2_90l", {"poses": 100, "noise_mm": 0.3}),
        ("mh180", {"poses": 60, "targets": ("a", "b", "c"), "noise_mm": 0.01}),
        ("fanuc_r2000ic_165f", {"poses": 40, "targets": ("a", "b", "c"), "repeats": 2}),
        ("iiwa14", {"poses": 15, "turned": True, "repeats": 3}),
        ("iiwa14", {"poses": 20, "turned": True}),
        ("meca500", {"poses": 10}),
        ("irb120", {"poses": 60, "noise_mm": 0.02, "share": 0.2}),
    ],
    ids=str,
)
def test_simulated_files_raise_no_suspicion(robot, kind, tmp_path):
    assert simulated(robot, **kind).check(tmp_path).suspicions == ()


@pytest.mark.parametrize("seed", range(4))
def test_readings_without_noise_of_the_arm_as_described_raise_no_suspicion(seed, tmp_path):
    arm = robots.load("irb120")
    q = np.round(np.random.default_rng(seed).uniform(-1.0, 1.0, (40, 6)), 6)
    columns = dict(zip((f"q{i}_rad" for i in range(1, 7)), q.T, strict=True))
    columns |= dict(zip(("x_mm", "y_mm", "z_mm"), forward(arm, q).position_mm.T, strict=True))
    assert File(columns, "irb120").check(tmp_path).suspicions == ()


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.parametrize("which", [plants.every, plants.some])
def test_joints_in_radians_under_degrees(name, which, tmp_path):
    file = good(name)
    bad = plants.in_radians(file, plants.joints(file), which(file))
    found = only(bad.check(tmp_path), "joint_units", which(file))
    assert "radians" in found.what


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.parametrize("which", [plants.every, plants.some])
def test_metres_under_millimetres(name, which, tmp_path):
    file = good(name)
    bad = plants.scaled(file, plants.points(file), 1e-3, which(file))
    found = only(bad.check(tmp_path), "length_units", which(file))
    assert "metres" in found.what


@pytest.mark.parametrize("name", ["arm"])
@pytest.mark.parametrize("which", [plants.every, plants.some])
def test_left_handed_positions(name, which, tmp_path):
    file = good(name)
    bad = plants.mirrored(file, "y", which(file))
    only(bad.check(tmp_path), "left_handed", which(file))


@pytest.mark.parametrize("name", ["arm"])
def test_left_handed_frames(name, tmp_path):
    file, mirror = good(name), np.diag([1.0, -1.0, 1.0])
    bad = plants.mirrored(file, "y", plants.every(file))
    bad = plants.turned(bad, mirror @ plants.rotations(file) @ mirror, plants.every(file))
    only(bad.check(tmp_path), "left_handed", plants.every(file))


@pytest.mark.parametrize("name", ["arm"])
@pytest.mark.parametrize("which", [plants.every, plants.some])
def test_transposed_rotations(name, which, tmp_path):
    file = good(name)
    bad = plants.transposed(file, which(file))
    only(bad.check(tmp_path), "transposed_rotation", which(file))


def test_swapped_euler_convention(tmp_path):
    file = good("ur10")
    found = only(
        plants.of_another_convention(file).check(tmp_path), "euler_convention", plants.every(file)
    )
    assert "angles xyz in the columns' order" in found.what  # ZYX about moving axes


@pytest.mark.parametrize("name", ["arm"])
@pytest.mark.parametrize("which", [plants.every, plants.some])
def test_orientation_in_radians_under_degrees(name, which, tmp_path):
    file = good(name)
    bad = plants.in_radians(file, plants.ANGLES, which(file))
    found = only(bad.check(tmp_path), "angle_units", which(file))
    assert "radians" in found.what


@pytest.mark.parametrize(
    ("name", "joint"),
    [
        *(("arm", joint) for joint in range(1, 7)),
        ("ur10", 4),
        ("ur10", 5),
        ("ur10", 6),
        ("fanuc", 2),
    ],
)
def test_wrong_joint_sign(name, joint, tmp_path):
    file = good(name)
    bad = plants.scaled(file, [f"q{joint}_deg"], -1.0, plants.every(file))
    found = only(bad.check(tmp_path), "joint_sign", plants.every(file))
    assert f"joint {joint} " in found.what


def test_wrong_joint_sign_in_some_rows(tmp_path):
    file = good("arm")
    bad = plants.scaled(file, ["q3_deg"], -1.0, plants.some(file))
    only(bad.check(tmp_path), "joint_sign", plants.some(file))


@pytest.mark.parametrize("name", QUICK)
def test_coupled_joints(name, tmp_path):
    file = good(name)
    bad = plants.coupled(file, plants.every(file))
    found = only(bad.check(tmp_path), "joint_coupling", plants.every(file))
    assert "joint 3 plus joint 2" in found.what


@pytest.mark.parametrize("name", ["arm"])
def test_exchanged_joint_columns(name, tmp_path):
    file = good(name)
    columns = {"q4_deg": file.columns["q5_deg"], "q5_deg": file.columns["q4_deg"]}
    only(file.but(**columns).check(tmp_path), "joint_order", plants.every(file))


@pytest.mark.parametrize("name", ["fanuc"])
def test_duplicate_rows(name, tmp_path):
    file = good(name)
    bad, rows = plants.copied(file, plants.some(file))
    only(bad.check(tmp_path), "duplicate_rows", rows)


@pytest.mark.parametrize("name", ["ur10", "fanuc"])
def test_outliers(name, tmp_path):
    file, rng = good(name), np.random.default_rng(3)
    bad = file
    for row in plants.some(file):
        bad = plants.shifted(bad, plants.points(file)[:3], 20.0 * rng.normal(size=3), [row])
    only(bad.check(tmp_path), "outliers", plants.some(file))


@pytest.mark.parametrize(("name", "by_mm"), [("arm", (0.3, -0.3, 0.3)), ("ur10", (1.0, -0.5, 0.5))])
def test_a_tool_that_moved(name, by_mm, tmp_path):
    file = good(name)
    bad = plants.on_the_flange(file, plants.rotations(file), by_mm, plants.late(file))
    # Errors of a real arm as large as the move can hide in which of two rows it began.
    found = only(bad.check(tmp_path), "target_moved", plants.late(file), unsure=name == "ur10")
    assert np.linalg.norm(found.values["shift_mm"]) == pytest.approx(np.linalg.norm(by_mm), rel=0.2)


@pytest.mark.parametrize("by_mm", [0.3, 1.0])
def test_one_of_three_targets_that_moved(by_mm, tmp_path):
    file = good("fanuc")
    flange = plants.triad(file, ("mA", "mB", "mC"))
    bad = plants.on_the_flange(file, flange, (by_mm, by_mm, 0.0), plants.late(file), "mB_")
    found = only(bad.check(tmp_path), "target_moved", plants.late(file))
    assert "mB" in found.what


def test_targets_taken_for_one_another(tmp_path):
    file = good("fanuc")
    bad = plants.exchanged(file, "mA", "mB", plants.some(file))
    only(bad.check(tmp_path), "target_swapped", plants.some(file))


@pytest.mark.parametrize(
    ("name", "by_mm", "turn_mrad"),
    [
        ("arm", (1.0, -0.5, 0.7), 1.0),
        ("ur10", (1.0, -0.5, 0.7), 1.0),
        ("fanuc", (5.0, 0.0, 0.0), 0.0),
    ],
)
def test_a_base_frame_that_jumps(name, by_mm, turn_mrad, tmp_path):
    file = good(name)
    rows = np.arange(150, len(file)) if name == "fanuc" else plants.late(file)
    bad = plants.jumped(file, by_mm, turn_mrad, rows)
    only(bad.check(tmp_path), "base_jump", rows)


@pytest.mark.parametrize("name", ["ur10", "arm"])
def test_commanded_joints_in_some_rows(name, tmp_path):
    file = good(name)
    rows = plants.some(file, 12)
    only(plants.rounded(file, rows, 0).check(tmp_path), "commanded_joints", rows)


@pytest.mark.parametrize("name", QUICK)
def test_commanded_joints_in_all_rows(name, tmp_path):
    file = good(name)
    rows = plants.every(file)
    only(plants.rounded(file, rows, 0).check(tmp_path), "commanded_joints", rows)


def in_sessions(file, counts):
    """The file as measured from several places, each with a base frame of its own."""
    session, rng = np.repeat(range(len(counts)), counts), np.random.default_rng(7)
    for number in range(1, len(counts)):
        rows = np.flatnonzero(session == number)
        file = plants.jumped(file, rng.uniform(-2000, 2000, 3), 1e3 * rng.normal(), rows)
    return file, session.astype(float)


def test_sessions_have_bases_of_their_own(tmp_path):
    file, session = in_sessions(simulated("irb120", poses=100), (60, 40))
    assert file.but(session=session).check(tmp_path).suspicions == ()
    rows = np.arange(80, 100)
    bad = plants.jumped(file, (2.0, -1.0, 1.0), 1.0, rows).but(session=session)
    only(bad.check(tmp_path), "base_jump", rows)


def test_commanded_joints_that_part_from_those_read_back(tmp_path):
    file = good("arm")
    columns = {n.replace("_deg", "_cmd_deg"): file.columns[n] + 1e-4 for n in plants.joints(file)}
    assert file.but(**columns).check(tmp_path).suspicions == ()
    bad = plants.rounded(file, plants.some(file), 0).but(**columns)
    only(bad.check(tmp_path), "commanded_joints", plants.some(file))


@pytest.mark.parametrize(
    ("measured_on", "said"), [("mh180", "fanuc_r2000ic_165f"), ("fanuc_r2000ic_165f", "mh180")]
)
def test_a_robot_of_the_same_build_and_other_lengths(measured_on, said, tmp_path):
    file = replace(simulated(measured_on, poses=100, share=0.4), robot=said)
    found = only(file.check(tmp_path), "does_not_fit", plants.every(file))
    assert "other lengths" in found.what
    assert found.level == "stops"


def test_what_stops_a_workflow_can_be_accepted_in_the_configuration():
    assert set(key("data_check.accept")["propertyNames"]["enum"]) == set(STOPPING)


@pytest.mark.parametrize("name", ["arm"])
def test_a_robot_that_is_not_the_one_described(name, tmp_path):
    file = replace(good(name), robot="meca500")
    found = {each.kind: each for each in file.check(tmp_path).suspicions}
    assert set(found) <= {"does_not_fit", "outside_limits"}
    assert found["does_not_fit"].lines == lines(plants.every(file))
    assert "robot" in found["does_not_fit"].fix
