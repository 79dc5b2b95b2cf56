"""Rows of measurements are named as the user's own files name them, and none is left out unsaid."""

import pytest
from command_line import answer
from stages_by_hand import run_stages
from tracked_arm import XYZ, Q, call, table, tracked, written

COUNT = 60
IT = tracked("ur10", COUNT, 11)
NAMES = [f"P{i}_1" for i in range(1, COUNT + 1)]
_STAGES = ("measurements", "data_check", "vec", "dh", "residuals", "excluded_rows", "summary")
EMPTY, WRONG, AWAY = 4, 20, 33  # rows, from 0: blank, 6 mm off, left out by the configuration


@pytest.fixture(scope="module")
def two_files(tmp_path_factory):
    """A folder with points in one file, joints in another, described by init; and what it said."""
    folder = tmp_path_factory.mktemp("two")
    point = IT.point.copy()
    point[WRONG, 2] += 6.0
    cells = point.astype(str).astype(object)
    cells[EMPTY] = "---"
    points = table(["Point", *XYZ, "Operator"], NAMES, cells, ["ab"] * COUNT)
    joints = table(["Name", *Q], [f"P{i}" for i in range(1, COUNT + 1)], IT.q)
    files = written(folder, tracker_csv=points, robot_csv=joints)
    said = call("init", *files, "--robot", "ur10", "--out", folder / "cell", "--name", "m")
    assert said.exit_code in (0, 1), said.output
    config = folder / "cell" / "m.yaml"
    quick = folder / "quick.yaml"
    quick.write_text(
        "calibration: {vec: {order: 1}, dh: {fit_to: measurements}}\n"
        "datasets: {m: {evaluation: {space: measured}, data_check: {accept: {outliers: a test, "
        "few_poses: a test}}, measurements: {folds: 3, "
        "file: {exclude: [{lines: [35], reason: bumped}]}}}}\n"
    )
    return folder, (config, quick), said.output


@pytest.fixture(scope="module")
def results(two_files):
    folder, configs, _ = two_files
    return run_stages(_STAGES, configs, folder / "results")


def test_the_first_poses_have_the_names_of_the_file(two_files):
    assert "line 2 (P1_1) of tracker.csv " in two_files[2]


def test_a_suspicion_names_the_pose_and_the_file_of_its_line(two_files):
    told = answer("check-data", two_files[1][0], code=None)
    found = next(e for e in told["datasets"][0]["suspicions"] if e["kind"] == "outliers")
    assert found["lines"] == [WRONG + 2]
    assert found["where"] == f"line {WRONG + 2} ({NAMES[WRONG]}) of tracker.csv"


def test_the_summary_names_rows_as_the_file_does(results):
    found = answer("summary", results)["m"]
    assert found["excluded"][0]["where"] == f"line {AWAY + 2} ({NAMES[AWAY]}) of tracker.csv"
    assert 0.0 < found["excluded"][0]["error_mm"] < 3.0
    places = [each["text"] + each["lines"] for each in found["findings"]]
    assert any(f"line {WRONG + 2} ({NAMES[WRONG]}) of tracker.csv" in each for each in places)


def test_nothing_is_left_out_without_a_word(results):
    told = answer("summary", results)["m"]["left_out"]
    assert any(NAMES[EMPTY] in text for text in told)
