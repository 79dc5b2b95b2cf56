"""Files as the makers of robots name their joints and poses: right, asked about or refused."""

import numpy as np
import pytest
from tracked_arm import (
    assert_read,
    assert_turned,
    call,
    described,
    refused,
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


def test_a_commanded_point_in_millimetres_is_no_measured_one(tmp_path):
    # The unit's letters stand in the word: Command X [mm].
    names = [*joints("q{}_deg"), *axes("Command {} [mm]"), *axes("Comment {} [mm]")]
    files = written(tmp_path, m_csv=table(names[:9], IT.q, IT.point))
    assert "nominal" in refused(files)


def test_yaskawa_axes_by_their_letters(tmp_path):
    names = [*(f"{letter}-axis [deg]" for letter in "SLURBT"), *XYZ]
    section, _ = described(written(tmp_path, m_csv=table(names, IT.q, IT.point)))
    assert_read(section, IT)


PULSES = np.array([1000.0, 1100.5, 900.0, -800.0, 700.0, 455.1])


@pytest.mark.parametrize("names", [[f"{a} [pulse]" for a in "SLURBT"], list("SLURBT")])
def test_yaskawa_pulses_are_asked_about(names, tmp_path):
    text = table([*names, *XYZ], np.round(IT.q * PULSES), IT.point)
    files = written(tmp_path, m_csv=text)
    assert "--pulses-per-deg" in refused(files)
    per_deg = ",".join(map(str, PULSES))
    assert "6 numbers" in refused(files, "--pulses-per-deg", "1000,1000")
    section, _ = described(files, f"--pulses-per-deg={per_deg}")
    assert section["pulses_per_deg"] == list(PULSES)
    arm = tracked()
    rounded = np.round(arm.q * PULSES) / PULSES
    assert_read(section, type(arm)(arm.name, rounded, arm.point, arm.turn, arm.controller))


def test_an_answer_to_the_question_for_pulses_is_as_good_as_the_option(tmp_path):
    names = [*(f"{a} [pulse]" for a in "SLURBT"), *XYZ]
    files = written(tmp_path, m_csv=table(names, np.round(IT.q * 1000.0), IT.point))
    answer = ",".join(["1000"] * 6)
    done = call("init", *files, "--robot", "ur10", "--out", tmp_path / "cell", input=f"{answer}\n")
    assert done.exit_code == 0, done.output
    assert "pulses_per_deg" in (tmp_path / "cell" / "m.yaml").read_text()


@pytest.mark.parametrize(
    ("joint", "letters", "convention"),
    [("J{}", "WPR", "xyz"), ("A{}", "ABC", "ZYX"), ("JT{}", "OAT", "ZYZ")],
)
def test_angles_of_fanuc_kuka_and_kawasaki(joint, letters, convention, tmp_path):
    names = [*joints(joint), *"XYZ", *letters]
    text = table(names, IT.q, IT.point, IT.turn.as_euler(convention, degrees=True))
    section, _ = described(written(tmp_path, m_csv=text))
    assert section["orientation"]["convention"] == convention
    assert_turned(assert_read(section, IT), IT)


def test_mecademic_alpha_beta_gamma(tmp_path):
    names = [*joints("theta_{}"), "x", "y", "z", "alpha", "beta", "gamma"]
    text = table(names, IT.q, IT.point, IT.turn.as_euler("XYZ", degrees=True))
    section, _ = described(written(tmp_path, m_csv=text))
    assert_turned(assert_read(section, IT), IT)


def test_abb_quaternions_are_scalar_first_and_9e9_is_an_axis_that_is_not_there(tmp_path):
    names = [*joints("rax_{}"), *(f"eax_{a}" for a in "abcdef"), "x", "y", "z"]
    names += [f"q{i}" for i in range(1, 5)]
    spare = np.full((len(IT.q), 6), "9E+09", dtype=object)
    text = table(names, IT.q, spare, IT.point, IT.turn.as_quat(scalar_first=True))
    section, _ = described(written(tmp_path, m_csv=text))
    assert_turned(assert_read(section, IT), IT)


def test_what_an_abb_controller_calculated_is_not_taken_for_measured(tmp_path):
    names = [*joints("rax_{}"), "trans.x", "trans.y", "trans.z"]
    files = written(tmp_path, m_csv=table(names, IT.q, IT.controller))
    assert "--take trans.x" in refused(files)


def test_ur_reads_actual_before_target_and_its_own_kinematics_never(tmp_path):
    names = ["timestamp", *joints("target_q_{}", 0), *joints("actual_q_{}", 0)]
    names += [*joints("actual_TCP_pose_{}", 0), "tracker_x_mm", "tracker_y_mm", "tracker_z_mm"]
    pose = np.hstack([IT.controller / 1000.0, IT.turn.as_rotvec()])
    time = np.arange(len(IT.q)) * 5.0
    q = np.deg2rad(IT.q)
    section, told = described(
        written(tmp_path, m_csv=table(names, time, np.round(q, 1), q, pose, IT.point))
    )
    assert_read(section, IT)
    assert section["joint_unit"] == "rad"
    assert set(joints("actual_TCP_pose_{}", 0)) <= set(told["unused_columns"])


def test_targets_keep_the_digit_at_the_end_of_their_names(tmp_path):
    names = joints("q{}_deg") + [f"smr{i}_{axis}_mm" for i in (1, 2, 3) for axis in "xyz"]
    others = [IT.point + IT.turn.apply(v) for v in ([90, 0, 0], [0, 80, 0])]
    section, told = described(written(tmp_path, m_csv=table(names, IT.q, IT.point, *others)))
    assert told["targets"] == ["smr1", "smr2", "smr3"]
    assert_read(section, IT, target="smr1")


def test_centres_that_were_not_corrected_are_asked_about(tmp_path):
    names = [*joints("J{} [deg]"), *XYZ, "Radius uncorrected [mm]"]
    files = written(tmp_path, m_csv=table(names, IT.q, IT.point, np.full(len(IT.q), 19.05)))
    said = refused(files)
    assert "--take 'X [mm]'" in said
    section, _ = described(files, "--take", "X [mm]")
    assert_read(section, IT)


@pytest.mark.parametrize("mark", ["_", "-"])
def test_readings_of_a_pose_that_its_name_counts_are_repeats(mark, tmp_path):
    rows = np.repeat(np.arange(len(IT.q)), 2)
    names = [
        f"P{row + 1}{mark}{number}" for row, number in zip(rows, [1, 2] * len(IT.q), strict=True)
    ]
    point = IT.point[rows]
    text = table(["Point", *joints("q{}_deg"), *XYZ], names, IT.q[rows], point)
    section, _ = described(written(tmp_path, m_csv=text))
    columns = assert_read(section, IT, rows)
    assert columns["pose"].tolist() == rows.tolist()
    assert columns["repeat"].tolist() == [0, 1] * len(IT.q)


def test_names_that_count_but_are_poses_of_their_own_stay_so(tmp_path):
    names = [f"P{row // 2}_{row % 2 + 1}" for row in range(len(IT.q))]
    text = table(["Point", *joints("q{}_deg"), *XYZ], names, IT.q, IT.point)
    section, _ = described(written(tmp_path, m_csv=text))
    assert len(set(assert_read(section, IT)["pose"].tolist())) == len(IT.q)


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


@pytest.mark.parametrize("flag", ["--yes", None])
def test_the_first_poses_are_shown_as_understood_before_anything_is_written(flag, tmp_path):
    names = [*joints("q{}_deg"), *XYZ, "rx_deg", "ry_deg", "rz_deg"]
    text = table(names, IT.q, IT.point, IT.turn.as_euler("XYZ", degrees=True))
    files = written(tmp_path, m_csv=text)
    words = ["init", *files, "--robot", "ur10", "--out", tmp_path / "cell"]
    done = call(*words, *([flag] if flag else ["--orientation", "XYZ"]))
    assert done.exit_code == 0, done.output
    lines = done.output.splitlines()
    shown = [line for line in lines if line.startswith("  line ")]
    assert len(shown) == 3
    assert shown[0] == "  line 2: joints " + ", ".join(f"{v:.3f}" for v in IT.q[0])
    tool = lines[lines.index(shown[0]) + 1]
    assert "tool at " + ", ".join(f"{v:.3f}" for v in IT.point[0]) in tool
    assert f"turned by {np.rad2deg(IT.turn[0].magnitude()):.3f} deg" in tool
    written_at = next(i for i, line in enumerate(lines) if line.startswith("written:"))
    assert lines.index(shown[2]) < written_at


def test_a_pose_read_ten_times_is_shown_once_and_its_columns_are_named(tmp_path):
    pose, rows = np.repeat(np.arange(16), 10), np.tile(np.arange(10), 16)
    drift = np.random.default_rng(0).normal(0.0, 0.03, (160, 6))
    beside = IT.point + IT.turn.apply([40.0, -30.0, 20.0])
    points = np.column_stack([IT.point[pose], beside[pose]]) + drift
    names = ["Messung", "Wiederholung", *joints("q{}_deg")]
    names += [f"smr{each} {axis} [mm]" for each in "AB" for axis in "XYZ"]
    text = table(names, pose, rows, IT.q[pose], np.round(points, 4))
    done = call("init", *written(tmp_path, m_csv=text), "--robot", "ur10", "--yes", "--out",
                tmp_path / "cell")  # fmt: skip
    assert done.exit_code == 0, done.output
    lines = done.output.splitlines()
    heads = [i for i, line in enumerate(lines) if line.startswith("  line ")]
    assert [lines[i].split(":")[0] for i in heads] == ["  line 2", "  line 12", "  line 22"]
    assert all(lines[i + 3] == "    more readings of it: 9" for i in heads)


def test_points_a_controller_calculated_are_told_so_though_they_are_rounded(tmp_path):
    text = table([*joints("q{}_deg"), *XYZ], IT.q, np.round(IT.controller, 2))
    _, told = described(written(tmp_path, m_csv=text))
    assert any("closer than instruments measure" in words for words in told["remarks"])
    _, told = described(written(tmp_path, m_csv=table([*joints("q{}_deg"), *XYZ], IT.q, IT.point)))
    assert not any("closer than" in words for words in told["remarks"])


def test_the_direction_a_pose_was_approached_from_is_kept(tmp_path):
    rows = np.repeat(np.arange(len(IT.q)), 2)
    names = [f"P{row + 1}_{number}" for row, number in zip(rows, [1, 2] * len(IT.q), strict=True)]
    side = ["+", "-"] * len(IT.q)
    text = table(
        ["Point", "Approach", *joints("q{}_deg"), *XYZ], names, side, IT.q[rows], IT.point[rows]
    )
    section, _ = described(written(tmp_path, m_csv=text))
    assert len(set(assert_read(section, IT, rows)["pose"].tolist())) == 2 * len(IT.q)
