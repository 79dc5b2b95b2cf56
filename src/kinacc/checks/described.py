"""Measured files that nobody has described: their settings, as ``kinacc init`` finds them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from kinacc.checks import check
from kinacc.checks.findings import Finding
from kinacc.checks.report import Progress, Report
from kinacc.checks.which_robot import fitting
from kinacc.errors import InputError, Problem
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import Robot
from kinacc.measurements.intake import guess as guesses
from kinacc.measurements.intake.guess import Guess
from kinacc.measurements.intake.write import dataset_content, plain_name
from kinacc.measurements.layout import Layout
from kinacc.measurements.reader import MeasuredFile, read


def describe_files(
    files: Sequence[str | Path], robot: str | None = None, answers: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Settings of the data set in measured files, as in the configuration.

    Parameters
    ----------
    files
        A file with joints and measured points, or two files, one of item.
    robot
        A shipped name, a robot file or a URDF file; None for a shipped robot that fits.
    answers
        What the files leave open, by the option of ``kinacc init``: joint_unit, length_unit,
        orientation, take, join, clock_offset, decimal, sheet and so on.

    Returns
    -------
    dict
        ``{name: settings}``, with the name of the file of points.

    Raises
    ------
    InputError
        Listing the questions that the files leave open with their answers, or what is wrong.
    """
    guess = guesses.look(list(files), answers)

    def silent(items: Iterable[Any], _: str) -> Iterable[Any]:
        return items

    if robot is None:
        if not (fit := fitting(guess, silent)):
            fix = "give robot: a name in docs/robots.md, a robot file or a URDF file"
            raise InputError(
                Problem(guess.table.path, "no shipped robot fits the readings", fix=fix)
            )
        robot = fit[0]
    name = plain_name(guess.table.path)
    guess, report, _ = corrected(guess, robots.load(robot), name, silent)
    if (coupling := coupling_of(report)) is not None:
        fix = "kinacc init writes the robot file with this joint_map"
        raise InputError(Problem(f"robot {robot}", coupling.what, fix=fix))
    return {name: dataset_content(robot, guess, int(report.facts["poses"]))}


def corrected(
    guess: Guess, robot: Robot, name: str, progress: Progress
) -> tuple[Guess, Report, MeasuredFile]:
    """Correct assumed settings of a file where its readings contradict them.

    Parameters
    ----------
    guess
        Settings of the file, of which some are assumed.
    robot
        The arm that was measured.
    name
        Name of the data set in the report.
    progress
        Called on what is iterated and a label.

    Returns
    -------
    guess, report, readings
        The corrected guess, the check of the readings, and the readings.

    Raises
    ------
    InputError
        Where the robot has another number of joints.
    """
    if robot.dh.joints != guess.joints:
        message = f"{robot.name} has {robot.dh.joints} joints, the file {guess.joints}"
        raise InputError(Problem("--robot", message))
    for _ in range(3):
        reading = read(guess.section, robot, strict=False)
        layout = Layout.of(guess.section)
        report = check.check(reading, layout, robot, name, guess.section["path"], progress)
        settings = _contradicted(guess, report)
        guess = replace(guess, notes=tuple(dict.fromkeys((*guess.notes, *reading.notes))))
        if not settings:
            break
        guess = _set_right(guess, settings)
    return guess, report, reading


def _contradicted(guess: Guess, report: Report) -> dict[str, Any]:
    """Settings that were assumed and that the readings contradict, as they should be."""
    settings: dict[str, Any] = {}
    for item in report.suspicions:
        if item.kind == "left_handed" and "horizontal" in guess.assumed:
            return {"horizontal": ""}
        wanted = dict(item.values.get("setting", {}))
        turn = dict(wanted.pop("orientation", {}))
        about = "angle_unit" if "unit" in turn else "order" if "order" in turn else "orientation"
        if turn and about in guess.assumed:
            settings |= {"orientation": turn}
            settings |= {"e": wanted["e"]} if "e" in wanted else {}
        settings |= {k: v for k, v in wanted.items() if k in guess.assumed}
    return settings


def coupling_of(report: Report) -> Finding | None:
    """The coupling of two joints that alone explains the readings, where there is one."""
    return next((item for item in report.suspicions if "joint_map" in item.values), None)


def _set_right(guess: Guess, settings: dict[str, Any]) -> Guess:
    """The guess with settings that the readings show, in place of the assumed ones."""
    settings = dict(settings)
    shown = {key: value for key, value in settings.items() if key in guess.assumed}
    if "horizontal" in settings:
        ways = guess.section["directions"]
        clockwise = ways["horizontal"] == "counterclockwise"
        shown["horizontal"] = "clockwise" if clockwise else "counterclockwise"
        settings = {"directions": ways | {"horizontal": shown["horizontal"]}}
    if in_order := settings.pop("e", None):
        columns = dict(guess.section["columns"])
        unit = guess.section["orientation"]["unit"]
        angles = [columns.pop(name, f"{name}_{unit}") for name in in_order]
        columns |= {f"e{number}": column for number, column in enumerate(angles, 1)}
        settings["columns"] = columns
    if "orientation" in settings:
        turn = settings["orientation"]
        key = "angle_unit" if "unit" in turn else "order" if "order" in turn else "orientation"
        shown[key] = " ".join(map(str, turn.values()))
    assumed = {key: text for key, text in guess.assumed.items() if key not in shown}
    notes = [f"{key.replace('_', ' ')} {value}: found by trying it on the readings"
             for key, value in shown.items()]  # fmt: skip
    return replace(guess.but(settings), assumed=assumed, notes=(*guess.notes, *notes))
