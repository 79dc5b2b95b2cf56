"""A robot program corrected for a calibrated arm: the same text, other numbers.

The corrected pose is the one whose nominal inverse reaches the programmed pose on the calibrated
model: joints of the posture that the program states are refined onto the programmed pose, and the
nominal arm's pose at these joints is written.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from kinacc.deployment import compensate as inverse
from kinacc.deployment.compensate import PoseStatus
from kinacc.deployment.predict import predict
from kinacc.deployment.programs import (
    abb,
    fanuc,
    kuka,
    posture,
    table,
    universal,
    yaskawa,
)
from kinacc.deployment.programs.record import (
    BASE,
    KNOWN,
    TOOL,
    Frames,
    Language,
    Position,
    Program,
    Source,
    frames_of_yaml,
    replaced,
)
from kinacc.deployment.record import FLANGE, MEASURED, Calibration
from kinacc.errors import InputError, Problem, input_error, refuse
from kinacc.geometry import IDENTITY, Pose, compose, invert
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.model import JointState
from kinacc.kinematics.robot import Robot, forward
from kinacc.tables.atomic import write_new

LANGUAGES: tuple[Language, ...] = tuple(
    module.LANGUAGE for module in (kuka, abb, fanuc, universal, yaskawa, table)
)
AT_MOST_MM = 20.0
_RECORD = ".kinacc.json"
_SAME_TOOL_MM, _SAME_TOOL_RAD = 5.0, np.deg2rad(1.0)
_SINGULAR = 0.02  # smallest singular value of the Jacobian in rad and units of the reach
_SHOWN = [
    "change_mm", "change_mrad", "largest_joint_change_deg", "expected_error_mm",
    "is_measured_there", "is_near_singular",
]  # fmt: skip
_POINT = "tool of the program"
_UNKNOWN = "not a calibrated target; expected errors include the uncertainty of its position"
_TRACK = "an external axis is not at zero (--base-is-fixed: none moves the robot's base)"
Ask = Callable[[str, str], np.ndarray]
Options = Mapping[str, Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class CorrectedProgram:
    """A program whose positions are corrected.

    ``table``: one row a position; ``refused``: positions that could not be corrected, with the
    reason; ``not_corrected``: statements whose positions are computed,
    incomplete or defined elsewhere; ``remarks``:
    tools whose calibrated place is used. ``files``: new contents by the file they come from.
    """

    language: str
    calibration: str
    table: pd.DataFrame
    refused: tuple[Problem, ...]
    not_corrected: tuple[str, ...]
    remarks: tuple[str, ...]
    files: Mapping[Path, bytes]

    def write(self, out: Path | str, force: bool = False) -> list[str]:
        """Write the program; InputError for positions refused, or files that are there."""
        refuse(self.refused, "Positions cannot be corrected; nothing was written")
        out, (first, *others) = Path(out), self.files
        facts = {
            "from": [path.name for path in self.files],
            "calibration": self.calibration,
            "sha256": _digest(self.files.values()),
        }
        contents: dict[str | Path, bytes] = {out: self.files[first]}
        contents |= {out.with_suffix(path.suffix): self.files[path] for path in others}
        contents[out.with_name(out.name + _RECORD)] = f"{json.dumps(facts, indent=1)}\n".encode()
        return write_new(contents, force)


def read_program(
    path: Path | str,
    frame_files: Iterable[Path | str] = (),
    pulses_per_deg: np.ndarray | None = None,
) -> tuple[Language, Program]:
    """Positions of a program and of the files that belong to it, and its language.

    ``frame_files``: further files with tools and bases, such as KUKA's $config.dat. Raises
    InputError with the line for what cannot be read.
    """
    path = Path(path)
    ending = path.suffix.lower()
    languages = {known: item for item in LANGUAGES for known in item.endings}
    if ending not in languages:
        message = f"ends in {ending!r}: no robot language"
        raise input_error(str(path), message, ", ".join(languages))
    language = languages[ending]
    beside = {item.name.lower(): item for item in path.parent.iterdir() if item != path}
    partners = (beside.get(path.stem.lower() + suffix) for suffix in language.partners)
    named = map(beside.get, language.frame_files)
    sources = [Source.read(item) for item in (path, *filter(None, partners))]
    frames = dict(KNOWN)
    for source in [*map(Source.read, map(Path, (*filter(None, named), *frame_files))), *sources]:
        is_yaml = source.path.suffix.lower() == ".yaml"
        frames |= (
            frames_of_yaml(source, language.convention) if is_yaml else language.frames(source)
        )
    program = language.read(sources, pulses_per_deg)
    program = replace(program, frames=frames | program.frames)
    if not program.positions:
        message = "is computed, incomplete or defined elsewhere"
        computed = [Problem(line, message) for line in program.not_corrected]
        raise InputError([Problem(str(path), "has no positions that can be corrected"), *computed])
    return language, program


def compensate_program(
    calibration: Calibration,
    path: Path | str,
    tools: Mapping[str, np.ndarray] | None = None,
    bases: Mapping[str, np.ndarray] | None = None,
    frame_files: Iterable[Path | str] = (),
    near_rad: np.ndarray | None = None,
    pulses_per_deg: np.ndarray | None = None,
    point: str | None = None,
    at_most_mm: float = AT_MOST_MM,
    base_is_fixed: bool = False,
    ask: Ask | None = None,
) -> CorrectedProgram:
    """A program corrected for a calibrated arm.

    Parameters
    ----------
    tools, bases
        Frames that the program does not hold, by name ("" for all): six numbers in mm and degrees
        in the controller's convention; the tool in the flange, the base in the robot's base.
    near_rad
        Reported joints (k,) before the program, for languages whose positions state no posture.
    point
        Calibrated target that the tool is, or ``flange`` for a tool as the controller has it. A
        target within 5 mm and 1 deg of the controller's tool where not given.
    at_most_mm
        A larger change of a position is refused.
    base_is_fixed
        External axes that are not at zero do not move the robot's base.
    ask
        Called with kind and name of a frame that is missing; gives its numbers.

    Raises
    ------
    InputError
        For a file that cannot be read, frames that are missing, a program compensated before.
    """
    language, program = read_program(path, frame_files, pulses_per_deg)
    _refuse_second_time(program)
    options = {TOOL: tools or {}, BASE: bases or {}}
    program = replace(program, frames=_all_frames(program, options, ask))
    robot, positions, new = calibration.robot, program.positions, {}
    starts, reasons = _starts(robot, language, program, near_rad, base_is_fixed)
    rows, remarks = _outcomes(calibration, program, starts, point)
    for position, row in zip(rows.index, rows.itertuples(), strict=True):
        if reason := _obstacle(robot, language, position, row, at_most_mm):
            reasons[position] = reason
        elif position.scale is None:
            place = compose(invert(program.frame(BASE, position)), row.pose)
            new[position] = program.convention.numbers(place, position.numbers)
        else:
            new[position] = row.q_rad / _unit(robot) * position.scale
    table = pd.DataFrame({
        "position": [item.name for item in positions],
        "file": [item.where for item in positions],
        "kind": ["pose" if item.scale is None else "joints" for item in positions],
    }).join(rows.reindex(positions)[_SHOWN].reset_index(drop=True))  # fmt: skip
    table["status"] = [reasons.get(item, "corrected") for item in positions]
    return CorrectedProgram(
        language.name,
        f"{calibration.name}, {calibration.choice}",
        table,
        tuple(
            Problem(f"{item.where} {item.name}", reasons[item])
            for item in positions
            if item in reasons
        ),
        tuple(program.not_corrected),
        tuple(remarks),
        {source.path: replaced(source, new) for source in program.sources},
    )


def _starts(
    robot: Robot,
    language: Language,
    program: Program,
    near_rad: np.ndarray | None,
    base_is_fixed: bool,
) -> tuple[dict[Position, np.ndarray], dict[Position, str]]:
    """Reported joints (k,) of the nominal arm at positions, and why others have none."""
    poses = [item for item in program.positions if item.has_frames]
    flange = [program.flange(item) for item in poses]
    ways = dict(zip(poses, posture.postures_of(robot, flange), strict=True))
    starts: dict[Position, np.ndarray] = {}
    reasons: dict[Position, str] = {}
    for item in program.positions:
        start: np.ndarray | str = item.refused
        if item in ways and item.moves_outside and not base_is_fixed:
            start = _TRACK
        elif item in ways:
            near = near_rad if item.near_rad is None else item.near_rad
            start = posture.choose(robot, ways[item], language.posture, item.posture, near)
        elif not start and len(item.places) != robot.dh.joints:
            start = f"has {len(item.places)} joints, not {robot.dh.joints}"
        elif not start:
            q_rad = item.numbers / item.scale * _unit(robot)
            inside = limits.within(q_rad, robot.q_min_rad, robot.q_max_rad)
            start = q_rad if inside else "its joints are beyond the limits"
        if isinstance(start, str):
            reasons[item] = start
        else:
            near_rad = starts[item] = start
    return starts, reasons


def _unit(robot: Robot) -> np.ndarray:
    """Radians (mm where a joint slides) of a unit in which joints are written, (k,)."""
    return np.where(robot.dh.prismatic, 1.0, np.pi / 180.0)


def _outcomes(
    calibration: Calibration,
    program: Program,
    starts: Mapping[Position, np.ndarray],
    point: str | None,
) -> tuple[pd.DataFrame, list[str]]:
    """Rows of ``_corrected`` by position, and remarks."""
    remarks: list[str] = []
    parts = [pd.DataFrame(columns=_SHOWN)]
    for name in dict.fromkeys(position.tool for position in starts):
        group = [position for position in starts if position.tool == name]
        tool = program.frame(TOOL, group[0])
        target, place, remark = _carried(calibration, tool, point)
        remarks += [f"Tool {name or 'of joints'}: {remark}"] if remark else []
        q_rad = np.stack([starts[position] for position in group])
        parts.append(_corrected(calibration, q_rad, target, place, tool).set_axis(group))
    return pd.concat(parts[1:] or parts), remarks


def _obstacle(
    robot: Robot, language: Language, position: Position, row: Any, at_most_mm: float
) -> str:
    """Why a position cannot be corrected as its ``row`` has it; empty where it can."""
    if row.outcome > PoseStatus.EXTRAPOLATED:
        status = PoseStatus(row.outcome).name.lower().replace("_", " ")
        return f"the calibrated arm: {status}" + f": joint {row.joints}" * bool(row.joints)
    if row.change_mm > at_most_mm:
        return f"would move by {row.change_mm:.3g} mm (--at-most-mm; is --tool right?)"
    if not position.posture:
        return ""
    changed = posture.unmatched(robot, language.posture, position.posture, row.q_rad)
    return f"the posture would change to {changed}" if changed else ""


def _digest(contents: Iterable[bytes]) -> str:
    return hashlib.sha256(b"\0".join(contents)).hexdigest()


def _refuse_second_time(program: Program) -> None:
    path = program.sources[0].path
    digest = _digest(source.text.encode("latin-1") for source in program.sources)
    for record in sorted(path.parent.glob(f"*{_RECORD}")):
        if digest in record.read_text(errors="replace"):
            fix = "give the program it was made from"
            raise input_error(str(path), f"was compensated before ({record.name})", fix=fix)


def _all_frames(program: Program, options: Options, ask: Ask | None) -> Frames:
    """The program's frames and those a person gave; InputError naming those that are missing."""
    frames, problems = dict(program.frames), []
    poses = [item for item in program.positions if item.has_frames]
    wanted = {(kind, getattr(item, kind) or "") for item in poses for kind in (TOOL, BASE)}
    # Joints are corrected where their tool is: its name asks for it, and one for all is theirs.
    wanted |= {(TOOL, item.tool) for item in program.positions if item.tool and not item.refused}
    wanted |= {(TOOL, name) for name in options[TOOL] if not name}
    for kind, name in sorted(wanted - set(frames)):
        numbers = options[kind].get(name, options[kind].get(""))
        if numbers is None and ask is not None:
            numbers = ask(kind, name)
        if numbers is None:
            fix = f'give --{kind} "{name and name + "="}x,y,z,.." (mm, deg) or --frames FILE'
            message = f"{kind} {name or 'of its positions'} is not in the program"
            problems.append(Problem(str(program.sources[0].path), message, fix=fix))
        else:
            frames[kind, name] = program.convention.typed(numbers)
    refuse(problems, "Frames are missing")
    return frames


