"""What a campaign says of how near its bounds are, and how near they could be."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
from command_line import call

from kinacc.assess.attainable import width_limits
from kinacc.assess.simulate import carry_on
from kinacc.campaign import folder as folders
from kinacc.campaign import nearness
from kinacc.campaign.reading import Reading
from kinacc.campaign.state import restore


@pytest.fixture
def measured(make_plan, make_world):
    """A campaign on disk or not, with so many readings of the world."""

    def make(readings, points=40, budget=120):
        plan = make_plan(points=points, budget=budget)
        world = make_world(plan)
        state = restore(plan, [])
        taken = []

        def read(row, visit):
            reading = world.reading_mm(row, visit)
            point = int(state.rows[row])
            where = plan.points.modelled_mm[point] + reading
            taken.append(Reading(point, where, "tracker"))
            return reading

        carry_on(plan.assessor.begin(plan.candidates(state.rows)), read, limit=readings)
        return plan, [folders.readings_entry(taken)]

    return make


def test_a_finished_campaign_is_told_what_more_skill_would_have_saved(measured, errors_mm):
    plan, entries = measured(120)
    state = restore(plan, entries)
    sizes = np.linalg.norm(errors_mm(40), axis=1)
    true = width_limits(sizes, 0.05, len(state.told), 0.05)
    for each in nearness.as_facts(state):
        assert each["sizes"] == "estimated"
        assert each["attainable_mm"] == pytest.approx(true.attainable_mm, rel=0.15)
        assert each["proven_mm"] == pytest.approx(true.proven_mm, rel=0.15)
        assert each["lower_mm"] == pytest.approx(true.lower_mm, rel=1e-3)
    head, now, known, proven = nearness.in_words(state)
    shown, said = nearness.as_facts(state)[1], state.statements()[1]
    assert head == "how near the bounds are (all candidates, 120 readings):"
    assert f"upper bound {said.upper_mm - said.value_mm:.3f} mm above the estimate" in now
    assert f"lower bound {said.value_mm - said.lower_mm:.3f} mm below" in now
    assert f"{shown['attainable_mm']:.3f} mm above, {shown['lower_mm']:.3f} mm below" in known
    assert f"nearer than: {shown['proven_mm']:.3f} mm above" in proven
    assert "(estimated)" in known
    assert "(estimated)" in proven


def test_a_line_tells_two_figures_at_most_and_fits_a_screen(measured):
    plan, entries = measured(120)
    lines = nearness.in_words(restore(plan, entries))
    assert len(lines) == 4
    for line in lines:
        assert len(re.findall(r"\d+\.\d+", line)) <= 2
        assert len(line) <= 100


def test_nothing_is_told_of_bounds_that_are_not_stated(measured):
    plan, entries = measured(3)
    state = restore(plan, entries)
    assert nearness.in_words(state) == []
    assert all(math.isnan(each["attainable_mm"]) for each in nearness.as_facts(state))
    assert nearness.in_words(restore(plan, [])) == []


def test_status_report_and_page_say_the_same(begun):
    folder = begun("--noise-mm", "0.05", "--frame", "base", points=12, budget=20)
    rng, errors = np.random.default_rng(3), {}
    file = folder.parent / "readings.csv"
    while rows := json.loads(call("campaign", "next", folder, "--all", "--json").stdout).get(
        "rows"
    ):
        text = ["pose,x_mm,y_mm,z_mm"]
        for row in rows:
            error = errors.setdefault(row["pose"], rng.normal(0.0, 0.3, 3))
            at = [row[f"expected_{axis}_mm"] for axis in "xyz"] + error + rng.normal(0.0, 0.05, 3)
            text.append(",".join(map(str, [row["pose"], *at])))
        file.write_text("\n".join(text) + "\n")
        assert call("campaign", "record", folder, file).exit_code == 0
    status = call("campaign", "status", folder)
    lines = status.output.splitlines()
    (first,) = [at for at, each in enumerate(lines) if each.startswith("how near")]
    head, *told = lines[first : first + 4]
    limits = json.loads(call("campaign", "status", folder, "--json").stdout)["limits"]
    assert [each["target"] for each in limits] == ["measured", "candidates"]
    assert f"{limits[1]['attainable_mm']:.3f} mm" in told[1]
    page = folder.parent / "page.html"
    done = call("campaign", "report", folder, "--page", page)
    assert done.exit_code == 0, done.output
    listed = "\n".join([f"- {head}", *(f"  - {each.strip()}" for each in told)])
    assert listed in (folder / "report" / "report.md").read_text()
    for each in (head, *told):
        assert each.strip()[1:] in page.read_text()
