"""Joints that a command is given, in a file or as arguments; remarks on the rows of an answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import click
import numpy as np

from kinacc.cli.choice import Options, joint_answers
from kinacc.cli.process import AGAINST
from kinacc.deployment.record import Calibration
from kinacc.errors import Problem, first_few, input_error, refuse
from kinacc.kinematics.robot import Robot, outside_limits
from kinacc.measurements.intake.choices import Answers
from kinacc.measurements.rows import Rows, read_rows
from kinacc.measurements.table import numbers_of

_MUCH_MOVED_MM = 0.1  # by a mm or mrad of undetermined parameters


def read(path: str, robot: Robot, need: str = "joints", answers: Answers | None = None) -> Rows:
    """Rows of a file, as ``read_rows``; notes on how it was read go to the error stream."""
    rows = read_rows(path, robot.dh.prismatic, need, answers)
    for note in rows.notes:
        click.echo(f"{path}: {note}", err=True)
    return rows


def read_joints(path: str, robot: Robot, answers: Answers | None = None) -> tuple[Rows, np.ndarray]:
    """Rows of a file and their joints (n, k)."""
    rows = read(path, robot, answers=answers)
    assert rows.joints is not None  # read_rows refuses a file without them
    return rows, rows.joints


def numbers_given(option: str, text: str, count: int) -> np.ndarray:
    """Numbers (count,) of an option such as "1,2,3"; InputError for others."""
    values = numbers_of(text)
    if len(values) != count:
        raise input_error(option, repr(text), f"{count} numbers")
    return values


def joints_given(option: str, text: str, slides: np.ndarray) -> np.ndarray:
    """Joints (k,) of an option such as "10,-20,30,0,45,0" in deg, in mm where one slides (k,)."""
    return numbers_given(option, text, len(slides)) * np.where(slides, 1.0, np.pi / 180.0)


def joints_of(
    robot: Robot, path: str | None, in_deg: Sequence[str], answers: Answers
) -> tuple[Rows, np.ndarray]:
    """Rows and joints (n, k) of a file or of arguments.

    InputError without any, or outside the limits. ``answers`` to what the file leaves open, by
    option.
    """
    if (path is None) != bool(in_deg):
        raise input_error("joints", "are needed once", "a file, --joints-deg")
    if path is not None:
        rows, joints = read_joints(path, robot, answers)
    else:
        slides = robot.dh.prismatic
        joints = np.array([joints_given("--joints-deg", text, slides) for text in in_deg])
        rows = Rows(np.arange(1, len(joints) + 1), joints)
    require_within_limits(robot, rows.label, joints, path or "joints")
    return rows, joints


def candidates(
    options: Options, robot: Robot, most: int, draw: Callable[[int], np.ndarray]
) -> tuple[Rows, np.ndarray]:
    """Rows and joints (n, k) of the file of ``--candidates``, or as many as it states, drawn."""
    text = options["candidates"]
    if text.lstrip("-").isdecimal():
        if not 2 <= int(text) <= most:
            raise input_error("--candidates", text, f"2 to {most}, or a file")
        joints = draw(int(text))
        return Rows(np.arange(1, len(joints) + 1), joints), joints
    rows, joints = read_joints(text, robot, joint_answers(options))
    require_within_limits(robot, rows.label, joints, text)
    if len(joints) > most:
        raise input_error(text, f"{len(joints)} candidates", f"at most {most}")
    return rows, joints


def require_within_limits(robot: Robot, label: np.ndarray, joints: np.ndarray, where: str) -> None:
    """Raise InputError with every joint of which a row lies outside the robot's limits."""
    problems = []
    for fault in outside_limits(robot, joints, 1e-9):
        name = f"q{fault.joint}"
        fix = f"the column looks like degrees: name it {name}_deg"
        place = f"{where}, {name}, rows {first_few(label[fault.rows])}"
        value = f"{fault.values[0]:g} {fault.unit}"
        problems.append(
            Problem(place, value, fault.allowed, fix if fault.looks_like_degrees else "")
        )
    refuse(problems, "Joints outside the robot's limits")


def print_remarks(
    rows: Rows, calibration: Calibration, unlike: np.ndarray, moved_mm: np.ndarray, frame: str
) -> None:
    """Name unused columns and count doubtful rows on the error stream.

    ``unlike`` (n,): rows unlike measured poses. ``moved_mm`` (n,): movement of poses in the robot's
    base by a mm or mrad of undetermined parameters.
    """
    if rows.unused:
        click.echo(f"not used: {', '.join(rows.unused)}", err=True)
    if rows.payload is not None and not calibration.model.knows_loads:
        model = f"the {calibration.choice} model was fitted without loads that change"
        click.echo(f"not used: payload; {model}", err=True)
    if np.any(unlike):
        click.echo(
            f"warning: {np.sum(unlike)} of {len(unlike)} poses are not near measured poses "
            "(status); their errors may be larger",
            err=True,
        )
    largest = np.nan_to_num(moved_mm).max(initial=0.0)
    if frame == "base" and largest > _MUCH_MOVED_MM:
        click.echo(
            f"warning: each mm or mrad of undetermined parameters moves poses by up to "
            f"{largest:.2g} mm in the base frame; compare --frame instrument",
            err=True,
        )


def end_where_missing(answers: np.ndarray, quantity: str) -> None:
    """Count the rows (n, m) without an answer on the error stream, and leave with exit code 1."""
    missing = int(np.isnan(answers).any(axis=1).sum())
    if missing:
        click.echo(
            f"{missing} of {len(answers)} rows without {quantity}: status says why", err=True
        )
        raise SystemExit(AGAINST)
