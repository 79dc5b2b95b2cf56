"""Measured files that nobody has described: their settings, as ``kinacc init`` finds them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.calibration.least_squares import one_thread
from kinacc.checks import check, digits, readings, shipped
from kinacc.checks.findings import Finding, Report
from kinacc.config.values import did_you_mean
from kinacc.errors import InputError, Problem, input_error, refuse
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import Robot
from kinacc.measurements.intake import guess as guesses
from kinacc.measurements.intake.guess import Guess
from kinacc.measurements.intake.write import dataset_content, plain_name, template_text
from kinacc.measurements.layout import ANGLE, LENGTH
from kinacc.measurements.reader import MeasuredFile, read

ANSWERS = (
    *("joint_unit", "length_unit", "angle_unit", "orientation", "take", "join", "clock_offset"),
    *("decimal", "thousands", "encoding", "sheet", "names", "pulses_per_deg", "no_reading"),
    *("sigma", "direction_unit", "vertical", "horizontal"),
)
_CALCULATED_MM = 0.004  # closer to an arm than any instrument measures
_COARSE_DEG = 0.005  # 0.09 mm at 1 m; less is nothing beside what instruments measure with
_ABOUT = {  # the setting that a finding contradicts
    "joint_units": "joint_unit",
    "length_units": "length_unit",
    "angle_units": "angle_unit",
    "euler_convention": "orientation",
    "left_handed": "horizontal",
}


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
        What the files leave open, by the option of ``kinacc init``: some of ``ANSWERS``.

    Returns
    -------
    dict
        ``{name: settings}``, with the name of the file of points.

    Raises
    ------
    InputError
        Listing the questions that the files leave open with their answers, or what is wrong.
    """
    answers = answers or {}
    refuse(
        Problem(key, "is not an answer on files", ", ".join(ANSWERS), did_you_mean(key, ANSWERS))
        for key in answers
        if key not in ANSWERS
    )
    texts = {key: value if key == "take" else str(value) for key, value in answers.items()}
    guess = guesses.look(list(files), texts)
    if robot is None:
        if not (fit := fitting(guess)):
            fix = "give robot: a name in docs/robots.md, a robot file or a URDF file"
            raise input_error(guess.table.path, "no shipped robot fits the readings", fix=fix)
        robot = fit[0]
    name = plain_name(guess.table.path)
    guess, report, _ = corrected(guess, robots.load(robot))
    if (coupling := coupling_of(report)) is not None:
        fix = "kinacc init writes the robot file with this joint_map"
        raise input_error(f"robot {robot}", coupling.what, fix=fix)
    return {name: dataset_content(robot, guess, int(report.facts["poses"]))}


def corrected(guess: Guess, robot: Robot) -> tuple[Guess, Report, MeasuredFile]:
    """Correct assumed settings of a file where its readings contradict them.

    Parameters
    ----------
    guess
        Settings of the file, of which some are assumed.
    robot
        The arm that was measured.

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
        fix = f"joints are J1 .. J{robot.dh.joints} in the robot's order"
        read_columns = guess.columns.read()
        if unused := ", ".join(name for name in guess.table.columns if name not in read_columns):
            fix += f"; rename theirs among the columns not used: {unused}"
        raise input_error("--robot", message, fix=fix)
    for _ in range(3):
        reading = read(guess.section, robot, strict=False)
        report = check.check(reading, guess.section, robot)
        guess = replace(guess, notes=tuple(dict.fromkeys((*guess.notes, *reading.notes))))
        before, guess = guess, _set_right(guess, report)
        if guess is before:
            break
    return guess, report, reading


def coupling_of(report: Report) -> Finding | None:
    """The coupling of two joints that alone explains the readings, where there is one."""
    return next((item for item in report.suspicions if item.values.get("joint_map")), None)


def _set_right(guess: Guess, report: Report) -> Guess:
    """The guess with assumed settings that the readings contradict as they should be."""
    for item in report.suspicions:
        about, setting = _ABOUT.get(item.kind, ""), dict(item.values.get("setting", {}))
        if about not in guess.assumed:
            continue
        if about == "horizontal":
            ways = guess.section["directions"]
            is_clockwise = ways["horizontal"] == "clockwise"
            way = "counterclockwise" if is_clockwise else "clockwise"
            setting = {"directions": ways | {"horizontal": way}}
        if in_order := setting.pop("e", None):
            columns, unit = dict(guess.section["columns"]), guess.section["orientation"]["unit"]
            angles = [columns.pop(name, f"{name}_{unit}") for name in in_order]
            setting["columns"] = columns | {f"e{n}": column for n, column in enumerate(angles, 1)}
        if setting:
            assumed = {key: text for key, text in guess.assumed.items() if key != about}
            note = f"{about.replace('_', ' ')} set by the readings: {item.what}"
            guess = replace(guess.but(setting), assumed=assumed, notes=(*guess.notes, note))
    return guess


@one_thread
def fitting(guess: Guess) -> list[str]:
    """Fit the shipped robots to a file.

    Parameters
    ----------
    guess
        What a measured file holds.

    Returns
    -------
    list of str
        Names of the robots that fit: one, or those of equal geometry; or none.
    """
    arm = robots.of_text(template_text("any", guess.joints), "any.yaml")
    try:
        every = readings.of_file(read(guess.section, arm, strict=False), arm)
    except InputError:
        return []
    return shipped.fitting(readings.merged(every)[0])


def remarks_on(guess: Guess, report: Report) -> Iterator[str]:
    """Limits of readings that contradict nothing: points that were calculated, rounded joints.

    Parameters
    ----------
    guess
        The description of a file.
    report
        The check of its readings.

    Yields
    ------
    str
        A remark each, with lengths in mm.
    """
    fit = report.facts.get("quick_fit")
    if fit and fit["left_per_axis_mm"] <= _CALCULATED_MM:
        yield (
            f"the points follow the joints to {fit['left_per_axis_mm']:.1g} mm, closer than "
            "instruments measure: were they calculated by the controller or a simulation?"
        )
    if guess.section.get("pulses_per_deg"):
        return
    columns = [guess.table.columns[name.column] for name in guess.columns.joints
               if name.unit not in LENGTH]  # fmt: skip
    unit_deg = np.rad2deg(ANGLE[guess.section["joint_unit"]])
    steps = (digits.step(column, unit_deg, guess.table.decimal) for column in columns)
    step = min(steps, default=0.0)
    if step > _COARSE_DEG:
        yield (
            f"joints are written in steps of {step:.2g} deg: {1000.0 * np.deg2rad(step):.2g} mm at "
            "1 m from an axis; export more digits"
        )
