"""Positions of a robot program with the places of their numbers in the text.

Files are decoded as Latin-1, one character a byte, so that every byte that is no replaced number
comes back unchanged, whatever the encoding and the line ends.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import yaml

from kinacc.deployment.programs.orientation import Convention
from kinacc.deployment.programs.posture import Posture
from kinacc.errors import input_error
from kinacc.geometry import IDENTITY, Pose, compose, invert

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
TOOL, BASE = "tool", "base"
CHANGED = "the program changes its tool or base"
SEVERAL = "is used with different tools or bases"
STILL = "the tool stands still"
ROBOT = "of the robot"  # name of the base of positions in the robot's base
Place = tuple[int, int]
Frames = dict[tuple[str, str], Pose]
NAMES = [(TOOL, "0"), (BASE, "0"), (BASE, ROBOT), (TOOL, "TOOL0"), (BASE, "WOBJ0")]
KNOWN: Frames = dict.fromkeys(NAMES, IDENTITY)


@dataclass(frozen=True)
class Source:
    """One file of a program."""

    path: Path
    text: str

    @classmethod
    def read(cls, path: Path) -> Source:
        """The file's bytes as text; InputError for a file of two bytes a character."""
        content = path.read_bytes()
        if b"\0" in content[:4096]:
            raise input_error(str(path), "is no text of one byte a character")
        return cls(path, content.decode("latin-1"))

    def line(self, offset: int) -> str:
        """What a position is called that has no name but its line."""
        newlines = self.text.count("\n", 0, offset)
        return f"line {newlines + 1}"

    def where(self, offset: int) -> str:
        """File and line of an offset."""
        return self.line(offset).replace("line ", f"{self.path.name}:")

    def statement(self, offset: int, text: str) -> str:
        """File, line and words of a statement."""
        return f"{self.where(offset)}: {' '.join(text.split())}"

    def numbers(self, start: int, end: int) -> list[Place]:
        """Places of the numbers between two offsets."""
        return [number.span() for number in re.compile(NUMBER).finditer(self.text, start, end)]

    def values(self, places: Iterable[Place]) -> np.ndarray:
        """The numbers at places."""
        return np.array([float(self.text[slice(*place)].replace(",", ".")) for place in places])


@dataclass(frozen=True, eq=False)
class Position:
    """One position of a program.

    ``places``: of its numbers in ``source``, in the language's units: a pose, or joints where
    ``scale`` is given: written units per degree (mm where a joint slides). ``decimals``: digits
    after the point that new numbers have at least. ``tool`` and ``base`` name frames of the
    program, None where it states none. ``posture`` is compared with ``Language.posture``, empty
    where none is stated; ``near_rad``: joints near to it. ``moves_outside``: an external axis is
    not at zero. ``refused``: why it cannot be corrected.
    """

    name: str
    source: Source
    places: Sequence[Place]
    decimals: Sequence[int] | int
    scale: np.ndarray | float | None = None
    tool: str | None = None
    base: str | None = None
    posture: tuple[str | None, ...] = ()
    near_rad: np.ndarray | None = None
    moves_outside: bool = False
    refused: str = ""

    @property
    def has_frames(self) -> bool:
        """Whether it is a pose in a base, of a tool, that can be corrected."""
        return self.scale is None and not self.refused

    @property
    def numbers(self) -> np.ndarray:
        """The numbers as written."""
        return self.source.values(self.places)

    @property
    def where(self) -> str:
        """File and line."""
        return self.source.where(self.places[0][0])


@dataclass(frozen=True)
class Program:
    """A program as read.

    ``not_corrected``: statements whose positions are computed, incomplete or defined elsewhere.
    ``convention``: how this file writes poses. ``frames``: tools and
    bases by kind and name; of a language's ``read`` those of the program's own statements.
    """

    sources: Sequence[Source]
    positions: Sequence[Position]
    convention: Convention
    not_corrected: Sequence[str] = ()
    frames: Frames = field(default_factory=dict)

    def frame(self, kind: str, position: Position) -> Pose:
        """Tool or base of a position."""
        return self.frames.get((kind, getattr(position, kind) or ""), IDENTITY)

    def flange(self, position: Position) -> Pose:
        """Wanted pose of the flange, of a position that is no joints."""
        place = self.convention.pose(position.numbers, position.where)
        tool = invert(self.frame(TOOL, position))
        return compose(compose(self.frame(BASE, position), place), tool)


Use = tuple[str | None, str | None, str]  # tool, base, and why these cannot be corrected
UNUSED: Use = (None, None, "")


