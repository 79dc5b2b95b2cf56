"""A campaign in a folder, as tests of its commands use it: the arm at it, and what it says."""

from __future__ import annotations

import json

import numpy as np
from command_line import call

from kinacc.assess.world import carry_on, drawn_world, key_of
from kinacc.campaign import folder as campaigns
from kinacc.campaign.state import Reading, Readings

SIGMA_MM = 0.05


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


class Arm:
    """The arm at the campaign: its errors are known here, and its readings are those of a world."""

    def __init__(self, folder, sigma_mm=SIGMA_MM):
        self.plan = campaigns.open_(folder).plan
        rows = self.plan.visiting(frozenset())
        errors = np.random.default_rng(11).normal(size=(len(rows), 3)) * 0.2
        errors[5] = (0.9, -0.6, 0.5)
        self.world = drawn_world(errors[rows], sigma_mm, key_of(5), 200)
        self.row = {int(point): row for row, point in enumerate(rows)}
        self.reads = np.zeros(len(rows), dtype=int)

    def position(self, label):
        """What the instrument reads next at a point, as text."""
        point = self.plan.points.number(label)
        row = self.row[point]
        seen = self.plan.points.modelled_mm[point] + self.world.reading_mm(row, self.reads[row])
        self.reads[row] += 1
        return ",".join(repr(float(each)) for each in seen)


def standing(folder):
    """What status says, without a forecast."""
    return json.loads(call("campaign", "status", folder, "--json").stdout)


def files_of(folder):
    """Everything in a campaign's folder but the empty lock."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "lock"}


def refused(folder, *words):
    """The message of a command that must fail and leave the campaign as it was."""
    before = files_of(folder)
    done = call("campaign", *words, code=2)
    assert "Traceback" not in done.output
    assert files_of(folder) == before
    return done.output


def recorded(folder, arm, count):
    """Take the next ``count`` readings through one file per reading of the arm."""
    for _ in range(count):
        with campaigns.writing(folder) as opened:
            state = opened.state
            label = arm.plan.points.label[state.requested]
            seen = [float(each) for each in arm.position(label).split(",")]
            taken = Reading(state.requested, np.array(seen), arm.plan.instruments[0].name)
            opened.write(Readings(readings=[taken]))
