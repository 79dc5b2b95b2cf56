"""Loading: files merge as given, data sets are complete, and every mistake is named at once."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest
from complaints import complaints
from shared_data import ROOT

from kinacc.checks.configuration import load
from kinacc.config.reading import mapping
from kinacc.config.schema import defaults

PAPER = ROOT / "config.yaml"
UR10 = ROOT / "examples" / "ur10.yaml"


@pytest.fixture
def config(tmp_path):
    """Write text as a configuration file and return its path."""

    def write(text: str, name: str = "own.yaml") -> Path:
        path = tmp_path / name
        path.write_text(textwrap.dedent(text), encoding="utf-8")
        return path

    return write


def test_the_paper_s_study_is_the_default():
    paper = load([PAPER])["mh180"]
    assert (paper["study"]["alpha"], paper["evaluation"]["points"]) == (0.6, 200)
    histories = paper["histories"]
    for name, eta_mm in (("rejected", 0.834), ("larger", 0.844), ("kept", 1.023)):
        assert histories[f"eta_ratio_{name}"] * 0.906 == pytest.approx(eta_mm, abs=1e-6)


def test_paths_are_seen_from_the_file_they_stand_in(tmp_path, monkeypatch):
    here, cell = tmp_path / "here", tmp_path / "my cell"
    for folder in (here, cell / "data"):
        folder.mkdir(parents=True)
    (cell / "data" / "poses.csv").write_text("x\n")
    (cell / "arm.yaml").write_text("name: arm\n")
    (cell / "own.yaml").write_text(
        "datasets: {a: {robot: arm.yaml, "
        "measurements: {source: file, file: {path: data/poses.csv}}}}\n"
    )
    for start, way in ((here, "../my cell/"), (cell, ""), (tmp_path, "my cell/")):
        monkeypatch.chdir(start)
        own = load([f"{way}own.yaml"])["a"]
        assert own["robot"] == f"{way}arm.yaml"
        assert own["measurements"]["file"]["path"] == f"{way}data/poses.csv"


def test_later_files_replace_values_and_keep_the_rest(config):
    own = config("""
        study: {repetitions: 7}
        datasets:
          mh180: {study: {alpha: 0.5}}
          second: {robot: mh180, study: {repetitions: 3}, seed: 9}
        """)
    loaded = load([PAPER, own])
    assert loaded["mh180"]["study"]["repetitions"] == 7
    assert loaded["mh180"]["study"]["alpha"] == 0.5
    assert loaded["mh180"]["study"]["measurements"] == 200
    assert (loaded["second"]["study"]["repetitions"], loaded["second"]["seed"]) == (3, 9)
    assert loaded["mh180"]["seed"] == defaults()["seed"]


OWN = "datasets: {own: {robot: ur10, measurements: {source: file, file: {"
BAD = [  # text, key path, and what is wrong or nearest
    ("studdy: {alpha: 0.5}", "own.yaml:2, studdy", "study?"),
    ("datasets: {own: {robot: mh180, map: {grid: 25}}}", "datasets.own.map.grid", "grid_mm?"),
    ("alpha: 0.5", "own.yaml:2, alpha", "study.alpha"),
    ("study: {noise_mm: [0.05, 50]}", "study.noise_mm[1]", "50 should be less than or equal to 5"),
    ("study: {alpha: 60}", "study.alpha", "less than 1"),
    ("map: {grid_mm: .nan}", "map.grid_mm", "finite"),
    ("map: {grid_mm: 25 mm}", "map.grid_mm", "'25 mm'"),
    ("study: {alpha: }", "study.alpha", "null"),
    ("study: {distance: square}", "study.distance", "squared?"),
    ("figures: {formats: [svg, svg]}", "figures.formats", "more than once"),
    ("study: 5", "own.yaml:2, study", "5 should be"),
    ("evaluation: {cylinder: {angle_deg: [60, 0]}}", "angle_deg", "not rising"),
    ("calibration: {vec: {joint_range: limit}}", "joint_range", "limits?"),
    ("calibration: {vec: {joint_range: [[0, 1], [0, 1]]}}", "joint_range", "at least 4"),
    ("measurements: {folds: 3, validation_fold: 3}", "measurements.validation_fold", "no fold 3"),
    ("measurements: {folds: null}", "measurements.validation_fold", "folds: null"),
    ("study: {noise_mm: [0.2, 0.1]}", "study.noise_mm", "not rising"),
    ("map: {slices_deg: [0, 75]}", "map.slices_deg", "75"),
    ("histories: {eta_ratio_larger: 0.9}", "eta_ratio_larger", "not larger"),
    ("datasets: {../evil: {robot: mh180}}", "datasets.../evil", "should match pattern"),
    ("datasets: {-x: {robot: mh180}}", "datasets.-x", "should match pattern"),
    ("datasets: {12: {robot: mh180}}", "datasets[12]", "valid string"),
    ("datasets: {own: {seed: 1}}", "datasets.own", "has no robot"),
    ("datasets: {own: {robot: mh108}}", "datasets.own.robot", "mh180?"),
    ("datasets: {own: {robot: my/arm.yaml}}", "datasets.own.robot", "no robot 'my/arm"),
    (OWN + "}}}}", "datasets.own.measurements.source", "is not given"),
    (OWN + "path: no.csv}}}}", "datasets.own.measurements.file.path", "'no.csv' does not exist"),
    ("datasets: {own: {robot: ur10}}", "measurements.source", "no synthetic ur10"),
    ("calibration: {dh: {hayati_joints: [2, 7]}}", "hayati_joints", "mh180 has no joint 7"),
    ("calibration: {dh: {parameters: {joint 2 e: free}}}", "parameters.joint 2 e", "no parameter"),
    ("calibration: {dh: {parameters: {joint 7 d: free}}}", "parameters.joint 7 d", "no joint 7"),
    ("calibration: {frames: {base z: fixed}}", "calibration.frames", "not estimated"),
    (
        "calibration: {vec: {joint_range: [[0, 1], [0, 1], [0, 1], [0, 1]]}}",
        "joint_range",
        "4 pairs for the 6 joints of mh180",
    ),
    (OWN + "path: own.yaml, thousands: '.'}}}}", "file.thousands", "also the decimal"),
    ("measurements: {file: {columns: {qx1: a}}}", "columns.qx1", "unknown name"),
    (
        "calibration: {base_and_tool: estimated}\nevaluation: {space: measured}",
        "calibration.base_and_tool",
        "in its own base frame",
    ),
]


@pytest.mark.parametrize(("text", "place", "words"), BAD)
def test_bad_configuration_is_named_with_its_place(config, text, place, words, tmp_path):
    own = config("# a comment first, to move the lines\n" + text)
    (found,) = complaints(PAPER, own, folder=tmp_path)
    assert place in found.partition(": ")[0]
    assert words in found


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"# nothing\n", "is empty"),
        (b"- a\n- b\n", "holds no keys"),
        (b"seed: [1\n", "is not YAML"),
        (b"study:\n\talpha: 0.5\n", "is not YAML"),
        (b"seed: \xff\xfe\n", "not text in UTF-8"),
        (b"seed: &a [*a]\n", "for themselves"),
        (b"{a: 1}: 2\n", "unknown key"),
    ],
)
def test_what_is_no_configuration_at_all(tmp_path, content, words):
    path = tmp_path / "own.yaml"
    path.write_bytes(content)
    found = complaints(PAPER, path)
    assert any(words in text and "own.yaml" in text for text in found), found


def test_all_problems_come_in_one_message(config):
    own = config("""
        study: {alpha: 2, repetitions: 0, noise_mm: [.nan]}
        typo: 1
        datasets:
          a/b: {robot: nobody, seed: 1}
          c: {measurements: {folds: 1}}
        """)
    found = complaints(PAPER, own)
    assert len(found) == 8, found
    lines = [int(text.split("own.yaml:")[1].split(",")[0]) for text in found]
    assert lines == sorted(lines)


def test_a_number_with_an_exponent_is_one_unless_it_is_quoted():
    read = mapping("plain: 1e-3\nquoted: '1e-3'\ntagged: !!str 5", "x").data
    assert read == {"plain": 1e-3, "quoted": "1e-3", "tagged": "5"}
