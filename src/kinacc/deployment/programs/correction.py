"""A robot program corrected for a calibrated arm: the same text, other numbers.

The corrected pose is the one whose nominal inverse reaches the programmed pose on the calibrated
model: joints of the posture that the program states are refined onto the programmed pose, and the
nominal arm's pose at these joints is written.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from kinacc.deployment import compensate as inverse
from kinacc.deployment.compensate import PoseStatus
from kinacc.deployment.predict import predict
from kinacc.deployment.programs import abb, fanuc, kuka, posture, table, universal, yaskawa
from kinacc.deployment.programs.record import (
    BASE,
    POSE,
    TOOL,
    Language,
    Position,
    Program,
    Reading,
    Source,
    replaced,
)
from kinacc.deployment.record import FLANGE, MEASURED, Calibration
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import IDENTITY, Pose, compose, invert, log_so3
from kinacc.kinematics import dh
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.model import JointState
from kinacc.tables.atomic import write_together

LANGUAGES: tuple[Language, ...] = tuple(
    module.LANGUAGE for module in (kuka, abb, fanuc, universal, yaskawa, table)
)
AT_MOST_MM = 20.0
SIDECAR = ".kinacc.json"
_SAME_TOOL_MM, _SAME_TOOL_RAD = 5.0, np.deg2rad(1.0)
_SINGULAR = 0.02  # smallest singular value of the Jacobian in rad and units of the reach
_POINT = "tool of the program"


@dataclass(frozen=True)
class CorrectedProgram:
    """A program whose positions are corrected.

    ``table``: one row a position; ``refused``: positions that could not be corrected, with the
    reason; ``left``: statements whose positions the program computes, not corrected; ``remarks``:
    what a person should know. ``files``: new contents by the file they come from.
    """

    language: str
    table: pd.DataFrame
    refused: tuple[Problem, ...]
    left: tuple[str, ...]
    remarks: tuple[str, ...]
    files: Mapping[Path, bytes]
    digest: str
    made_with: str

    def outputs(self, out: Path | str) -> dict[Path, bytes]:
        """Contents by file to write, with the record that marks the program as corrected."""
        out = Path(out)
        first = next(iter(self.files))
        named = {
            source: out if source == first else out.with_suffix(source.suffix)
            for source in self.files
        }
        facts = {
            "corrected": [path.name for path in named.values()],
            "from": [path.name for path in self.files],
            "calibration": self.made_with,
            "positions_sha256": self.digest,
        }
        mark = out.with_name(out.name + SIDECAR)
        contents = {named[source]: content for source, content in self.files.items()}
        return {**contents, mark: (json.dumps(facts, indent=1) + "\n").encode()}

    def write(self, out: Path | str, force: bool = False) -> None:
        """Write the program; InputError for positions refused, or files that are there."""
        refuse(self.refused, "Positions cannot be corrected; nothing was written")
        contents = self.outputs(out)
        if not force:
            refuse(
                Problem(str(path), "is there already", fix="give --force to replace it")
                for path in contents
                if path.exists()
            )
        write_together(contents)


def language_of(path: Path | str) -> Language:
    """The language of a program by its file's ending; InputError for an unknown one."""
    ending = Path(path).suffix.lower()
    for language in LANGUAGES:
        if ending in language.endings:
            return language
    known = ", ".join(end for language in LANGUAGES for end in language.endings)
    raise InputError(Problem(str(path), f"ends in {ending!r}: no robot language", known))


def read_program(
    path: Path | str,
    frame_files: Iterable[Path | str] = (),
    pulses_per_degree: np.ndarray | None = None,
) -> Program:
    """Positions of a program and of the files that belong to it.

    ``frame_files``: further files with tools and bases, such as KUKA's $config.dat. Raises
    InputError with the line for what cannot be read.
    """
    program = language_of(path).read(_reading(Path(path), frame_files, pulses_per_degree))
    if not program.positions:
        raise InputError(Problem(str(path), "has no positions that can be corrected"))
    return program


def _reading(path: Path, frame_files: Iterable, pulses_per_degree: np.ndarray | None) -> Reading:
    language = language_of(path)
    beside = sorted(each for each in path.parent.glob("*") if each.is_file())
    partners = [
        each
        for each in beside
        if each.stem.lower() == path.stem.lower()
        and each.suffix.lower() in language.partners
        and each != path
    ]
    frames = [each for each in beside if each.name.lower() in language.frame_files]
    sources = tuple(Source.read(each) for each in (path, *partners))
    others = tuple(Source.read(Path(each)) for each in (*frames, *frame_files))
    return Reading(sources, others, pulses_per_degree)


