"""Robot programs of 20 points in the languages of five makers, written and read back.

A program is text with numbered places: the numbers of its positions. What is read back must have
every other character as it was written.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from oracles import kinematics
from oracles.controllers.arms import Arm

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
        return kinematics.frame(*place, self.back(np.array(numbers[3:])))

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


_QUATERNION = Convention(
    lambda turn: turn.as_quat(canonical=True, scalar_first=True),
    lambda v: Rotation.from_quat(v, scalar_first=True),
    (2, 7, 4),
)
PULSES = np.array([1341.4, -1310.5, 1250.0, 1022.2, -980.0, 633.3])  # a degree
CONVENTIONS = {
    "kuka": _euler("ZYX", decimals=(3, 4, 4)),
    "fanuc": _euler("xyz", decimals=(3, 3, 3)),
    "yaskawa": _euler("xyz", decimals=(3, 4, 0), joint=PULSES * np.rad2deg(1.0)),
    "abb": _QUATERNION,
    "staubli": _euler("XYZ", decimals=(3, 4, 4)),
    "table": replace(_QUATERNION, decimals=(4, 7, 5)),
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
    return kinematics.posture(arm.frames(shown), (arm.matrix @ shown)[0])


def _filled(text: str, points: np.ndarray, **forms: Callable) -> str:
    """The text with each mark ``@X`` replaced by ``forms["X"]`` of the next point."""
    left = iter(points)
    return re.sub("@([A-Z])", lambda mark: forms[mark[1]](next(left)), text)


def _named(names: str, values) -> str:
    return ",".join(f"{name} {value}" for name, value in zip(names.split(), values, strict=True))


KUKA_DATA = """&ACCESS RVP
DEFDAT  WELD
;FOLD EXTERNAL DECLARATIONS
;ENDFOLD
DECL E6POS XP1={@P,%E}
DECL E6POS XP2={@P,%E}
DECL E6POS XP3={@P,%E}
DECL E6POS XP4={@P,%E}
DECL E6POS XP5={@P,%E}
DECL POS XP6={@P}
GLOBAL FRAME XF1={@F}
DECL E6AXIS XJ1={@J,%E}
DECL AXIS XJ2={@J}
DECL FDAT FP1={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}
ENDDAT
"""
KUKA_SOURCE = """&ACCESS RVP
&REL 3
DEF weld ( )
; Schwei\xdfnaht, X 12.0 bleibt
$TOOL={%TOOL}
$BASE = {%BASE}
$VEL.CP=0.25
PTP {@J,%E}
PTP XJ1
PTP XJ2 C_PTP
PTP XP1
LIN XP2 C_DIS
CIRC XP3, XP4
SPLINE
  SPL XP5
