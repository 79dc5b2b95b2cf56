"""``kinacc init``: from a measured file to the two files a calibration starts from."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinacc.checks.described import corrected, coupling_of
from kinacc.checks.report import Report
from kinacc.checks.which_robot import fitting
from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.file_options import file_options
from kinacc.cli.first_poses import first_poses, in_words, poses_without_robot
from kinacc.cli.init_questions import confirmed, guessed, unanswered
from kinacc.cli.init_remarks import remarks_on
from kinacc.cli.output import Output, answers, require_writable
from kinacc.config.names import LONGEST
from kinacc.errors import InputError, Problem
from kinacc.kinematics import robot as robots
from kinacc.measurements.intake import write
from kinacc.measurements.intake.groups import listed
from kinacc.measurements.intake.guess import Guess
from kinacc.progress import reporting
from kinacc.tables.atomic import replacing

_FILE = "measurements.file"
_FOLDS_UNKNOWN = 60


@dataclass(frozen=True)
class Description:
    """What ``kinacc init`` has written.

    Attributes
    ----------
    written
        The robot file, where one was needed, and the data set.
    robot, robot_because
        The robot, None for a form to fill in, and how it was chosen.
    joints, targets
        Number of joints and names of the targets.
    file
        The section ``measurements.file``.
    assumed
        What the file does not state, by setting.
    notes
        Facts on how the file was read.
    unused_columns
        Columns that are not read, with the reason.
    suspicions
        Findings of the data check.
    remarks
        Limits of the readings that contradict nothing.
    first_poses
        The first poses as understood.
    next
        The commands that follow.
    """

    written: list[str]
    robot: str | None
    robot_because: str
    joints: int
    targets: list[str]
    file: dict[str, Any]
    assumed: dict[str, str]
    notes: tuple[str, ...]
    unused_columns: dict[str, str]
    suspicions: list[str]
    remarks: list[str]
    first_poses: list[dict]
    next: list[str]


@click.command("init")
@click.argument("measurement_files", nargs=-1, required=True, type=click.Path())
@option("--robot", help="A shipped name, a robot file or a URDF file. [found by fitting]")
@option("--out", "folder", default=".", help="Folder to write to.")
@option("--name", help="Name of the data set. [as the file]")
@option("--joint-unit", type=choice.values_of(f"{_FILE}.joint_unit"), help="Unit of the joints.")
@option(
    "--length-unit", type=choice.values_of(f"{_FILE}.length_unit"), help="Unit of the positions."
)
@option(
    "--angle-unit", type=choice.values_of(f"{_FILE}.orientation.unit"), help="Unit of orientations."
)
@option(
    "--orientation",
    help="quaternion (scalar first), quaternion_xyzw, rotation_vector, none, or an Euler "
    "convention such as XYZ.",
)
@option(
    "--take",
    multiple=True,
    metavar="COLUMN",
    help="Read this column, and those that go with it, where the names leave several readings "
    "open. May be given again.",
)
@file_options
@option(
    "--join",
    metavar="HOW",
    help="How joints and points of two files belong together: A=B (column A of the joints names "
    "the poses as B of the points), time or order.",
)
@option(
    "--clock-offset",
    metavar="SECONDS",
    help="Seconds to add to times of points to get the joints'.",
)
@option("--pulses-per-deg", metavar="A,B,..", help="Pulses of each joint in a degree.")
@option(
    "--yes",
    is_flag=True,
    help="Ask nothing; take the guesses, which are stated. Stops where there is no guess.",
)
@answers("Print the answer as JSON; asks nothing.", force="Replace files that are there.")
def init(measurement_files: tuple[str, ...], out: Output, **options) -> None:
    """Describe MEASUREMENT_FILES: write their data set and, where needed, its robot.

    Looks at the names and numbers of the file, asks what they do not say, and tries the answer on
    the readings themselves. What was measured is read, and not what was wanted or how far off it
    was; joints read back are read, and not commanded ones. Writes NAME.yaml and NAME.robot.yaml,
    which name every column that is read, and overwrites nothing. Two files are joints and points
    of the same poses.

    \b
    Example:
      kinacc init series_D.csv --robot ur10 --name ur10_d
      kinacc init tracker.csv --robot arm.urdf --orientation ZYX --out cell3 --yes
      kinacc init log.csv --take actual_q_0 --take X
      kinacc init joints.csv points.csv --join Name=Point
    """
    ask = not (options["yes"] or out.as_json)
    stated = {key: value for key, value in options.items() if value not in (None, ())}
    guess = guessed(measurement_files, stated, ask)
    name = options["name"] or write.plain_name(guess.table.path)
    if name != write.plain_name(f"{name}.csv"):
        raise InputError(Problem("--name", name, f"at most {LONGEST} letters, digits, _ and -"))
    dataset = Path(options["folder"], f"{name}.yaml")
    robot_file = dataset.with_name(f"{name}.robot.yaml")
    robot_option = options["robot"]
    stays = (
        robot_option is not None
        and Path(robot_option).suffix in (".yaml", ".yml")
        and Path(robot_option).is_file()
    )
    require_writable([dataset] if stays else [dataset, robot_file], out.force)
    if ask and (changed := confirmed(guess, robot_option)):
        guess = guessed(measurement_files, stated | changed, ask)
    robot, chosen = _robot(guess, robot_option, ask)
    text = _robot_text(robot, guess.joints, name, robot_file.parent)
    texts = {} if text is None else {robot_file: text}
    report, remarks = None, []
    if robot is None:
        poses = poses_without_robot(guess)
    else:
        arm = robots.load(robot)
        with reporting(f"init {name}", bar=True) as progress:
            guess, report, reading = corrected(guess, arm, name, progress)
            if texts and (coupling := coupling_of(report)) is not None:
                matrix = coupling.values["joint_map"]
                why = f"found by trying it on the readings: {coupling.what}"
                texts = {
                    robot_file: write.coupled_text(text, matrix, f"Joints are coupled, {why}.")
                }
                note = f"joint_map of the robot file that is written couples joints, {why}"
                arm = replace(arm, joint_map=np.array(matrix, dtype=float))
                guess = replace(guess, notes=(*guess.notes, note))
                guess, report, reading = corrected(guess, arm, name, progress)
        poses = first_poses(reading, arm.dh.prismatic)
        remarks = list(remarks_on(guess, report, reading, arm))
    if not out.as_json:
        click.echo("\n".join(in_words(poses)))
    texts[dataset] = _dataset(
        dataset, name, str(robot_file) if text else robot, guess, report, chosen
    )
    with replacing(list(texts)) as parts:
        for part, content in zip(parts, texts.values(), strict=True):
            part.write_text(content, encoding="utf-8")
    result = Description(
        [str(path) for path in texts],
        robot,
        chosen,
        guess.joints,
        list(guess.columns.targets),
        guess.section,
        guess.assumed,
        guess.notes,
        guess.unused(),
        [finding.kind for finding in report.suspicions] if report else [],
        remarks,
        poses,
        [shlex.join(["kinacc", command, str(dataset)]) for command in ("check-data", "calibrate")],
    )
    out.say(result, "\n".join(_lines(result, guess, report)))


def _robot(guess: Guess, stated: str | None, ask: bool) -> tuple[str | None, str]:
    """The robot as stated, found by fitting, or as answered; None for a template. And why."""
    if stated is not None:
        return stated, "as given"
    with reporting("init", bar=True) as progress:
        fit = fitting(guess, progress)
    if ask:
        question = "Robot (name in docs/robots.md, robot or URDF file, or 'new' for a form)"
        try:
            answer = click.prompt(question, default=fit[0] if fit else "new")
        except click.Abort:
            raise unanswered(guess, [], None) from None
        return (None, "a template to fill in") if answer == "new" else (answer, "as answered")
    if not fit:
        return None, "none of the shipped robots fits; a template to fill in"
    if len(fit) > 1:
        return fit[0], f"fits the readings, as does {', '.join(fit[1:])} (--robot)"
    return fit[0], "the only shipped robot that fits the readings"


def _robot_text(robot: str | None, joints: int, name: str, folder: Path) -> str | None:
    """The text of the robot file to write; None where a robot file is used where it stands."""
    if robot is None:
        return write.template_text(f"{name}_robot", joints)
    if robot in robots.shipped():
        return write.shipped_text(robot)
    if Path(robot).suffix.lower() in (".urdf", ".xml", ".xacro"):
        return write.urdf_text(robots.load(robot).name, Path(robot), folder)
    return None


def _dataset(
    path: Path, name: str, robot: str, guess: Guess, report: Report | None, chosen: str
) -> str:
    """Text of the data set, which names files from where it stands."""
    how = _how(report).capitalize()
    note = [f"Written by kinacc init. Robot: {chosen}."]
    note += [f"{how}: {text}." for text in guess.assumed.values()]
    note += [f"Not read: {names} ({why})." for why, names in _unread(guess.unused()) if why]
    check = shlex.join(["kinacc", "check-data", str(path)])
    note.append(f"Everything not given here has its default (docs/configuration.md).\n    {check}")
    poses = int(report.facts["poses"]) if report else _FOLDS_UNKNOWN
    files = {"path": write.seen_from(path.parent, guess.section["path"])}
    if joints := guess.section.get("joints"):
        files["joints"] = joints | {"path": write.seen_from(path.parent, joints["path"])}
    robot = write.seen_from(path.parent, robot)
    return write.dataset_text(name, robot, guess.but(files), poses, "\n".join(note))


def _how(report: Report | None) -> str:
    """How far what the file does not state was held against its readings."""
    return "assumed" if report is None or report.stopping else "assumed, and the readings agree"


def _unread(unused: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Reasons, each with the columns that are not read for it."""
    for why in dict.fromkeys(unused.values()):
        yield why, ", ".join(name for name in unused if unused[name] == why)


