"""Robot programs of 20 points in the languages of five makers, written and read back.

A program is text with numbered places: the numbers of its positions. What is read back must have
every other character as it was written.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from oracles.controllers.arms import Arm, frame

POINTS = 20
_PLACE = re.compile(r"<(\d+)>")
_NUMBER = r"\s*[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?\s*"


@dataclass(frozen=True)
class Convention:
    """A maker's numbers of a pose (4 x 4, mm) and of joints (rad), and their decimals."""

    turn: Callable[[Rotation], np.ndarray]
    back: Callable[[np.ndarray], Rotation]
    decimals: tuple[int, int, int]  # of positions, orientations, joints
    metre: float = 1.0
    joint: np.ndarray | float = 180.0 / np.pi

    def of_pose(self, pose: np.ndarray) -> list[float]:
        turned = self.turn(Rotation.from_matrix(pose[:3, :3]))
        return [*(pose[:3, 3] * self.metre), *turned]

    def pose(self, numbers) -> np.ndarray:
        place = np.array(numbers[:3]) / self.metre
        return frame(*place, self.back(np.array(numbers[3:])))

    def of_joints(self, shown: np.ndarray) -> list[float]:
        return [*(shown * self.joint)]

    def joints(self, numbers) -> np.ndarray:
        return np.array(numbers) / self.joint


def _euler(order: str, **more) -> Convention:
    return Convention(
        lambda turn: turn.as_euler(order, degrees=True),
        lambda v: Rotation.from_euler(order, v, degrees=True),
        **more,
    )


PULSES = np.array([1341.4, -1310.5, 1250.0, 1022.2, -980.0, 633.3])  # a degree
CONVENTIONS = {
    "kuka": _euler("ZYX", decimals=(3, 4, 4)),
    "fanuc": _euler("xyz", decimals=(3, 3, 3)),
    "yaskawa": _euler("xyz", decimals=(3, 4, 0), joint=PULSES * np.rad2deg(1.0)),
    "abb": Convention(
        lambda turn: turn.as_quat(canonical=True, scalar_first=True),
        lambda v: Rotation.from_quat(v, scalar_first=True),
        (2, 7, 4),
    ),
    "table": Convention(
        lambda turn: turn.as_quat(canonical=True, scalar_first=True),
        lambda v: Rotation.from_quat(v, scalar_first=True),
        (4, 7, 5),
    ),
    "ur": Convention(
        lambda turn: turn.as_rotvec(), Rotation.from_rotvec, (6, 6, 6), metre=1e-3, joint=1.0
    ),
}


@dataclass(frozen=True)
class Point:
    """A position: the joints it was taught at (6,), whether it is one of joints, its numbers."""

    shown: np.ndarray
    of_joints: bool
    places: range


@dataclass
class Program:
    """``files``: texts with places by ending; ``numbers`` as written (text) at these places."""

    arm: Arm
    maker: str
    tool: np.ndarray
    base: np.ndarray
    files: dict[str, str] = field(default_factory=dict)
    numbers: list[str] = field(default_factory=list)
    points: list[Point] = field(default_factory=list)

    @property
    def convention(self) -> Convention:
        return CONVENTIONS[self.maker]

    def add(self, shown: np.ndarray, of_joints: bool = False) -> list[str]:
        """A point taught at joints; the marks of its places."""
        numbers, kinds = self.convention.of_joints(shown), [2] * 6
        if not of_joints:
            pose = np.linalg.inv(self.base) @ self.arm.pose(shown) @ self.tool
            numbers = self.convention.of_pose(pose)
            kinds = [0] * 3 + [1] * (len(numbers) - 3)
        first = len(self.numbers)
        for number, kind in zip(numbers, kinds, strict=True):
            self.numbers.append(f"{number:.{self.convention.decimals[kind]}f}")
        self.points.append(Point(shown, of_joints, range(first, len(self.numbers))))
        return [f"<{place}>" for place in self.points[-1].places]

    def write(self, folder: Path, name: str) -> Path:
        """The files of the program; the first one's path."""
        for ending, text in self.files.items():
            whole = _PLACE.sub(lambda found: self.numbers[int(found[1])], text)
            (folder / f"{name}{ending}").write_bytes(whole.encode("latin-1"))
        return folder / f"{name}{next(iter(self.files))}"

    def read(self, folder: Path, name: str) -> list[float]:
        """The numbers of its files; every other byte must be as it was written."""
        numbers: list[float] = [np.nan] * len(self.numbers)
        for ending, text in self.files.items():
            written = (folder / f"{name}{ending}").read_bytes().decode("latin-1")
            parts = _PLACE.split(text)
            pattern = "".join(
                f"({_NUMBER})" if odd % 2 else re.escape(part) for odd, part in enumerate(parts)
            )
            found = re.fullmatch(pattern, written)
            assert found, f"{name}{ending}: more than the numbers of its positions has changed"
            for place, number in zip(parts[1::2], found.groups(), strict=True):
                numbers[int(place)] = float(number)
                as_before = self.numbers[int(place)].partition(".")[2]
                assert len(number.strip().partition(".")[2]) >= len(as_before), number
        return numbers


