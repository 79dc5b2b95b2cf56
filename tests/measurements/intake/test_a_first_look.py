"""What is found out about a file nobody has described: how it is written, what its columns hold."""

import pytest

from kinacc.errors import InputError
from kinacc.measurements.column_names import name_of
from kinacc.measurements.intake import guess, text
from kinacc.measurements.intake.columns import recognise

KUKA = """exported by a controller
Nr;A1;A2;A3;A4;A5;A6;X;Y;Z;A;B;C
;[deg];[deg];[deg];[deg];[deg];[deg];[mm];[mm];[mm];[deg];[deg];[deg]
1;10,5;20,1;30;1,5;-12;3;1000,5;20,5;33,1;10;20;30
2;11,5;20,1;31;1,5;-12;3;1001,5;22,5;33,1;10;20;30
"""


@pytest.fixture
def file(tmp_path):
    def write(content):
        path = tmp_path / "readings.csv"
        path.write_text(content, encoding="utf-8")
        return path

    return write


def names(*columns):
    return [name_of(column) for column in columns]


def test_semicolons_decimal_commas_and_lines_around_the_names(file):
    found = guess.look(file(KUKA))
    section = found.section
    assert (section["delimiter"], section["decimal"]) == (";", ",")
    assert (section["skip_lines"], section["skip_under_names"]) == (1, 1)
    assert section["columns"]["q6"] == "A6"
    assert [section["columns"][axis] for axis in ("rx", "ry", "rz")] == ["C", "B", "A"]
    assert section["orientation"] == {"kind": "euler", "convention": "ZYX", "unit": "deg"}
    assert (section["joint_unit"], section["length_unit"]) == ("deg", "mm")
    assert set(found.assumed) == {"orientation"}


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
def test_every_mark_between_columns(file, mark):
    rows = [["q1", "q2", "q3", "q4", "x", "y", "z"], *([["1.5"] * 7] * 3)]
    path = file("\n".join(mark.join(row) for row in rows))
    assert text.look(path).written.delimiter == ("blanks" if mark == " " else mark)
    assert text.look(path).written.decimal == "."


def test_units_by_name_and_by_size(file):
    head = "q1_deg,q2_deg,q3_deg,q4_deg,x,y,z\n"
    found = guess.look(file(head + "0.1,0.2,0.3,0.1,1.5,0.2,0.3\n" * 3))
    assert found.section["joint_unit"] == "deg"
    assert found.section["length_unit"] == "m"
    assert "1.5" in found.assumed["length_unit"]
    assert "joint_unit" not in found.assumed
    assert [found.section["columns"][axis] for axis in "xyz"] == ["x", "y", "z"]


def test_targets_keep_their_names_and_every_column_read_is_named(file):
    head = "config,repeat,q1_deg,q2_deg,q3_deg,q4_deg,mA_x_mm,mA_y_mm,mA_z_mm,b_x_mm,b_y_mm,b_z_mm"
    points = ["1,2,3,1,2,9", "1,2,3,1,8,3", "1,2,3,7,2,3"]  # 6 mm apart, in another direction each
    rows = "".join(f"{n},0,10,20,30,4{n},{p}\n" for n, p in enumerate(points))
    found = guess.look(file(f"{head}\n{rows}"))
    assert list(found.columns.targets) == ["mA", "b"]
    assert found.section["targets"] == ["mA", "b"]
    columns = found.section["columns"]
    assert (columns["pose"], columns["q4"], columns["b_z"]) == ("config", "q4_deg", "b_z_mm")
    assert set(columns.values()) == set(head.split(","))


def test_commanded_joints_and_wanted_poses_are_no_readings():
    found = recognise(
        names(
            *(f"joint_{i}_cmd" for i in range(1, 7)),
            *(f"joint_{i}_actual" for i in range(1, 7)),
            *("goal_x", "goal_y", "goal_z", "tcp_x", "tcp_y", "tcp_z"),
        )
    )
    assert [each.column for each in found.joints] == [f"joint_{i}_actual" for i in range(1, 7)]
    assert [each.column for each in found.commanded] == [f"joint_{i}_cmd" for i in range(1, 7)]
    assert list(found.targets) == ["tcp"]


def test_quaternions_are_no_joints():
    found = recognise(names(*(f"J{i}" for i in range(1, 8)), "x", "y", "z", "qw", "qx", "qy", "qz"))
    assert len(found.joints) == 7
    assert found.turn[0] == "quaternion"
    assert found.targets["tool"]["qw"].column == "qw"


def test_standard_deviations_go_with_their_target():
    found = recognise(names(*(f"q{i}" for i in range(6)), "x", "y", "z", "std_x", "std_y", "std_z"))
    assert found.targets["tool"]["std_y"].column == "std_y"
    assert found.joints[0].column == "q0"


def test_what_cannot_be_found_is_said(file):
    with pytest.raises(InputError, match="joints"):
        guess.look(file("a,b,c\n1,2,3\n4,5,6\n"))
    with pytest.raises(InputError, match="no names"):
        guess.look(file("1,2,3\n4,5,6\n"))
    with pytest.raises(InputError, match="no such file"):
        guess.look("absent.csv")
