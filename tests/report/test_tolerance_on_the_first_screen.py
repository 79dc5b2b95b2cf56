"""The tolerance of the configuration on the first screen: whose it is, and whether it is kept."""

from __future__ import annotations

import html
import re

import pytest
from command_line import call, small_study
from stages_by_hand import run_stage
from test_report_campaign import measured

from kinacc.calibration.summary import Tolerance
from kinacc.report.campaign_answers import answers


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    base = tmp_path_factory.mktemp("tolerance")
    return small_study(base)


def said(results, tolerance):
    """What the first screen says of a tolerance, after the summary was made with it."""
    config = results.parents[1] / "small.yaml"
    text = config.read_text().partition("tolerance:")[0]
    config.write_text(text + (f"tolerance: {tolerance}\n" if tolerance else ""))
    done = run_stage("summary", "--config", config, "--results", results.parent)
    assert done.exit_code == 0, done.output
    done = call("report", results)
    assert done.exit_code == 0, done.output
    page = (results / "report.html").read_text(encoding="utf-8")
    text = html.unescape(re.sub(r"<[^>]+>", " ", page.partition("<body")[2]))
    return shown(text)


def shown(text):
    """The sentence on the tolerance of a first screen."""
    text = " ".join(text.partition("Error at poses")[0].split())
    return next(each for each in re.split(r"(?<=\.) ", text) if each.startswith("Tolerance"))


@pytest.mark.parametrize(
    ("tolerance", "words"),
    [
        (None, "Tolerance: none set"),
        (
            "{mm: 50, of: mean}",
            "Tolerance 50 mm for the mean error held out (the configuration's): accept, the mean "
            "error held out is",
        ),
        ("{mm: 0.001, of: mean}", "(the configuration's): reject, the mean error held out is"),
        (
            "{mm: 0.001, of: quantile_99}",
            "Tolerance 0.001 mm for the empirical 99 % quantile of the errors held out (the "
            "configuration's): reject, more than 1 % of the errors held out are beyond",
        ),
        ("{mm: 50, of: quantile_99}", "undecided, 80 errors are held out, too few to tell of 1 %"),
        (
            "{mm: 50}",
            "Tolerance 50 mm for the upper bound of a campaign (the configuration's): undecided, "
            "no campaign bounds it",
        ),
    ],
)
def test_the_page_says_whether_the_tolerance_of_the_configuration_is_kept(
    results, tolerance, words
):
    assert words in said(results, tolerance)


def test_the_page_in_a_browser_says_the_same(results):
    told = said(results, "{mm: 1.5, of: mean}")
    done = call("report", results, "--out", results.parent / "page.html")
    assert done.exit_code == 0, done.output
    page = html.unescape((results.parent / "page.html").read_text(encoding="utf-8"))
    assert f'<p class="answer">{told}</p>' in page


def tolerances(own, stated):
    """What is said of tolerances of a campaign with its own, and of the configuration."""
    return [
        each for each in answers(measured(tolerance_mm=own).state, stated) if "olerance" in each
    ]


def test_a_campaign_says_whose_tolerance_it_is_held_to():
    (alone,) = tolerances(2.0, None)
    assert alone.startswith("Tolerance 2 mm for the upper bound of a campaign (the campaign's): ")
    (both,) = tolerances(2.0, Tolerance(2.0, "bound"))
    assert both == alone.replace("the campaign's", "the configuration's and the campaign's")
    own, other = tolerances(2.0, Tolerance(0.001, "bound"))
    assert own == alone
    assert "0.001 mm for the upper bound of a campaign (the configuration's): reject" in other
    assert tolerances(2.0, Tolerance(0.001, "mean")) == [alone]
    assert not tolerances(None, None)