ENDSPLINE
LIN XP6
LIN XF1
PTP {@P,%E} C_DIS
LIN {@P,%E} C_DIS
SLIN {@P,%E} C_DIS
SPTP {@P,%E} C_DIS
LIN {@F}
CIRC {@P}, {@P}
PTP {E6POS: @P}
PTP {E6AXIS: @J}
PTP {E6AXIS: @J}
WAIT SEC 0.5
END
"""


def kuka(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """KRL: .src and .dat, declared and inline, of all types."""
    program = Program(arm, "kuka", tool, base)

    def place(q) -> str:
        return _named("X Y Z A B C", program.add(q))

    def pose(q) -> str:
        behind, above = posture(arm, q)
        status = behind + 2 * above + 4 * (q[4] < 0.0)
        turn = sum(1 << axis for axis in range(6) if q[axis] < 0.0)
        return f"{place(q)},S {status},T {turn}"

    def joints(q) -> str:
        return _named("A1 A2 A3 A4 A5 A6", program.add(q, True))

    both = _filled(KUKA_DATA + KUKA_SOURCE, points, P=pose, F=place, J=joints)
    for mark, frames in (("%TOOL", tool), ("%BASE", base)):
        values = [f"{value:.6f}" for value in program.convention.of_pose(frames)]
        both = both.replace(mark, _named("X Y Z A B C", values))
    both = both.replace("%E", _named("E1 E2 E3 E4 E5 E6", ["0.0"] * 6)).replace("\n", "\r\n")
    data, end, source = both.partition("ENDDAT\r\n")
    program.files = {".src": source, ".dat": data + end}
    return program


RAPID = """%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Weld
  PERS tooldata tGun:=[TRUE,%TOOL,[1,[0,0,1],[1,0,0,0],0,0,0]];
  PERS wobjdata wTab:=[FALSE,TRUE,"",%USER,%OBJECT];
  ! caf\xe9: [[1,2,3],[1,0,0,0]] stays
  CONST robtarget p10:=@P;
  LOCAL CONST robtarget p20:=@P;
  CONST robtarget p30:=@P;
  CONST robtarget p40:=@P;
  CONST robtarget p50:=@P;
  CONST robtarget p60:=@P;
  CONST robtarget p70:=@P;
  CONST robtarget p80:=@P;
  CONST robtarget p90:=@P;
  CONST jointtarget j10:=@J;
  CONST jointtarget j20:=@J;
  CONST jointtarget j30:=@J;
  PROC main()
    ConfL\\Off;
    MoveAbsJ j10\\NoEOffs,v1000,z50,tGun;
    MoveAbsJ j20\\NoEOffs,v1000,z50,tGun;
    MoveAbsJ j30\\NoEOffs,v1000,z50,tGun;
    MoveJ p10,v500,z10,%F;
    MoveJ p20,v500,z10,%F;
    MoveJ p30,v500,z10,%F;
    MoveL p40,v200,fine,%F;
    MoveL p50,v200,fine,%F;
    MoveL p60,v200,fine,%F;
    MoveL p70,v200,fine,%F;
    MoveC p80,p90,v100,z5,%F;
    MoveL @P,v200,z1,%F;
    MoveL @P,v200,z1,%F;
    MoveL @P,v200,z1,%F;
    MoveL @P,v200,z1,%F;
    MoveC @P,
      @P,v100,fine,%F;
    MoveAbsJ @J,v1000,fine,tGun;
    MoveAbsJ @J,v1000,fine,tGun;
    WaitTime 0.5;
  ENDPROC
ENDMODULE
"""


def abb(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """RAPID: declared and inline targets, with tool and work object of the module."""
    program = Program(arm, "abb", tool, base)

    def framed(values) -> str:
        return f"[{','.join(values[:3])}],[{','.join(values[3:])}]"

    def pose(q) -> str:
        values = program.add(q)
        behind, above = posture(arm, q)
        quadrants = [int(np.floor(np.rad2deg(q[axis]) / 90.0)) for axis in (0, 3, 5)]
        conf = [*quadrants, 4 * behind + 2 * (not above) + (q[4] <= 0.0)]
        outer = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"
        return f"[{framed(values)},[{','.join(map(str, conf))}],{outer}]"

    def joints(q) -> str:
        return f"[[{','.join(program.add(q, True))}],[9E9,9E9,9E9,9E9,9E9,9E9]]"

    text = _filled(RAPID, points, P=pose, J=joints).replace("%F", "tGun\\WObj:=wTab")
    user = tool  # any frame: the object's stands in it
    marks = {"%TOOL": tool, "%USER": user, "%OBJECT": np.linalg.inv(user) @ base}
    for mark, frames in marks.items():
        values = [f"{value:.9f}" for value in program.convention.of_pose(frames)]
        text = text.replace(mark, f"[{framed(values)}]")
    program.files = {".mod": text}
    return program


FANUC = """/PROG  WELD
/ATTR
OWNER\t\t= MNEDITOR;
COMMENT\t\t= "X = 1.0 mm";
DEFAULT_GROUP\t= 1,*,*,*,*;
/MN
   1:  UFRAME_NUM=1 ;
   2:  UTOOL_NUM=1 ;
