"""KUKA KRL: a .src file and the .dat file beside it; frames of $config.dat."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from kinacc.deployment.programs.orientation import KUKA, Convention
from kinacc.deployment.programs.record import (
    JOINTS,
    NUMBER,
    POSE,
    Language,
    Place,
    Position,
    Program,
    Reading,
    Source,
    blanked,
    unused,
)
from kinacc.geometry import IDENTITY, Pose

CONVENTION = Convention(KUKA)
_AXES = tuple(f"A{number}" for number in range(1, 7))
_FRAME = ("X", "Y", "Z", "A", "B", "C")
_AGGREGATE = re.compile(r"\{\s*(?:\w+\s*:)?([^{}]*)\}")
_PART = re.compile(rf"(\w+)(?:\[\])?\s+({NUMBER}|'[BH][0-9A-F]+'|[^,\s][^,]*)", re.I)
_MOTION = re.compile(r"^\s*(S?PTP|S?LIN|S?CIRC|SPL)(_REL)?\b(.*)", re.I)
_ASSIGNED = re.compile(
    r"^\s*(?:DECL\s+)?(?:GLOBAL\s+)?(?:CONST\s+)?(?:\w+\s+)?"
    r"(\$?\w+(?:\s*\[\s*\d+\s*\])?)\s*=",
    re.I,
)
_NUMBERED = re.compile(r"BAS\s*\(\s*#(TOOL|BASE)\s*,\s*(\d+)\s*\)|\$(TOOL|BASE)\s*=\s*(\S.*)", re.I)
_NAMES = re.compile(r"\$?[A-Z_]\w*(?:\s*\[\s*\w+\s*\])?", re.I)
_EMPTY = ("$NULLFRAME",)


@dataclass
class _Aggregate:
    """A ``{..}`` of a line: its components by name, and where their values stand."""

    source: int
    line: int
    start: int
    end: int
    parts: dict[str, tuple[str, Place]]

    def has(self, names: Sequence[str]) -> bool:
        """Whether all these components are there, as numbers."""
        return all(
            name in self.parts and re.fullmatch(NUMBER, self.parts[name][0]) for name in names
        )

    def values(self, names: Sequence[str]) -> np.ndarray:
        return np.array([float(self.parts[name][0]) for name in names])


@dataclass
class _Frames:
    """Tool and base in force, as names; None where the program does not say."""

    tool: str | None = None
    base: str | None = None
    refused: str = ""


@dataclass
class _Walk:
    """What was found so far."""

    frames: dict[tuple[str, str], Pose] = field(default_factory=lambda: unused())
    data: dict[str, _Frames] = field(default_factory=dict)
    declared: dict[str, Position] = field(default_factory=dict)
    inline: list[Position] = field(default_factory=list)
    uses: dict[str, list[_Frames]] = field(default_factory=dict)
    left: list[str] = field(default_factory=list)


def read(reading: Reading) -> Program:
    """Positions of a KRL program."""
    walk = _Walk()
    for source in reading.frame_files:
        _frames_of(walk, source)
    data_first = sorted(enumerate(reading.sources), key=lambda each: each[1].path.suffix.lower())
    for number, source in data_first:
        _read_file(walk, number, source)
    positions = [*_placed(walk), *walk.inline]
    positions.sort(key=lambda each: (-each.source, each.line, each.places[0]))
    return Program(reading.sources, tuple(positions), walk.frames, tuple(walk.left))


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Status bits 0 to 2 and turn bits of the six axes."""
    is_ahead, is_above, _ = sides
    a5 = q_deg[4]
    bent_back = -180.0 <= a5 < 0.0 or a5 >= 180.0
    bits = (not is_ahead, is_above, bent_back)
    status = tuple(f"S bit {number} {int(bit)}" for number, bit in enumerate(bits))
    return (*status, *(f"T bit {axis} {int(angle < 0.0)}" for axis, angle in enumerate(q_deg[:6])))


def _lines(text: str) -> Iterator[tuple[int, int, str]]:
    """Number, offset and text of each line, comments and strings blank."""
    offset = 0
    for number, line in enumerate(text.splitlines(keepends=True), 1):
        yield number, offset, blanked(line, r'"[^"\r\n]*"', r";.*", r"^\s*&.*")
        offset += len(line)