def posture(arm: Arm, shown: np.ndarray) -> tuple[bool, bool]:
    """Whether the wrist is behind axis 1, and the elbow above the line from shoulder to wrist."""
    dh = arm.matrix @ shown
    here, places = np.eye(4), []
    for (theta, d, a, alpha), q in zip(arm.rows, dh, strict=True):
        places.append(here[:3, 3].copy())
        turn = Rotation.from_euler("ZX", [q + np.deg2rad(theta), np.deg2rad(alpha)])
        step = frame(turn=turn)
        angle = q + np.deg2rad(theta)
        step[:3, 3] = a * np.cos(angle), a * np.sin(angle), d
        here = here @ step
    ahead = np.array([np.cos(dh[0]), np.sin(dh[0]), 0.0])
    flat = [np.array([p @ ahead, p[2]]) for p in places]
    upper, fore = flat[2] - flat[1], flat[4] - flat[2]
    return bool(flat[4][0] < 0.0), bool(upper[1] * fore[0] - upper[0] * fore[1] > 0.0)


def _decimal(values, digits: str = ".6f") -> list[str]:
    return [f"{value:{digits}}" for value in values]


def kuka(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """KRL: .src and .dat, declared and inline, of all types."""
    program = Program(arm, "kuka", tool, base)
    outer = "E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0"

    def named(names: str, values) -> str:
        return ",".join(f"{a} {v}" for a, v in zip(names.split(), values, strict=True))

    def pose(q, with_posture: bool = True) -> str:
        text = named("X Y Z A B C", program.add(q))
        if not with_posture:
            return text
        behind, above = posture(arm, q)
        status = behind + 2 * above + 4 * (q[4] < 0.0)
        turn = sum(1 << axis for axis in range(6) if q[axis] < 0.0)
        return f"{text},S {status},T {turn}"

    def joints(q) -> str:
        return named("A1 A2 A3 A4 A5 A6", program.add(q, True))

    frames = [
        named("X Y Z A B C", _decimal(program.convention.of_pose(each))) for each in (tool, base)
    ]
    p = iter(points)
    data = ["&ACCESS RVP", "DEFDAT  WELD", ";FOLD EXTERNAL DECLARATIONS", ";ENDFOLD"]
    for number in range(1, 6):
        data.append(f"DECL E6POS XP{number}={{{pose(next(p))},{outer}}}")
    data.append(f"DECL POS XP6={{{pose(next(p))}}}")
    data.append(f"GLOBAL FRAME XF1={{{pose(next(p), False)}}}")
    data.append(f"DECL E6AXIS XJ1={{{joints(next(p))},{outer}}}")
    data.append(f"DECL AXIS XJ2={{{joints(next(p))}}}")
    data.append('DECL FDAT FP1={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}')
    data.append("ENDDAT")
    lines = ["&ACCESS RVP", "&REL 3", "DEF weld ( )", "; Schwei\xdfnaht, X 12.0 bleibt",
             "$TOOL={" + frames[0] + "}", "$BASE = {" + frames[1] + "}",
             "$VEL.CP=0.25", f"PTP {{{joints(next(p))},{outer}}}", "PTP XJ1", "PTP XJ2 C_PTP",
             "PTP XP1", "LIN XP2 C_DIS", "CIRC XP3, XP4", "SPLINE", "  SPL XP5", "ENDSPLINE",
             "LIN XP6", "LIN XF1"]  # fmt: skip
    for word in ("PTP", "LIN", "SLIN", "SPTP"):
        lines.append(f"{word} {{{pose(next(p))},{outer}}} C_DIS")
    lines.append(f"LIN {{{pose(next(p), False)}}}")
    lines.append(f"CIRC {{{pose(next(p))}}}, {{{pose(next(p))}}}")
    lines.append(f"PTP {{E6POS: {pose(next(p))}}}")
    lines += [f"PTP {{E6AXIS: {joints(each)}}}" for each in p]
    lines += ["WAIT SEC 0.5", "END"]
    program.files = {".src": "\r\n".join(lines) + "\r\n", ".dat": "\r\n".join(data) + "\r\n"}
    return program


def abb(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """RAPID: declared and inline targets, with tool and work object of the module."""
    program, p = Program(arm, "abb", tool, base), iter(points)

    def pose(q) -> str:
        values = program.add(q)
        behind, above = posture(arm, q)
        quadrants = [int(np.floor(np.rad2deg(q[axis]) / 90.0)) for axis in (0, 3, 5)]
        conf = [*quadrants, 4 * behind + 2 * (not above) + (q[4] <= 0.0)]
        outer = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"
        place, turn = ",".join(values[:3]), ",".join(values[3:])
        return f"[[{place}],[{turn}],[{','.join(map(str, conf))}],{outer}]"

    def joints(q) -> str:
        return f"[[{','.join(program.add(q, True))}],[9E9,9E9,9E9,9E9,9E9,9E9]]"

    def fixed(each) -> str:
        numbers = _decimal(program.convention.of_pose(each), ".9f")
        return f"[[{','.join(numbers[:3])}],[{','.join(numbers[3:])}]]"

    lines = ["%%%", "  VERSION:1", "  LANGUAGE:ENGLISH", "%%%", "MODULE Weld",
             f"  PERS tooldata tGun:=[TRUE,{fixed(tool)},[1,[0,0,1],[1,0,0,0],0,0,0]];",
             f'  PERS wobjdata wTab:=[FALSE,TRUE,"",{fixed(base)},[[0,0,0],[1,0,0,0]]];',
             "  ! caf\xe9: [[1,2,3],[1,0,0,0]] stays"]  # fmt: skip
    for number in range(10, 100, 10):
        word = "LOCAL CONST" if number == 20 else "CONST"
        lines.append(f"  {word} robtarget p{number}:={pose(next(p))};")
    for number in (10, 20, 30):
        lines.append(f"  CONST jointtarget j{number}:={joints(next(p))};")
    frames = "tGun\\WObj:=wTab"
    lines += ["  PROC main()", "    ConfL\\Off;"]
    lines += [f"    MoveAbsJ j{number}\\NoEOffs,v1000,z50,tGun;" for number in (10, 20, 30)]
    lines += [f"    MoveJ p{number},v500,z10,{frames};" for number in (10, 20, 30)]
    lines += [f"    MoveL p{number},v200,fine,{frames};" for number in (40, 50, 60, 70)]
    lines.append(f"    MoveC p80,p90,v100,z5,{frames};")
    for _ in range(4):
        lines.append(f"    MoveL {pose(next(p))},v200,z1,{frames};")
    lines.append(f"    MoveC {pose(next(p))},")
    lines.append(f"      {pose(next(p))},v100,fine,{frames};")
    lines += [f"    MoveAbsJ {joints(each)},v1000,fine,tGun;" for each in p]
    lines += ["    WaitTime 0.5;", "  ENDPROC", "ENDMODULE"]
    program.files = {".mod": "\n".join(lines) + "\n"}
    return program


def fanuc(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """LS: Cartesian and joint positions; frames are in a file of their own."""
    program, lines, moves = Program(arm, "fanuc", tool, base), [], []
    for number, q in enumerate(points, 1):
        of_joints = number % 4 == 0
        values = [each.rjust(9) for each in program.add(q, of_joints)]
        lines += [f"P[{number}]{{", "   GP1:"]
        if of_joints:
            lines.append("\tUF : 1, UT : 1,\t")
            named = [f"J{i}={value} deg" for i, value in enumerate(values, 1)]
        else:
            behind, above = posture(arm, q)
            turns = [int(np.floor((np.rad2deg(q[axis]) + 180.0) / 360.0)) for axis in (0, 3, 5)]
            letters = "F" if q[4] > 0.0 else "N", "UD"[not above], "TB"[behind]
            config = f"{' '.join(letters)}, {', '.join(map(str, turns))}"
            lines.append(f"\tUF : 1, UT : 1,\t\tCONFIG : '{config}',")
            units = ["mm"] * 3 + ["deg"] * 3
            named = [
                f"{a} ={value}  {unit}"
                for a, value, unit in zip("XYZWPR", values, units, strict=True)
            ]
        lines += ["\t" + ",\t".join(named[:3]) + ",", "\t" + ",\t".join(named[3:]), "};"]
        word, speed = ("J", "50%") if of_joints or number == 1 else ("L", "200mm/sec")
        moves.append(f"{number + 2:4d}:{word} P[{number}] {speed} CNT50    ;")
    head = ["/PROG  WELD", "/ATTR", "OWNER\t\t= MNEDITOR;", 'COMMENT\t\t= "X = 1.0 mm";',
            "DEFAULT_GROUP\t= 1,*,*,*,*;", "/MN", "   1:  UFRAME_NUM=1 ;",
            "   2:  UTOOL_NUM=1 ;", *moves, "/POS"]  # fmt: skip
    program.files = {".ls": "\n".join([*head, *lines, "/END"]) + "\n"}
    return program


def ur(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """URScript: poses and joints, in variables and inline."""
    program, p = Program(arm, "ur", tool, np.eye(4)), iter(points)

    def pose(q) -> str:
        return f"p[{', '.join(program.add(q))}]"

    def joints(q) -> str:
        return f"[{', '.join(program.add(q, True))}]"

    tcp = ", ".join(_decimal(program.convention.of_pose(tool), ".9f"))
    lines = ["def weld():", f"  set_tcp(p[{tcp}])", "  # p[0.1, 0.2, 0.3, 0, 0, 0] in a comment"]
    lines.append(f"  movej({joints(next(p))}, a=1.4, v=1.05)")
    lines.append(f"  global start_p={pose(next(p))}")
    lines.append(f"  home_q = {joints(next(p))}")
    lines.append("  movel(start_p, a=1.2, v=0.25)")
    lines.append("  movej(home_q, a=1.4, v=1.05, r=0.02)")
    for _ in range(3):
        lines.append(f"  movej({pose(next(p))}, a=1.4, v=1.05)")
        lines.append(f"  movel({pose(next(p))}, a=1.2, v=0.25, t=0, r=0.01)")
        lines.append(f"  movep({pose(next(p))}, a=1.2, v=0.25, r=0.005)")
        lines.append(f"  movec({pose(next(p))}, {pose(next(p))}, a=1.2, v=0.1, r=0.005, mode=1)")
    lines += [f"  movel({joints(each)}, a=1.2, v=0.25)" for each in p]
    lines += ["  sleep(0.5)", "end"]
    program.files = {".script": "\n".join(lines) + "\n"}
    return program


def yaskawa(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """JBI: pulses, and Cartesian positions in a user frame; --tool and --base say the frames."""
    program, p = Program(arm, "yaskawa", tool, base), list(points)
    lines = ["/JOB", "//NAME WELD", "//POS", f"///NPOS {len(p)},0,0,0,0,0", "///TOOL 1",
             "///POSTYPE PULSE", "///PULSE"]  # fmt: skip
    for number, q in enumerate(p[:8]):
        lines.append(f"C{number:05d}={','.join(program.add(q, True))}")
    lines += ["///USER 1", "///POSTYPE USER", "///RECTAN "]
    stated = None
    for number, q in enumerate(p[8:], 8):
        behind, above = posture(arm, q)
        turned = (np.rad2deg(q[3]) + 180.0) % 360.0 - 180.0
        conf = f"{int(not -90.0 < turned <= 90.0)},{int(not above)},{int(behind)},0,0,0,0,0"
        if conf != stated:
            lines.append(f"///RCONF {conf}")
            stated = conf
        lines.append(f"C{number:05d}={','.join(program.add(q))}")
    lines += ["//INST", "///DATE 2026/11/25 10:50", "///ATTR SC,RW", "///GROUP1 RB1", "NOP"]
    for number in range(len(p)):
        move = f"MOVJ C{number:05d} VJ=10.00" if number < 8 else f"MOVL C{number:05d} V=100.0"
        lines.append(move)
    program.files = {".JBI": "\r\n".join([*lines, "END"]) + "\r\n"}
    return program


def table(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """CSV: poses in the robot's base, in no stated posture."""
    program = Program(arm, "table", tool, np.eye(4))
    lines = ["pose;x_mm;y_mm;z_mm;qw;qx;qy;qz;speed"]
    lines += [f"P{i};{';'.join(program.add(q))};{250 + i}" for i, q in enumerate(points)]
    program.files = {".csv": "\r\n".join(lines) + "\r\n"}
    return program


def table_of_joints(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """CSV: joints."""
    program = Program(arm, "table", tool, np.eye(4))
    lines = ["speed," + ",".join(f"q{i}_deg" for i in range(1, 7))]
    lines += [f"{250 + i},{','.join(program.add(q, True))}" for i, q in enumerate(points)]
    program.files = {".csv": "\n".join(lines)}
    return program


WRITERS = {
    "kuka": kuka,
    "abb": abb,
    "fanuc": fanuc,
    "ur": ur,
    "yaskawa": yaskawa,
    "csv": table,
    "csv of joints": table_of_joints,
}
