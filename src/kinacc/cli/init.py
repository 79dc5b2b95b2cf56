"""``kinacc init``: from a measured file to the two files a calibration starts from."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from kinacc.calibration.summary import reported_joints
from kinacc.checks.described import corrected, coupling_of, fitting, remarks_on
from kinacc.checks.findings import Report
from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.output import Output, answers
from kinacc.config.names import LONGEST
from kinacc.errors import input_error
from kinacc.kinematics import robot as robots
from kinacc.measurements.intake import write
from kinacc.measurements.intake.groups import listed
from kinacc.measurements.intake.guess import Guess, look
from kinacc.measurements.reader import MeasuredFile, read
from kinacc.measurements.rows import joint_columns
from kinacc.progress import reporting
from kinacc.report import rendering
from kinacc.report.terminal import print_table
from kinacc.tables.atomic import require_writable, write_together

_FOLDS_UNKNOWN = 60
_FIRST_POSES = 3
_QUATERNION = ["qx", "qy", "qz", "qw"]


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
        A row for each target of the first poses, as understood: joints (deg, mm), position (mm),
        rotation vector (deg).
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
    first_poses: pd.DataFrame
    next: list[str]


@click.command("init")
@click.argument("measurement_files", nargs=-1, required=True, type=choice.PATH)
@option("--robot", help="A shipped name, a robot file or a URDF file. [found by fitting]")
@option("--out", "folder", default=".", help="Folder to write to.")
@option("--name", help="Name of the data set. [as the file]")
@choice.setting("--length-unit", "length_unit", "Unit of the positions.")
@choice.setting("--angle-unit", "orientation.unit", "Unit of orientations.")
@option("--orientation",
        help="quaternion (scalar first), quaternion_xyzw, rotation_vector, none, or an Euler "
        "convention such as XYZ.")  # fmt: skip
@choice.file_options
@option("--join", metavar="HOW",
        help="Join of joints and points of two files: A=B (column A of the joints names the poses "
        "as B of the points), time or order.")  # fmt: skip
@option("--clock-offset", metavar="SECONDS",
        help="Seconds added to times of points to get the joints'.")  # fmt: skip
@answers(force=True)
def init(measurement_files: tuple[str, ...], out: Output, **options: Any) -> None:
    """Describe MEASUREMENT_FILES: write their data set and, where needed, its robot.

    Where the files can be read in several ways, nothing is written, and the options that decide are
    named. Two files are joints and points of the same poses.

    \b
    Example:
      kinacc init series_D.csv --robot ur10 --name ur10_d
      kinacc init joints.csv points.csv --join Name=Point
    """
    if len(measurement_files) > 2:
        message = f"{len(measurement_files)} files"
        allowed = "one file, or one of joints and one of points"
        raise input_error(" ".join(measurement_files), message, allowed)
    stated = {key: value for key, value in options.items() if value not in (None, ())}
    guess = look(measurement_files, stated)
    name = options["name"] or write.plain_name(guess.table.path)
    if name != write.plain_name(f"{name}.csv"):
        raise input_error("--name", name, f"at most {LONGEST} letters, digits, _ and -")
    dataset = Path(options["folder"], f"{name}.yaml")
    robot_file = dataset.with_name(f"{name}.robot.yaml")
    if options["robot"] and dataset.resolve() == Path(options["robot"]).resolve():
        raise input_error(
            str(dataset), "is the robot file, and would be overwritten", fix="give --name"
        )
    robot, chosen = _robot(guess, options["robot"])
    text = _robot_text(robot, guess.joints, name, robot_file.parent)
    texts = {} if text is None else {robot_file: text}
    require_writable([dataset, *texts], out.force)
    report, remarks = None, []
    if robot is None:  # joints need no robot to be read
        arm = robots.of_text(write.template_text("any", guess.joints), "any.yaml")
        reading = read(guess.section, arm, strict=False)
    else:
        arm = robots.load(robot)
        with reporting(f"init {name}"):
            guess, report, reading = corrected(guess, arm)
            if text is not None and (coupling := coupling_of(report)) is not None:
                matrix = coupling.values["joint_map"]
                why = f"found by trying it on the readings: {coupling.what}"
                texts[robot_file] = write.coupled_text(text, matrix, f"Joints are coupled, {why}.")
                note = f"joint_map of the robot file that is written couples joints, {why}"
                arm = replace(arm, joint_map=np.array(matrix, dtype=float))
                guess = replace(guess, notes=(*guess.notes, note))
                guess, report, reading = corrected(guess, arm)
        remarks = list(remarks_on(guess, report))
    poses = _first_poses(reading, arm.dh.prismatic)
    if not out.as_json:
        click.echo("First poses as understood (joints in deg, positions in mm, rotation vectors):")
        print_table(poses.dropna(axis=1, how="all"))
    how = "assumed" if report is None or report.stopping else "assumed, and the readings agree"
    unused = guess.reasons(reading.unused)
    unread = {
        why: ", ".join(column for column in unused if unused[column] == why)
        for why in unused.values()
    }
    head = [f"Written by kinacc init. Robot: {chosen}."]
    head += [f"{how.capitalize()}: {assumed}." for assumed in guess.assumed.values()]
    head += [f"Not read: {names} ({why})." for why, names in unread.items() if why]
    used = robot if robot and text is None else str(robot_file)
    texts[dataset] = _dataset(dataset, name, used, guess, report, head)
    write_together({path: content.encode() for path, content in texts.items()})
    result = Description(
        written=[str(path) for path in texts],
        robot=robot,
        robot_because=chosen,
        joints=guess.joints,
        targets=list(guess.columns.targets),
        file=guess.section,
        assumed=guess.assumed,
        notes=guess.notes,
        unused_columns=unused,
        suspicions=[finding.kind for finding in report.suspicions] if report else [],
        remarks=remarks,
        first_poses=poses,
        next=[_command("check-data", dataset), _command("calibrate", dataset)],
    )
    about = {"columns": guess.columns, "listed": listed, "how": how, "unread": unread}
    out.show(result, lines=rendering.lines("description.txt", d=result, **about))


def _first_poses(reading: MeasuredFile, prismatic: np.ndarray) -> pd.DataFrame:
    """A row for each target of the first poses, as it was read first, in deg and mm."""
    table = pd.DataFrame(reading.columns)
    table = table[table["pose"].isin(table["pose"].unique()[:_FIRST_POSES])]
    table = table.drop_duplicates(["pose", "target"]).reset_index(drop=True)
    joints = reported_joints(table, len(prismatic))
    where = [reading.row_names.one(int(line)) for line in table["row"]]
    first = pd.DataFrame({"where": where, **joint_columns(prismatic, joints)})
    first = first.join(table[["target", "x_mm", "y_mm", "z_mm"]])
    turned = table[_QUATERNION].astype(float).dropna()
    if len(turned):
        vectors = Rotation.from_quat(turned).as_rotvec(degrees=True)
        first.loc[turned.index, ["rvx_deg", "rvy_deg", "rvz_deg"]] = vectors
    return first


def _robot(guess: Guess, stated: str | None) -> tuple[str | None, str]:
    """The robot as stated or found by fitting, None for a template; and why."""
    if stated is not None:
        return stated, "as given"
    with reporting("init"):
        fit = fitting(guess)
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
    path: Path, name: str, robot: str, guess: Guess, report: Report | None, head: list[str]
) -> str:
    """Text of the data set below a ``head``; it names files from where it stands."""
    check = _command("check-data", path)
    default = f"Everything not given here has its default (docs/configuration.md).\n    {check}"
    poses = int(report.facts["poses"]) if report else _FOLDS_UNKNOWN
    files = {"path": write.seen_from(path.parent, guess.section["path"])}
    if joints := guess.section.get("joints"):
        files["joints"] = joints | {"path": write.seen_from(path.parent, joints["path"])}
    robot = write.seen_from(path.parent, robot)
    return write.dataset_text(name, robot, guess.but(files), poses, "\n".join([*head, default]))


def _command(name: str, dataset: Path) -> str:
    return shlex.join(["kinacc", name, str(dataset)])