def _carried(calibration: Calibration, tool: Pose, point: str | None) -> tuple[str, Pose, str]:
    """The program's tool on the calibrated arm: its name, its place in the last frame, a remark.

    The name is that of the target whose place and covariance are its own.
    """
    mounted = compose(compose(_moved(calibration), calibration.robot.flange), tool)
    for target in [point] if point else calibration.targets:
        place = calibration.point(target)
        if calibration.orientation_source(target) != MEASURED:
            place = Pose(mounted.rotation, place.position_mm)
        gap_mm, gap_rad = inverse.distance(place, mounted)
        if target != FLANGE and (point or (gap_mm <= _SAME_TOOL_MM and gap_rad <= _SAME_TOOL_RAD)):
            gap = f"{gap_mm:.3g} mm and {1e3 * gap_rad:.3g} mrad"
            remark = f"the calibrated {target}, {gap} from the controller's tool, takes its place"
            return target, place, f"{remark} (--point flange: the controller's tool)."
    return _POINT, mounted, _UNKNOWN if calibration.targets else ""


def _moved(calibration: Calibration) -> Pose:
    """A point of the last frame of the anchor, the DH model fitted alike, in that of the model."""
    anchor = calibration.anchor
    if anchor is None or not calibration.targets:
        return IDENTITY
    name = calibration.default_point
    return compose(calibration.point(name), invert(anchor.point(name)))


