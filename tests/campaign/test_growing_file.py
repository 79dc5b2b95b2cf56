"""One file of readings that is added to all day and recorded again and again."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import call, small_study

HEAD = "pose,x_mm,y_mm,z_mm"


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    """Results of a small synthetic study, made by the workflow's own stages."""
    return small_study(tmp_path_factory.mktemp("study"))


class Day:
    """A campaign at the arm and the file its readings are added to."""

    def __init__(self, folder, calibration):
        self.folder = folder / "a check"
        self.file = folder / "readings.csv"
        done = call("campaign", "start", self.folder, "--calibration", calibration, "--model", "dh",
                    "--drawn", 12, "--budget", 40, "--instrument", "tracker=0.05", "--instrument",
                    "camera=0.1", "--frame", "base")  # fmt: skip
        assert done.exit_code == 0, done.output
        shown = call("campaign", "next", self.folder, "--all", "--json").stdout
        self.visit = json.loads(shown)["rows"]
        self.rng = np.random.default_rng(3)

    def row(self, place):
        """A row of a new reading at a point of the visit."""
        point = self.visit[place]
        seen = [point[f"expected_{axis}_mm"] + self.rng.normal(0.1, 0.05) for axis in "xyz"]
        return ",".join([point["pose"], *(f"{each:.4f}" for each in seen)])

    def record(self, rows, *words, head=HEAD, file=None):
        """Write the rows and record the file."""
        file = file or self.file
        file.parent.mkdir(exist_ok=True)
        file.write_text("\n".join([head, *rows]) + "\n")
        return call("campaign", "record", self.folder, file, *words)

    def takes(self, rows, new, *words, **more):
        """Record rows of which so many are new."""
        before = self.taken()
        done = self.record(rows, *words, **more)
        assert done.exit_code == 0, done.output
        assert f"recorded: {new} readings" in done.output
        assert self.taken() == before + new
        return done.output

    def refuses(self, rows, *words, **more):
        """The message of rows of which none may be taken."""
        journal = self.folder / "readings.jsonl"
        before = journal.read_bytes()
        done = self.record(rows, *words, **more)
        assert done.exit_code == 2, done.output
        assert journal.read_bytes() == before
        return done.output

    def taken(self):
        status = call("campaign", "status", self.folder, "--json", "--simulations", 0)
        return json.loads(status.stdout)["readings"]

    def positions(self):
        lines = (self.folder / "readings.jsonl").read_text().splitlines()
        entries = [json.loads(line)["entry"] for line in lines]
        return [tuple(each["position_mm"]) for entry in entries for each in entry["readings"]]

    def strike(self, number):
        done = call("campaign", "strike", self.folder, number, "--reason", "not seated")
        assert done.exit_code == 0, done.output


@pytest.fixture
def day(tmp_path, calibration):
    return Day(tmp_path, calibration)


def other(row, axis=2, by=0.02):
    """A row with one coordinate changed."""
    cells = row.split(",")
    cells[axis] = f"{float(cells[axis]) + by:.4f}"
    return ",".join(cells)


def test_new_rows_are_taken_and_old_ones_are_told_as_known(day):
    rows = [day.row(place) for place in range(6)]
    assert "known" not in day.takes(rows[:2], 2)
    said = day.takes(rows[:3], 1)
    assert "known: 2 rows recorded before, as readings 1 to 2" in said
    assert "known: 3 rows recorded before, as readings 1 to 3" in day.takes(rows, 3)
    assert len(set(day.positions())) == len(day.positions()) == 6
    assert "was recorded before: readings 1 to 6, no row is new" in day.refuses(rows)
    assert "was recorded before" in day.refuses(rows, "--again")


def test_a_machine_is_told_what_is_known(day):
    rows = [day.row(place) for place in range(3)]
    day.takes(rows[:2], 2)
    content = json.loads(day.record(rows, "--json").stdout)
    assert (content["taken"], content["known"], content["gone"]) == (1, [1, 2], [])


