"""Files whose names hold more than one reading: the measured one is taken, or it is asked."""

from types import SimpleNamespace

import numpy as np
import pytest
from command_line import call
from tracked_arm import assert_read, assert_turned, described, looked, refused, table, tracked

from kinacc.checks.configuration import load
from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.measurements.intake import guess as guesses
from kinacc.measurements.reader import read

ROWS = 14
ARM = robot.load("ur10")
TRACKED = tracked(poses=ROWS)


def numbered(pattern, count=6, first=1):
    return [pattern.format(number) for number in range(first, first + count)]


def by_axis(pattern):
    """Names of x, y, z; capitals where the pattern asks for {A}."""
    return [pattern.format(a=axis, A=axis.upper()) for axis in "xyz"]


RNG, MEASURED = np.random.default_rng(4), TRACKED.point
NOMINAL = np.round(MEASURED + RNG.normal(0, 0.7, (ROWS, 3)), 4)
# What else stands in the files of a tracked arm.
IT = SimpleNamespace(
    q=TRACKED.q, measured=MEASURED, nominal=NOMINAL, deviation=MEASURED - NOMINAL,
    spread=RNG.uniform(0.01, 0.05, (ROWS, 3)), turn=TRACKED.turn, rounded=np.round(TRACKED.q),
    quaternion=TRACKED.turn.as_quat(scalar_first=True), controller=TRACKED.controller,
)  # fmt: skip
Q = (numbered("q{}_deg"), IT.q)
X = (by_axis("{a}_mm"), IT.measured)


@pytest.fixture
def file(tmp_path):
    def write(*groups):
        names = [name for group, _ in groups for name in group]
        path = tmp_path / "readings.csv"
        path.write_text(table(names, *(values for _, values in groups)), encoding="utf-8")
        return path

    return write


def positions(path):
    """A section of positions alone, as a user writes it."""
    return {"path": str(path), "orientation": {"kind": "none"}}


def section_of(path, **answers):
    """What a run would read, where init finds it without a question."""
    return looked(path, **answers)[0]


def assert_measured(section, others=()):
    """The run takes the measured points, the joints as they were and the ``others``' targets."""
    targets = read(section, ARM, strict=False).columns["target"]
    assert set(targets) == {"tool", *others}
    return assert_read(section, TRACKED)


RIGHT = {
    "nominal beside ours": [Q, X, (by_axis("nom_{a}_mm"), IT.nominal)],
    "nominal, actual, d": [
        Q,
        (by_axis("Nominal {A} [mm]"), IT.nominal),
        (by_axis("Actual {A} [mm]"), IT.measured),
        (by_axis("d{A} [mm]"), IT.deviation),
    ],
    "uncertainties": [Q, (by_axis("{A}"), IT.measured), (by_axis("U{a}"), IT.spread / 1000)],
    "Greek letters": [
        Q,
        (by_axis("Δ{a}"), IT.deviation),
        (by_axis("{a}_meas"), IT.measured),
        (by_axis("σ{a}"), IT.spread),
        (by_axis("{a}_nom"), IT.nominal),
    ],
    "a controller's log beside a tracker": [
        (numbered("target_q_{}", first=0), np.deg2rad(IT.rounded)),
        (numbered("actual_q_{}", first=0), np.deg2rad(IT.q)),
        (numbered("actual_qd_{}", first=0), IT.q * 0.0),
        (numbered("joint_temperatures_{}", first=0), IT.q * 0.0 + 30.0),
        (numbered("actual_TCP_pose_{}", first=0), np.hstack([IT.controller / 1000.0] * 2)),
        (by_axis("tracker_{a}_mm"), IT.measured),
    ],
    "joints in both units": [(numbered("q{}_rad"), np.deg2rad(IT.q)), Q, X],
    "velocities and forces": [
        Q,
        X,
        (by_axis("v{a} [mm/s]"), IT.spread),
        (by_axis("F{a} [N]"), IT.spread),
        (numbered("J{} [deg/s]"), IT.q * 0.1),
    ],
    "three reflectors": [
        Q,
        (by_axis("B1 {A} nominal"), IT.nominal),
        X,
        (by_axis("B1_{a}_mm"), IT.measured + IT.turn.apply([90, 0, 0])),
        (by_axis("B2_{a}_mm"), IT.measured + IT.turn.apply([0, 90, 0])),
    ],
}