def _aggregates(source: int, line: int, offset: int, text: str) -> Iterator[_Aggregate]:
    for found in _AGGREGATE.finditer(text):
        parts = {}
        for part in _PART.finditer(text, found.start(1), found.end(1)):
            start = offset + part.start(2)
            value = part[2].strip()
            parts[part[1].upper()] = (value, Place(start, start + len(value)))
        yield _Aggregate(source, line, found.start(), found.end(), parts)


def _frames_of(walk: _Walk, source: Source) -> None:
    """TOOL_DATA and BASE_DATA of a $config.dat."""
    for number, offset, line in _lines(source.text):
        named = re.match(r"\s*(?:DECL\s+\w+\s+)?(TOOL|BASE)_DATA\s*\[\s*(\d+)\s*\]\s*=", line, re.I)
        for each in _aggregates(0, number, offset, line) if named else ():
            if each.has(_FRAME):
                frame = CONVENTION.pose(each.values(_FRAME))
                walk.frames[named[1].lower(), str(int(named[2]))] = frame


def _read_file(walk: _Walk, number: int, source: Source) -> None:
    now = _Frames()
    _frames_of(walk, source)
    for line, offset, text in _lines(source.text):
        found = list(_aggregates(number, line, offset, text))
        now = _frames_in_force(walk, now, text, found, f"{source.path.name}:{line}")
        where = f"{source.path.name}:{line}"
        if motion := _MOTION.match(text):
            _move(walk, now, motion, found, where)
        elif assigned := _ASSIGNED.match(text):
            _declare(walk, assigned, text, found, where)
        elif re.search(r"\bX\w*\.[XYZABC]\s*=|\w+\.A[1-6]\s*=", text, re.I):
            walk.left.append(f"{where}: {text.strip()}")


def _frames_in_force(
    walk: _Walk, now: _Frames, text: str, found: list[_Aggregate], where: str
) -> _Frames:
    """The frames after a line that may set them."""
    if re.search(r"#TCP\b", text, re.I) and "IPO" in text.upper():
        now = replace(now, refused="the tool stands still (#TCP)")
    elif re.search(r"\$IPO_MODE\s*=\s*#BASE\b", text, re.I):
        now = replace(now, refused="")
    if active := re.search(r"\bFDAT_ACT\s*=\s*(\w+)", text, re.I):
        return walk.data.get(active[1].upper(), _Frames())
    for setting in _NUMBERED.finditer(text):
        kind = (setting[1] or setting[3]).lower()
        name = setting[2]
        if name is None:
            name = _frame_name(walk, kind, setting[4].strip(), found, where)
        else:
            name = str(int(name))
        now = replace(now, **{kind: name})
    return now


def _frame_name(
    walk: _Walk, kind: str, value: str, found: list[_Aggregate], where: str
) -> str | None:
    """What an assignment to $TOOL or $BASE names; a frame written there is entered."""
    if listed := re.match(r"(?:TOOL|BASE)_DATA\s*\[\s*(\d+)\s*\]\s*$", value, re.I):
        return str(int(listed[1]))
    if data := re.match(r"S(?:TOOL2?|BASE)\s*\(\s*(\w+)", value, re.I):
        return getattr(walk.data.get(data[1].upper(), _Frames()), kind)
    if value.upper().startswith(_EMPTY):
        walk.frames[kind, "$NULLFRAME"] = IDENTITY
        return "$NULLFRAME"
    if value.startswith("{") and found and found[0].has(_FRAME):
        walk.frames[kind, where] = CONVENTION.pose(found[0].values(_FRAME))
        return where
    return value


