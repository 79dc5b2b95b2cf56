"""Values that are allowed and look like slips are asked about, with the reason."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from command_line import call

from kinacc.calibration import noise
from kinacc.calibration.observations import full_poses
from kinacc.campaign import doubts
from kinacc.campaign.instrument import instruments
from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics import dh, robot


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
def visited(start, tmp_path):
    """A campaign, and the rows of its first visit with small errors: pose, x, y, z in mm."""
    assert start("--noise-mm", 0.05).exit_code == 0
    folder = tmp_path / "check"
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
    done = call("campaign", "record", folder, path)
    assert done.exit_code == 2
    assert "line 9" in done.output
    assert done.output.count("--accept-implausible") == 1
    assert json.loads(call("campaign", "status", folder, "--json").stdout)["readings"] == 0
    # What was read again and stands is taken, for to drop it would make the bound wrong.
    assert call("campaign", "record", folder, path, "--accept-implausible").exit_code == 0


def test_a_report_has_spreadsheets_and_a_page_that_is_not_overwritten(visited, tmp_path):
    folder, rows = visited
    assert call("campaign", "record", folder, written(tmp_path / "r.csv", rows)).exit_code == 0
    page = tmp_path / "check.html"
    words = ("campaign", "report", folder, "--out", tmp_path / "one", "--table", "xlsx")
    done = call(*words, "--table", "csv", "--page", page)
    assert done.exit_code == 0, done.output
    csv = pd.read_csv(tmp_path / "one" / "campaign_points.csv")
    pd.testing.assert_frame_equal(
        csv, pd.read_excel(tmp_path / "one" / "campaign_points.xlsx"), rtol=1e-9
    )
    text = page.read_text("utf-8")
    bound = json.loads(call("campaign", "status", folder, "--json").stdout)["bounds"][0]
    assert f"{bound['upper_mm']:.3f}" in text
    assert "://" not in text.partition("<script")[0]
    for other in (page, tmp_path / "check.pdf"):
        done = call("campaign", "report", folder, "--page", other)
        assert done.exit_code == 2
        assert "Nothing was written" in done.output
    assert page.read_text("utf-8") == text


def readings_of(poses, times, std_mm, sessions=1, seed=3):
    """Positions of poses read several times, with a base of its own in each session."""
    rng, arm = np.random.default_rng(seed), robot.load("irb120")
    at = np.tile(np.repeat(np.arange(poses), times), sessions)
    session = np.repeat(np.arange(sessions), poses * times)
    q = rng.uniform(-1, 1, (poses, 6))[at] + rng.normal(size=(len(at), 6)) * 1e-4
    flange = dh.forward(arm.dh, q)
    point = flange.position_mm + flange.rotation @ [50.0, 20.0, 80.0]
    bases = exp_so3(rng.normal(size=(sessions, 3)))[session]
    measured = (bases @ point[..., None])[..., 0] + rng.normal(size=point.shape) * std_mm
    read = full_poses(q, Pose(np.full_like(bases, np.nan), measured))
    return replace(read, session=session, session_names=tuple(map(str, range(sessions))))


def noise_of(*given, **options):
    """The noise of :func:`readings_of`."""
    return noise.of_readings(readings_of(*given, **options), robot.load("irb120").dh)


@pytest.mark.parametrize("sessions", [1, 2])
def test_noise_below_the_scatter_of_repeated_readings_is_asked_about(sessions):
    known = noise_of(30, 4, 0.06, sessions)
    assert known.freedom == 90 * sessions
    assert known.std_mm == pytest.approx(0.06, rel=0.25)
    (problem,) = doubts.of_little_noise(instruments(["tracker=0.03"], "base"), known)
    assert "scatter by 0.0" in problem.what
    assert not doubts.of_little_noise(instruments(["tracker=0.06"], "base"), known)


@pytest.mark.parametrize(("poses", "times"), [(120, 1), (9, 2)])
def test_where_hardly_any_joints_were_read_again_the_calibration_tells_no_noise(poses, times):
    assert doubts.noise_by_repeats(noise_of(poses, times, 0.06)) == ""


def test_a_campaign_without_noise_is_told_what_its_calibration_knows_of_it(start, tmp_path):
    for done in (start(), call("campaign", "plan"), call("campaign", "plan", "--errors", tmp_path)):
        assert done.exit_code == 2
        assert "noise: is not given; give it in one of three ways:" in done.output
        for way in ("kinacc repeatability FILE", "--noise estimate", "--noise-mm MM"):
            assert way in done.output
    assert not (tmp_path / "check").exists()
