"""A campaign's page and section: verdict, population, tables, and text of strangers as text."""

from __future__ import annotations

import matplotlib.text
import numpy as np
import pytest
from campaign_on_disk import make_plan, opened

from kinacc.campaign import report
from kinacc.figures.campaign import draw_bounds, draw_readings
from kinacc.report import page
from kinacc.report.campaign import campaign_page, markdown, section


def of_plan(readings=99, noise_mm=0.05, extra=(), **settings):
    """A campaign of an arm whose errors are known; ``settings`` of its plan."""
    plan = make_plan(**{"points": 12, "budget": 16, **settings})
    rng, rows = np.random.default_rng(4), plan.visiting(frozenset())
    true = np.random.default_rng(5).normal(0.0, 0.2, (len(rows), 3))[rows]
    return opened(plan, lambda row, _: true[row] + rng.normal(0.0, noise_mm, 3), readings, extra)


def measured(**change):
    """A campaign and its tables."""
    campaign = of_plan(**change)
    return campaign, report.tables(campaign)


@pytest.mark.parametrize(
    ("change", "badge"),
    [
        ({"tolerance_mm": 2.0}, ("MODEL WITHIN 2 mm", False)),
        ({"tolerance_mm": 0.1}, ("MODEL BEYOND 0.1 mm", True)),
        ({"readings": 3}, ("NO BOUND YET", True)),
        ({}, ("tolerance: none set", False)),
        ({"points": 8, "budget": 60, "noise_mm": 0.4}, ("NO BOUND", True)),
        ({"points": 60, "budget": 40, "tolerance_mm": 2.0}, ("UNDECIDED", True)),
    ],
    ids=str,
)
def test_the_badge_is_the_verdict(change, badge):
    campaign, tables = measured(**change)
    page = campaign_page(campaign, section(campaign, tables))
    assert page.badge == badge
    if badge[0] == "NO BOUND":
        assert {row["sure"] for row in page.rows} == {""}
    if campaign.state.requested is not None:
        assert "kinacc campaign next check" in page.notes["NEXT"]


def test_picture_and_conformity_have_the_number_of_excepted_candidates():
    campaign, tables = measured(points=60, budget=40, tolerance_mm=2.0)
    part = section(campaign, tables)
    values = part.rows()
    assert len(values["every"]) == values["measured"] == 36
    points, about = tables["campaign_points"], tables["campaign_bounds"]
    assert values["largest"][0]["error_mm"] == np.nanmax(points["error_mm"])
    assert (np.asarray(about["excepted"]) > 0).any()
    drawn = draw_bounds(points, about, len(campaign.plan.route))
    shown = drawn.axes[1].lines[0].get_ydata()
    np.testing.assert_array_equal(shown, about["upper_mm"][about["target"] == "measured"])
    readings = tables["campaign_readings"]
    shown = draw_readings(readings).axes[0].lines[0].get_ydata()
    np.testing.assert_array_equal(shown, readings["error_mm"])
    labels = [each.get_text() for each in drawn.findobj(matplotlib.text.Text)]
    assert "bounds, all but 3 candidates" in labels
    assert "all but 3 of these 60 candidates: **undecided**" in markdown(part, "picture")


def test_reasons_and_names_of_strangers_are_text():
    reason, names = '<script>alert("x")</script>', [f'<b>"{i}' for i in range(12)]
    unread = int(of_plan(readings=6).state.rows[-1])
    entries = (
        {"kind": "strike", "reading": 2, "reason": reason},
        {"kind": "leave_out", "point": unread, "reason": "behind a <b>"},
    )
    campaign, tables = measured(readings=6, extra=entries, names=names)
    part = section(campaign, tables)
    values, shown = part.rows(), campaign_page(campaign, part)
    (struck,), (left_out,) = values["struck"], values["left_out"]
    assert (struck["reading"], struck["struck"]) == (2, reason)
    assert (left_out["point"], left_out["reason"]) == (names[unread], "behind a <b>")
    text = page.html(shown, {})
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert" in text
    assert '<b>"' not in text