class Moves:
    """Positions of a program as they are read, and the frames of the moves that use them.

    ``positions``: with the key that moves have for them; ``uses``: by key, in the order of the
    moves; ``refused``: why positions with a frame, by kind and name, cannot be corrected.
    """

    def __init__(self) -> None:
        self.positions: list[tuple[Hashable, Position]] = []
        self.uses: dict[Hashable, set[Use]] = {}
        self.refused: dict[tuple[str, str | None], str] = {}
        self.not_corrected: list[str] = []
        self.frames: Frames = {}

    def use(self, key: Hashable, tool: str | None, base: str | None, reason: str = "") -> None:
        """A move that uses the positions of a key."""
        self.uses.setdefault(key, set()).add((tool, base, reason))

    def program(self, sources: Sequence[Source], convention: Convention) -> Program:
        """The program, its positions in the order of the moves, with the frames of these.

        Positions that no move uses are not corrected, unless none is used.
        """
        positions: list[Position] = []
        idle: list[Position] = []
        order = {key: number for number, key in enumerate(self.uses)}
        for key, position in sorted(self.positions, key=lambda item: order.get(item[0], 0)):
            uses = self.uses.get(key, {UNUSED})
            tool, base, reason = next(iter(uses))
            reason = self.refused.get((TOOL, tool)) or self.refused.get((BASE, base)) or reason
            reason = SEVERAL if len(uses) > 1 else reason
            position = replace(position, tool=tool, base=base, refused=reason)
            (positions if key in self.uses else idle).append(position)
        lines = [f"{item.where}: {item.name}, which no move uses" for item in idle if positions]
        not_corrected = [*self.not_corrected, *lines]
        return Program(sources, positions or idle, convention, not_corrected, self.frames)


@dataclass(frozen=True)
class Language:
    """One language: how its programs are read and its numbers are meant.

    ``read(sources, pulses_per_deg)`` gives a Program; ``frames(source)`` the tools and
    bases that a file holds. ``partners``: endings of files written together with the program;
    ``frame_files``: names, in lower case, of files with frames beside it. ``posture``: what the
    controller calls the posture, from the sides (front, elbow up, wrist of joint 5 positive) and
    the joints in degrees.
    """

    name: str
    endings: tuple[str, ...]
    convention: Convention
    read: Callable[[Sequence[Source], np.ndarray | None], Program]
    frames: Callable[[Source], Frames] = lambda source: {}
    posture: Posture = lambda sides, q_deg: ()
    partners: tuple[str, ...] = ()
    frame_files: tuple[str, ...] = ()


def blanked(text: str, *patterns: str) -> str:
    """The text with comments and strings, which match, replaced by spaces: offsets as before."""
    return re.sub(
        "|".join(patterns), lambda match: re.sub(r"[^\r\n]", " ", match[0]), text, flags=re.M
    )


def replaced(source: Source, new: Mapping[Position, np.ndarray]) -> bytes:
    """The file with new numbers of its positions."""
    text = source.text
    changes: list[tuple[Place, float, int]] = []
    for position, values in new.items():
        if position.source is source:
            decimals = np.broadcast_to(position.decimals, len(values))
            changes += zip(position.places, values, decimals, strict=True)
    for (start, end), value, least in sorted(changes, reverse=True):
        text = text[:start] + _written(text[start:end], value, least) + text[end:]
    return text.encode("latin-1")


def _written(old: str, value: float, least: int) -> str:
    """A number in the form of the old one, with as many digits after the point and ``least``.

    The old text where it is the same number to that many digits.
    """
    point = re.search(r"[.,](\d*)", old)
    decimals = max(least, len(point[1]) if point and "e" not in old.lower() else 0)
    if abs(value - float(old.replace(",", "."))) < 0.5 * 10.0**-decimals:
        return old
    text = f"{value:{'+' if old[0] == '+' else ''}.{decimals}f}"
    text = text.lstrip("-") if float(text) == 0.0 else text
    text = re.sub(r"^([-+]?)0\.", r"\1.", text) if re.match(r"[-+]?\.", old) else text
    return text.replace(".", ",") if "," in old else text


def frames_of_yaml(source: Source, convention: Convention) -> Frames:
    """Frames of ``tools: {1: [six numbers]}``, ``bases: {1: [..]}``, in mm and degrees."""
    try:
        content = yaml.safe_load(source.text)
        return {
            (kind, str(number)): convention.typed(np.array(numbers, float))
            for kind in (TOOL, BASE)
            for number, numbers in content.get(f"{kind}s", {}).items()
        }
    except (yaml.YAMLError, AttributeError, TypeError, ValueError):
        allowed = "tools: {1: [six numbers]}, bases: {1: [six numbers]}"
        raise input_error(str(source.path), "is no file of frames", allowed) from None
