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
from kinacc.deployment.programs.frame_files import frames_of
from kinacc.deployment.programs.orientation import Convention
from kinacc.deployment.programs.record import (
    BASE,
    TOOL,
    Language,
    Position,
    Program,
    Source,
    replaced,
)
from kinacc.deployment.record import FLANGE, MEASURED, Calibration
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import IDENTITY, Pose, compose, invert, log_so3
from kinacc.kinematics import dh
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.robot import Robot
from kinacc.tables.atomic import write_together

LANGUAGES: tuple[Language, ...] = tuple(
    module.LANGUAGE for module in (kuka, abb, fanuc, universal, yaskawa, table)
)
AT_MOST_MM = 20.0
_RECORD = ".kinacc.json"
_SAME_TOOL_MM, _SAME_TOOL_RAD = 5.0, np.deg2rad(1.0)
_SAME_MM, _SAME_RAD = 1e-6, 1e-9  # a pose that is no other
_SINGULAR = 0.02  # smallest singular value of the Jacobian in rad and units of the reach
_POINT = "tool of the program"
_TRACK = "an external axis is not at zero (--base-is-fixed: none moves the robot's base)"
_REASONS = {
    PoseStatus.OTHER_POSTURE: "the calibrated arm reaches it only in another posture",
    PoseStatus.OUTSIDE_LIMITS: "the corrected joints are beyond the limits",
    PoseStatus.OUTSIDE_RANGE: "a joint is outside the range that the model covers",
    PoseStatus.NOT_REACHED: "the calibrated arm cannot reach it",
}
Ask = Callable[[str, str], np.ndarray]


@dataclass(frozen=True)
class CorrectedProgram:
    """A program whose positions are corrected.

    ``table``: one row a position; ``refused``: positions that could not be corrected, with the
    reason; ``left``: statements whose positions the program computes, not corrected; ``remarks``:
    tools whose calibrated place is used. ``files``: new contents by the file they come from.
    """

    language: str
    calibration: str
    table: pd.DataFrame
    refused: tuple[Problem, ...]
    left: tuple[str, ...]
    remarks: tuple[str, ...]
    files: Mapping[Path, bytes]

    def write(self, out: Path | str, force: bool = False) -> None:
        """Write the program; InputError for positions refused, or files that are there."""
        refuse(self.refused, "Positions cannot be corrected; nothing was written")
        out, first = Path(out), next(iter(self.files))
        facts = {
            "from": [path.name for path in self.files],
            "calibration": self.calibration,
            "sha256": _digest(self.files.values()),
        }
        contents = {
            out if path == first else out.with_suffix(path.suffix): content
            for path, content in self.files.items()
        }
        contents[out.with_name(out.name + _RECORD)] = f"{json.dumps(facts, indent=1)}\n".encode()
        there = [] if force else [path for path in contents if path.exists()]
        fix = "give --force to replace it"
        refuse(Problem(str(path), "is there already", fix=fix) for path in there)
        write_together(contents)


def read_program(
    path: Path | str,
    frame_files: Iterable[Path | str] = (),
    pulses_per_degree: np.ndarray | None = None,
) -> tuple[Language, Program]:
    """Positions of a program and of the files that belong to it, and its language.

    ``frame_files``: further files with tools and bases, such as KUKA's $config.dat. Raises
    InputError with the line for what cannot be read.
    """
    path = Path(path)
    ending = path.suffix.lower()
    language = next((each for each in LANGUAGES if ending in each.endings), None)
    if language is None:
        known = ", ".join(ending for each in LANGUAGES for ending in each.endings)
        raise InputError(Problem(str(path), f"ends in {ending!r}: no robot language", known))
    beside = sorted(each for each in path.parent.glob("*") if each.is_file() and each != path)
    partners = [
        each
        for each in beside
        if each.stem.lower() == path.stem.lower() and each.suffix.lower() in language.partners
    ]
    named = [each for each in beside if each.name.lower() in language.frame_files]
    sources = [Source.read(each) for each in (path, *partners)]
    frames = {}
    for source in [*(Source.read(Path(each)) for each in (*named, *frame_files)), *sources]:
        is_yaml = source.path.suffix.lower() in (".yaml", ".yml")
        own = frames_of(source, language.convention) if is_yaml else language.frames(source)
        frames.update(own)
    program = language.read(sources, frames, pulses_per_degree)
    if not program.positions:
        raise InputError(Problem(str(path), "has no positions that can be corrected"))
    return language, program


