"""New readings of an arm held to its series, and the text of the configuration with them."""

from __future__ import annotations

import datetime
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinacc.calibration import delivered
from kinacc.checks.contradictions import load
from kinacc.config.edit import flow, with_added
from kinacc.config.reading import read
from kinacc.config.series import FLAGS, MOVED, SAME
from kinacc.deployment.shared_readings import known_rows
from kinacc.errors import InputError, Problem, first_few, gathered, refuse
from kinacc.kinematics import robot
from kinacc.measurements import times
from kinacc.measurements.files import load as loaded
from kinacc.measurements.folds import split
from kinacc.measurements.layout import Layout
from kinacc.measurements.reader import read as read_measured
from kinacc.tables.atomic import write_whole

_MARK = "\ufeff"  # with which some editors begin a file


@dataclass(frozen=True)
class Member:
    """A file that a data set reads: where it is, its day where that is known, what was moved."""

    path: str
    date: str | None
    moved: Mapping[str, str | None]


@dataclass(frozen=True)
class Arm:
    """A data set to which readings are added: of which file and name, its full settings.

    ``members`` are its files by date; one alone, without a date, where it is no series yet.
    ``text`` is that of the file, ``first`` its path of the one file as it is written there.
    """

    config: str
    name: str
    settings: Mapping[str, Any]
    members: tuple[Member, ...]
    text: str
    first: str

    @property
    def is_series(self) -> bool:
        """Whether the data set has a series already."""
        return self.members[0].date is not None


def opened(config: str, dataset: str | None) -> Arm:
    """The measured data set of a configuration file; InputError where it is not clear which."""
    full = load([config])
    names = [
        name
        for name, settings in full.items()
        if settings["measurements"]["source"] == "file" and "line_of" not in settings
    ]
    if not names or dataset not in (names if dataset or len(names) > 1 else (None,)):
        what = f"{dataset!r} is none of them" if dataset else "is not given"
        what = what if names else f"{config} has no data set with a measured file"
        raise InputError(Problem("--dataset", what, ", ".join(names)))
    name = dataset or names[0]
    settings, none = full[name], dict.fromkeys(FLAGS)
    members = [
        Member(_path(full[line["name"]]), line["date"], {flag: line[flag] for flag in FLAGS})
        for line in settings.get("series", ())
    ]
    document, _ = read(config)
    first = document.data["datasets"][name].get("measurements") or {}
    first = (first.get("file") or {}).get("path") or _beside(config, _path(settings))
    # As bytes: reading as text would turn the ends of lines.
    text = Path(config).read_bytes().decode("utf-8")
    members = members or [Member(_path(settings), None, none)]
    return Arm(config, name, settings, tuple(members), text, first)


def _beside(config: str, path: str) -> str:
    """A path as seen from the folder of a configuration file."""
    if os.path.isabs(path):
        return path
    return os.path.relpath(path, Path(config).absolute().parent).replace(os.sep, "/")


def _path(settings: Mapping[str, Any]) -> str:
    return settings["measurements"]["file"]["path"]


def misfits(path: str, arm: Arm, tool: str | None) -> list[Problem]:
    """Why a file cannot be a line of the arm's series: unreadable, other targets, read before."""
    problems: list[Problem] = []
    with gathered(problems):
        own = _measured(path, arm)
        given = {"measurements": own}
        section = arm.settings["calibration"]
        with gathered(problems):
            delivered.require_enough_rows(given, robot.load(arm.settings["robot"]), section)
        other = None
        for member in arm.members:
            with suppress(InputError):
                other = _measured(member.path, arm)
                if known_rows(own, other).all():
                    what = f"holds the readings of {member.path}, which is a line already"
                    problems.append(Problem(path, what, "new readings"))
        if other is not None:
            problems += _of_targets(path, own, other, arm, tool)
    return problems


def _measured(path: str, arm: Arm) -> Mapping[str, Any]:
    """Measurements of a file by the settings of the arm; InputError listing what is wrong."""
    section = arm.settings["measurements"]
    own = {**section, "file": {**section["file"], "path": path}}
    with warnings.catch_warnings(action="ignore"):  # said when it is calibrated
        seen = read_measured(own["file"], robot.load(arm.settings["robot"]))
        return split(seen.columns, {**arm.settings, "measurements": own})