def _lines(result: Description, guess: Guess, report: Report | None) -> Iterator[str]:
    """The description as it is printed."""
    columns, section, turn = guess.columns, guess.section, guess.section["orientation"]
    yield from (f"file: {text}" for text in result.notes)
    yield f"robot: {result.robot or result.written[0]} ({result.robot_because})"
    names = listed([name.column for name in columns.joints])
    yield f"joints: {result.joints}, in {section['joint_unit']}: {names}"
    targets = [f"{name} ({listed([target[axis].column for axis in 'xyz'])})"
               for name, target in columns.targets.items()]  # fmt: skip
    yield f"targets, in {section['length_unit']}: {', '.join(targets)}"
    kind = f"Euler angles {turn['convention']}" if turn["kind"] == "euler" else turn["kind"]
    unit = f", in {turn['unit']}" if turn["kind"] in ("euler", "rotation_vector") else ""
    yield f"orientation: {kind}{unit}"
    also = [f"{quantity} ({name.column})" for quantity, name in columns.single.items()]
    if columns.commanded:
        also.append(f"commanded joints ({listed([name.column for name in columns.commanded])})")
    if also:
        yield f"also read: {', '.join(also)}"
    yield from (f"{_how(report)}: {text}" for text in result.assumed.values())
    for why, unread in _unread(result.unused_columns):
        yield f"columns not used: {unread}" + (f" ({why})" if why else "")
    if result.suspicions:
        yield f"suspicions: {', '.join(dict.fromkeys(result.suspicions))} (details: check-data)"
    yield from (f"note: {text}" for text in result.remarks)
    yield from (f"written: {path}" for path in result.written)
    if report is None:
        yield "fill in the robot file first"
    yield from ("next:", *(f"  {command}" for command in result.next))
