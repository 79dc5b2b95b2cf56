"""Values that are allowed and look like slips are asked about, with the reason."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from command_line import call

from kinacc.campaign.begin import noise_doubts
from kinacc.campaign.instrument import instruments


@pytest.fixture
def start(calibration, tmp_path):
    """Start a campaign of 200 candidates with further options."""

    def begin(*more):
        return call("campaign", "start", tmp_path / "check", "--calibration", calibration,
                    "--robot", "mh180", "--model", "dh", *more)  # fmt: skip

    return begin


def test_micrometres_given_as_millimetres_of_noise_are_asked_about(start, tmp_path):
    done = start("--noise-mm", 50)
    assert done.exit_code == 2
    assert "are micrometres meant? Then it is 0.05 mm" in done.output
    assert not (tmp_path / "check").exists()
    assert start("--noise-mm", 50, "--sure").exit_code == 0


def test_a_small_budget_is_told_how_many_candidates_its_bound_leaves_aside(start):
    done = start("--noise-mm", 0.05, "--budget", 100)
    assert done.exit_code == 0, done.output
    # Seven can all be missed by 90 of 200, six cannot: at 2.5 %.
    said = " ".join(done.output.split())
    assert "will leave 6 candidates out; 195 readings" in said


@pytest.fixture
def visited(begun, tmp_path):
    """A campaign, and the rows of its first visit with small errors: pose, x, y, z in mm."""
    folder = begun("--noise-mm", 0.05, points=40, budget=40)
    rows = json.loads(call("campaign", "next", folder, "--all", "--json").stdout)["rows"]
    noise = np.random.default_rng(5).normal(size=(len(rows), 3)) * 0.25
    return folder, [
        [
            row["pose"],
            *(row[f"expected_{axis}_mm"] + off for axis, off in zip("xyz", own, strict=True)),
        ]
        for row, own in zip(rows, noise, strict=True)
    ]


def written(path, rows):
    """A file of readings."""
    lines = ["pose,x_mm,y_mm,z_mm", *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_reading_three_mm_off_where_less_than_one_is_usual_is_asked_about(visited, tmp_path):
    folder, rows = visited
    rows[7][1] += 3.5
    path = written(tmp_path / "readings.csv", rows)
    done = call("campaign", "record", folder, path, code=2)
    assert "line 9" in done.output
    assert done.output.count("--accept-implausible") == 1
    assert json.loads(call("campaign", "status", folder, "--json").stdout)["readings"] == 0
    # What was read again and stands is taken, for to drop it would make the bound wrong.
    call("campaign", "record", folder, path, "--accept-implausible", code=0)


def test_a_report_has_spreadsheets_and_a_page_that_is_not_overwritten(visited, tmp_path):
    folder, rows = visited
    call("campaign", "record", folder, written(tmp_path / "r.csv", rows), code=0)
    page = tmp_path / "check.html"
    words = ("campaign", "report", folder, "--out", tmp_path / "one", "--table", "xlsx")
    call(*words, "--table", "csv", "--page", page, code=0)
    csv = pd.read_csv(tmp_path / "one" / "campaign_points.csv")
    pd.testing.assert_frame_equal(
        csv, pd.read_excel(tmp_path / "one" / "campaign_points.xlsx"), rtol=1e-9
    )
    text = page.read_text("utf-8")
    bound = json.loads(call("campaign", "status", folder, "--json").stdout)["bounds"][0]
    assert f"{bound['upper_mm']:.3f}" in text
    assert "://" not in text.partition("<script")[0]
    for other in (page, tmp_path / "check.pdf"):
        done = call("campaign", "report", folder, "--page", other, code=2)
        assert "Nothing was written" in done.output
    assert page.read_text("utf-8") == text


@pytest.mark.parametrize(
    ("freedom", "noise_mm", "doubted"), [(90, 0.03, 1), (90, 0.06, 0), (9, 0.03, 0)]
)
def test_noise_below_the_scatter_of_repeated_readings_is_asked_about(freedom, noise_mm, doubted):
    known = SimpleNamespace(freedom=freedom, per_axis_mm=0.06)
    used = instruments([f"tracker={noise_mm}"], "base")
    assert len(noise_doubts(used, known=known)) == doubted
