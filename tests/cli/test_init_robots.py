"""Files as the makers of robots name their joints and poses: right, asked about or refused."""

import numpy as np
import pandas as pd
import pytest
from tracked_arm import (
    assert_read,
    call,
    described,
    table,
    tracked,
    written,
)

IT = tracked()
XYZ = ["X [mm]", "Y [mm]", "Z [mm]"]
LANGUAGES = {
    "English": ("Joint {} (deg)", "Measured {} (mm)", "Nominal {} (mm)"),
    "German": ("Achse {} [°]", "{} gemessen [mm]", "{} Soll [mm]"),
    "French": ("axe {} (degrés)", "{} mesuré (mm)", "{} théorique (mm)"),
    "Spanish": ("Eje {} (grados)", "Posición {} medida (mm)", "Posición {} nominal (mm)"),
    "Italian": ("Giunto {} (gradi)", "Quota {} misurata (mm)", "Quota {} nominale (mm)"),
    "Portuguese": ("Articulação {} (graus)", "Posição {} medido (mm)", "Posição {} nominal (mm)"),
    "Japanese": ("関節{}[度]", "測定位置{}[mm]", "指令位置{}[mm]"),
    "Japanese, another hand": ("第{}軸角度(度)", "計測値{}(ｍｍ)", "設計値{}(ｍｍ)"),
}


def joints(pattern, first=1):
    return [pattern.format(i) for i in range(first, first + 6)]


def axes(pattern):
    return [pattern.format(axis) for axis in "XYZ"]


@pytest.mark.parametrize("language", LANGUAGES)
def test_headers_of_a_language_are_read(language, tmp_path):
    joint, measured, nominal = LANGUAGES[language]
    names = [*joints(joint), *axes(nominal), *axes(measured)]
    files = written(tmp_path, m_csv=table(names, IT.q, IT.point + 1.5, IT.point, mark=";"))
    section, told = described(files)
    assert_read(section, IT)
    assert told["unused_columns"] == dict.fromkeys(axes(nominal), "nominal")


def test_rounded_joints_are_said_to_cost_what_they_do(tmp_path):
    arm = tracked(digits=2)
    text = table([*joints("q{}_deg"), *XYZ], arm.q, arm.point)
    _, told = described(written(tmp_path, m_csv=text))
    said = next(words for words in told["remarks"] if "steps of" in words)
    assert "0.01 deg" in said
    step, reach = float(said.split(": ")[1].split()[0]), float(said.split(" at ")[1].split()[0])
    assert step == pytest.approx(np.deg2rad(0.01) * 1000.0 * reach, rel=0.1)
    _, told = described(written(tmp_path, m_csv=table([*joints("q{}_deg"), *XYZ], IT.q, IT.point)))
    assert not any("steps of" in words for words in told["remarks"])


def test_the_first_poses_are_shown_as_understood_before_anything_is_written(tmp_path):
    names = [*joints("q{}_deg"), *XYZ, "rx_deg", "ry_deg", "rz_deg"]
    text = table(names, IT.q, IT.point, IT.turn.as_euler("XYZ", degrees=True))
    files = written(tmp_path, m_csv=text)
    _, told = described(files, "--orientation", "XYZ")
    shown = pd.DataFrame(told["first_poses"])
    assert list(shown["where"]) == ["line 2", "line 3", "line 4"]
    np.testing.assert_allclose(shown[[f"q{i}_deg" for i in range(1, 7)]], IT.q[:3], atol=1e-4)
    np.testing.assert_allclose(shown[["x_mm", "y_mm", "z_mm"]], IT.point[:3], atol=1e-6)
    vector = IT.turn[:3].as_rotvec(degrees=True)
    np.testing.assert_allclose(shown[["rvx_deg", "rvy_deg", "rvz_deg"]], vector, atol=1e-4)
    words = ["init", *files, "--robot", "ur10", "--out", tmp_path / "cell", "--name", "again"]
    done = call(*words, "--orientation", "XYZ")
    assert done.exit_code == 0, done.output
    assert done.output.index("line 4") < done.output.index("written:")


def test_points_a_controller_calculated_are_told_so_though_they_are_rounded(tmp_path):
    text = table([*joints("q{}_deg"), *XYZ], IT.q, np.round(IT.controller, 2))
    _, told = described(written(tmp_path, m_csv=text))
    assert any("closer than instruments measure" in words for words in told["remarks"])
    _, told = described(written(tmp_path, m_csv=table([*joints("q{}_deg"), *XYZ], IT.q, IT.point)))
    assert not any("closer than" in words for words in told["remarks"])
