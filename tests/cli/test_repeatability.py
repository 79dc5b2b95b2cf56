"""Repeated readings: what `kinacc repeatability` says of instrument, arm and a campaign's noise."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import scipy.stats
from command_line import answer, call
from read_columns import XYZ_MM

FIVE = np.array(
    [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, -0.4, 0.0), (0.0, 0.0, 0.1), (-0.1, 0.2, 0.2)]
)


def estimated(path, rows, *options):
    """What the command states for rows: a DataFrame, or columns and a position (n, 3) in mm."""
    rows.to_csv(path, index=False, float_format="%.9f")
    return answer("repeatability", path, *options)


def visits(position_mm, **columns):
    """Rows of poses (p, v, 3) that were visited v times."""
    poses, times, _ = position_mm.shape
    rows = pd.DataFrame({"pose": np.repeat([f"P{i}" for i in range(poses)], times), **columns})
    rows["visit"] = np.arange(poses * times)
    return rows.join(pd.DataFrame(position_mm.reshape(-1, 3), columns=XYZ_MM))


def test_pose_repeatability_is_that_of_iso_9283_worked_by_hand(tmp_path):
    three = FIVE[:3]
    rows = pd.concat([visits(FIVE[None] + 100.0 * np.arange(1, 4)), visits(three[None] * 2.0)])
    rows["pose"] = ["P0"] * 5 + ["P1"] * 3
    result = estimated(tmp_path / "five.csv", rows)
    one = np.linalg.norm(FIVE - [0.04, -0.04, 0.06], axis=1)
    other = 2.0 * np.linalg.norm(three - three.mean(axis=0), axis=1)
    for row, distance in zip(result["rows"], (one, other), strict=True):
        wanted = distance.mean() + 3.0 * distance.std(ddof=1)
        assert row["rp_mm"] == pytest.approx(wanted, rel=1e-9)
    mean = np.concatenate([one, other]).mean()
    pooled = ((4.0 * one.var(ddof=1) + 2.0 * other.var(ddof=1)) / 6.0) ** 0.5
    assert result["mean_distance_mm"] == pytest.approx(mean, rel=1e-9)
    assert result["rp_mm"] == pytest.approx(mean + 3.0 * pooled, rel=1e-9)
    std = np.std(FIVE[:, 0], ddof=1)
    np.testing.assert_allclose(result["rows"][0]["std_x_mm"], std, rtol=1e-9)


def test_instrument_visits_and_sides_are_separated_as_by_the_analysis_of_variance(tmp_path):
    rng, shape = np.random.default_rng(4), (12, 2, 3, 2)  # poses, sides, visits, readings
    position = rng.uniform(-900, 900, (12, 1, 1, 1, 3)) + rng.normal(0.0, 0.02, (*shape, 3))
    position += rng.normal(0.0, 0.05, (12, 2, 3, 1, 3)) + rng.normal(0.0, 0.08, (12, 2, 1, 1, 3))
    rows = pd.DataFrame(np.argwhere(np.ones(shape))[:, :3], columns=["pose", "side", "visit"])
    rows[XYZ_MM] = position.reshape(-1, 3)
    result = estimated(tmp_path / "all.csv", rows)
    within = position.var(axis=3, ddof=1).mean(axis=(0, 1, 2))
    between = position.mean(axis=3).var(axis=2, ddof=1).mean(axis=(0, 1))
    across = position.mean(axis=(2, 3)).var(axis=1, ddof=1).mean(axis=0)
    visit = between - within / 2.0
    side = across - visit / 3.0 - within / 6.0
    np.testing.assert_allclose(result["instrument_std_mm"], np.sqrt(within), rtol=1e-6)
    # The arm's own parts are covariances: a difference of two is one only nearly.
    np.testing.assert_allclose(result["one_side_std_mm"], np.sqrt(visit), rtol=1e-6)
    np.testing.assert_allclose(result["all_sides_std_mm"], np.sqrt(visit + side), rtol=1e-6)
    whole = np.mean(within + visit + side)
    np.testing.assert_allclose(result["std_mm"], np.sqrt(whole), rtol=1e-6)
    terms = np.mean(within) / 2.0, np.mean(between) * 2.0 / 3.0, np.mean(across)
    welch = whole**2 / sum(t**2 / nu for t, nu in zip(terms, (72, 48, 12), strict=True))
    assert result["noise"]["freedom"] == pytest.approx(3.0 * welch, rel=1e-9)
    for name, share in (("std_low_mm", 0.975), ("std_high_mm", 0.025)):
        end = np.sqrt(whole * 3.0 * welch / scipy.stats.chi2.ppf(share, 3.0 * welch))
        assert result[name][0] == pytest.approx(end, rel=1e-9)


@pytest.mark.parametrize(("side_mm", "files"), [(0.03, 400), (0.0, 100)])
def test_a_campaign_of_readings_like_these_has_the_noise_told_of_them(side_mm, files):
    """Over many files, unbalanced as people measure: unbiased, with limits that hold in 95 %."""
    from kinacc.checks.repeatability import AXES, limits, noise_of, parts

    rng = np.random.default_rng(2)
    truth, held, sizes = 0.02**2 + 0.05**2 + side_mm**2, 0, []
    side = np.repeat(np.arange(30), 4)
    visit = np.cumsum(np.r_[1, rng.random(119) < 0.7] | np.r_[1, np.diff(side)]) - 1
    for _ in range(files):
        shift = rng.normal(size=(30, 3)) * side_mm
        off = rng.normal(size=(visit[-1] + 1, 3)) * 0.05
        at = shift[side] + off[visit] + rng.normal(size=(120, 3)) * 0.02
        read = pd.DataFrame({"pose": side // 2, "side": side, "visit": visit})
        found = noise_of(parts(read.join(pd.DataFrame(at, columns=AXES))), np.zeros(3))
        size = np.trace(found.covariance_mm2) / 3.0
        sizes.append(size)
        low, high = limits(np.sqrt([size]), found.freedom)
        held += bool(low[0] ** 2 <= truth <= high[0] ** 2)
    assert np.mean(sizes) == pytest.approx(truth, rel=0.03)
    assert 0.92 * files <= held <= 0.98 * files


def test_poses_that_scatter_differently_are_found_as_by_bartlett(tmp_path):
    rng = np.random.default_rng(5)
    position = 0.05 * rng.normal(size=(5, 12, 3))
    result = estimated(tmp_path / "alike.csv", visits(position))
    centred = position - position.mean(axis=1, keepdims=True)
    root = np.linalg.cholesky(np.einsum("pvi,pvj->ij", centred, centred) / 55.0)
    white = np.linalg.solve(root, centred.reshape(-1, 3).T).T.reshape(5, 12, 3)
    # Bartlett's statistic is that of five samples of 34 numbers with these variances.
    numbers = rng.normal(size=(5, 34))
    numbers = scipy.stats.zscore(numbers, axis=1, ddof=1)
    numbers *= np.sqrt(np.sum(white**2, axis=(1, 2)) / 33.0)[:, None]
    wanted = scipy.stats.bartlett(*numbers).pvalue
    assert result["poses_equal_probability"] == pytest.approx(wanted, rel=1e-6)
    assert result["poses_differ"] is None
    position[4] *= 4.0
    result = estimated(tmp_path / "differ.csv", visits(position))
    assert result["poses_equal_probability"] < 1e-6
    assert "P4" in result["poses_differ"]


def test_axes_that_differ_make_a_covariance(tmp_path):
    rng = np.random.default_rng(6)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    position = (rng.normal(size=(20, 3, 3)) * (0.01, 0.01, 0.1)) @ turn.T
    noise = estimated(tmp_path / "axes.csv", visits(position))["noise"]
    assert not noise["is_even"]
    pooled = sum(np.cov(pose.T, ddof=1) for pose in position) / 20.0
    np.testing.assert_allclose(noise["covariance_mm2"], pooled, rtol=1e-6)
    assert noise["freedom"] == pytest.approx(40.0)


def test_readings_the_instrument_rounds_away_have_the_noise_of_the_rounding(tmp_path):
    noise = np.random.default_rng(8).normal(size=(20, 3, 3)) * (0.3, 0.01, 0.01)
    position = 5.0 * np.arange(20)[:, None, None] + 0.5 * np.round(noise)
    result = estimated(tmp_path / "steps.csv", visits(position))
    assert result["resolution_mm"][0] == pytest.approx(0.5)
    assert min(result["std_mm"]) == pytest.approx(5.0 / np.sqrt(12.0))
    assert any(result["noise"]["rounded"])


def test_rows_of_one_pose_after_another_are_asked_about(tmp_path):
    rows = visits(np.random.default_rng(3).normal(size=(2, 5, 3))).drop(columns="visit")
    path = tmp_path / "rows.csv"
    result = estimated(path, rows, "--rows", "visits")
    assert result["noise"]["freedom"] == pytest.approx(24.0)
    stays = estimated(path, rows, "--rows", "stays")
    assert stays["noise"] is None
    np.testing.assert_allclose(stays["instrument_std_mm"], result["std_mm"], rtol=0.5)
    call("repeatability", path, code=2)


@pytest.mark.parametrize(
    ("header", "stamps", "hours"),
    [
        ("time", [f"2026-05-04T08:0{each}:00" for each in range(5)], 4 / 60),
        ("time_s", [3600 * each for each in range(5)], 4.0),
        ("time_min", [60 * each for each in range(5)], 4.0),
    ],
)
def test_the_time_at_a_pose_is_known_from_several_columns(tmp_path, header, stamps, hours):
    read = visits(FIVE[None], **{header: stamps})
    # A pose that is read once has no time between its readings.
    read = pd.concat([read, *(read.tail(1).assign(pose=name) for name in ("once", "too"))])
    result = estimated(tmp_path / "time.csv", read)
    assert result["hours_at_a_pose"] == pytest.approx(hours)


BAD = """pose,visit,side,time,target,x_mm,y_mm,z_mm
A,1,left,noon,m1,1,2,3
A,1,left,12:00:00,m2,1,zwei,3
,2,right,12:01:00,m1,1,2,1e9
"""


@pytest.mark.parametrize(
    ("content", "problems"),
    [
        (BAD, 4),
        ("pose,visit,x_mm,y_mm,z_mm\n" + "A,{},0.123456789,5.123456789,7.123456789\n" * 9, 1),
        ("pose,x_mm,y_mm,z_mm\nA,1,2,3\nB,4,5,6\n", 1),
        ("x_mm,y_mm,z_mm\n1,2,3\n4,5,6\n", 1),
    ],
)
def test_problems_of_a_file_are_listed_together(tmp_path, content, problems):
    file = tmp_path / "bad.csv"
    file.write_text(content.format(*range(9)))
    assert len(answer("repeatability", file, code=2)["problems"]) == problems