def frames_missing(program: Program) -> list[tuple[str, str]]:
    """Kind and name of frames that positions need and the program does not hold."""
    wanted = {
        (kind, getattr(position, kind) or "")
        for position in program.positions
        if position.kind == POSE and not position.refused
        for kind in (TOOL, BASE)
    }
    return sorted(wanted - set(program.frames))


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
        External axes that move do not move the robot's base.

    Raises
    ------
    InputError
        For a file that cannot be read, frames that are missing, a program compensated before.
    """
    path = Path(path)
    language, program = language_of(path), read_program(path, frame_files, pulses_per_degree)
    digest = _digest(program)
    _refuse_second_time(path, digest)
    program = _with_frames(program, language, tools or {}, bases or {}, path)
    found = _Correction(calibration, language, program, point, at_most_mm)
    reasons = found.refusals_before(base_is_fixed)
    start = found.starts(near_rad, reasons)
    values, rows = found.corrected(start, reasons)
    refused = tuple(
        Problem(f"{found.where(number)} {program.positions[number].name}", why)
        for number, why in sorted(reasons.items())
    )
    files = [each.path for each in program.sources]
    contents = dict(zip(files, replaced(program, values), strict=True))
    new = tuple(Source(file, content.decode("latin-1")) for file, content in contents.items())
    reading = _reading(path, frame_files, pulses_per_degree)
    rewritten = language.read(replace(reading, sources=new))
    return CorrectedProgram(
        language.name,
        rows,
        refused,
        program.left,
        tuple(found.remarks),
        contents,
        _digest(rewritten),
        f"{calibration.name}, {calibration.choice}",
    )


def _digest(program: Program) -> str:
    """Of the numbers of all positions, in their order; texts and names do not count."""
    return hashlib.sha256(
        repr([each.numbers.tolist() for each in program.positions]).encode()
    ).hexdigest()


def _refuse_second_time(path: Path, digest: str) -> None:
    for mark in sorted(path.parent.glob(f"*{SIDECAR}")):
        try:
            known = json.loads(mark.read_text()).get("positions_sha256")
        except (OSError, ValueError, AttributeError):
            continue
        if known == digest:
            fix = "give the program it was made from"
            raise InputError(Problem(str(path), f"was compensated before ({mark.name})", fix=fix))


def _with_frames(
    program: Program, language: Language, tools: Mapping, bases: Mapping, path: Path
) -> Program:
    """The program with frames a person gave; InputError naming those that are missing."""
    frames, problems = dict(program.frames), []
    for kind, name in frames_missing(program):
        given = tools if kind == TOOL else bases
        numbers = given.get(name, given.get(""))
        if numbers is None:
            what = f"{kind} {name} is not in the program" if name else f"no {kind} is stated"
            label = f"{name}=" if name else ""
            order = (program.convention or language.convention).orientation
            fix = f'give --{kind} "{label}x,y,z,.." (mm, deg: {order}), or --frames FILE'
            problems.append(Problem(str(path), what, fix=fix))
        else:
            frames[kind, name] = (program.convention or language.convention).typed(numbers)
    refuse(problems, f"Frames of {path} are missing")
    if "" in tools:
        frames.setdefault((TOOL, ""), (program.convention or language.convention).typed(tools[""]))
    return replace(program, frames=frames)


class _Correction:
    """Joints, corrected numbers and facts of the positions of one program."""

    def __init__(
        self,
        calibration: Calibration,
        language: Language,
        program: Program,
        point: str | None,
        at_most_mm: float,
    ) -> None:
        self.calibration, self.robot = calibration, calibration.robot
        self.language, self.program, self.at_most_mm = language, program, at_most_mm
        self.convention = program.convention or language.convention
        self.remarks: list[str] = []
        self.tool = [self._frame(TOOL, each) for each in program.positions]
        self.base = [self._frame(BASE, each) for each in program.positions]
        self.carried = {
            name: self._carried(name, point) for name in {each.tool for each in program.positions}
        }

    def where(self, number: int) -> str:
        """File and line of a position."""
        position = self.program.positions[number]
        return f"{self.program.sources[position.source].path.name}:{position.line}"

    def _frame(self, kind: str, position: Position) -> Pose:
        return self.program.frames.get((kind, getattr(position, kind) or ""), IDENTITY)

    def _carried(self, name: str | None, point: str | None) -> Pose:
        """The program's tool on the calibrated arm, in the last frame of its model."""
        calibration = self.calibration
        flange = _flange(calibration)
        tool = self.program.frames.get((TOOL, name or ""))
        if tool is None or point == FLANGE:
            return compose(flange, tool or IDENTITY)
        mounted = compose(flange, tool)
        for target in [point] if point else calibration.targets:
            place = calibration.point(target)
            if calibration.orientation_source(target) != MEASURED:
                place = Pose(mounted.rotation, place.position_mm)
            gap_mm, gap_rad = _apart(place, mounted)
            if point or (gap_mm <= _SAME_TOOL_MM and gap_rad <= _SAME_TOOL_RAD):
                self.remarks.append(
                    f"Tool {name or ''}: the calibrated {target} is {gap_mm:.3g} mm and "
                    f"{1e3 * gap_rad:.3g} mrad from the controller's tool and takes its place "
                    "(--point flange: the controller's tool)."
                )
                return place
        return mounted

    def refusals_before(self, base_is_fixed: bool) -> dict[int, str]:
        """Reasons by position, from the program alone."""
        reasons = {
            number: each.refused
            for number, each in enumerate(self.program.positions)
            if each.refused
        }
        poses = [each for each in self.program.positions if each.kind == POSE]
        moving = {tuple(np.trim_zeros(each.external, "b")) for each in poses if each.external}
        if len(moving) > 1 and not base_is_fixed:
            what = (
                "external axes move, and a track would move the base (--base-is-fixed: none does)"
            )
            for number, each in enumerate(self.program.positions):
                if each.kind == POSE:
                    reasons.setdefault(number, what)
        return reasons

    def starts(self, near_rad: np.ndarray | None, reasons: dict[int, str]) -> np.ndarray:
        """Reported joints (n, k) of the nominal arm at the positions; NaN where refused."""
        robot, positions = self.robot, self.program.positions
        q_rad = np.full((len(positions), robot.dh.joints), np.nan)
        unit = np.where(robot.dh.prismatic, 1.0, np.pi / 180.0)
        flange = {}
        for number, each in enumerate(positions):
            if number in reasons:
                continue
            if each.kind != POSE:
                if len(each.numbers) != robot.dh.joints:
                    reasons[number] = f"has {len(each.numbers)} joints, not {robot.dh.joints}"
                    continue
                q_rad[number] = each.numbers / each.scale * unit
                if not limits.within(q_rad[number], robot.q_min_rad, robot.q_max_rad):
                    reasons[number] = "its joints are beyond the limits"
                continue
            try:
                pose = compose(self.base[number], self.convention.pose(each.numbers))
            except InputError as error:
                reasons[number] = error.problems[0].what
                continue
            flange[number] = compose(pose, invert(self.tool[number]))
        if flange:
            goal = Pose(*(np.stack(part) for part in zip(*flange.values(), strict=True)))
            ways = dict(zip(flange, posture.postures_of(robot, goal), strict=True))
            near = near_rad
            for number, each in enumerate(positions):
                if number in ways:
                    try:
                        q_rad[number] = posture.choose(
                            robot, ways[number], self.language.posture, each.posture, near
                        )
                    except InputError as error:
                        problem = error.problems[0]
                        reasons[number] = "; ".join(filter(None, [problem.what, problem.fix]))
                if np.isfinite(q_rad[number]).all():
                    near = q_rad[number]
        return q_rad

    def corrected(
        self, start: np.ndarray, reasons: dict[int, str]
    ) -> tuple[dict[int, np.ndarray], pd.DataFrame]:
        """New numbers by position, and the table."""
        positions = self.program.positions
        rows = pd.DataFrame(
            {
                "position": [each.name for each in positions],
                "file": [self.where(number) for number in range(len(positions))],
                "kind": [each.kind for each in positions],
            }
        )
        values: dict[int, np.ndarray] = {}
        for name in {each.tool for each in positions}:
            group = np.array([
                number
                for number, each in enumerate(positions)
                if each.tool == name and number not in reasons
            ], dtype=int)  # fmt: skip
            if len(group):
                self._correct_group(group, start[group], self.carried[name], values, rows, reasons)
        rows["status"] = [reasons.get(number, "corrected") for number in range(len(positions))]
        return {number: new for number, new in values.items() if number not in reasons}, rows

    def _correct_group(
        self,
        group: np.ndarray,
        start: np.ndarray,
        carried: Pose,
        values: dict[int, np.ndarray],
        rows: pd.DataFrame,
        reasons: dict[int, str],
    ) -> None:
        """Correct the positions of one tool."""
        robot, tool = self.robot, self.tool[group[0]]
        arm = _carrying(self.calibration, carried)
        wanted = _nominal(arm, start, tool)
        found = inverse.compensate(arm, wanted, start, point=_POINT)
        usable = found.status <= PoseStatus.EXTRAPOLATED
        q_rad = np.where(usable[:, None], found.q_rad, start)
        new = _nominal(arm, q_rad, tool)
        shift_mm, turn_rad = _apart(new, wanted)
        known = predict(arm, q_rad, point=_POINT)
        at = JointState(robot.dh_joints(q_rad))
        std = np.nan_to_num(known.std_position_mm)
        slopes = dh.joint_jacobian(robot.dh, at.q_rad)
        reach_mm = np.sum(np.abs(robot.dh.a_mm) + np.abs(robot.dh.d_mm))
        slopes = slopes * np.repeat([1.0 / reach_mm, 1.0], 3)[:, None]
        facts = {
            "change_mm": shift_mm,
            "change_mrad": 1e3 * turn_rad,
            "largest_joint_change_deg": np.rad2deg(np.abs(q_rad - start).max(axis=1)),
            "expected_error_mm": np.hypot(np.nan_to_num(known.unexplained[:, 0]), std),
            "is_measured_there": known.near,
            "is_near_singular": np.linalg.svd(slopes, compute_uv=False)[:, -1] < _SINGULAR,
        }
        for key, column in facts.items():
            rows.loc[group, key] = pd.Series(column, group)
        for place, number in enumerate(group):
            if not usable[place]:
                reasons[number] = _REASONS[PoseStatus(found.status[place])]
            elif shift_mm[place] > self.at_most_mm:
                reasons[number] = f"would move by {shift_mm[place]:.3g} mm (--at-most-mm)"
            elif why := self._numbers(number, q_rad[place], new, place, values):
                reasons[number] = why

    def _numbers(
        self, number: int, q_rad: np.ndarray, new: Pose, place: int, values: dict[int, np.ndarray]
    ) -> str:
        """Enter the new numbers of a position; returns why it is refused."""
        position, robot = self.program.positions[number], self.robot
        if position.kind != POSE:
            unit = np.where(robot.dh.prismatic, 1.0, np.pi / 180.0)
            values[number] = q_rad / unit * position.scale
            return ""
        if position.posture is not None and self.language.posture is not None:
            apart = posture.changed(robot, self.language.posture, position.posture, q_rad)
            if apart:
                return f"the posture would change: {apart}"
        pose = Pose(new.rotation[place], new.position_mm[place])
        local = compose(invert(self.base[number]), pose)
        values[number] = self.convention.numbers(local, position.numbers)
        return ""