def compensate_program(
    calibration: Calibration,
    path: Path | str,
    tools: Mapping[str, np.ndarray] | None = None,
    bases: Mapping[str, np.ndarray] | None = None,
    frame_files: Iterable[Path | str] = (),
    near_rad: np.ndarray | None = None,
    pulses_per_degree: np.ndarray | None = None,
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
    language, program = read_program(path, frame_files, pulses_per_degree)
    convention = program.convention or language.convention
    _refuse_second_time(program)
    frames = _all_frames(program, language, {TOOL: tools or {}, BASE: bases or {}}, ask)
    positions, robot = program.positions, calibration.robot
    tool, base = (
        [frames.get((kind, getattr(each, kind) or ""), IDENTITY) for each in positions]
        for kind in (TOOL, BASE)
    )
    reasons = {number: each.refused for number, each in enumerate(positions) if each.refused}
    for number, each in enumerate(positions):
        if each.moves_outside and each.scale is None and not base_is_fixed:
            reasons.setdefault(number, _TRACK)
    start = _starts(calibration, language, convention, positions, tool, base, near_rad, reasons)
    rows = pd.DataFrame({
        "position": [each.name for each in positions],
        "file": [each.where for each in positions],
        "kind": ["pose" if each.scale is None else "joints" for each in positions],
    })  # fmt: skip
    new: dict[Position, np.ndarray] = {}
    remarks = []
    for name in dict.fromkeys(each.tool for each in positions):
        group = [n for n, each in enumerate(positions) if each.tool == name and n not in reasons]
        if not group:
            continue
        own = frames.get((TOOL, name or ""))
        carried, remark = _carried(calibration, own, point)
        remarks += [f"Tool {name or ''}: {remark}"] if remark else []
        facts, q_rad, pose = _corrected(calibration, start[group], carried, own or IDENTITY)
        rows.loc[group, list(facts)] = facts.set_axis(group)
        for place, number in enumerate(group):
            position, status = positions[number], facts["status"].iloc[place]
            if status in _REASONS:
                reasons[number] = _REASONS[PoseStatus(status)]
            elif facts["change_mm"].iloc[place] > at_most_mm:
                reasons[number] = (
                    f"would move by {facts['change_mm'].iloc[place]:.3g} mm (--at-most-mm)"
                )
            elif position.scale is not None:
                new[position] = q_rad[place] / _unit(robot) * position.scale
            elif (
                position.posture
                and language.posture
                and (
                    apart := posture.unmatched(
                        robot, language.posture, position.posture, q_rad[place]
                    )
                )
            ):
                reasons[number] = f"the posture would change: {apart}"
            else:
                moved = facts["change_mm"].iloc[place], facts["change_mrad"].iloc[place]
                local = compose(invert(base[number]), Pose(*(part[place] for part in pose)))
                is_same = moved[0] < _SAME_MM and 1e-3 * moved[1] < _SAME_RAD
                numbers = position.numbers
                new[position] = numbers if is_same else convention.numbers(local, numbers)
    rows["status"] = [reasons.get(number, "corrected") for number in range(len(positions))]
    return CorrectedProgram(
        language.name,
        f"{calibration.name}, {calibration.choice}",
        rows,
        tuple(
            Problem(f"{positions[number].where} {positions[number].name}", why)
            for number, why in sorted(reasons.items())
        ),
        tuple(program.left),
        tuple(remarks),
        {source.path: replaced(source, new) for source in program.sources},
    )


def _digest(contents: Iterable[bytes]) -> str:
    return hashlib.sha256(b"\0".join(contents)).hexdigest()


def _refuse_second_time(program: Program) -> None:
    path = program.sources[0].path
    digest = _digest(source.text.encode("latin-1") for source in program.sources)
    for mark in sorted(path.parent.glob(f"*{_RECORD}")):
        if digest in mark.read_text(errors="replace"):
            fix = "give the program it was made from"
            raise InputError(Problem(str(path), f"was compensated before ({mark.name})", fix=fix))


def _all_frames(program: Program, language: Language, given: Mapping, ask: Ask | None) -> dict:
    """The program's frames and those a person gave; InputError naming those that are missing."""
    convention = program.convention or language.convention
    frames, problems = dict(program.frames), []
    poses = [each for each in program.positions if each.scale is None and not each.refused]
    wanted = {(kind, getattr(each, kind) or "") for each in poses for kind in (TOOL, BASE)}
    if "" in given[TOOL]:
        wanted.add((TOOL, ""))
    for kind, name in sorted(wanted - set(frames)):
        numbers = given[kind].get(name, given[kind].get(""))
        if numbers is None and ask is not None:
            numbers = ask(kind, name)
        if numbers is not None:
            frames[kind, name] = convention.typed(numbers)
            continue
        what = f"{kind} {name} is not in the program" if name else f"no {kind} is stated"
        label = f"{name}=" if name else ""
        fix = (
            f'give --{kind} "{label}x,y,z,.." (mm, deg: {convention.orientation}) or --frames FILE'
        )
        problems.append(Problem(str(program.sources[0].path), what, fix=fix))
    refuse(problems, "Frames are missing")
    return frames


def _starts(
    calibration: Calibration,
    language: Language,
    convention: Convention,
    positions: list[Position],
    tool: list[Pose],
    base: list[Pose],
    near: np.ndarray | None,
    reasons: dict[int, str],
) -> np.ndarray:
    """Reported joints (n, k) of the nominal arm at the positions; NaN where refused."""
    robot = calibration.robot
    q_rad = np.full((len(positions), robot.dh.joints), np.nan)
    flange: dict[int, Pose] = {}
    for number, each in enumerate(positions):
        if number not in reasons and each.scale is None:
            try:
                pose = compose(base[number], convention.pose(each.numbers))
                flange[number] = compose(pose, invert(tool[number]))
            except InputError as error:
                reasons[number] = str(error.problems[0])
    stacked = [np.stack(part) for part in zip(*flange.values(), strict=True)]
    ways = (
        dict(zip(flange, posture.postures_of(robot, Pose(*stacked)), strict=True)) if flange else {}
    )
    for number, each in enumerate(positions):
        if number in ways:
            own = near if each.near_rad is None else each.near_rad
            try:
                q_rad[number] = posture.choose(
                    robot, ways[number], language.posture, each.posture, own
                )
            except InputError as error:
                reasons[number] = error.problems[0].what
        elif number not in reasons:
            if len(each.numbers) != robot.dh.joints:
                reasons[number] = f"has {len(each.numbers)} joints, not {robot.dh.joints}"
                continue
            q_rad[number] = each.numbers / each.scale * _unit(robot)
            if not limits.within(q_rad[number], robot.q_min_rad, robot.q_max_rad):
                reasons[number] = "its joints are beyond the limits"
        near = q_rad[number] if np.isfinite(q_rad[number]).all() else near
    return q_rad


def _unit(robot: Robot) -> np.ndarray:
    """Radians (mm where a joint slides) of a unit in which joints are written, (k,)."""
    return np.where(robot.dh.prismatic, 1.0, np.pi / 180.0)


def _carried(calibration: Calibration, tool: Pose | None, point: str | None) -> tuple[Pose, str]:
    """The program's tool on the calibrated arm, in the last frame of its model, and a remark."""
    flange = compose(_moved(calibration), calibration.robot.flange)
    mounted = compose(flange, tool or IDENTITY)
    if tool is None or point == FLANGE:
        return mounted, ""
    for target in [point] if point else calibration.targets:
        place = calibration.point(target)
        if calibration.orientation_source(target) != MEASURED:
            place = Pose(mounted.rotation, place.position_mm)
        gap_mm, gap_rad = _apart(place, mounted)
        if point or (gap_mm <= _SAME_TOOL_MM and gap_rad <= _SAME_TOOL_RAD):
            gap = f"{gap_mm:.3g} mm and {1e3 * gap_rad:.3g} mrad"
            remark = f"the calibrated {target}, {gap} from the controller's tool, takes its place"
            return place, f"{remark} (--point flange: the controller's tool)."
    return mounted, ""


def _moved(calibration: Calibration) -> Pose:
    """A point of the last frame of the anchor, the DH model fitted alike, in that of the model."""
    anchor = calibration.anchor
    if anchor is None or not calibration.targets:
        return IDENTITY
    name = calibration.default_point
    return compose(calibration.point(name), invert(anchor.point(name)))


def _corrected(
    calibration: Calibration, start: np.ndarray, carried: Pose, tool: Pose
) -> tuple[pd.DataFrame, np.ndarray, Pose]:
    """Facts of positions of one tool, corrected joints (n, k), nominal poses there (n, ...)."""
    robot, anchor = calibration.robot, calibration.anchor
    if anchor is not None:
        place = compose(invert(_moved(calibration)), carried)
        anchor = replace(anchor, targets={**anchor.targets, _POINT: place})
    targets = {**calibration.targets, _POINT: carried}
    arm = replace(calibration, targets=targets, anchor=anchor)
    wanted = _nominal(calibration, start, tool)
    found = inverse.compensate(arm, wanted, start, point=_POINT)
    usable = found.status <= PoseStatus.EXTRAPOLATED
    q_rad = np.where(usable[:, None], found.q_rad, start)
    new = _nominal(calibration, q_rad, tool)
    shift_mm, turn_rad = _apart(new, wanted)
    known = predict(arm, q_rad, point=_POINT)
    slopes = dh.joint_jacobian(robot.dh, robot.dh_joints(q_rad))
    slopes[:, :3] /= np.sum(np.abs(robot.dh.a_mm) + np.abs(robot.dh.d_mm))
    facts = pd.DataFrame({
        "change_mm": shift_mm,
        "change_mrad": 1e3 * turn_rad,
        "largest_joint_change_deg": np.rad2deg(np.abs(q_rad - start).max(axis=1)),
        "expected_error_mm": np.hypot(
            np.nan_to_num(known.unexplained[:, 0]), np.nan_to_num(known.std_position_mm)
        ),
        "is_measured_there": known.near,
        "is_near_singular": np.linalg.svd(slopes, compute_uv=False)[:, -1] < _SINGULAR,
        "status": found.status,
    })  # fmt: skip
    return facts, q_rad, new


def _nominal(calibration: Calibration, q_rad: np.ndarray, tool: Pose) -> Pose:
    """Poses (n, ...) of the tool that the nominal arm takes at reported joints (n, k)."""
    robot = calibration.robot
    end = compose(robot.base, dh.forward(robot.dh, robot.dh_joints(q_rad)))
    return compose(compose(end, robot.flange), tool)


def _apart(pose: Pose, other: Pose) -> tuple[np.ndarray, np.ndarray]:
    turn = log_so3(np.swapaxes(other.rotation, -1, -2) @ pose.rotation)
    gap = np.linalg.norm(pose.position_mm - other.position_mm, axis=-1)
    return gap, np.linalg.norm(turn, axis=-1)
