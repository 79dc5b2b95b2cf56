"""Files that say what the arm carried in each row."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import call

from kinacc.checks.contradictions import load
from kinacc.config.schema import defaults
from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.measurements.reader import read

ARM = robot.load("ur10")
COUNT = 40


def written(tmp_path, names, rows):
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, (COUNT, 6))
    point = robot.forward(ARM, q).position_mm
    lines = [",".join([*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm", *names])]
    for joints, at, more in zip(np.rad2deg(q), point, rows, strict=True):
        lines.append(",".join([*(f"{v:.9g}" for v in (*joints, *at)), *map(str, more)]))
    path = tmp_path / "rows.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def section(path, **columns):
    file = defaults()["measurements"]["file"]
    turn = {**file["orientation"], "kind": "none"}
    return {**file, "path": str(path), "orientation": turn, "columns": columns}


def test_mass_and_centre_of_every_row(tmp_path):
    names = ["payload_kg", "payload_x_mm", "payload_y_m", "payload_z_mm"]
    path = written(tmp_path, names, [(i % 3, 10, 0.02, -30) for i in range(COUNT)])
    columns = read(section(path), ARM).columns
    assert columns["payload_kg"].tolist() == [float(i % 3) for i in range(COUNT)]
    centre = [columns[f"payload_{axis}_mm"][1] for axis in "xyz"]
    np.testing.assert_allclose(centre, [10.0, 20.0, -30.0])


def test_a_mass_alone_hangs_at_the_last_frame_and_an_empty_cell_says_nothing(tmp_path):
    path = written(tmp_path, ["Last"], [("" if i == 2 else 5,) for i in range(COUNT)])
    columns = read(section(path, payload="Last"), ARM).columns
    assert columns["payload_z_mm"][0] == 0.0
    assert np.isnan([columns["payload_kg"][2], columns["payload_x_mm"][2]]).all()


def test_a_negative_mass_and_a_centre_without_a_mass_are_refused(tmp_path):
    path = written(tmp_path, ["payload_kg"], [(-2.5,)] * COUNT)
    with pytest.raises(InputError, match=r"payload_kg.*a mass of -2\.5 kg"):
        read(section(path), ARM)
    names = [f"payload_{axis}_mm" for axis in "xyz"]
    path = written(tmp_path, names, [(1, 2, 3)] * COUNT)
    with pytest.raises(InputError, match="payload_kg: is missing beside the centre"):
        read(section(path), ARM)
    path = written(tmp_path, ["payload_kg", *names[:2]], [(1, 2, 3)] * COUNT)
    with pytest.raises(InputError, match="payload_z: is missing beside"):
        read(section(path), ARM)


def described(path):
    folder = path.parent / "cell"
    done = call("init", path, "--robot", "ur10", "--out", folder, "--yes")
    assert done.exit_code == 0, done.output
    return load((folder / "rows.yaml",))["rows"]["measurements"]["file"], done.output


@pytest.mark.parametrize("name", ["Payload [kg]", "Nutzlast_kg", "charge utile (kg)"])
def test_init_takes_a_load_under_names_people_use(tmp_path, name):
    path = written(tmp_path, [name], [(i % 2,) for i in range(COUNT)])
    found = read(described(path)[0], ARM).columns
    assert found["payload_kg"].tolist() == [float(i % 2) for i in range(COUNT)]


def test_init_takes_the_centre_of_a_load(tmp_path):
    names = ["Nutzlast [kg]", *(f"Schwerpunkt Nutzlast {axis} [mm]" for axis in "XYZ")]
    path = written(tmp_path, names, [(1, 2, 3, 4)] * COUNT)
    found = read(described(path)[0], ARM).columns
    assert [found[f"payload_{axis}_mm"][0] for axis in "xyz"] == [2.0, 3.0, 4.0]


def test_a_charge_without_a_unit_is_left_to_the_user(tmp_path):
    path = written(tmp_path, ["charge"], [(i,) for i in range(COUNT)])
    section, output = described(path)
    assert "payload" not in section["columns"]
    assert "charge" in output
