"""Whoever keeps many robots asks for all of them at once: which is good, which is not known."""

import csv
import io
import json
import math
import os
import re
import shutil
from pathlib import Path

import pytest
import yaml
from command_line import call, small_study
from stages_by_hand import run_stage

from kinacc.campaign import of_calibration
from kinacc.campaign.journal import JOURNAL
from kinacc.report import answer
from kinacc.tables import store

COLUMNS = ("bound_mm", "confidence", "campaign", "campaign_date", "verdict")


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Results of a small synthetic study, up to its summary."""
    base = tmp_path_factory.mktemp("study")
    folder = small_study(base)
    done = run_stage("summary", "--config", base / "small.yaml", "--results", folder.parent)
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture
def fleet(study, tmp_path, monkeypatch):
    """Results of two robots, line_a and line_b, in the current folder."""
    monkeypatch.setenv("COLUMNS", "80")
    for name in ("line_a", "line_b"):
        shutil.copytree(study, tmp_path / "results" / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "results"


def campaign(name, readings=8, noise=0.05, model="dh", more=(), off_mm=0.0):
    """A campaign of five candidates on a robot that is off, so many of its readings taken."""
    words = ("--model", model, "--drawn", 5, "--budget", 8, "--noise-mm", noise, *more)
    folder, place = f"results/{name}", f"check_{name}"
    begun = call("campaign", "start", place, "--calibration", folder, *words)
    assert begun.exit_code == 0, begun.output
    for number in range(readings):
        row = json.loads(call("campaign", "next", place, "--json").stdout)["rows"][0]
        at = ",".join(str(row[f"expected_{axis}_mm"] + off_mm + 0.01 * number) for axis in "xyz")
        assert call("campaign", "record", place, f"--position-mm={at}").exit_code == 0


def rows(*words, code=0):
    done = call("summary", *words, "--json")
    assert done.exit_code == code, done.output
    return {row["data_set"]: row for row in json.loads(done.stdout)["rows"]}


def test_each_robot_has_the_errors_that_its_half_page_says(fleet):
    told = json.loads(call("fitted", "results/line_a", "--json").stdout)
    held_out = told["held_out_error"][told["selected"]]
    row = rows()["line_a"]
    assert row["model"] == told["selected"]
    assert row["held_out_mean_mm"] == held_out["mean"]
    assert row["held_out_99_mm"] == held_out["quantile_99"]
    assert row["held_out_largest_mm"] == held_out["largest"]
    assert (row["robot"], row["held_out_rows"]) == ("mh180", held_out["n"])
    assert [row.get(name) for name in COLUMNS] == [None] * len(COLUMNS)


def test_a_campaign_bounds_the_robot_it_is_about_and_no_other(fleet):
    campaign("line_b")
    bound = json.loads(call("fitted", "results/line_b", "--json").stdout)["largest_error"]
    found = rows()
    assert found["line_b"]["bound_mm"] == bound["upper_mm"] > 0.0
    assert found["line_b"]["confidence"] == 0.95
    assert "nothing moved" in found["line_b"]["bound_if"]
    assert "all 5 candidates" in found["line_b"]["bound_of"]
    entry = json.loads(Path("check_line_b/readings.jsonl").read_text().splitlines()[-1])
    assert entry["entry"]["at"].startswith(found["line_b"]["campaign_date"])
    assert found["line_a"]["bound_mm"] is None


def test_the_day_of_a_file_is_said_to_be_that(fleet):
    os.utime(fleet / "line_a" / "summary.parquet", (0, 0))
    assert rows()["line_a"]["file_date"] == "1970-01-01"


def test_nothing_is_accepted_by_a_bound_that_is_not_there(fleet):
    campaign("line_a")
    found = rows("--tolerance-mm", 1, code=1)
    assert (found["line_a"]["verdict"], found["line_b"]["verdict"]) == ("accept", "undecided")
    assert found["line_b"]["because"] == "no campaign bounds it"
    assert "1 accept, 1 undecided" in call("summary", "--tolerance-mm", 1).output


def test_a_tolerance_below_the_lower_bound_rejects(fleet):
    campaign("line_a", off_mm=0.4)
    row = rows("--tolerance-mm", 0.1, code=1)["line_a"]
    assert row["lower_mm"] > 0.1
    assert row["verdict"] == "reject"


def test_readings_that_contradict_the_noise_accept_nothing(fleet):
    campaign("line_a", readings=7, noise=1.0)
    row = rows("--tolerance-mm", 50, code=1)["line_a"]
    assert row["verdict"] == "undecided"


def test_a_history_takes_the_bound_of_a_campaign_that_came_to_its_end(fleet):
    tables = answer.read("results/line_a")
    campaign("line_a")
    campaign("line_b", readings=7)
    ended, going = (Path(f"check_{name}") for name in ("line_a", "line_b"))
    # Both have the same tables: a campaign is known by the model it judges, not by a name.
    bound_mm = rows()["line_a"]["bound_mm"]
    assert of_calibration.finished(tables, "dh", [going, ended]) == bound_mm
    assert math.isnan(of_calibration.finished(tables, "dh", [going]))
    assert math.isnan(of_calibration.finished(tables, "vec", [ended]))
    (ended / JOURNAL).write_text("no journal")
    assert math.isnan(of_calibration.finished(tables, "dh", [ended]))


def test_the_tolerance_of_a_campaign_counts_where_no_other_is_given(fleet):
    campaign("line_a", more=("--tolerance-mm", 2))
    found = rows()
    assert (found["line_a"]["verdict"], found["line_a"]["tolerance_mm"]) == ("accept", 2.0)
    assert found["line_b"]["verdict"] is None


def test_errors_held_out_can_be_held_to_a_tolerance_which_has_to_be_given(fleet):
    row = rows()["line_a"]
    few = row["held_out_rows"] < 100
    above = rows("--by", "held-out", "--tolerance-mm", row["held_out_99_mm"] + 1, code=int(few))
    assert above["line_a"]["verdict"] == ("undecided" if few else "accept")
    below = rows("--by", "held-out", "--tolerance-mm", row["held_out_99_mm"] / 2, code=1)
    assert below["line_a"]["verdict"] == "reject"
    done = call("summary", "--by", "held-out")
    assert done.exit_code == 2
    assert "--tolerance-mm" in done.output


def test_robots_without_a_summary_are_named_all_of_them(fleet):
    (fleet / "line_c" / "logs").mkdir(parents=True)
    shutil.copytree(fleet / "line_a", fleet / "line_d")
    (fleet / "line_d" / "summary.parquet").write_bytes(b"half of one")
    done = call("summary")
    assert done.exit_code == 1
    found = rows(code=1)
    assert list(found) == ["line_a", "line_b", "line_c", "line_d"]
    assert found["line_c"]["model"] is None


def test_a_summary_that_was_emptied_is_a_problem_and_no_crash(fleet):
    path = fleet / "line_a" / "summary.parquet"
    table = {name: values[:0] for name, values in store.read(path).items()}
    store.write(path, "summary", table, store.read_metadata(path))
    assert "does not say which robot" in rows(code=1)["line_a"]["remarks"]


def test_folders_that_hold_nothing_are_all_named_at_once(fleet, tmp_path):
    (tmp_path / "bare").mkdir()
    done = call("summary", "bare", "gone")
    assert done.exit_code == 2


def test_one_robot_and_folders_of_several_can_be_named(fleet):
    assert list(rows("results/line_b")) == ["line_b"]
    shutil.copytree(fleet / "line_a", "other/line_a")
    found = json.loads(call("summary", "results", "other", "--json").stdout)["rows"]
    assert [row["folder"] for row in found] == ["results/line_a", "results/line_b", "other/line_a"]


def test_a_spreadsheet_has_what_the_terminal_has_no_room_for(fleet):
    campaign("line_a")
    shown = call("summary").output
    assert max(map(len, shown.splitlines())) <= 80
    assert "the bound is on the largest error of all 5 candidates" in " ".join(shown.split())
    (first, _) = csv.DictReader(io.StringIO(call("summary", "--csv").output))
    assert first["campaign"] == "check_line_a"
    done = call("summary", "--out", "robots.csv")
    assert done.exit_code == 0, done.output
    assert re.search(r"^line_b,", Path("robots.csv").read_text(), re.MULTILINE)
    assert call("summary", "--csv", "--json").exit_code == 2


def test_a_bound_on_another_model_than_the_one_selected_says_so(fleet):
    selected = rows()["line_a"]["model"]
    other = {"dh": "vec", "vec": "dh"}[selected]
    campaign("line_a", model=other)
    assert "which is not the model selected" in rows()["line_a"]["remarks"]


def many(folder, count):
    """A configuration file for each of many robots."""
    folder.mkdir()
    for number in range(count):
        told = {"datasets": {f"cell_{number}": {"robot": "mh180"}}}
        (folder / f"cell_{number}.yaml").write_text(yaml.safe_dump(told))
    return sorted(map(str, folder.iterdir()))


def test_a_robot_described_in_two_files_is_named_with_both(tmp_path):
    text = "datasets: {cell: {robot: ur10, measurements: {source: file, file: {path: a.csv}}}}\n"
    for name in ("one", "two"):
        (tmp_path / f"{name}.yaml").write_text(text)
    (tmp_path / "a.csv").write_text("")
    done = call("calibrate", tmp_path / "one.yaml", tmp_path / "two.yaml")
    assert done.exit_code == 2
    for word in ("'cell'", "one.yaml", "two.yaml", "a name of its own"):
        assert word in done.output


def test_a_folder_stands_for_the_configuration_files_in_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = "datasets: {same: {robot: ur10, measurements: {source: file, file: {path: a.csv}}}}\n"
    many(tmp_path / "robots", 1)
    for name in ("robots/one.yaml", "robots/two.yaml"):
        Path(name).write_text(text)
    Path("robots/one.robot.yaml").write_text("name: an arm of ours, which is no configuration\n")
    told = call("calibrate", "robots").output
    assert "robots/two.yaml" in told
    assert "one.robot.yaml" not in told
    Path("bare").mkdir()
    done = call("calibrate", "bare")
    assert done.exit_code == 2
