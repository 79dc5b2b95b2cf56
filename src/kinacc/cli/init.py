"""``kinacc init``: from a measured file to the two files a calibration starts from."""

from __future__ import annotations

import shlex
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.file_options import file_options
from kinacc.cli.output import Output, answers

if TYPE_CHECKING:
    from kinacc.checks.findings import Finding
    from kinacc.checks.report import Report
    from kinacc.kinematics.robot import Robot
    from kinacc.measurements.intake.guess import Guess
    from kinacc.measurements.reader import MeasuredFile

_FILE = "measurements.file"


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
      kinacc init ../shared/data/ur10_tmac/series_D.csv --robot ur10 --name ur10_d
      kinacc init tracker.csv --robot arm.urdf --orientation ZYX --out cell3 --yes
      kinacc init log.csv --take actual_q_0 --take X
      kinacc init joints.csv points.csv --join Name=Point
    """
    from kinacc.checks.described import coupling_of
    from kinacc.cli.first_poses import first_poses, poses_without_robot
    from kinacc.cli.init_questions import asked, guessed
    from kinacc.cli.init_remarks import remarks_on, rounded
    from kinacc.errors import InputError
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.intake.write import plain_name
    from kinacc.tables.atomic import replacing

    ask = not (options["yes"] or out.as_json)
    answers = {key: value for key, value in options.items() if value not in (None, ())}
    guess = guessed(measurement_files, answers, ask)
    name = options["name"] or plain_name(guess.table.path)
    folder = Path(options["folder"])
    paths = folder / f"{name}.yaml", folder / f"{name}.robot.yaml"
    _refuse(paths[: 1 if _is_robot_file(options["robot"]) else 2], name, out.force)
    first_shown: list[dict] = []
    if ask:
        if guess.assumed:
            with suppress(InputError):  # joints that slide are not to be read without their robot
                first_shown = poses_without_robot(guess)
        _show(first_shown, out)
        if changed := asked(guess, options["robot"]):
            guess = guessed(measurement_files, answers | changed, ask)
    robot, chosen = _robot(guess, options["robot"], ask)
    robot_path, text = _robot_file(robot, guess.joints, name, paths[1])
    report, remarks = None, []
    if robot is not None:
        arm = robots.load(robot)
        guess, report, reading = _tried(guess, arm, name)
        if text is not None and (coupling := coupling_of(report)) is not None:
            text, arm, guess = _coupled(text, arm, guess, coupling)
            guess, report, reading = _tried(guess, arm, name)
        shown = first_poses(reading, arm.dh.prismatic)
        remarks = [*remarks_on(guess, report), *rounded(guess, reading, arm)]
    else:
        shown = poses_without_robot(guess)
    if shown != first_shown:  # answers, or the readings, show more than the names did
        _show(shown, out)
    texts = {} if text is None else {paths[1]: text}
    texts[paths[0]] = _dataset(paths[0], name, robot_path, guess, report, chosen)
    with replacing(list(texts)) as parts:
        for part, text in zip(parts, texts.values(), strict=True):
            part.write_text(text, encoding="utf-8")
    _tell(out, guess, robot or robot_path, chosen, report, list(texts), paths[0], shown, remarks)


def _show(shown: list[dict], out: Output) -> None:
    """Print the first poses, if any, before anything is written."""
    from kinacc.cli.first_poses import in_words

    if shown and not out.as_json:
        click.echo("\n".join(in_words(shown)))


_FOLDS_UNKNOWN = 60


def _is_robot_file(robot: str | None) -> bool:
    """Whether a robot file was given, which is used where it stands and not written."""
    return robot is not None and Path(robot).suffix in (".yaml", ".yml") and Path(robot).is_file()


def _robot_file(robot: str | None, joints: int, name: str, path: Path) -> tuple[str, str | None]:
    """What the data set calls its robot, and the text of the robot file to write, if any."""
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.intake import write

    if robot is None:
        return str(path), write.template_text(f"{name}_robot", joints)
    if robot in robots.shipped():
        return str(path), write.shipped_text(robot)
    if Path(robot).suffix.lower() in (".urdf", ".xml", ".xacro"):
        return str(path), write.urdf_text(robots.load(robot).name, Path(robot), path.parent)
    return robot, None


def _refuse(paths, name: str, force: bool) -> None:
    """Raise where the name is no name, or a file is there that must not be replaced."""
    from kinacc.config.names import LONGEST
    from kinacc.errors import Problem, refuse
    from kinacc.measurements.intake.write import plain_name

    problems = []
    if name != plain_name(f"{name}.csv"):
        problems.append(
            Problem("--name", repr(name), f"at most {LONGEST} letters, digits, _ and -")
        )
    if not force:
        problems += [
            Problem(str(path), "is there already", fix="give --force to replace it, or --name")
            for path in paths
            if path.exists()
        ]
    refuse(problems)


def _robot(guess: Guess, given: str | None, ask: bool) -> tuple[str | None, str]:
    """The robot as given, found by fitting, or as answered; None for a template. And why."""
    from kinacc.checks.which_robot import fitting
    from kinacc.cli.init_questions import refuse_unanswered
    from kinacc.progress import reporting

    if given is not None:
        return given, "as given"
    with reporting("init", bar=True) as progress:
        found = fitting(guess, progress)
    if ask:
        question = "Robot (name in docs/robots.md, robot or URDF file, or 'new' for a form)"
        try:
            answer = click.prompt(question, default=found[0] if found else "new")
        except click.Abort:
            refuse_unanswered(guess, {}, None)
        return (None, "a template to fill in") if answer == "new" else (answer, "as answered")
    if not found:
        return None, "none of the shipped robots fits; a template to fill in"
    if len(found) > 1:
        return found[0], f"fits the readings, as does {', '.join(found[1:])} (--robot)"
    return found[0], "the only shipped robot that fits the readings"


def _tried(guess: Guess, arm: Robot, name: str) -> tuple[Guess, Report, MeasuredFile]:
    """The guess corrected by the readings, the check of them, and what was read."""
    from kinacc.checks.described import corrected
    from kinacc.progress import reporting

    with reporting(f"init {name}", bar=True) as progress:
        return corrected(guess, arm, name, progress)


def _coupled(text: str, arm: Robot, guess: Guess, coupling: Finding) -> tuple:
    """The robot file's text, the arm and the guess, with the joint_map that the readings show."""
    import numpy as np

    from kinacc.measurements.intake.write import coupled_text

    matrix = coupling.values["joint_map"]
    why = f"found by trying it on the readings: {coupling.what}"
    note = f"joint_map of the robot file that is written couples joints, {why}"
    text = coupled_text(text, matrix, f"Joints are coupled, {why}.")
    arm = replace(arm, joint_map=np.array(matrix, dtype=float))
    return text, arm, replace(guess, notes=(*guess.notes, note))


