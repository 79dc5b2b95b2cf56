"""A report in which more was read than its bounds say, and what it says of that."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from command_line import call, small_study


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    """Results of a small synthetic study, made by the workflow's own stages."""
    return small_study(tmp_path_factory.mktemp("study"))


@pytest.fixture
def reported(calibration, tmp_path):
    """Measure a whole campaign of an arm with given errors and noise; its report, and the words."""

    def make(stated_mm, errors_mm, noise_mm, *more, points=12, budget=12):
        folder, file = tmp_path / "check", tmp_path / "readings.csv"
        done = call("campaign", "start", folder, "--calibration", calibration, "--model", "dh",
                    "--drawn", points, "--budget", budget, "--noise-mm", stated_mm, "--frame",
                    "base", *more)  # fmt: skip
        assert done.exit_code == 0, done.output
        rng, errors = np.random.default_rng(1), {}
        while rows := json.loads(call("campaign", "next", folder, "--all", "--json").stdout).get(
            "rows"
        ):
            with file.open("w", newline="") as stream:
                out = csv.writer(stream)
                out.writerow(["pose", "x_mm", "y_mm", "z_mm"])
                for row in rows:
                    error = errors.setdefault(row["pose"], rng.normal(0.0, errors_mm, 3))
                    seen = error + rng.normal(0.0, noise_mm, 3)
                    modelled = [row[f"expected_{axis}_mm"] for axis in "xyz"]
                    out.writerow([row["pose"], *map(float, modelled + seen)])
            done = call("campaign", "record", folder, file)
            assert done.exit_code == 0, done.output
        done = call("campaign", "report", folder)
        assert done.exit_code == 0, done.output
        return (folder / "report" / "report.md").read_text(), done.output

    return make


def largest(text):
    """Rows of the table of largest errors: point, readings, error, least, most."""
    part = text.split("## Largest errors")[1].split("##")[0]
    lines = [line for line in part.splitlines() if line.startswith("| ")][1:]
    return [[cell.strip() for cell in line.strip("| ").split("|")] for line in lines]


def test_readings_quieter_than_the_noise_stated_lie_above_their_limits(reported):
    text, words = reported(1.0, 0.05, 0.05, "--assessor", "single_shot")
    rows = largest(text)
    assert all(float(row[2]) > float(row[4]) for row in rows)
    top = rows[0][0]
    for shown in (text, words):
        assert f"measured points read more than that, point {top} the most, {rows[0][2]}" in shown
        assert "the mean of 1 reading with noise of 1.000 mm per axis" in shown
    assert "Read above their own limit" in text
    assert all(row[0] in text.split("Read above their own limit")[1] for row in rows)
    assert "the noise may be stated too large" in text


def test_points_beyond_a_share_of_the_region_are_said_to_be_beyond_it(reported):
    text, _ = reported(0.02, 0.2, 0.02, "--assessor", "region_share", "--set", "share=0.5",
                       points=60, budget=60)  # fmt: skip
    assert "of the 60 measured points read more than that" in text
    assert "the bound leaves out 50.0% of the region" in text
    assert "stated too" not in text


def test_a_report_that_agrees_with_itself_has_nothing_to_explain(reported):
    text, words = reported(0.05, 0.2, 0.05)
    assert all(float(row[2]) <= float(row[4]) for row in largest(text))
    for sign in ("read more than that", "own limit", "contradict"):
        assert sign not in text + words
