"""The page on public robots: what it says is in its table, and the table is what kinacc finds."""

from __future__ import annotations

import csv

import document_public_robots as page
import numpy as np
import public_robots as runs
import pytest


@pytest.fixture(scope="module")
def rows():
    return {row[:4]: row for row in runs.read()}


def test_the_page_is_written_from_its_table():
    written = (page.DOCS / "public-robots.md").read_text(encoding="utf-8")
    assert written == page.text(runs.read()), "run python tools/document_public_robots.py"


@pytest.mark.parametrize("name", ["published_grid.csv", "published_random.csv"])
def test_the_digits_tell_that_a_measured_point_is_target_plus_difference(name):
    lines = (runs.UR5 / name).read_text(encoding="utf-8").splitlines()
    table = np.genfromtxt(lines, delimiter=",", names=True)
    target, dif = (np.stack([table[f"{a}_{part}"] for a in "xyz"]) for part in ("t", "dif"))
    assert np.abs(np.round(target + dif, 6) - (target + dif)).max() < 1e-9
    assert np.mean(np.abs(np.round(target - dif, 6) - (target - dif)) < 1e-9) < 0.05


def test_the_thesis_figure_before_is_that_of_the_published_differences():
    lines = (runs.UR5 / "published_random.csv").read_text(encoding="utf-8").splitlines()
    table = np.genfromtxt(lines, delimiter=",", names=True)
    sizes = np.linalg.norm([table[f"{axis}_dif"] for axis in "xyz"], axis=0)
    assert f"{sizes.mean():.3f}" in page.PAGE
    assert sizes.mean() == pytest.approx(page.BEFORE_MM, rel=1e-3)


def test_both_files_of_series_d_hold_the_same_readings():
    def table(name: str, **how: str) -> list[dict[str, str]]:
        text = (runs.UR10 / name).read_text(encoding="utf-8")
        return list(csv.DictReader(text.splitlines(), **how))

    ours, published = table("series_D.csv"), table("published_series_D.csv", delimiter=";")
    assert len(ours) == len(published) == 632
    theirs = [[row[f"measurement_{axis}"].replace(",", ".") for axis in "xyz"] for row in published]
    np.testing.assert_array_equal(
        [[float(row[f"{axis}_mm"]) for axis in "xyz"] for row in ours], np.array(theirs, float)
    )


def test_base_and_tool_fitted_elsewhere_are_judged_as_those_of_a_run_are(rows):
    """Of the nominal arm nothing but base and tool is fitted: to all readings, or all but a fifth.

    Twelve numbers take hardly anything off hundreds of readings.
    """
    for fitted, judged in (("ur10_b", "ur10_d"), ("ur10_d", "ur10_b")):
        elsewhere = rows[fitted, judged, "all", "nominal"]
        home = rows[judged, judged, "all", "nominal"]
        assert elsewhere.readings == home.readings
        for name in ("mean_mm", "rms_mm"):
            seen, held_out = getattr(elsewhere, name), getattr(home, name)
            assert 0.99 * held_out < seen < held_out
