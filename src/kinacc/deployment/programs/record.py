"""Positions of a robot program with the places of their numbers in the text.

Files are decoded as Latin-1, one character a byte, so that every byte that is no replaced number
comes back unchanged, whatever the encoding and the line ends.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kinacc.deployment.programs.orientation import Convention
from kinacc.errors import InputError, Problem
from kinacc.geometry import IDENTITY, Pose

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
POSE, JOINTS = "pose", "joints"
TOOL, BASE = "tool", "base"
_NUMBER = re.compile(NUMBER)


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
            raise InputError(
                Problem(str(path), "is no text of one byte a character", "ASCII, UTF-8, Windows")
            )
        return cls(path, content.decode("latin-1"))

    def line(self, offset: int) -> int:
        """Number of the line at an offset, from 1."""
        return self.text.count("\n", 0, offset) + 1


class Place(NamedTuple):
    """Where a number stands: offsets in the text."""

    start: int
    end: int


@dataclass(frozen=True)
class Position:
    """One position of a program.

    ``numbers`` are those written, in the language's units: a position and an orientation, or
    joints; ``decimals`` the digits after the point that a new number has at least. ``scale``
    (k,): written units per degree (mm where a joint slides) of joints. ``tool`` and ``base`` name
    frames of the program, None where the program does not state one. ``posture`` is compared with
    ``Language.posture``, None where none is stated. ``external``: axes beyond the arm. ``refused``:
    why this position cannot be corrected.
    """

    name: str
    source: int
    line: int
    kind: str
    places: tuple[Place, ...]
    numbers: np.ndarray
    decimals: tuple[int, ...]
    tool: str | None = None
    base: str | None = None
    posture: tuple[str | None, ...] | None = None
    external: tuple[float, ...] = ()
    scale: np.ndarray | float = 1.0
    refused: str = ""


@dataclass(frozen=True)
class Program:
    """What was read: files, positions in their order, frames by kind and name.

    ``left``: statements whose positions are computed by the program and stay as they are.
    ``convention``: that of this file, where it is not the one of its language.
    """

    sources: tuple[Source, ...]
    positions: tuple[Position, ...]
    frames: Mapping[tuple[str, str], Pose] = field(default_factory=dict)
    left: tuple[str, ...] = ()
    convention: Convention | None = None


@dataclass(frozen=True)
class Reading:
    """What a language is given beside the program: further files with frames, and a pulse scale."""

    sources: tuple[Source, ...]
    frame_files: tuple[Source, ...] = ()
    pulses_per_degree: np.ndarray | None = None


@dataclass(frozen=True)
class Language:
    """One language: how its programs are read and its numbers are meant.

    ``partners``: endings of files read and written together with the program; ``frame_files``:
    names, in lower case, of files with frames that are looked for in the program's folder.
    ``posture``: what the controller calls the posture, from the sides (front, elbow up, wrist of
    joint 5 positive) and the joints in degrees.
    """

    name: str
    endings: tuple[str, ...]
    convention: Convention
    read: Callable[[Reading], Program]
    posture: Callable[[Sequence[bool], np.ndarray], tuple[str, ...]] | None = None
    partners: tuple[str, ...] = ()
    frame_files: tuple[str, ...] = ()


def blanked(text: str, *patterns: str) -> str:
    """The text with what matches replaced by spaces: comments and strings, offsets as before."""
    for pattern in patterns:
        text = re.sub(pattern, lambda found: re.sub(r"[^\r\n]", " ", found[0]), text)
    return text


def numbers_in(text: str, start: int, end: int) -> list[Place]:
    """Places of the numbers between two offsets."""
    return [Place(*found.span()) for found in _NUMBER.finditer(text, start, end)]


def values_at(text: str, places: Iterable[Place]) -> np.ndarray:
    """The numbers at places."""
    return np.array([float(text[place.start : place.end]) for place in places])


def written(old: str, value: float, least: int) -> str:
    """A number in the form of the old one: its digits after the point, at least ``least``.

    The old text where it is the same number to that many digits.
    """
    if "," in old:
        return written(old.replace(",", "."), value, least).replace(".", ",")
    point = re.search(r"\.(\d*)", old)
    is_short = "e" not in old.lower()
    decimals = max(least, len(point[1]) if point and is_short else 0)
    if abs(value - float(old)) < 0.5 * 10.0**-decimals:
        return old
    text = f"{value:.{decimals}f}"
    if float(text) == 0.0:
        text = text.lstrip("-")
    if old.startswith("+") and not text.startswith("-"):
        text = "+" + text
    return re.sub(r"^([-+]?)0\.", r"\1.", text) if re.match(r"[-+]?\.", old) else text


def replaced(program: Program, new: Mapping[int, np.ndarray]) -> list[bytes]:
    """The files with new numbers, by number of the position."""
    changes: list[list[tuple[Place, str]]] = [[] for _ in program.sources]
    for number, values in new.items():
        position = program.positions[number]
        text = program.sources[position.source].text
        for place, value, least in zip(position.places, values, position.decimals, strict=True):
            changes[position.source].append((place, written(text[slice(*place)], value, least)))
    files = []
    for source, made in zip(program.sources, changes, strict=True):
        parts, done = [], 0
        for place, text in sorted(made):
            parts += [source.text[done : place.start], text]
            done = place.end
        files.append("".join([*parts, source.text[done:]]).encode("latin-1"))
    return files


def unused(*kinds: str) -> dict[tuple[str, str], Pose]:
    """Frames of number 0, which every controller has as the identity."""
    return {(kind, "0"): IDENTITY for kind in kinds or (TOOL, BASE)}