@pytest.mark.parametrize("case", RIGHT)
def test_what_was_measured_is_read_whatever_stands_beside_it(case, file):
    others = ("B1", "B2") if case == "three reflectors" else ()
    answers = {"sigma": "none"} if case == "uncertainties" else {}
    assert_measured(section_of(file(*RIGHT[case]), **answers), others)


def test_what_was_commanded_goes_beside_what_was_reported(file):
    section = section_of(file(*RIGHT["a controller's log beside a tracker"]))
    commanded = read(section, ARM, strict=False).commanded
    np.testing.assert_allclose(commanded, np.deg2rad(IT.rounded), atol=1e-6)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_q1_to_q4_beside_joints_are_a_quaternion(file, tmp_path, order):
    four = IT.quaternion if order == "wxyz" else IT.quaternion[:, [1, 2, 3, 0]]
    path = file((numbered("rax_{}"), IT.q), X, (numbered("q{}", 4), four))
    section, _ = described([path])  # the order is found by trying
    assert section["orientation"]["kind"] == "quaternion"
    assert section["orientation"]["order"] == order
    columns = assert_measured(section)
    assert_turned(columns, TRACKED)


def test_standard_deviations_are_those_of_the_measured_point(file):
    measured = (by_axis("Measured {A} [mm]"), IT.measured)
    spread = (by_axis("Measured std {A} [mm]"), IT.spread)
    wide = (by_axis("U95 {A} [mm]"), 2 * IT.spread)
    deviation = (by_axis("Dev {A} [mm]"), IT.deviation)
    columns = assert_measured(section_of(file(Q, wide, measured, spread, deviation)))
    std_mm = np.stack([columns[f"std_{axis}_mm"] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(std_mm, IT.spread, rtol=1e-6)


ASKED = {
    "a point and the length of its deviation": [Q, X, (["3D error [mm]"], IT.spread[:, :1])],
    "a target beside a point": [Q, X, (by_axis("target_{a}_mm"), IT.nominal)],
    "the published form of a robot's data": [
        (numbered("joint_{}"), IT.q),
        (by_axis("{a}_t"), IT.nominal),
        (by_axis("{a}_dif"), IT.deviation),
    ],
    "words nobody knows": [
        Q,
        (by_axis("zadana_{a}"), IT.nominal),
        (by_axis("zmierzona_{a}"), IT.measured),
    ],
    "the same name with other numbers": [Q, X, (by_axis("{A}"), IT.nominal)],
    "commanded joints alone": [(numbered("joint_{}_cmd"), IT.rounded), X],
    "numbers without a word for joints": [(numbered("position[{}]", first=0), IT.q), X],
    "the controller's orientation beside a tracker's point": [
        (numbered("robax_{}"), IT.q),
        (by_axis("trans_{a}"), IT.controller),
        (numbered("rot_q{}", 4), IT.quaternion),
        (by_axis("tracker_{a}"), IT.measured),
    ],
}


@pytest.mark.parametrize("case", ASKED)
def test_two_readings_are_asked_about_and_never_taken_in_silence(case, file):
    assert "--take" in refused([file(*ASKED[case])])


def test_an_option_decides(file, tmp_path):
    path = file(*ASKED["a target beside a point"])
    call("init", path, "--robot", "ur10", "--out", tmp_path / "b", "--take", "x_mm", code=0)
    section = load((tmp_path / "b" / "readings.yaml",))["readings"]["measurements"]["file"]
    assert (section["columns"]["x"], section["targets"]) == ("x_mm", ["tool"])


REFUSED = {
    "only nominal points": ([Q, (by_axis("soll_{a}"), IT.nominal)], "nominal"),
    "only deviations": ([Q, (by_axis("d{A} [mm]"), IT.deviation)], "a deviation"),
    "milliradians": ([(numbered("q{} [mrad]"), 1e3 * np.deg2rad(IT.q)), X], "mrad"),
    "joints in millimetres": ([(numbered("J{} [mm]"), IT.q), X], "joints in mm"),
    "thousands of metres": ([Q, (by_axis("{a}_m"), IT.measured)], "at most 50 m"),
    "positions in two units": (
        [Q, (["X [mm]", "Y [mm]", "Z [m]"], IT.measured * [1, 1, 1e-3])],
        "one unit",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_refused_with_its_reason(case, file):
    groups, reason = REFUSED[case]
    assert reason in refused([file(*groups)])


@pytest.mark.parametrize("mapped", [True, False])
@pytest.mark.parametrize(
    ("key", "unit", "ours", "column"),
    [("joint_unit", "rad", "q1", "q1_deg"), ("length_unit", "m", "x", "x_mm")],
)
def test_a_key_against_the_names_is_refused(file, mapped, key, unit, ours, column):
    section = positions(file(Q, X)) | {key: unit, "columns": {ours: column} if mapped else {}}
    with pytest.raises(InputError, match=f"{column}.*measurements.file.{key} says {unit}"):
        read(section, ARM)


def test_the_reader_takes_no_nominal_point_for_a_target(file):
    section = positions(file(*RIGHT["nominal beside ours"]))
    reading = read(section, ARM)
    assert set(reading.columns["target"]) == {"tool"}
    assert reading.unused == tuple(by_axis("nom_{a}_mm"))
    both = read(section | {"targets": ["tool", "nom"]}, ARM)
    assert set(both.columns["target"]) == {"tool", "nom"}


@pytest.mark.parametrize("word", ["soll", "dev", "sigma", "robot", "target"])
def test_the_reader_takes_no_point_alone_that_says_it_was_not_measured(file, word):
    section = positions(file(Q, (by_axis(f"{word}_{{a}}_mm"), IT.measured)))
    with pytest.raises(InputError, match=r"measurements\.file\.targets"):
        read(section, ARM)
    assert len(read(section | {"targets": [word]}, ARM).columns["x_mm"]) == ROWS


def test_a_unit_is_told_by_the_size_of_numbers_below_zero_too(file):
    path = file((numbered("J{}"), -np.abs(IT.q)), ([*"XYZ"], -np.abs(IT.measured)))
    section = guesses.look(path).section
    assert (section["joint_unit"], section["length_unit"]) == ("deg", "mm")


@pytest.mark.parametrize("turned_deg", [0.0, 5.0])
def test_numbers_behind_names_count_readings_unless_one_is_of_other_joints(file, turned_deg):
    names = [f"P{row // 2}_{row % 2}" for row in range(ROWS)]
    q, point = (np.repeat(each[::2], 2, axis=0) for each in (IT.q, IT.measured))
    q[-1] += turned_deg
    section = guesses.look(file((["pose"], names), (Q[0], q), (X[0], point))).section
    assert section.get("repeats_in_names", False) == (turned_deg == 0.0)


def test_a_reflector_of_another_radius_needs_a_target_of_its_own(file):
    radius = (["radius_mm"], [19.05, 6.35] * (ROWS // 2))
    assert "radius_mm" in refused([file(Q, X, (["target"], ["A"] * ROWS), radius)])


@pytest.mark.parametrize("unit", ["mil", "arcsec"])
def test_directions_in_a_unit_that_is_not_read_are_refused_by_it(file, unit):
    angles = ([f"Hz [{unit}]", f"V [{unit}]", "D [mm]"], IT.measured)
    assert f"are in {unit}" in refused([file(Q, angles)])
