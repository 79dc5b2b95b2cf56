"""Of several reflectors, which one the errors of maps and operating points are of."""

import numpy as np

from kinacc.study.summary import differences

MAP = {"position_max_mm": np.array([0.4, np.nan])}


def points(*joints):
    return {"point": np.arange(2), "q1": np.array(joints), "true_error_mm": np.array([0.2, 0.3])}


def measured(*targets):
    rows = [(q, target) for q in (0.1, 0.2) for target in targets]
    return {"q1": np.array([q for q, _ in rows]), "target": np.array([t for _, t in rows], object)}


def test_drawn_points_and_maps_of_three_reflectors_are_of_the_tool_and_say_so():
    for line in differences(points(0.5, 0.6), measured("mA", "mB", "mC"), MAP):
        assert "of the tool of the robot's file, none of mA, mB, mC" in line
        assert "evaluation.tool_mm" in line
    for line in differences(points(0.5, 0.6), measured("tool", "mB"), MAP):
        assert line.endswith("of target tool alone")


def test_measured_points_are_of_every_reflector():
    (line,) = differences(points(0.1, 0.2), measured("mA", "mB"))
    assert line.endswith("of mean readings, of mA, mB")


def test_with_one_target_nothing_is_said_of_targets():
    for given in (points(0.1, 0.2), points(0.5, 0.6)):
        for line in differences(given, measured("mA"), MAP):
            assert "mA" not in line
            assert "tool" not in line