def _corrected(
    calibration: Calibration, start: np.ndarray, target: str, carried: Pose, tool: Pose
) -> pd.DataFrame:
    """Outcomes of positions of one tool: corrected joints, nominal poses there, changes.

    Joints that the model does not cover are so whatever another posture would reach.
    """
    robot, anchor = calibration.robot, calibration.anchor
    if anchor is not None:
        place = compose(invert(_moved(calibration)), carried)
        anchor = replace(anchor, targets={**anchor.targets, target: place})
    targets = {**calibration.targets, target: carried}
    arm = replace(calibration, targets=targets, anchor=anchor)
    wanted = compose(forward(robot, start), tool)
    result = inverse.compensate(arm, wanted, start, point=target)
    beyond = arm.outside_range(robot.dh_joints(start))
    uncovered = (result.status == PoseStatus.OTHER_POSTURE) & beyond.any(axis=1)
    status = np.where(uncovered, PoseStatus.OUTSIDE_RANGE, result.status)
    beyond = np.where(uncovered[:, None], beyond, result.offending)
    joints = [", ".join(map(str, 1 + np.flatnonzero(row))) for row in beyond]
    q_rad = np.where(np.isfinite(result.q_rad) & ~uncovered[:, None], result.q_rad, start)
    new = compose(forward(robot, q_rad), tool)
    shift_mm, turn_rad = inverse.distance(new, wanted)
    known = predict(arm, q_rad, point=target)
    slopes = robot.dh.joint_jacobian(JointState(robot.dh_joints(q_rad)))
    slopes[:, :3] /= np.sum(np.abs(robot.dh.a_mm) + np.abs(robot.dh.d_mm))
    errors_mm = np.nan_to_num([known.unexplained[:, 0], known.std_position_mm])
    return pd.DataFrame(
        {
            "q_rad": list(q_rad),
            "pose": [Pose(*parts) for parts in zip(*new, strict=True)],
            "outcome": status,
            "joints": joints,
            "change_mm": shift_mm,
            "change_mrad": 1e3 * turn_rad,
            "largest_joint_change_deg": np.rad2deg(np.abs(q_rad - start).max(axis=1)),
            "expected_error_mm": np.hypot(*errors_mm),
            "is_measured_there": known.near,
            "is_near_singular": np.linalg.svd(slopes, compute_uv=False)[:, -1] < _SINGULAR,
        }
    )