@pytest.mark.parametrize("changed", [0, 1, 2])
@pytest.mark.parametrize("appended", [0, 1, 3])
def test_an_old_row_that_was_changed_is_asked_about(day, changed, appended):
    rows = [day.row(place) for place in range(6)]
    for count in (1, 2, 3):  # one row at a time, each its own entry of the journal
        day.takes(rows[:count], 1)
    now = rows[: 3 + appended]
    now[changed] = other(now[changed])
    said = day.refuses(now)
    assert f"line {changed + 2}: stands where reading {changed + 1} was" in said
    assert said.count("stands where") == 1
    assert f"kinacc campaign strike '{day.folder}' {changed + 1} --reason" in said
    day.strike(changed + 1)
    day.takes(now, 1 + appended)
    assert day.taken() == 3 + appended


def test_the_first_and_only_row_that_was_changed_is_asked_about(day):
    rows = [day.row(place) for place in range(3)]
    day.takes(rows[:1], 1)
    now = [other(rows[0]), *rows[1:]]
    assert "line 2: stands where reading 1 was" in day.refuses(now)
    assert day.refuses(now[:1])
    day.takes(now, 3, "--again")


def test_a_file_of_which_every_row_was_changed_is_asked_about(day):
    rows = [day.row(place) for place in range(5)]
    day.takes(rows[:3], 3)
    shifted = [other(each, 1, 0.5) for each in rows]
    said = day.refuses(shifted)
    assert "lines 2-4: stand where readings 1 to 3 were" in said
    assert said.count("the file does not hold any more") == 1


def test_a_file_written_over_with_new_readings_of_a_point_is_asked_about_once(day):
    first, second = ([day.row(0) for _ in range(3)] for _ in range(2))
    day.takes(first, 3)
    said = day.refuses(second)
    assert said.count("  - ") == 1
    assert "stand where readings 1 to 3 were" in said
    assert "in a file written over: record it again with --again" in said
    assert f"kinacc campaign strike '{day.folder}' NUMBER --reason .." in said
    day.takes(second, 3, "--again")
    mixed = [second[0], *(day.row(0) for _ in range(2))]  # an old row and new ones
    said = day.refuses(mixed)
    assert said.count("  - ") == 1
    assert "lines 3-4: stand where readings 5 to 6 were" in said
    day.takes(mixed, 2, "--again")
    assert day.taken() == 8


def test_a_row_that_got_another_point_is_asked_about(day):
    rows = [day.row(place) for place in range(4)]
    day.takes([f"{each},tracker" for each in rows[:3]], 3, head=HEAD + ",instrument")
    now = [f"{each},tracker" for each in rows]
    moved = day.visit[7]["pose"] + rows[1][rows[1].index(",") :]
    said = day.refuses([now[0], f"{moved},tracker", *now[2:]], "--accept-implausible",
                       head=HEAD + ",instrument")  # fmt: skip
    assert "line 3: stands where reading 2 was" in said
    now[1] = now[1].replace("tracker", "camera")
    said = day.refuses(now, head=HEAD + ",instrument")
    assert "line 3: is reading 2 by its position, and was recorded with another instrument" in said
    day.strike(2)
    day.takes(now, 2, head=HEAD + ",instrument")


def test_rows_that_repeat_to_the_last_digit_are_asked_about_and_can_be_taken(day):
    rows = [day.row(place) for place in range(3)]
    day.takes(rows[:2], 2)
    now = [*rows, rows[2], rows[0]]
    said = day.refuses(now)
    assert "line 5: is line 4, to the last digit" in said
    assert "line 6: is reading 1, to the last digit" in said
    assert "line 2: " not in said
    said = day.takes(now, 3, "--again")
    assert "known: 2 rows" in said
    assert "was recorded before" in day.refuses(now, "--again")
    day.takes([*now, day.row(5)], 1)
    assert day.taken() == 6


