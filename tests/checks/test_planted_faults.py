"""Every known fault, planted in a good file, is named with its rows; good files raise none.

Measured files are used where real errors of an arm could hide or feign a fault.
"""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import plants
import pytest
from good_files import measured, simulated

from kinacc.measurements.intake.write import shipped_text

EVERY, SOME, LATE = plants.every, plants.some, plants.late


@cache
def good(name):
    """A good file: measured (every eighth pose of a series will do), or of a simulated arm."""
    if name == "arm":
        return simulated("irb120", poses=80, turned=True)
    if name == "three":
        return simulated("mh180", poses=60, targets=("mA", "mB", "mC"), noise_mm=0.01)
    return measured("fanuc") if name == "fanuc" else measured("ur10_d").rows(slice(0, 632, 8))


def lines(rows):
    """Lines of the file that rows (from 0) stand on, under one line of names."""
    return {int(row) + 2 for row in rows}


def only(report, kind, rows, unsure=0):
    """The one finding there is, of the kind and rows wanted, but for ``unsure`` of them."""
    assert [each.kind for each in report.suspicions] == [kind], report.suspicions
    assert len(set(report.suspicions[0].lines) ^ lines(rows)) <= unsure, report.suspicions
    return report.suspicions[0]


def frames_mirrored(file, rows):
    mirror = np.diag([1.0, -1.0, 1.0])
    return plants.turned(
        plants.mirrored(file, rows), mirror @ plants.rotations(file) @ mirror, rows
    )


def slips(file, rows):
    by_mm = 20.0 * np.random.default_rng(3).normal(size=(len(rows), 3))
    return plants.shifted(file, plants.points(file)[:3], by_mm, rows)


def readings_in_turn(file, rows):
    names = [*plants.points(file), *plants.ANGLES]
    return plants.put(file, names, rows, plants.taken(file, names, np.roll(rows, 1)))


# Faults in all rows of a simulated arm are golden (tests/golden/faults), with their sizes.
FAULTS = [
    ("joint_units", plants.joints_in_radians, "fanuc", SOME),
    ("length_units", plants.in_metres, "arm", SOME),
    ("joint_sign", plants.reversed_joint, "arm", SOME),
    ("left_handed", plants.mirrored, "arm", SOME),
    ("left_handed", frames_mirrored, "arm", EVERY),
    ("transposed_rotation", plants.transposed, "arm", SOME),
    ("angle_units", plants.angles_in_radians, "arm", SOME),
    ("euler_convention", plants.of_another_convention, "ur10", EVERY),
    ("joint_coupling", plants.coupled, "fanuc", EVERY),
    ("outliers", slips, "ur10", SOME),
    ("base_jump", plants.jumped, "ur10", LATE),
    (
        "base_jump",
        partial(plants.jumped, by_mm=(5.0, 0.0, 0.0), turn_mrad=0.0),
        "fanuc",
        partial(LATE, share=0.625),
    ),
    ("target_swapped", plants.exchanged, "three", SOME),
    ("rows_exchanged", readings_in_turn, "arm", SOME),
    ("commanded_joints", plants.rounded, "ur10", partial(SOME, count=12)),
]


@pytest.mark.parametrize(("kind", "fault", "name", "which"), FAULTS)
def test_a_planted_fault_is_named_with_its_rows(kind, fault, name, which, tmp_path):
    file = good(name)
    only(fault(file, which(file)).check(tmp_path), kind, which(file))


@pytest.mark.parametrize(("name", "joint"), [("arm", 1), ("ur10", 5)])
def test_a_joint_that_counts_the_other_way_is_named(name, joint, tmp_path):
    file = good(name)
    bad = plants.reversed_joint(file, EVERY(file), joint)
    assert only(bad.check(tmp_path), "joint_sign", EVERY(file)).values["joint"] == joint


def test_a_joint_that_counts_from_another_zero_is_found_with_its_sign(tmp_path):
    file = good("arm").rows(slice(0, 40))
    bad = file.but(q3_deg=file.columns["q3_deg"] - 90.0)
    found = only(bad.check(tmp_path), "joint_zero", EVERY(bad))
    assert found.values["zero_deg"] == 90.0


def test_joints_in_radians_of_which_two_count_the_other_way_are_all_named(tmp_path):
    file = good("arm").rows(slice(0, 40))
    rows = EVERY(file)
    file = plants.reversed_joint(plants.reversed_joint(file, rows, 2), rows, 3)
    file = plants.joints_in_radians(file, rows)
    found = [(each.kind, each.values.get("joint")) for each in file.check(tmp_path).suspicions]
    assert sorted(found) == [("joint_sign", 2), ("joint_sign", 3), ("joint_units", None)]


def test_positions_mirrored_beside_good_orientations_are_mended_alone(tmp_path):
    bad = plants.mirrored(good("arm"), EVERY(good("arm")), "x")
    found = only(bad.check(tmp_path), "left_handed", EVERY(bad))
    assert found.fix.startswith("negate x of the positions;")


def test_a_tool_that_moved(tmp_path):
    file, by_mm = good("ur10"), (1.0, -0.5, 0.5)
    bad = plants.on_the_flange(file, plants.rotations(file), by_mm, LATE(file))
    # Errors of a real arm as large as the move can hide in which of two rows it began.
    found = only(bad.check(tmp_path), "target_moved", LATE(file), unsure=1)
    assert np.linalg.norm(found.values["shift_mm"]) == pytest.approx(np.linalg.norm(by_mm), rel=0.2)


