"""Yaskawa JBI jobs: positions in pulses and Cartesian; frames of TOOL.CND and UFRAME.CND."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinacc.deployment.programs.frame_files import frames_of
from kinacc.deployment.programs.orientation import FIXED, Convention
from kinacc.deployment.programs.record import (
    BASE,
    JOINTS,
    POSE,
    TOOL,
    Language,
    Position,
    Program,
    Reading,
    numbers_in,
    values_at,
)
from kinacc.errors import InputError, Problem
from kinacc.geometry import IDENTITY

CONVENTION = Convention(FIXED)
_POSITION = re.compile(r"(B?C|P|BP|EC|EX)(\d+)\s*=")
_ROBOT = "ROBOT"


def read(reading: Reading) -> Program:
    """Positions of a job; those of base and station axes stay as they are."""
    (source,) = reading.sources
    frames = {(TOOL, "0"): IDENTITY, (BASE, _ROBOT): IDENTITY}
    frames.update(frames_of(reading.frame_files, CONVENTION))
    state = {"TOOL": "0", "USER": None, "POSTYPE": "", "RCONF": None, "unit": ""}
    positions, base_axes, left = [], {}, []
    offset = 0
    for number, line in enumerate(source.text.splitlines(keepends=True), 1):
        text = line.strip()
        if text.startswith("//INST"):
            left += _computed(source.text[offset:], number, source.path.name)
            break
        if text.startswith("///"):
            word, _, rest = text[3:].partition(" ")
            if word in ("PULSE", "RECTAN", "ANGLE"):
                state["unit"] = word
            elif word == "TOOL":
                state["TOOL"] = str(int(rest.split(",")[0]))
            elif word in state:
                state[word] = rest.strip()
        elif found := _POSITION.match(text):
            start = offset + line.index("=") + 1
            places = numbers_in(source.text, start, offset + len(line))
            values = values_at(source.text, places)
            if found[1].startswith(("B", "E")):
                base_axes[found[2]] = (*base_axes.get(found[2], ()), *values)
            else:
                positions.append(_position(found[0][:-1].strip(), number, places, values, state))
        offset += len(line)
    positions = [
        replace(each, external=(*each.external, *base_axes.get(re.sub(r"\D", "", each.name), ())))
        for each in positions
    ]
    if any(each.kind == JOINTS for each in positions):
        positions = _scaled(positions, reading)
    return Program(reading.sources, tuple(positions), frames, tuple(left))


def _position(name: str, line: int, places: list, values: np.ndarray, state: dict) -> Position:
    kind = POSE if state["unit"] == "RECTAN" else JOINTS
    decimals = (3, 3, 3, 4, 4, 4) if kind == POSE else (0,) * len(places)
    base, stated, refused = None, None, ""
    if kind == POSE:
        reference = state["POSTYPE"].upper()
        if reference == "USER":
            base = str(int(state["USER"] or 0))
        elif reference in ("ROBOT", "BASE"):
            base = _ROBOT
        else:
            refused = f"positions of the kind {reference or 'not stated'} cannot be corrected"
        stated = _stated(state["RCONF"])
    used = 6 if kind == POSE else len(places)
    return Position(
        name,
        0,
        line,
        kind,
        tuple(places[:used]),
        values[:used],
        decimals,
        state["TOOL"],
        base,
        stated,
        tuple(values[used:]),
        refused=refused,
    )


def _stated(text: str | None) -> tuple[str | None, ...] | None:
    if not text:
        return None
    bits = [int(bit) for bit in text.split(",")[:6]]
    names = [pair[bit] for pair, bit in zip(_WORDS, bits, strict=False)]
    return (*names, *(None,) * (6 - len(names)))


_WORDS = (
    ("flip", "no flip"),
    ("upper arm", "lower arm"),
    ("front", "rear"),
    ("R < 180", "R >= 180"),
    ("T < 180", "T >= 180"),
    ("S < 180", "S >= 180"),
)


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Flip by the R axis, upper arm, front, and turns of R, T and S."""
    is_ahead, is_above, _ = sides
    r = (q_deg[3] + 180.0) % 360.0 - 180.0
    bits = (not -90.0 < r <= 90.0, not is_above, not is_ahead)
    turned = [not -180.0 < q_deg[axis] <= 180.0 for axis in (3, 5, 0)]
    return tuple(pair[int(bit)] for pair, bit in zip(_WORDS, (*bits, *turned), strict=True))


def _scaled(positions: list[Position], reading: Reading) -> list[Position]:
    """Joints with pulses a degree; InputError where no scale is known."""
    scale = reading.pulses_per_degree
    if scale is None:
        what = "positions are in pulses"
        fix = "give --pulses-per-degree, one number an axis (S, L, U, R, B, T)"
        raise InputError(Problem(str(reading.sources[0].path), what, fix=fix))
    scaled = []
    for each in positions:
        if each.kind == JOINTS:
            count = len(scale)
            each = replace(
                each,
                places=each.places[:count],
                numbers=each.numbers[:count],
                decimals=each.decimals[:count],
                external=(*each.numbers[count:], *each.external),
                scale=np.asarray(scale),
            )
        scaled.append(each)
    return scaled


def _computed(text: str, first: int, name: str) -> list[str]:
    """Moves by a shift or to a variable that the job computes."""
    found = []
    for number, line in enumerate(text.splitlines(), first):
        if re.match(r"\s*(IMOV|SFTON|CNVRT|MULMAT|SETE)\b", line):
            found.append(f"{name}:{number}: {line.strip()}")
    return found


LANGUAGE = Language(
    "Yaskawa JBI", (".jbi",), CONVENTION, read, posture, (), ("tool.cnd", "uframe.cnd")
)
