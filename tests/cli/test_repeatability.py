"""Repeated readings: what `kinacc repeatability` says of instrument, arm and a campaign's noise."""

from __future__ import annotations

import json

import numpy as np
import pytest
import scipy.stats
from command_line import call

FIVE = np.array(
    [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, -0.4, 0.0), (0.0, 0.0, 0.1), (-0.1, 0.2, 0.2)]
)


def written(path, header, rows):
    """A CSV of rows whose last three cells are a position in mm."""
    lines = [",".join([*map(str, row[:-1]), *(f"{each:.9f}" for each in row[-1])]) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


def estimated(file, *more):
    done = call("repeatability", file, *more, "--json")
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def simulated(seed, poses, sides, visits, readings, std_mm):
    """Rows of a nested experiment with standard deviations of instrument, visits and sides."""
    rng = np.random.default_rng(seed)
    instrument, arm, side_of = std_mm
    rows = []
    for pose in range(poses):
        middle = rng.uniform(-900, 900, 3)
        for side in range(sides):
            shift = rng.normal(size=3) * side_of
            for visit in range(visits):
                off = rng.normal(size=3) * arm
                for _ in range(readings):
                    at = middle + shift + off + rng.normal(size=3) * instrument
                    rows.append((f"P{pose}", "+-"[side], f"{side}.{visit}", at))
    return rows


def position(rows, poses, sides, visits, readings):
    return np.array([row[-1] for row in rows]).reshape(poses, sides, visits, readings, 3)


def test_pose_repeatability_is_that_of_iso_9283_worked_by_hand(tmp_path):
    rows = [("A", number, each) for number, each in enumerate(FIVE + 100.0 * np.arange(1, 4))]
    rows += [("B", number, 2.0 * shift) for number, shift in enumerate(FIVE)]
    said = estimated(written(tmp_path / "five.csv", "pose,visit,x_mm,y_mm,z_mm", rows))
    middle = np.array([0.04, -0.04, 0.06])
    distance = [np.linalg.norm(each - middle) for each in FIVE]
    mean = sum(distance) / 5.0
    spread = (sum((each - mean) ** 2 for each in distance) / 4.0) ** 0.5
    first, second = said["rows"]
    assert first["rp_mm"] == pytest.approx(mean + 3.0 * spread, rel=1e-9)
    assert second["rp_mm"] == pytest.approx(2.0 * (mean + 3.0 * spread), rel=1e-9)
    pooled = (4.0 * (1.0 + 4.0) * spread**2 / 8.0) ** 0.5
    assert said["mean_distance_mm"] == pytest.approx(1.5 * mean, rel=1e-9)
    assert said["rp_mm"] == pytest.approx(1.5 * mean + 3.0 * pooled, rel=1e-9)
    np.testing.assert_allclose(first["std_x_mm"], np.std(FIVE[:, 0], ddof=1), rtol=1e-9)


def test_instrument_visits_and_sides_are_told_apart_as_by_the_analysis_of_variance(tmp_path):
    shape = 12, 2, 3, 2
    rows = simulated(4, *shape, (0.02, 0.05, 0.04))
    said = estimated(written(tmp_path / "all.csv", "pose,side,visit,x_mm,y_mm,z_mm", rows))
    at = position(rows, *shape)
    within = at.var(axis=3, ddof=1).mean(axis=(0, 1, 2))
    between = at.mean(axis=3).var(axis=2, ddof=1).mean(axis=(0, 1))
    across = at.mean(axis=(2, 3)).var(axis=1, ddof=1).mean(axis=0)
    visits = between - within / 2.0
    sides = across - visits / 3.0 - within / 6.0
    np.testing.assert_allclose(said["instrument_std_mm"], np.sqrt(within), rtol=1e-6)
    # The arm's own parts are covariances: a difference of two is one only nearly.
    np.testing.assert_allclose(said["one_side_std_mm"], np.sqrt(visits), rtol=1e-6)
    np.testing.assert_allclose(said["all_sides_std_mm"], np.sqrt(visits + sides), rtol=1e-6)
    whole = np.mean(within + visits + sides)
    np.testing.assert_allclose(said["std_mm"], np.sqrt(whole), rtol=1e-6)
    terms = np.mean(within) / 2.0, np.mean(between) * 2.0 / 3.0, np.mean(across)
    assert sum(terms) == pytest.approx(whole)
    welch = whole**2 / sum(t**2 / nu for t, nu in zip(terms, (72, 48, 12), strict=True))
    assert said["noise"]["freedom"] == pytest.approx(3.0 * welch, rel=1e-9)
    low = np.sqrt(whole * 3.0 * welch / scipy.stats.chi2.ppf(0.975, 3.0 * welch))
    assert said["std_low_mm"][0] == pytest.approx(low, rel=1e-9)


def test_a_campaign_of_readings_like_these_has_the_noise_told_of_them(tmp_path):
    """Over many files, unbalanced as people measure: unbiased, with limits that hold in 95 %."""
    from kinacc.checks.repeatability import Repeated, limits, noise_of, parts

    rng = np.random.default_rng(2)
    truth, held, sizes = 0.02**2 + 0.05**2 + 0.03**2, 0, []
    side = np.repeat(np.arange(30), 4)
    visit = np.cumsum(np.r_[1, rng.random(119) < 0.7] | np.r_[1, np.diff(side)]) - 1
    for _ in range(400):
        shift = rng.normal(size=(30, 3)) * 0.03
        off = rng.normal(size=(visit[-1] + 1, 3)) * 0.05
        at = shift[side] + off[visit] + rng.normal(size=(120, 3)) * 0.02
        found = noise_of(parts(Repeated(at, side // 2, side, visit)), np.zeros(3))
        size = np.trace(found.covariance_mm2) / 3.0
        sizes.append(size)
        low, high = limits(np.sqrt([size]), found.freedom)
        held += bool(low[0] ** 2 <= truth <= high[0] ** 2)
    assert np.mean(sizes) == pytest.approx(truth, rel=0.03)
    assert 0.92 * 400 <= held <= 0.98 * 400


def test_poses_that_scatter_alike_and_differently_are_told_as_by_bartlett(tmp_path):
    rng = np.random.default_rng(5)
    scatter = [0.05, 0.05, 0.05, 0.05, 0.2]
    rows = [
        (f"P{pose}", visit, std * rng.normal(size=3))
        for pose, std in enumerate(scatter)
        for visit in range(12)
    ]
    file = written(tmp_path / "poses.csv", "pose,visit,x_mm,y_mm,z_mm", rows)
    said = estimated(file)
    assert said["poses_equal_probability"] < 1e-6
    assert "P4" in said["poses_differ"]
    alike = [(pose, visit, at if pose != "P4" else at / 4.0) for pose, visit, at in rows]
    said = estimated(written(tmp_path / "alike.csv", "pose,visit,x_mm,y_mm,z_mm", alike))
    at = np.array([row[-1] for row in alike]).reshape(5, 12, 3)
    centred = at - at.mean(axis=1, keepdims=True)
    root = np.linalg.cholesky(np.einsum("pvi,pvj->ij", centred, centred) / 55.0)
    white = np.linalg.solve(root, centred.reshape(-1, 3).T).T.reshape(5, 12, 3)
    own = np.sum(white**2, axis=(1, 2)) / 33.0
    # Bartlett's statistic is that of five samples of 34 numbers with these variances.
    samples = []
    for each in own:
        numbers = rng.normal(size=34)
        samples.append((numbers - numbers.mean()) / numbers.std(ddof=1) * np.sqrt(each))
    wanted = scipy.stats.bartlett(*samples).pvalue
    assert said["poses_equal_probability"] == pytest.approx(wanted, rel=1e-6)
    assert said["poses_differ"] is None


def test_axes_that_differ_are_said_and_make_a_covariance(tmp_path):
    rng = np.random.default_rng(6)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rows = [
        (f"P{pose}", visit, turn @ (rng.normal(size=3) * (0.01, 0.01, 0.1)))
        for pose in range(20)
        for visit in range(3)
    ]
    said = estimated(written(tmp_path / "axes.csv", "pose,visit,x_mm,y_mm,z_mm", rows))
    assert not said["noise"]["is_even"]
    at = np.array([row[-1] for row in rows]).reshape(20, 3, 3)
    pooled = sum(np.cov(each.T, ddof=1) for each in at) / 20.0
    np.testing.assert_allclose(said["noise"]["covariance_mm2"], pooled, rtol=1e-6)
    assert said["noise"]["freedom"] == pytest.approx(40.0)


def test_readings_the_instrument_rounds_away_have_the_noise_of_the_rounding(tmp_path):
    rng = np.random.default_rng(8)
    rows = [
        (f"P{pose}", visit, 5.0 * pose + 0.5 * np.round(rng.normal(size=3) * (0.3, 0.01, 0.01)))
        for pose in range(20)
        for visit in range(3)
    ]
    said = estimated(written(tmp_path / "steps.csv", "pose,visit,x_mm,y_mm,z_mm", rows))
    assert said["resolution_mm"][0] == pytest.approx(0.5)
    assert min(said["std_mm"]) == pytest.approx(5.0 / np.sqrt(12.0))
    assert any(said["noise"]["rounded"])


def test_rows_of_one_pose_after_another_are_asked_about(tmp_path):
    rng = np.random.default_rng(3)
    rows = [(pose, rng.normal(size=3)) for pose in "AB" for _ in range(5)]
    file = written(tmp_path / "rows.csv", "pose,x_mm,y_mm,z_mm", rows)
    done = call("repeatability", file)
    assert done.exit_code == 2
    visits = estimated(file, "--rows", "visits")
    assert visits["noise"]["freedom"] == pytest.approx(24.0)
    stays = estimated(file, "--rows", "stays")
    assert stays["noise"] is None
    np.testing.assert_allclose(stays["instrument_std_mm"], visits["std_mm"], rtol=0.5)


@pytest.mark.parametrize(
    ("header", "stamps", "hours"),
    [
        ("time", [f"2026-05-04T08:0{each}:00" for each in range(5)], 4 / 60),
        ("time", [f"08:0{each}:30" for each in range(5)], 4 / 60),
        ("time_s", [60 * each for each in range(5)], 4 / 60),
        ("time_h", list(range(5)), 4.0),
        ("started", list(range(5)), None),
    ],
)
def test_the_time_at_a_pose_is_known_from_several_columns(tmp_path, header, stamps, hours):
    rows = [("A", number, stamps[number], at) for number, at in enumerate(FIVE)]
    file = written(tmp_path / "time.csv", f"pose,visit,{header},x_mm,y_mm,z_mm", rows)
    told = estimated(file)
    assert told["hours_at_a_pose"] == (hours if hours is None else pytest.approx(hours))
    assert any("over a day" in each for each in told["remarks"]) == (hours != 4.0)


BAD = """pose,visit,side,time,target,x_mm,y_mm,z_mm
A,1,left,noon,m1,1,2,3
A,1,left,12:00,m2,1,zwei,3
,2,right,12:01,m1,1,2,1e9
"""


@pytest.mark.parametrize(
    ("content", "problems"),
    [
        (BAD, 5),
        ("pose,visit,x_mm,y_mm,z_mm\n" + "A,{},0.123456789,5.123456789,7.123456789\n" * 9, 1),
        ("pose,x_mm,y_mm,z_mm\nA,1,2,3\nB,4,5,6\n", 1),
        ("x_mm,y_mm,z_mm\n1,2,3\n4,5,6\n", 1),
    ],
)
def test_problems_of_a_file_are_listed_together(tmp_path, content, problems):
    file = tmp_path / "bad.csv"
    file.write_text(content.format(*range(9)))
    done = call("repeatability", file, "--json")
    assert done.exit_code == 2
    assert len(json.loads(done.stdout)["problems"]) == problems
