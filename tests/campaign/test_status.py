"""The status of a campaign: bounds with their limits, verdicts, and texts with their conditions."""

from __future__ import annotations

import math
import re
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from campaign_on_disk import errors_mm, make_plan, opened, world_of

import kinacc
from kinacc.assess.attainable import width_limits
from kinacc.campaign.status import ADVICE, REASONS, status
from kinacc.report.rendering import lines


def measured(readings=999, points=40, budget=120, off_mm=None, exact=None, **settings):
    """The status of a campaign with so many readings of a world."""
    plan = make_plan(points=points, budget=budget, **settings)
    world, taken = world_of(plan), count()

    def read(row, visit):
        if exact is not None:
            return exact[row]
        off = off_mm(next(taken)) if off_mm else 0.0
        return world.reading_mm(row, visit) + off

    return status(opened(plan, read, readings))


def test_every_reason_has_a_text_and_no_text_is_left_over():
    sources = (path.read_text() for path in Path(kinacc.__file__).parent.rglob("*.py"))
    codes = {c for text in sources for c in re.findall(r"Reason\(\s*\"(\w+)\"", text)}
    assert set(REASONS) == codes | {"noise_tested", "noise_estimated"}
    assert set(ADVICE) < set(REASONS)


def test_limits_of_a_finished_campaign_are_those_of_the_true_errors():
    found = measured()
    sizes = np.linalg.norm(errors_mm(40), axis=1)
    true = width_limits(sizes, 0.05, 120, 0.05)
    for each in found.bounds:
        assert each.attainable_mm == pytest.approx(true.attainable_mm, rel=0.15)
        assert each.proven_mm == pytest.approx(true.proven_mm, rel=0.15)
        assert each.attainable_lower_mm == pytest.approx(true.attainable_lower_mm, rel=1e-3)
        assert each.lower_mm <= sizes.max() <= each.upper_mm


def test_the_noise_of_three_axes_is_taken_off_the_sizes_that_limits_go_by():
    sizes = np.linspace(0.1, 0.6, 40)
    exact = np.array([[1.0, 2.0, 2.0]]) / 3.0 * np.sqrt(sizes**2 + 3.0 * 0.05**2)[:, None]
    found = measured(readings=40, exact=exact)
    true = width_limits(sizes, 0.05, 40, 0.05)
    for each in found.bounds:
        assert each.attainable_mm == pytest.approx(true.attainable_mm, rel=1e-6)
        assert each.proven_mm == pytest.approx(true.proven_mm, rel=1e-6)


@pytest.mark.parametrize(
    ("tolerance_mm", "verdict"), [(2.0, "accept"), (0.1, "reject"), (1.19, "undecided")]
)
def test_the_verdict_is_the_headline(tolerance_mm, verdict):
    found = measured(tolerance_mm=tolerance_mm)
    bound = found.bound
    assert (found.readings_used, found.points_measured, bound.unmeasured) == (120, 40, 0)
    if verdict == "undecided":
        assert bound.lower_mm < tolerance_mm < bound.upper_mm
    assert bound.verdict == verdict
    headline, *_ = lines("campaign_status.txt", s=found, verbose=False)
    assert headline.startswith(verdict.upper())
    assert f"{tolerance_mm:g} mm" in headline
    if verdict == "accept":
        assert "the nominal model of mh180" in headline
        assert f"upper bound {bound.upper_mm:.3f} mm, 95 % confidence" in headline


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"points": 40, "budget": 100, "references": 20,
          "off_mm": lambda n: np.array([4e-3 * n, 0, 0])}, "drift"),
        ({"points": 40, "budget": 100, "off_mm": lambda n: 0.8 * (n == 70)}, "wrong_readings"),
        ({"points": 8, "budget": 60,
          "off_mm": lambda n: np.random.default_rng(n).normal(0.0, 0.4, 3)}, "scatter"),
    ],
)  # fmt: skip
def test_readings_against_an_assumption_withhold_the_bounds(change, code):
    found = measured(**change, tolerance_mm=5.0)
    assert lines("campaign_status.txt", s=found, verbose=False)[0].startswith("NO BOUND")
    assert found.advice == (ADVICE[code],)
    assert all(math.isnan(each.upper_mm) for each in found.bounds)
    if code == "wrong_readings":
        assert "reading 71 at point" in found.against[1]


def test_bounds_below_the_estimate_are_doubted_with_the_noise():
    found = measured(assessor="single_shot", texts=("tracker=3",), tolerance_mm=5.0)
    assert found.bound.verdict == "undecided"
    assert "noise misstated" in found.bound.doubt
    assert "times as far from the predictions as the stated noise" in found.against[0]


def test_what_was_looked_for_and_not_found_is_noted_with_its_condition():
    found = measured(references=20, noise="estimated", noise_freedom=60)
    assert found.against == ()
    assert "determined by a test with 60 degrees of freedom" in found.assumes
    assert any("no drift and no step" in note for note in found.notes)