@pytest.mark.parametrize("name", ["fanuc", "three"])
def test_one_of_three_targets_that_moved(name, tmp_path):
    file = good(name)
    flange = plants.triad(file, ("mA", "mB", "mC"))
    bad = plants.on_the_flange(file, flange, (0.3, 0.3, 0.0), LATE(file), "mB_")
    found = only(bad.check(tmp_path), "target_moved", LATE(file))
    assert found.values["target"] == "mB"


def test_two_jumps_have_sizes_of_their_own(tmp_path):
    file = simulated("irb120", poses=90)
    for begin in (30, 60):
        file = plants.jumped(file, np.arange(begin, 90), (1.5, 0.0, 0.0), 0.0)
    found = file.check(tmp_path).suspicions
    assert [set(each.lines) for each in found] == [lines(range(b, 90)) for b in (30, 60)]
    for each in found:
        assert np.linalg.norm(each.values["shift_mm"]) == pytest.approx(1.5, rel=0.1)


def test_commanded_joints_that_part_from_those_read_back(tmp_path):
    file = good("arm").rows(slice(0, 50))
    sent = {n.replace("_deg", "_cmd_deg"): file.columns[n] + 1e-4 for n in plants.joints(file)}
    assert file.but(**sent).check(tmp_path).suspicions == ()
    bad = plants.rounded(file, SOME(file)).but(**sent)
    only(bad.check(tmp_path), "commanded_joints", SOME(file))


def test_a_robot_of_the_same_build_and_other_lengths(tmp_path):
    file = replace(simulated("mh180", poses=100, share=0.4), robot="fanuc_r2000ic_165f")
    found = only(file.check(tmp_path), "does_not_fit", EVERY(file))
    assert found.values["largest_mm"] > 10.0
    assert found.level == "stops"
    assert "mh180" in found.fix


def test_another_robot_that_fits_is_named(tmp_path):
    file = replace(simulated("ur10", poses=30), robot="ur5")
    found = only(file.check(tmp_path), "does_not_fit", EVERY(file))
    assert found.fix.partition("best first: ")[2].split(", ")[0] == "ur10"


NIGHT = [pytest.param(name, marks=pytest.mark.night) for name in ("ur10_a", "ur10_c")]


@pytest.mark.parametrize("name", ["ur10_d", "fanuc", *NIGHT])
def test_measured_files_raise_no_suspicion(name, tmp_path):
    assert measured(name).check(tmp_path).suspicions == ()


def test_a_measured_file_whose_largest_error_hangs_on_three_rows(tmp_path):
    """UR10 B: line 534 repeats 533 at other joints, and three rows make the maximum."""
    report = measured("ur10_b").check(tmp_path)
    found = {each.kind: each.lines for each in report.suspicions}
    assert found == {"repeated_reading": (534, 1065), "largest_rows": (534, 856, 857)}
    assert not report.stopping


@pytest.mark.parametrize(
    ("robot", "kind"),
    [
        ("tx2_90l", {"poses": 100, "noise_mm": 0.3}),
        ("fanuc_r2000ic_165f", {"poses": 40, "targets": ("a", "b", "c"), "repeats": 2}),
        ("iiwa14", {"poses": 15, "turned": True, "repeats": 3}),
        ("meca500", {"poses": 10}),
        ("irb120", {"poses": 60, "noise_mm": 0.02, "share": 0.2}),
    ],
    ids=str,
)
def test_simulated_files_raise_no_suspicion(robot, kind, tmp_path):
    assert simulated(robot, **kind).check(tmp_path).suspicions == ()


def test_the_joint_map_that_is_advised_mends_a_coupling(tmp_path):
    file = good("arm").rows(slice(0, 40))
    file = plants.coupled(file, EVERY(file))
    found = only(file.check(tmp_path), "joint_coupling", EVERY(file))
    assert (found.values["joint"], found.values["other"]) == (3, 2)
    (tmp_path / "own.yaml").write_text(
        f"{shipped_text('irb120')}\njoint_map: {found.values['joint_map']}\n"
    )
    mended = replace(file, robot=tmp_path / "own.yaml").check(tmp_path)
    # The limits are those of the joints as the robot counts them.
    assert {each.kind for each in mended.suspicions} <= {"outside_limits"}


def test_sound_rows_that_alone_show_a_movement_are_no_slips(tmp_path):
    # Every fifth pose of a measured UR10 whose joint 4 has moved by 1 mrad: no other pose is near
    # the last two, and without them nothing tells where they are to within 0.3 m.
    file = measured("ur10_d").rows(slice(0, 299, 5))
    file = file.but(q4_deg=file.columns["q4_deg"] + np.rad2deg(1e-3))
    assert file.check(tmp_path).suspicions == ()


def test_one_target_touched_in_one_row_shows_by_its_distances_where_the_arm_errs_by_more(tmp_path):
    file = simulated(poses=80, targets=("mA", "mB"), noise_mm=0.03)
    errors = 0.3 * np.random.default_rng(4).normal(size=(80, 3))  # the same for both targets
    names = plants.points(file)
    file = plants.put(
        file, names, EVERY(file), plants.taken(file, names, EVERY(file)) + np.tile(errors, 2)
    )
    assert not file.check(tmp_path).suspicions
    touched = plants.put(file, ["mA_x_mm"], [33], plants.taken(file, ["mA_x_mm"], [33]) + 1.0)
    only(touched.check(tmp_path), "outliers", [33])