%s
/POS
%s
/END
"""
FANUC_POSE = """\tUF : 1, UT : 1,\t\tCONFIG : '%s',
\tX =%s  mm,\tY =%s  mm,\tZ =%s  mm,
\tW =%s  deg,\tP =%s  deg,\tR =%s  deg"""
FANUC_JOINTS = """\tUF : 1, UT : 1,\t
\tJ1=%s deg,\tJ2=%s deg,\tJ3=%s deg,
\tJ4=%s deg,\tJ5=%s deg,\tJ6=%s deg"""


def fanuc(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """LS: Cartesian and joint positions; frames are in a file of their own."""
    program, positions, moves = Program(arm, "fanuc", tool, base), [], []
    for number, q in enumerate(points, 1):
        of_joints = number % 4 == 0
        values = [each.rjust(9) for each in program.add(q, of_joints)]
        behind, above = posture(arm, q)
        turns = [int(np.floor((np.rad2deg(q[axis]) + 180.0) / 360.0)) for axis in (0, 3, 5)]
        letters = "F" if q[4] > 0.0 else "N", "UD"[not above], "TB"[behind]
        config = f"{' '.join(letters)}, {', '.join(map(str, turns))}"
        text = FANUC_JOINTS % (*values,) if of_joints else FANUC_POSE % (config, *values)
        positions.append(f"P[{number}]{{\n   GP1:\n{text}\n}};")
        word, speed = ("J", "50%") if of_joints or number == 1 else ("L", "200mm/sec")
        moves.append(f"{number + 2:4d}:{word} P[{number}] {speed} CNT50    ;")
    program.files = {".ls": FANUC % ("\n".join(moves), "\n".join(positions))}
    return program


URSCRIPT = """def weld():
  set_tcp(p[%TOOL])
  # p[0.1, 0.2, 0.3, 0, 0, 0] in a comment
  movej(@J, a=1.4, v=1.05)
  global start_p=@P
  home_q = @J
  movel(start_p, a=1.2, v=0.25)
  movej(home_q, a=1.4, v=1.05, r=0.02)
%MOVES  movel(@J, a=1.2, v=0.25)
  movel(@J, a=1.2, v=0.25)
  sleep(0.5)
end
"""
URSCRIPT_MOVES = """  movej(@P, a=1.4, v=1.05)
  movel(@P, a=1.2, v=0.25, t=0, r=0.01)
  movep(@P, a=1.2, v=0.25, r=0.005)
  movec(@P, @P, a=1.2, v=0.1, r=0.005, mode=1)
"""


def ur(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """URScript: poses and joints, in variables and inline."""
    program = Program(arm, "ur", tool, np.eye(4))
    text = _filled(
        URSCRIPT.replace("%MOVES", 3 * URSCRIPT_MOVES),
        points,
        P=lambda q: f"p[{', '.join(program.add(q))}]",
        J=lambda q: f"[{', '.join(program.add(q, True))}]",
    )
    tcp = ", ".join(f"{value:.9f}" for value in program.convention.of_pose(tool))
    program.files = {".script": text.replace("%TOOL", tcp)}
    return program


JBI = """/JOB
//NAME WELD
//POS
///NPOS %d,0,0,0,0,0
///TOOL 1
///POSTYPE PULSE
///PULSE
%s
///USER 1
///POSTYPE USER
///RECTAN\x20
%s
//INST
///DATE 2026/11/25 10:50
///ATTR SC,RW
///GROUP1 RB1
NOP
%s
END
"""


def yaskawa(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """JBI: pulses, and Cartesian positions in a user frame; --tool and --base say the frames."""
    program, pulses, poses, stated = Program(arm, "yaskawa", tool, base), [], [], None
    for number, q in enumerate(points):
        name = f"C{number:05d}"
        if number < 8:
            pulses.append(f"{name}={','.join(program.add(q, True))}")
            continue
        behind, above = posture(arm, q)
        turned = (np.rad2deg(q[3]) + 180.0) % 360.0 - 180.0
        conf = f"{int(not -90.0 < turned <= 90.0)},{int(not above)},{int(behind)},0,0,0,0,0"
        if conf != stated:
            poses.append(f"///RCONF {conf}")
            stated = conf
        poses.append(f"{name}={','.join(program.add(q))}")
    moves = ["MOVJ C%05d VJ=10.00"] * 8 + ["MOVL C%05d V=100.0"] * (len(points) - 8)
    moves = [move % number for number, move in enumerate(moves)]
    parts = ("\n".join(lines) for lines in (pulses, poses, moves))
    program.files = {".JBI": (JBI % (len(points), *parts)).replace("\n", "\r\n")}
    return program


def table(arm: Arm, points: np.ndarray, tool: np.ndarray, base: np.ndarray) -> Program:
    """CSV: poses in the robot's base, in no stated posture."""
    program = Program(arm, "table", tool, np.eye(4))
    lines = ["pose;x_mm;y_mm;z_mm;qw;qx;qy;qz;speed"]
    lines += [f"P{i};{';'.join(program.add(q))};{250 + i}" for i, q in enumerate(points)]
    program.files = {".csv": "\r\n".join(lines) + "\r\n"}
    return program


WRITERS = {
    "kuka": kuka,
    "abb": abb,
    "fanuc": fanuc,
    "ur": ur,
    "yaskawa": yaskawa,
    "csv": table,
}
