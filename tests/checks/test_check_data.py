"""check-data as a person and a program call it: exit codes, lines, numbers and the picture."""

import json

import numpy as np
import pytest
from command_line import call
from good_files import simulated


@pytest.fixture
def good():
    """A measured file of an arm as described."""
    return simulated("irb120", poses=80, noise_mm=0.0, off=0.0)


def report(config, code):
    done = call("check-data", config, "--json", code=code)
    return json.loads(done.stdout)


def test_suspicions_name_their_lines_and_end_with_1_and_are_drawn_once(good, tmp_path):
    by_mm = np.where(np.isin(np.arange(80), (4, 11)), 30.0, 0.0)
    config = good.but(x_mm=good.columns["x_mm"] + by_mm).write(tmp_path)
    words = ("check-data", config, "--picture", tmp_path / "checked.svg")
    done = call(*words, "--json", code=1)
    told = json.loads(done.stdout)
    assert told["verdict"] == "suspicions"
    assert told["datasets"][0]["suspicions"][0]["lines"] == [6, 13]
    assert told["datasets"][0]["suspicions"][0]["where"] == "lines 6, 13"
    assert told["datasets"][0]["facts"]["poses"] == 80
    call(*words, code=2)
    assert (tmp_path / "checked.svg").read_bytes().startswith(b"<?xml")


def test_what_cannot_be_used_ends_with_2(good, tmp_path):
    config = good.write(tmp_path)
    table = (tmp_path / "file.csv").read_text().splitlines(keepends=True)
    (tmp_path / "file.csv").write_text("".join(table[:4]))
    assert report(config, 2)["problems"]
    (tmp_path / "file.csv").unlink()
    assert report(config, 2)["problems"]
    config.write_text("datasets: {mh180: {robot: mh180}}\n")
    call("check-data", config, code=2)


def test_files_that_cannot_be_used_are_all_named_and_the_others_checked(good, tmp_path):
    configs = [good.write(tmp_path, name) for name in ("a", "b", "c")]
    for name in ("a", "c"):
        good.columns.head(3).to_csv(tmp_path / f"{name}.csv", index=False)
    problems = json.loads(call("check-data", *configs, "--json", code=2).stdout)["problems"]
    files = {problem["where"].split(",")[0] for problem in problems}
    assert files == {str(tmp_path / "a.csv"), str(tmp_path / "c.csv")}
    assert "b:" in call("check-data", *configs, code=2).stdout