def _of_targets(
    path: str, own: Mapping, other: Mapping, arm: Arm, tool: str | None
) -> list[Problem]:
    """What the targets of a file are otherwise than those of the newest line."""
    new, old = (sorted({*each["target"].tolist()}) for each in (own, other))
    if new == old or (tool == MOVED and len(new) == len(old)):
        return []
    what = f"has target{'s' * (len(new) > 1)} {first_few(new)}"
    allowed = f"{first_few(old)}, as {arm.members[-1].path}"
    return [Problem(path, what, allowed, "name them in measurements.file.targets or columns")]


def days(path: str, arm: Arm) -> list[str]:
    """Days that a file itself says it was measured on."""
    with suppress(InputError):
        return times.days(loaded(path, Layout.of(arm.settings["measurements"]["file"])))
    return []


def before(arm: Arm, dates: Sequence[str | None], day: str | None) -> str | None:
    """Day since which a line of ``day`` has to say what was moved, among ``dates``.

    None where it comes before all lines of a series, and where there is nothing to say it of.
    """
    known = sorted(each for each in dates if each)
    earlier = [each for each in known if day is None or each < day]
    # Of two files that become a series, whichever is the later one says it.
    return max(earlier, default=None if arm.is_series else min(known, default=None))


def placed(
    path: str, date: str, moved: Mapping[str, str | None], arm: Arm, first_date: str | None
) -> tuple[str, list[str]]:
    """The text with the new line, and the lines that are new in it.

    ``first_date``: of the one file there is where the data set is no series yet. Raises InputError
    where the lines contradict one another, or the text cannot be changed safely.
    """
    new = {"path": _beside(arm.config, path), "date": date}
    if arm.is_series:
        refuse(_contradicted(date, moved, arm), f"{path} was not added to {arm.config}")
        is_first = all(each.date is None or each.date > date for each in arm.members)
        lines = [new if is_first else new | _flags(moved)]
    else:
        if date == first_date:
            what = f"{date} is the date of the file that is there too"
            raise InputError(Problem("--date", what, "a day of its own"))
        old = {"path": arm.first, "date": first_date}
        lines = sorted((old, new), key=lambda line: line["date"])
        lines[1] = lines[1] | _flags(moved)
    dated = [{**each, "date": datetime.date.fromisoformat(each["date"])} for each in lines]
    mark = _MARK if arm.text.startswith(_MARK) else ""
    where = ("datasets", arm.name, "series")
    only = () if arm.is_series else (*where[:2], "measurements", "file", "path")
    text = with_added(arm.text.removeprefix(_MARK), where, dated, arm.config, only)
    return mark + text, [flow(each) for each in dated]


def _flags(moved: Mapping[str, str | None]) -> dict[str, str]:
    return {flag: moved[flag] or SAME for flag in FLAGS}


def _contradicted(date: str, moved: Mapping[str, str | None], arm: Arm) -> Iterable[Problem]:
    """What lines that are there would say wrongly once a line of ``date`` stands among them."""
    if any(each.date == date for each in arm.members):
        yield Problem("--date", f"{date} is the date of a line already", "a day of its own")
    later = [each for each in arm.members if each.date and each.date > date]
    is_first = len(later) == len(arm.members)
    for flag, how in FLAGS.items():
        if later and is_first:
            what = f"would follow {date}, and does not say whether {how} as then"
            fix = f"write {flag}: {SAME}, or {flag}: {MOVED}, into its line"
            yield Problem(f"{arm.config}, line of {later[0].date}", what, fix=fix)
        elif later and moved[flag] == MOVED and later[0].moved[flag] == SAME:
            what = f"says {flag}: {SAME} since the line before, which would be {date}"
            fix = f"write {flag}: {MOVED} into its line"
            yield Problem(f"{arm.config}, line of {later[0].date}", what, fix=fix)


def written(arm: Arm, text: str) -> None:
    """Replace the configuration file whole; a link stays one, and modes stay."""
    place = Path(os.path.realpath(arm.config))
    mode = place.stat().st_mode
    if place.read_bytes().decode("utf-8") != arm.text:
        what = "was changed while this ran"
        raise InputError(Problem(arm.config, what, fix="give the same command again"))
    write_whole(place, text.encode("utf-8"), on_disk=True)
    place.chmod(mode & 0o7777)