def _how(report: Report | None) -> str:
    """How far what the file does not state was held against its readings."""
    return "assumed" if report is None or report.stopping else "assumed, and the readings agree"


def _dataset(
    path: Path, name: str, robot: str, guess: Guess, report: Report | None, chosen: str
) -> str:
    """Text of the data set, which names files from where it stands."""
    from kinacc.kinematics.robot import shipped
    from kinacc.measurements.intake.write import dataset_text, seen_from

    note = [f"Written by kinacc init. Robot: {chosen}."]
    note += [f"{_how(report).capitalize()}: {text}." for text in guess.assumed.values()]
    note += [f"Not read: {names} ({why})." for why, names in _unread(guess).items() if why]
    check = shlex.join(["kinacc", "check-data", str(path)])
    note.append(f"Everything not given here is as in config.yaml.\n    {check}")
    configurations = _FOLDS_UNKNOWN if report is None else int(report.facts["poses"])
    robot = robot if robot in shipped() else seen_from(path.parent, robot)
    files = {"path": seen_from(path.parent, guess.section["path"])}
    if joints := guess.section.get("joints"):
        files["joints"] = joints | {"path": seen_from(path.parent, joints["path"])}
    return dataset_text(name, robot, guess.but(files), configurations, "\n".join(note))


def _unread(guess: Guess) -> dict[str, str]:
    """Columns that are not read, by the reason."""
    unused = guess.unused()
    reasons = dict.fromkeys(unused.values())
    return {why: ", ".join(n for n in unused if unused[n] == why) for why in reasons}


def _tell(
    out: Output, guess, robot, chosen, report, written, dataset: Path, shown=(), remarks=()
) -> None:
    """Print the answer."""
    from kinacc.measurements.intake.groups import listed

    commands = [shlex.join(["kinacc", name, str(dataset)]) for name in ("check-data", "calibrate")]
    columns, section, unused = guess.columns, guess.section, guess.unused()
    kinds = [] if report is None else [finding.kind for finding in report.suspicions]
    answer = {
        "written": [str(path) for path in written],
        "robot": robot,
        "robot_because": chosen,
        "joints": guess.joints,
        "targets": list(columns.targets),
        "file": section,
        "assumed": guess.assumed,
        "told": list(guess.notes),
        "unused_columns": unused,
        "suspicions": kinds,
        "remarks": list(remarks),
        "first_poses": list(shown),
        "next": commands,
    }
    turn = section["orientation"]
    kind = f"Euler angles {turn['convention']}" if turn["kind"] == "euler" else turn["kind"]
    unit = f", in {turn['unit']}" if turn["kind"] in ("euler", "rotation_vector") else ""
    targets = [f"{name} ({listed([target[axis].column for axis in 'xyz'])})"
               for name, target in columns.targets.items()]  # fmt: skip
    joints = listed([name.column for name in columns.joints])
    lines = [
        *(f"file: {text}" for text in guess.notes),
        f"robot: {robot} ({chosen})",
        f"joints: {guess.joints}, in {section['joint_unit']}: {joints}",
        f"targets, in {section['length_unit']}: {', '.join(targets)}",
        f"orientation: {kind}{unit}",
    ]
    also = [f"{quantity} ({name.column})" for quantity, name in columns.single.items()]
    also += [f"commanded joints ({listed([n.column for n in columns.commanded])})"] * bool(
        columns.commanded
    )
    lines += [f"also read: {', '.join(also)}"] if also else []
    lines += [f"{_how(report)}: {text}" for text in guess.assumed.values()]
    lines += [f"columns not used: {names}" + (f" ({why})" if why else "")
              for why, names in _unread(guess).items()]  # fmt: skip
    if kinds:
        lines.append(f"suspicions: {', '.join(dict.fromkeys(kinds))} (details: check-data)")
    lines += [f"note: {text}" for text in remarks]
    lines += [f"written: {path}" for path in written]
    lines += ["fill in the robot file first"] if report is None else []
    out.say(answer, "\n".join([*lines, "next:", *(f"  {command}" for command in commands)]))
