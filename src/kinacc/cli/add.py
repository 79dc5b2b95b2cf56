"""``kinacc add``: new readings of an arm as a further line of its series."""

from __future__ import annotations

import shlex
import sys
from typing import TYPE_CHECKING

import click

from kinacc.cli.choice import option
from kinacc.cli.output import Output, answers
from kinacc.config.series import FLAGS, MOVED, SAME, day_of
from kinacc.errors import Problem, gathered, refuse

if TYPE_CHECKING:
    from kinacc.deployment.adding import Arm

_FLAG = click.Choice([SAME, MOVED])
_DAY = "a day as 2026-06-02"


@click.command("add")
@click.argument("measurement_file", metavar="FILE", type=click.Path())
@option("--to", "config", required=True, type=click.Path(), help="Configuration file of the arm.")
@option("--dataset", help="Data set of the configuration; needed if there are two.")
@option("--date", help="Day it was measured, as 2026-06-02. [as times in the file say; else asked]")
@option("--base", type=_FLAG, help="Robot and instrument since the line before. [asked]")
@option("--tool", type=_FLAG, help="Tool or targets since the line before. [asked]")
@option("--first-date", help="Day of the file that is there, where it is no series yet. [asked]")
@answers("Print what was written as JSON; asks nothing.")
def add(
    measurement_file: str,
    config: str,
    dataset: str | None,
    date: str | None,
    base: str | None,
    tool: str | None,
    first_date: str | None,
    out: Output,
) -> None:
    """Add a measured FILE of the same arm to its series, one more line of the configuration.

    The file is read by the settings of the data set, and refused where it cannot be, has other
    targets or holds the readings of a line that is there. --base and --tool say whether something
    was moved since the line before: `same` is taken for a fact, `moved` costs the comparison the
    unknowns of a frame. A data set of one file becomes a series. Comments stay as they are. Then
    `kinacc calibrate` makes what depends on the new line, and the history of the arm.

    \b
    Example:
      kinacc add june.csv --to tracker.yaml --date 2026-06-02 --base moved --tool same
    """
    from kinacc.deployment import adding

    ask = sys.stdin.isatty() and not out.as_json
    title = f"{measurement_file} was not added to {config}"
    arm = adding.opened(config, dataset)
    problems = adding.misfits(measurement_file, arm, tool)
    if not arm.is_series:
        first_date = _day("--first-date", first_date, arm.members[0].path, arm, ask, problems)
    elif first_date is not None:
        what = "is given, and the data set has a series already"
        problems.append(Problem("--first-date", what, fix="leave it out"))
    day = _day("--date", date, measurement_file, arm, ask, problems)
    dates = [each.date for each in arm.members] if arm.is_series else [first_date]
    moved: dict[str, str | None] = {"base": base, "tool": tool}
    since = adding.before(arm, dates, day)
    if since is None and None in (day, *dates):
        since = "the day of the line before"  # which day is among what is asked
    if since is not None:
        moved = {flag: _flag(flag, moved[flag], since, ask, problems) for flag in FLAGS}
    text, lines = "", []
    if day is not None and not problems:
        with gathered(problems):
            text, lines = adding.placed(measurement_file, day, moved, arm, first_date)
    refuse(problems, title)
    adding.written(arm, text)
    following = shlex.join(["kinacc", "calibrate", config])
    words = "\n".join([f"{config}, series of {arm.name}:", *(f"  - {each}" for each in lines)])
    facts = {"config": config, "dataset": arm.name, "written": lines, "next": following}
    out.say(facts, f"{words}\nnext: {following}")


def _day(
    name: str, given: str | None, path: str, arm: Arm, ask: bool, problems: list[Problem]
) -> str | None:
    """A day as given, as the file says itself, or as a person answers."""
    from kinacc.deployment import adding

    if given is not None:
        if day_of(given) is None:
            problems.append(Problem(name, f"{given!r} is no day", _DAY))
        return day_of(given)
    found = adding.days(path, arm)
    if len(found) == 1:
        return found[0]
    said = f"its times are of {found[0]} to {found[-1]}" if found else "no column tells"
    if ask and not problems:
        answer = click.prompt(f"On which day was {path} measured ({said}; {_DAY})")
        return _day(name, answer, path, arm, ask, problems)
    what = f"is not given: on which day {path} was measured ({said})"
    problems.append(Problem(name, what, _DAY))
    return None


def _flag(
    flag: str, given: str | None, since: str, ask: bool, problems: list[Problem]
) -> str | None:
    """Whether something was moved, as given or as a person answers."""
    if given is not None:
        return given
    if ask and not problems:
        return click.prompt(f"{flag}: whether {FLAGS[flag]} as on {since}", type=_FLAG)
    what = f"is not given: whether {FLAGS[flag]} as on {since}"
    problems.append(Problem(f"--{flag}", what, f"{SAME}, {MOVED}"))
    return None
