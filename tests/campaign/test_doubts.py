"""Values that are allowed and look like slips are asked about, with the reason."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from campaign_on_disk import refusal, refused, standing, visit_of
from command_line import call

from kinacc.campaign.begin import noise_doubts
from kinacc.campaign.instrument import instruments


@pytest.fixture
def start(study, tmp_path):
    """Words that start a campaign of 200 candidates."""
    return ("campaign", "start", tmp_path / "check", "--calibration", study, "--model", "dh")


def test_micrometres_given_as_millimetres_of_noise_are_asked_about(start, tmp_path):
    said = refusal(*start, "--noise-mm", 50)
    assert "are micrometres meant? Then it is 0.05 mm" in said
    assert not (tmp_path / "check").exists()
    call(*start, "--noise-mm", 50, "--sure", code=0)


def test_a_small_budget_is_told_how_many_candidates_its_bound_leaves_aside(start):
    # Seven can all be missed by 90 of 200, six cannot: at 2.5 %.
    said = " ".join(call(*start, "--noise-mm", 0.05, "--budget", 100, code=0).output.split())
    assert "will leave 6 candidates out; 195 readings" in said


@pytest.fixture
def visited(begun):
    """A campaign, and the readings of its first visit with small errors."""
    folder = begun("--noise-mm", 0.05, points=40, budget=40)
    return folder, visit_of(folder, 0.25)


def test_a_reading_three_mm_off_where_less_than_one_is_usual_is_asked_about(visited, tmp_path):
    folder, rows = visited
    rows.loc[7, "x_mm"] += 3.5
    rows.to_csv(tmp_path / "readings.csv", index=False)
    words = ("record", folder, tmp_path / "readings.csv")
    said = refused(folder, *words)
    assert "line 9" in said
    assert said.count("--accept-implausible") == 1
    # What was read again and stands is taken, for to drop it would make the bound wrong.
    call("campaign", *words, "--accept-implausible", code=0)


def test_a_report_has_a_page_that_is_not_overwritten(visited, tmp_path):
    folder, rows = visited
    rows.to_csv(tmp_path / "readings.csv", index=False)
    call("campaign", "record", folder, tmp_path / "readings.csv", code=0)
    page = tmp_path / "check.html"
    call("campaign", "report", folder, "--out", tmp_path / "one", "--page", page, code=0)
    text = page.read_text("utf-8")
    assert f"{standing(folder)['bounds'][0]['upper_mm']:.3f}" in text
    assert "://" not in text.partition("<script")[0]
    for other in (page, tmp_path / "check.pdf"):
        assert "Nothing was written" in refused(folder, "report", folder, "--page", other)
    assert page.read_text("utf-8") == text


@pytest.mark.parametrize(
    ("freedom", "noise_mm", "doubted"), [(90, 0.03, 1), (90, 0.06, 0), (9, 0.03, 0)]
)
def test_noise_below_the_scatter_of_repeated_readings_is_asked_about(freedom, noise_mm, doubted):
    known = SimpleNamespace(freedom=freedom, per_axis_mm=0.06)
    used = instruments([f"tracker={noise_mm}"], "base")
    assert len(noise_doubts(used, known=known)) == doubted


@pytest.mark.parametrize(
    ("noise_mm", "rms_error_mm", "doubted"),
    [(0.2, 0.15, 1), (0.2, 0.2, 0), (0.02, 0.015, 1), (1.0, np.nan, 1), (0.5, np.nan, 0)],
)
def test_noise_larger_than_twice_the_rms_error_of_the_calibration_is_asked_about(
    noise_mm, rms_error_mm, doubted
):
    used = instruments([f"tracker={noise_mm}"], "base")
    assert len(noise_doubts(used, rms_error_mm)) == doubted