def test_a_row_whose_reading_was_struck_does_not_come_back(day):
    rows = [day.row(place) for place in range(3)]
    day.takes(rows[:2], 2)
    day.strike(2)
    assert "known: 2 rows" in day.takes(rows, 1)
    assert day.taken() == 2


def test_a_row_that_was_changed_is_found_in_a_file_that_was_sorted(day):
    rows = [day.row(place) for place in range(5)]
    day.takes(rows[:4], 4)
    now = [rows[3], rows[2], other(rows[0]), rows[1], rows[4]]
    assert "line 4: stands where reading 1 was" in day.refuses(now)
    day.takes([*rows[3::-1], rows[4]], 1)


def test_a_row_that_was_taken_out_of_the_file_is_told(day):
    rows = [day.row(place) for place in range(5)]
    day.takes(rows[:3], 3)
    said = day.takes([*rows[1:]], 2)  # the export keeps the last readings only
    assert "not in the file any more, and still in the campaign: reading 1; strike" in said
    said = day.takes([*rows[2:], day.row(5)], 1)
    assert "readings 1 to 2; strike" in said


def test_a_row_between_others_is_new_where_none_is_missing(day):
    rows = [day.row(place) for place in range(4)]
    broken = [rows[0], rows[1].replace(day.visit[1]["pose"], "elsewhere", 1), rows[2]]
    day.takes(broken, 2, "--skip-bad")
    day.takes(rows, 2)


def test_an_export_that_is_overwritten_by_each_reading_is_new_each_time(day):
    for place in (0, 1, 1, 2, 2):
        day.takes([day.row(place)], 1)
    day.takes([day.row(place) for place in (3, 4, 5)], 3)
    day.takes([day.row(place) for place in (4, 4, 1)], 3)


def test_a_second_round_in_a_file_of_its_own_is_new(day):
    day.takes([day.row(place) for place in range(4)], 4)
    second = day.file.parent / "second"
    day.takes([day.row(place) for place in range(4)], 4, file=second / "readings.csv")


def test_a_grown_copy_under_another_name_is_the_same_file(day):
    rows = [day.row(place) for place in range(4)]
    day.takes(rows[:3], 3)
    copy = day.file.parent / "readings_evening.csv"
    assert "stands where reading 2 was" in day.refuses([rows[0], other(rows[1]), *rows[2:]],
                                                       file=copy)  # fmt: skip
    assert "known: 3 rows" in day.takes(rows, 1, file=copy)


def test_a_reading_given_alone_and_written_down_as_well_is_taken_once(day):
    rows = [day.row(place) for place in range(3)]
    point, _, position = rows[0].partition(",")
    done = call("campaign", "record", day.folder, "--point", point, "--position-mm", position)
    assert done.exit_code == 0, done.output
    assert "known: 1 row recorded before, as reading 1" in day.takes(rows, 2)
    assert "known: 3 rows" in day.takes([*rows, rows[2]], 1, "--again")
    assert len(set(day.positions())) == 3


def test_a_campaign_of_an_earlier_version_goes_on(day):
    """Its journal says of which file readings were taken by a digest alone."""
    from kinacc.campaign import folder as campaigns

    rows = [day.row(place) for place in range(6)]
    day.takes(rows[:3], 3)
    path = day.folder / "readings.jsonl"
    entry = json.loads(path.read_text())["entry"]
    path.unlink()
    with campaigns.writing(day.folder) as opened:
        opened.write({key: entry[key] for key in ("kind", "readings", "file")})
    assert "was recorded before" in day.refuses(rows[:3])
    now = [rows[0], other(rows[1]), *rows[2:]]
    assert "line 3: stands where reading 2 was" in day.refuses(now)
    assert "known: 3 rows" in day.takes(rows[:4], 1)
    assert "known: 4 rows" in day.takes(rows, 2)
    assert len(set(day.positions())) == len(day.positions()) == 6
