"""check-data as a person and a program call it: exit codes, lines, numbers and the picture."""

import json

import pytest
from command_line import call
from good_files import simulated


@pytest.fixture
def configuration(tmp_path):
    """Writes a measured file of an arm as described, with a change of its columns."""
    good = simulated("irb120", poses=80, noise_mm=0.0, off=0.0)
    return lambda **columns: good.but(**columns).write(tmp_path)


def report(config, code):
    done = call("check-data", config, "--json")
    assert done.exit_code == code, done.output
    return json.loads(done.stdout)


def slipped(rows=(4, 11)):
    good = simulated("irb120", poses=80, noise_mm=0.0, off=0.0).columns["x_mm"].to_numpy(copy=True)
    good[list(rows)] += 30.0
    return good


def test_a_good_file_is_described_and_passes(configuration):
    done = call("check-data", configuration())
    assert done.exit_code == 0, done.output
    for words in ("poses: 80", "limits -165 to 165", "nothing suspicious"):
        assert words in done.output


def test_suspicions_name_their_lines_and_end_with_1(configuration):
    config = configuration(x_mm=slipped())
    assert "lines 6, 13" in call("check-data", config).output
    told = report(config, 1)
    assert told["verdict"] == "suspicions"
    assert told["datasets"][0]["suspicions"][0]["lines"] == [6, 13]
    assert told["datasets"][0]["facts"]["poses"] == 80


def test_the_picture_is_drawn_once(configuration, tmp_path):
    words = ("check-data", configuration(x_mm=slipped()), "--picture", tmp_path / "checked.svg")
    assert [call(*words, *more).exit_code for more in ((), (), ("--force",))] == [1, 2, 1]
    assert (tmp_path / "checked.svg").read_bytes().startswith(b"<?xml")


def test_what_cannot_be_used_ends_with_2(configuration, tmp_path):
    config = configuration()
    table = (tmp_path / "file.csv").read_text().splitlines(keepends=True)
    (tmp_path / "file.csv").write_text("".join(table[:4]))
    assert report(config, 2)["verdict"] == "unusable"
    (tmp_path / "file.csv").unlink()
    assert report(config, 2)["problems"]
    config.write_text("datasets: {mh180: {robot: mh180}}\n")
    assert call("check-data", config).exit_code == 2
