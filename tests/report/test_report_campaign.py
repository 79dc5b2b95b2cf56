"""A campaign's page and section: what is promised, of whom, and when nothing is."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import matplotlib.text
import numpy as np
import pytest

from kinacc.assess.statement import CANDIDATES
from kinacc.campaign import begin, folder, journal, report, words
from kinacc.campaign.folder import Opened
from kinacc.campaign.instrument import instruments
from kinacc.campaign.plan import Limits, assessor_of
from kinacc.campaign.reading import Reading
from kinacc.deployment.planning import spread
from kinacc.deployment.record import nominal
from kinacc.figures.campaign import draw
from kinacc.kinematics import robot as robots
from kinacc.report import page
from kinacc.report.campaign import campaign_page, markdown, section

TRUE_MM = 0.2


def measured(
    texts=("tracker=0.05",), points=12, budget=16, readings=99, noise_mm=0.05, tolerance_mm=None,
    extra=(), names=None, mean_mm=TRUE_MM, off_mm=lambda number: 0.0, **settings,
):  # fmt: skip
    """A campaign of an arm whose errors are known, with its state and tables."""
    arm = nominal(robots.load("mh180"))
    found = begin.points_of(
        arm, spread(arm.robot, points), names or [f"p{i}" for i in range(points)]
    )
    limits = Limits(np.deg2rad(0.02), 10.0, tolerance_mm)
    about = {"robot": "mh180", "calibration": "cell 3", "model": "dh", "point": "tool",
             "candidates": "drawn", "kinacc_version": "0"}  # fmt: skip
    plan = begin.plan_of(
        arm, found, assessor_of("search_and_confirm", {"measurements": budget, **settings}),
        instruments(texts, "base"), limits, 3, np.zeros(6), about,
    )  # fmt: skip
    rng, true = np.random.default_rng(4), np.random.default_rng(5).normal(0.0, mean_mm, (points, 3))
    rows = plan.visiting(frozenset())
    asking, entries = plan.assessor.begin(plan.candidates(rows)), []
    while len(entries) < readings and (row := asking.next()) is not None:
        seen = true[rows[row]] + rng.normal(0.0, noise_mm, 3) + off_mm(len(entries))
        used = plan.instruments[len(entries) % len(plan.instruments)]
        asking.record(row, seen, used.covariance_mm2)
        at = Reading(int(rows[row]), plan.points.modelled_mm[rows[row]] + seen, used.name)
        entries.append(folder.readings_entry([at]))
    journal_ = journal.Journal((*entries, *extra), "cd", (), 0)
    campaign = Opened(Path("check"), plan, journal_, "ab")
    state, tables = report.tables(campaign)
    return SimpleNamespace(opened=campaign, state=state, tables=tables)


@pytest.fixture(scope="module")
def whole():
    return measured(tolerance_mm=2.0)


def first_of(campaign):
    return campaign_page(campaign.opened, campaign.state, campaign.tables).first


def note(first, name):
    return " ".join(first.notes.get(name, ()))


def test_the_first_sentence_is_a_promise_with_its_odds_its_poses_and_its_conditions(whole):
    upper = whole.state.statements()[0].upper_mm
    first = first_of(whole)
    assert first.answers[0] == (
        "By a procedure whose bound is right in 95 of 100 campaigns, none of these 12 candidates "
        f"is off by more than {upper:.3f} mm, if the noise is at most 0.05 mm per axis and nothing "
        "moved (base, tool, instrument)."
    )
    assert first.badge == ("MODEL WITHIN 2 mm", False)
    assert "This is the error of the model" in first.answers[-1]
    assert "these 12 candidates (drawn)" in note(first, "VALID")


def test_a_tolerance_below_the_lower_bound_is_a_warning():
    first = first_of(measured(tolerance_mm=0.1))
    assert first.badge == ("MODEL BEYOND 0.1 mm", True)
    assert "reject" in first.answers[-2]


def test_two_instruments_are_named_with_the_noise_of_each():
    first = first_of(measured(("tracker=0.05", "camera=0.06")))
    assert "as stated (tracker: 0.05 mm per axis; camera: 0.06 mm per axis)" in first.answers[0]


def test_a_campaign_just_begun_promises_nothing_and_asks_for_the_next_point():
    campaign = measured(readings=3)
    first = first_of(campaign)
    assert first.badge == ("NO BOUND YET", True)
    assert "No upper bound" in first.answers[0]
    assert not re.search(r"\d+ of \d+ campaigns|confidence", " ".join(first.answers))
    label = campaign.state.plan.points.label[campaign.state.asked]
    assert f"point {label}; 13 readings are left" in note(first, "NEXT")
    assert "kinacc campaign next check" in note(first, "NEXT")


def test_readings_that_scatter_more_than_stated_take_the_promise_back():
    campaign = measured(points=8, budget=60, noise_mm=0.4)
    first = first_of(campaign)
    assert first.badge == ("NO BOUND", True)
    assert "times as much as the noise stated" in first.answers[0]
    assert "So no bound is stated." in first.answers
    assert not any("By a procedure" in each for each in first.answers)
    assert {row["right"] for row in first.tables[0].rows} == {None}
    assert "new campaign" in note(first, "NEXT")


def test_a_drift_that_was_found_asks_for_what_moved_and_not_for_more_readings():
    drifts = measured(points=40, budget=100, references=20, off_mm=lambda n: [4e-3 * n, 0, 0])
    first = first_of(drifts)
    assert first.badge == ("NO BOUND", True)
    assert "The reference poses show a drift of 0.4" in first.answers[0]
    assert "find what moved" in note(first, "NEXT").lower()


def test_a_reading_that_went_wrong_is_named_on_the_first_screen():
    wrong = measured(points=40, budget=100, off_mm=lambda number: 0.8 * (number == 70))
    first = first_of(wrong)
    assert "Reading 71 at point" in first.answers[1]
    assert "stated too small" not in " ".join(first.answers)
    assert "strike" in note(first, "NEXT")


def test_a_bound_on_all_but_some_says_so_in_promise_and_table():
    first = first_of(measured(points=60, budget=40, tolerance_mm=2.0))
    assert "no more than 3 of these 60 candidates are off" in first.answers[0]
    assert [row["of"] for row in first.tables[0].rows][-1] == "all but 3 candidates"
    assert first.badge == ("UNDECIDED", True)


def test_picture_and_conformity_say_how_many_a_bound_leaves_out():
    found = measured(points=60, budget=40, tolerance_mm=2.0)
    about = found.tables["campaign_bounds"]
    left = np.asarray(about["excepted"])
    assert (left > 0).any()
    drawn = draw(found.tables["campaign_points"], about, len(found.state.plan.route))
    labels = [each.get_text() for each in drawn.findobj(matplotlib.text.Text)]
    assert "bounds, all but 3 candidates" in labels
    text = markdown(found.opened, found.state, found.tables, "picture")
    assert "- all but 3 candidates: **undecided**" in text
    assert "all candidates" not in text.split("## Conformity")[1].split("##")[0]


def test_a_promise_names_what_was_asked_to_be_guarded_and_allowed_for():
    asked = {"error_of": "visit", "arm_mm": 0.03, "allowance_mm": 0.02, "wrong_rate": 0.01}
    promise = first_of(measured(points=40, budget=100, **asked)).answers[0]
    assert "right in 94 of 100 campaigns" in promise
    assert "in more than 5% of its future visits" in promise
    assert "what no repeat sees is at most 0.02 mm" in promise
    assert "at most 1.0% of the readings are wrong" in promise


def test_a_bound_as_small_as_the_noise_is_not_promised_for_less_noise():
    first = first_of(measured(("tracker=0.5",), points=4, budget=40, noise_mm=0.5))
    upper = float(re.search(r"more than ([\d.]+) mm", first.answers[0])[1])
    assert upper < 1.5
    assert "the noise is exactly 0.5 mm per axis" in first.answers[0]


def section_of(campaign):
    return section(campaign.opened, campaign.state, campaign.tables)


def test_every_point_with_its_limits_is_in_a_table(whole):
    found = section_of(whole).values
    assert sorted(row["point"] for row in found["every"]) == sorted(f"p{i}" for i in range(12))
    largest = found["largest"][0]["error_mm"]
    assert largest == np.nanmax(whole.tables["campaign_points"]["error_mm"])
    assert found["whom"] == "these 12 candidates (drawn)"


def test_what_was_struck_stands_there_with_its_reason_as_text():
    reason = '<script>alert("x")</script>'
    entries = (folder.strike_entry(2, reason),)
    campaign = measured(readings=6, extra=entries, names=[f'<b>"{i}' for i in range(12)])
    (row,) = section_of(campaign).values["struck"]
    assert (row["reading"], row["struck"]) == (2, reason)
    text = page.html(campaign_page(campaign.opened, campaign.state, campaign.tables))
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert" in text
    assert '<b>"' not in text


def test_a_point_left_out_is_told_with_its_reason_and_no_candidate_any_more():
    unread = measured(readings=6).state.rows[-1]
    campaign = measured(readings=6, extra=(folder.leave_out_entry(int(unread), "behind a <b>"),))
    (row,) = section_of(campaign).values["left_out"]
    label = campaign.state.plan.points.label[unread]
    assert (row["point"], row["left_out"]) == (label, "behind a <b>")
    first = first_of(campaign)
    assert "these 11 candidates" in note(first, "VALID")
    assert "was left out: behind a <b>" in note(first, "OPEN")


def test_noise_as_stated_is_seen_as_one_and_fourfold_noise_as_four():
    def rms(noise_mm):
        campaign = measured(points=4, budget=120, noise_mm=noise_mm)
        (row,) = section_of(campaign).values["instruments"]
        return row["scatter"]

    assert rms(0.05) == pytest.approx(1.0, abs=0.15)
    assert rms(0.2) == pytest.approx(4.0, abs=0.6)


def test_an_estimate_for_candidates_that_are_not_all_measured_is_said_to_be_low(whole):
    part = measured(points=40, budget=30)
    left = 40 - len({each.reading.point for each in part.state.told})
    assert left > 0
    low = f"The estimate for all candidates tends to be too low: {left} of 40 are not measured."
    for said in part.state.statements():
        assert words.statement(said, part.state).endswith(low) == (said.target == CANDIDATES)
    first = first_of(part)
    assert sum(text.count(low) for text in first.answers) == 1
    assert markdown(part.opened, part.state, part.tables, "picture").count(low) == 1
    every = markdown(whole.opened, whole.state, whole.tables, "picture")
    assert "tends to be too low" not in every