def _move(walk: _Walk, now: _Frames, motion: re.Match, found: list[_Aggregate], where: str) -> None:
    """Positions written in a motion, and the use of those that are named."""
    rest = motion[3]
    outside = re.split(r"\bWITH\b|\bC_\w+", re.sub(r"\{[^}]*\}", "", rest), flags=re.I)[0]
    names = [name.upper().replace(" ", "") for name in _NAMES.findall(outside)]
    data = [walk.data[name] for name in _names_of_data(walk, rest)]
    frames = data[0] if data else now
    if motion[2] or ":" in outside:
        walk.left.append(f"{where}: {motion[0].strip()}")
    else:
        for each in found[: 2 if "CIRC" in motion[1].upper() else 1]:
            position = _position(f"line {each.line}", each)
            if position is None:
                walk.left.append(f"{where}: {motion[0].strip()}")
            else:
                walk.inline.append(_framed(position, frames))
    for name in names:
        walk.uses.setdefault(name, []).append(frames)
        walk.uses.setdefault(name.split("[")[0], []).append(frames)


def _names_of_data(walk: _Walk, text: str) -> list[str]:
    return [name for name in map(str.upper, re.findall(r"\w+", text)) if name in walk.data]


def _declare(
    walk: _Walk, assigned: re.Match, text: str, found: list[_Aggregate], where: str
) -> None:
    """A position or motion data that a line declares or sets."""
    name = assigned[1].upper().replace(" ", "")
    if re.match(r"\$|TOOL_DATA|BASE_DATA|LOAD_DATA", name) or not found:
        return
    each = found[0]
    if "TOOL_NO" in each.parts and "BASE_NO" in each.parts:
        tool, base = (each.parts[key][0] for key in ("TOOL_NO", "BASE_NO"))
        still = each.parts.get("IPO_FRAME", ("",))[0].strip().upper() == "#TCP"
        walk.data[name] = _Frames(tool, base, "the tool stands still (#TCP)" if still else "")
    elif position := _position(name, each):
        if text[each.end :].strip().startswith(":") or name in walk.declared:
            walk.left.append(f"{where}: {text.strip()}")
        else:
            walk.declared[name] = position


def _position(name: str, each: _Aggregate) -> Position | None:
    """The position of an aggregate; None where some of its numbers are missing."""
    external = [key for key in each.parts if re.fullmatch(r"E[1-6]", key) and each.has([key])]
    outer = tuple(each.values(external))
    keys = _FRAME if each.has(_FRAME) else _AXES
    if not each.has(keys):
        return None
    places = tuple(each.parts[key][1] for key in keys)
    values = each.values(keys)
    is_pose = keys == _FRAME
    stated = _stated(each) if is_pose else None
    kind = POSE if is_pose else JOINTS
    return Position(
        name, each.source, each.line, kind, places, values, (4,) * 6, posture=stated, external=outer
    )


def _stated(each: _Aggregate) -> tuple[str | None, ...] | None:
    """Status and turn in the words of ``posture``."""
    s, t = (_whole(each.parts[key][0]) if key in each.parts else None for key in "ST")
    if s is None and t is None:
        return None
    status = [None if s is None else f"S bit {bit} {s >> bit & 1}" for bit in range(3)]
    turns = [None if t is None else f"T bit {bit} {t >> bit & 1}" for bit in range(6)]
    return (*status, *turns)


def _whole(text: str) -> int | None:
    base = {"'B": 2, "'H": 16}.get(text[:2].upper())
    if base:
        return int(text[2:].rstrip("'"), base)
    return int(float(text)) if re.fullmatch(NUMBER, text) else None


def _framed(position: Position, frames: _Frames) -> Position:
    return replace(position, tool=frames.tool, base=frames.base, refused=frames.refused)


def _placed(walk: _Walk) -> list[Position]:
    """Declared positions with the frames of the motions that use them, or of their own data."""
    positions = []
    for name, position in walk.declared.items():
        used = walk.uses.get(name) or walk.uses.get(name.split("[")[0]) if "[" in name else None
        used = used or walk.uses.get(name)
        own = walk.data.get("F" + name[1:]) if name.startswith("X") else None
        ways = {(each.tool, each.base, each.refused) for each in used or ([own] if own else [])}
        if len(ways) > 1:
            what = "is used with different tools or bases"
            positions.append(replace(position, refused=what))
        else:
            frames = _Frames(*next(iter(ways))) if ways else _Frames()
            positions.append(_framed(position, frames))
    return positions


LANGUAGE = Language(
    "KUKA KRL", (".src", ".dat"), CONVENTION, read, posture, (".src", ".dat"), ("$config.dat",)
)
