"""One file of readings that is added to all day and recorded again and again."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import call

from kinacc.campaign.campaign import Campaign

HEAD = "pose,x_mm,y_mm,z_mm"


class Day:
    """A campaign at the arm and the file its readings are added to."""

    def __init__(self, folder, file):
        self.folder, self.file = folder, file
        self.visit = Campaign(folder).visit().to_dict("records")
        self.rng = np.random.default_rng(3)

    def row(self, place):
        """A row of a new reading at a point of the visit."""
        point = self.visit[place]
        seen = [point[f"expected_{axis}_mm"] + self.rng.normal(0.1, 0.05) for axis in "xyz"]
        return ",".join([point["pose"], *(f"{each:.4f}" for each in seen)])

    def record(self, rows, *words):
        """Write the rows and record the file."""
        self.file.write_text("\n".join([HEAD, *rows]) + "\n")
        return call("campaign", "record", self.folder, self.file, *words)

    def takes(self, rows, new, *words):
        """Record rows of which so many are new."""
        before = self.taken()
        done = self.record(rows, *words)
        assert done.exit_code == 0, done.output
        assert f"Recorded {new} reading" in done.output
        assert self.taken() == before + new
        return done.output

    def refuses(self, rows, *words):
        """The message of rows of which none may be taken."""
        journal = self.folder / "readings.jsonl"
        before = journal.read_bytes()
        done = self.record(rows, *words)
        assert done.exit_code == 2, done.output
        assert journal.read_bytes() == before
        return done.output

    def taken(self):
        return len({item.reading.digits for item in Campaign(self.folder).state.readings})

    def strike(self, number):
        Campaign(self.folder).strike(number, "not seated")


@pytest.fixture
def day(tmp_path, begun):
    devices = ("--instrument", "tracker=0.05", "--instrument", "camera=0.1")
    folder = begun(*devices, "--frame", "base", points=12, budget=40)
    return Day(folder, tmp_path / "readings.csv")


def test_new_rows_are_taken_and_old_ones_are_told_as_known(day):
    rows = [day.row(place) for place in range(6)]
    day.takes(rows[:2], 2)
    assert "2 rows were recorded before" in day.takes(rows[:3], 1)
    content = json.loads(day.record(rows, "--json").stdout)
    assert (content["numbers"], content["known"]) == ([4, 5, 6], [1, 2, 3])
    assert day.taken() == 6
    assert "no new row" in day.refuses(rows)
    assert "no new row" in day.refuses(rows, "--again")


@pytest.mark.parametrize(("changed", "appended"), [(0, 0), (1, 1), (2, 3)])
def test_an_old_row_that_was_changed_is_asked_about(day, changed, appended):
    rows = [day.row(place) for place in range(6)]
    for count in (1, 2, 3):  # one row at a time, each its own entry of the journal
        day.takes(rows[:count], 1)
    now = rows[: 3 + appended]
    pose, x, *others = now[changed].split(",")
    now[changed] = ",".join([pose, f"{float(x) + 0.02:.4f}", *others])
    assert f"reading {changed + 1} any more" in day.refuses(now)
    day.strike(changed + 1)
    day.takes(now, 1 + appended)
    assert day.taken() == 3 + appended


def test_rows_that_repeat_to_the_last_digit_are_asked_about_and_can_be_taken(day):
    rows = [day.row(place) for place in range(3)]
    day.takes(rows[:2], 2)
    now = [*rows, rows[2]]
    said = day.refuses(now)
    assert "line 5: equals" in said
    assert "line 2: " not in said
    assert "Recorded 2 reading" in day.record(now, "--again").output
    assert "no new row" in day.refuses(now, "--again")
    assert len(Campaign(day.folder).state.readings) == 4


def test_a_row_whose_reading_was_struck_does_not_come_back(day):
    rows = [day.row(place) for place in range(3)]
    day.takes(rows[:2], 2)
    day.strike(2)
    day.takes(rows, 1)
    assert day.taken() == 2
