"""A campaign in a folder, as tests of its commands use it: the arm at it, and what it says."""

from __future__ import annotations

from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
from command_line import answer, call

from kinacc.assess.world import carry_on, drawn_world, key_of
from kinacc.campaign import begin
from kinacc.campaign import folder as campaigns
from kinacc.campaign.campaign import Campaign
from kinacc.campaign.folder import Opened
from kinacc.campaign.instrument import instruments
from kinacc.campaign.plan import Limits, Plan, assessor_of
from kinacc.campaign.state import Reading, Readings
from kinacc.deployment.planning import spread
from kinacc.deployment.record import nominal
from kinacc.kinematics import robot as robots

SIGMA_MM = 0.05


@cache
def mh180():
    """The nominal arm of all plans."""
    return nominal(robots.load("mh180"))


def make_plan(
    assessor="search_and_confirm", points=40, budget=40, texts=("tracker=0.05",), frame="base",
    tolerance_mm=None, names=None, **settings,
) -> Plan:  # fmt: skip
    """A plan of a campaign over ``points`` candidates."""
    arm, labels = mh180(), names or [f"p{i}" for i in range(points)]
    joints = spread(arm.robot, points)
    found = begin.points_of(arm, joints, labels, np.sign(joints).astype(np.int8))
    chosen = assessor_of(assessor, {"measurements": budget, **settings})
    used = instruments(texts, frame)
    limits = Limits(np.deg2rad(0.02), 10.0, tolerance_mm)
    return begin.plan_of(arm, found, chosen, used, limits, None, "drawn", 3)


def readings_of(plan, read, left_out=frozenset(), limit=None):
    """Readings in the order of the assessor's requests; ``read(row, visit)`` has their errors."""
    rows, readings = plan.visiting(left_out), []

    def noted(row, visit):
        error, point = read(row, visit), int(rows[row])
        position = plan.points.modelled_mm[point] + error
        readings.append(Reading(point, position, plan.instruments[0].name))
        return error

    carry_on(plan.assessor.begin(plan.candidates(rows)), noted, limit=limit)
    return readings


def entry_of(readings):
    """The entry of a journal with these readings."""
    return Readings(readings=readings).model_dump(exclude_none=True)


def opened(plan, read, limit=None, extra=()):
    """A campaign with readings of ``read(row, visit)`` and further entries in its journal."""
    entries = entry_of(readings_of(plan, read, limit=limit)), *extra
    return Opened(Path("check"), plan, campaigns.Journal(entries, "ab", (), 0))


def errors_mm(points):
    """True errors (m, 3) of candidates, one of them large."""
    errors = np.random.default_rng(11).normal(size=(points, 3)) * 0.2
    errors[7] = (0.9, -0.6, 0.5)
    return errors


def world_of(plan, left_out=frozenset(), sigma_mm=SIGMA_MM):
    """All readings one campaign could take, rows as the assessor numbers them."""
    errors = errors_mm(len(plan.points))[plan.visiting(left_out)]
    return drawn_world(errors, sigma_mm, key_of(5), 400)


class Arm:
    """The arm at the campaign: its errors are known here, and its readings are those of a world."""

    def __init__(self, folder, sigma_mm=SIGMA_MM):
        self.plan = campaigns.open_(folder).plan
        self.world = world_of(self.plan, sigma_mm=sigma_mm)
        self.rows = self.plan.visiting(frozenset()).tolist()
        self.reads = Counter()

    def seen_mm(self, label):
        """What the instrument reads next at a point."""
        point = self.plan.points.number(label)
        reading_mm = self.world.reading_mm(self.rows.index(point), self.reads[label])
        self.reads[label] += 1
        return self.plan.points.modelled_mm[point] + reading_mm

    def position(self, label):
        """The same as text."""
        return ",".join(map(repr, self.seen_mm(label).tolist()))


def visit_of(folder, std_mm):
    """A table of readings of the first visit, this far from where they are expected."""
    visit = Campaign(folder).visit()
    table = visit[["pose"]].copy()
    off_mm = np.random.default_rng(5).normal(0.0, std_mm, (3, len(visit)))
    for axis, off in zip("xyz", off_mm, strict=True):
        table[f"{axis}_mm"] = visit[f"expected_{axis}_mm"] + off
    return table


def refusal(*words):
    """The message of a command that must fail."""
    said = call(*words, code=2).output
    assert "Traceback" not in said
    return said


def standing(folder):
    """What status says, without a forecast."""
    return answer("campaign", "status", folder)


def files_of(folder):
    """Everything in a campaign's folder but the empty lock."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "lock"}


def refused(folder, *words):
    """The message of a command that must fail and leave the campaign as it was."""
    before = files_of(folder)
    said = refusal("campaign", *words)
    assert files_of(folder) == before
    return said


def recorded(folder, arm, count):
    """Take the next ``count`` readings, one by one."""
    campaign = Campaign(folder)
    for _ in range(count):
        campaign.add_reading(arm.seen_mm(campaign.next_pose().point))
