"""Files as the makers of robots name their joints and poses: right, asked about or refused."""

import numpy as np
import pandas as pd
import pytest
from read_columns import XYZ_MM
from tracked_arm import XYZ, Q, assert_read, described, table, tracked, written

from kinacc.measurements.intake import guess as guesses

IT = tracked()
LANGUAGES = {
    "English": ("Joint {} (deg)", "Measured {} (mm)", "Nominal {} (mm)"),
    "German": ("Achse {} [°]", "{} gemessen [mm]", "{} Soll [mm]"),
    "French": ("axe {} (degrés)", "{} mesuré (mm)", "{} théorique (mm)"),
    "Italian": ("Giunto {} (gradi)", "Quota {} misurata (mm)", "Quota {} nominale (mm)"),
    "Portuguese": ("Articulação {} (graus)", "Posição {} medido (mm)", "Posição {} nominal (mm)"),
    "Japanese": ("関節{}[度]", "測定位置{}[mm]", "指令位置{}[mm]"),
    "Japanese, another hand": ("第{}軸角度(度)", "計測値{}(ｍｍ)", "設計値{}(ｍｍ)"),
}


@pytest.mark.parametrize("language", LANGUAGES)
def test_headers_of_a_language_are_read(language, tmp_path):
    joint, measured, nominal = LANGUAGES[language]
    names = [
        *map(joint.format, range(1, 7)),
        *map(nominal.format, "XYZ"),
        *map(measured.format, "XYZ"),
    ]
    files = written(tmp_path, m_csv=table(names, IT.q, IT.point + 1.5, IT.point, mark=";"))
    guess = guesses.look(files, {})
    assert_read(guess.section, IT)
    unread = [nominal.format(axis) for axis in "XYZ"]
    assert guess.reasons(unread) == dict.fromkeys(unread, "nominal")


def described_with(tmp_path, *columns, names=(), options=()):
    """What init answers on joints, points and more."""
    text = table([*Q, *XYZ, *names], *columns)
    return described(written(tmp_path, m_csv=text), *options)[1]


def test_remarks_are_those_of_joints_and_points_that_are_rounded_or_calculated(tmp_path):
    arm = tracked(digits=2)
    rounded, calculated, usual = (
        described_with(tmp_path, q, point)["remarks"]
        for q, point in (
            (arm.q, arm.point), (IT.q, np.round(IT.controller, 2)), (IT.q, IT.point),
        )
    )  # fmt: skip
    assert rounded[-1].startswith("joints are written in steps of 0.01 deg: 0.17 mm at 1 m")
    assert "closer than instruments measure" in calculated[0]
    assert usual == []


def test_the_first_poses_are_shown_as_understood(tmp_path):
    turn = IT.turn.as_euler("XYZ", degrees=True)
    names, options = ("rx_deg", "ry_deg", "rz_deg"), ("--orientation", "XYZ")
    told = described_with(tmp_path, IT.q, IT.point, turn, names=names, options=options)
    shown = pd.DataFrame(told["first_poses"])
    assert list(shown["where"]) == ["line 2", "line 3", "line 4"]
    np.testing.assert_allclose(shown[Q], IT.q[:3], atol=1e-4)
    np.testing.assert_allclose(shown[XYZ_MM], IT.point[:3], atol=1e-6)
    vector = IT.turn[:3].as_rotvec(degrees=True)
    np.testing.assert_allclose(shown[["rvx_deg", "rvy_deg", "rvz_deg"]], vector, atol=1e-4)
