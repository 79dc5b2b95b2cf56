"""One file of readings that is added to all day and recorded again and again."""

from __future__ import annotations

import pytest
from campaign_on_disk import refused, standing, visit_of
from command_line import answer, call

from kinacc.campaign.campaign import Campaign


class Day:
    """A campaign at the arm and the file its readings are added to."""

    def __init__(self, folder, file):
        self.folder, self.file = folder, file
        self.rows = visit_of(folder, 0.1).round(4)

    def words(self, rows, *more):
        """Write rows of the file; the words of a command that records it."""
        rows.to_csv(self.file, index=False, float_format="%.4f")
        return ("record", self.folder, self.file, *more)

    def takes(self, rows, new, *more):
        """Record rows of which so many are new."""
        before = standing(self.folder)["readings"]
        output = call("campaign", *self.words(rows, *more), code=0).output
        assert f"Recorded {new} reading" in output
        assert standing(self.folder)["readings"] == before + new
        return output

    def refuses(self, rows, *more):
        """The message of rows of which none may be taken."""
        return refused(self.folder, *self.words(rows, *more))

    def strike(self, number):
        Campaign(self.folder).strike(number, "not seated")


@pytest.fixture
def day(tmp_path, begun):
    devices = ("--instrument", "tracker=0.05", "--instrument", "camera=0.1")
    folder = begun(*devices, "--frame", "base", points=12, budget=40)
    return Day(folder, tmp_path / "readings.csv")


def test_new_rows_are_taken_and_old_ones_are_told_as_known(day):
    rows = day.rows[:6]
    day.takes(rows[:2], 2)
    assert "2 rows were recorded before" in day.takes(rows[:3], 1)
    content = answer("campaign", *day.words(rows))
    assert (content["numbers"], content["known"]) == ([4, 5, 6], [1, 2, 3])
    assert "no new reading" in day.refuses(rows)


@pytest.mark.parametrize(("changed", "appended"), [(0, 0), (1, 1), (2, 3)])
def test_an_old_row_that_was_changed_is_asked_about(day, changed, appended):
    for count in (1, 2, 3):  # one row at a time, each its own entry of the journal
        day.takes(day.rows[:count], 1)
    now = day.rows[: 3 + appended].copy()
    now.loc[changed, "x_mm"] += 0.02
    assert f"reading {changed + 1} any more" in day.refuses(now)
    day.strike(changed + 1)
    day.takes(now, 1 + appended)


def test_rows_that_repeat_to_the_last_digit_are_asked_about_and_can_be_taken(day):
    day.takes(day.rows[:2], 2)
    now = day.rows.loc[[0, 1, 2, 2]]
    said = day.refuses(now)
    assert "line 5: equals" in said
    assert "line 2: " not in said
    day.takes(now, 2, "--again")
    assert "no new reading" in day.refuses(now, "--again")


def test_a_row_whose_reading_was_struck_does_not_come_back(day):
    day.takes(day.rows[:2], 2)
    day.strike(2)
    day.takes(day.rows[:3], 1)