_REASONS = {
    PoseStatus.OTHER_POSTURE: "the calibrated arm reaches it only in another posture",
    PoseStatus.OUTSIDE_LIMITS: "the corrected joints are beyond the limits",
    PoseStatus.OUTSIDE_RANGE: "a joint is outside the range that the model covers",
    PoseStatus.NOT_REACHED: "the calibrated arm cannot reach it",
}


def _flange(calibration: Calibration) -> Pose:
    """The flange in the last frame of a model: where the DH model, fitted alike, has it."""
    anchor = calibration.anchor
    if anchor is None or not calibration.targets:
        return calibration.robot.flange
    name = calibration.default_point
    moved = compose(calibration.point(name), invert(anchor.point(name)))
    return compose(moved, calibration.robot.flange)


def _carrying(calibration: Calibration, carried: Pose) -> Calibration:
    """The calibration with the program's tool among its targets."""
    anchor = calibration.anchor
    if anchor is not None:
        own = compose(invert(_flange(calibration)), carried)
        anchor = _carrying(anchor, compose(anchor.robot.flange, own))
    return replace(calibration, targets={**calibration.targets, _POINT: carried}, anchor=anchor)


def _nominal(calibration: Calibration, q_rad: np.ndarray, tool: Pose) -> Pose:
    """Poses (n, ...) of the tool that the nominal arm takes at reported joints (n, k)."""
    robot = calibration.robot
    end = compose(robot.base, dh.forward(robot.dh, robot.dh_joints(q_rad)))
    return compose(compose(end, robot.flange), tool)


def _apart(pose: Pose, other: Pose) -> tuple[np.ndarray, np.ndarray]:
    turn = log_so3(np.swapaxes(other.rotation, -1, -2) @ pose.rotation)
    gap = np.linalg.norm(pose.position_mm - other.position_mm, axis=-1)
    return gap, np.linalg.norm(turn, axis=-1)
