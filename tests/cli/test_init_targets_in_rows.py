"""Files with a row for every target of a pose, where no column calls the targets so."""

import numpy as np
from tracked_arm import XYZ, Q, looked, refused, table, tracked, written

from kinacc.kinematics import robot
from kinacc.measurements.reader import read

IT = tracked()
COUNT = len(IT.q)
NAMES = [f"P{row + 1}" for row in range(COUNT)]
LOWER = IT.point + IT.turn.apply([0.0, 0.0, -12.7])
JOINTS = table(["Pose", *Q], NAMES, IT.q)


def targets(section):
    found = read(section, robot.load("ur10")).columns
    return {name: np.sum(found["target"] == name) for name in dict.fromkeys(found["target"])}


def test_groups_from_two_places_of_the_tracker_are_no_targets(tmp_path):
    x, y, z = IT.point.T
    groups = ["SMR_A"] * COUNT + ["SMR_B"] * COUNT
    point = np.vstack([IT.point, np.stack([-y + 900.0, x, z], axis=1)])
    points = table(["Group", "Point", *XYZ], groups, NAMES * 2, point)
    said = refused(written(tmp_path, joints_csv=JOINTS, tracker_csv=points))
    assert "over 5 mm apart" in said


def in_one_nest(radius):
    point = np.where(np.array(radius)[:, None] > 10.0, IT.point, LOWER)
    return table([*Q, "Reflector radius [mm]", *XYZ], IT.q, [f"{r:g}" for r in radius], point)


def test_a_reflector_of_another_radius_is_a_target_of_its_own(tmp_path):
    text = in_one_nest([19.05] * 12 + [6.35] * (COUNT - 12))
    section, _ = looked(written(tmp_path, cell_csv=text))
    assert targets(section) == {"19.05": 12, "6.35": COUNT - 12}


def test_radii_that_were_measured_scatter_and_are_one_reflector(tmp_path):
    radius = np.linspace(19.04, 19.06, COUNT)
    section, _ = looked(written(tmp_path, cell_csv=in_one_nest(radius)))
    assert targets(section) == {"tool": COUNT}
