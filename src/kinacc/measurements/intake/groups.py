"""Columns of a foreign file that go together, and what their names say of them.

Columns that go together differ in one word only: a number for joints, x, y and z for points. What a
group holds is told by its other words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from kinacc.measurements import column_names
from kinacc.measurements.column_names import OPEN, OTHER, PLAIN, SPREAD, Name, role, speaks
from kinacc.measurements.layout import TOOL
from kinacc.measurements.words import WORDS

JOINTS, POINT, TURN, POSE, RADIUS = "joints", "point", "orientation", "pose", "radius"
SPREADS = "spread"
Values = Callable[[Name], np.ndarray]

_TURN_WORDS, _QUATERNION_WORDS = WORDS["turn"], WORDS["quaternion"]
_UNIT_LENGTH = 2e-3  # how far from 1 the length of a quaternion may be, as written


@dataclass(frozen=True)
class Group:
    """Columns that go together.

    ``kind`` is one of those above; ``role`` one of those of names; ``columns`` by our names (q1, x,
    rx, qw, quat1, std_x); ``turn`` kind and convention of orientations; ``weak`` where nothing says
    that they are joints, or that a spread is one standard deviation.
    """

    kind: str
    role: str
    target: str
    columns: dict[str, Name]
    turn: tuple[str, str] = ("none", "XYZ")
    weak: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' names in the file."""
        return tuple(name.column for name in self.columns.values())

    @property
    def units(self) -> tuple[str, ...]:
        """The units its columns state, each once."""
        return tuple(dict.fromkeys(name.unit for name in self.columns.values()))

    @property
    def words(self) -> tuple[str, ...]:
        """The words of its first column."""
        return next(iter(self.columns.values())).words

    def in_words(self) -> str:
        """The columns, the inner ones of many left out."""
        return listed(self.names)


def listed(names: Sequence[str]) -> str:
    """Names of columns, the inner ones of many left out."""
    return f"{names[0]} .. {names[-1]}" if len(names) > 4 else ", ".join(names)


def found(names: Sequence[Name], values: Values | None = None) -> list[Group]:
    """Every group of the columns, whatever it holds."""
    groups = [*_numbered(names, values), *_named(names), *_by_axis(names)]
    points = {
        each.columns["x"].without(each.words.index("x")) for each in groups if each.kind == POINT
    }
    groups += _by_word(names, points)
    for name in names:
        if WORDS["radius"] & {*name.words}:  # open where the name says that points are no centres
            said = OPEN if WORDS["not_corrected"] & {*name.words} else OTHER
            groups.append(Group(RADIUS, said, "", {"radius": name}))
    return groups


def is_pulse(unit: str) -> bool:
    """Whether a unit is pulses of a motor, which mean nothing without their number per degree."""
    return unit.lower() in ("pulse", "pulses", "count", "counts", "tick", "ticks")


def is_deviation(name: Name) -> bool:
    """Whether a column by itself says how far off a point was: error, 3D deviation."""
    told = {w for w in name.words if w not in WORDS["filling"] | {"d", "total"} and not w.isdigit()}
    said = role(name.words) == column_names.DEVIATION or {*name.words} == {"deviation"}
    return (
        said and len(told) <= 1 and not WORDS["external"] & told and name.unit not in ("deg", "rad")
    )


def _numbered(names: Sequence[Name], values: Values | None) -> Iterator[Group]:
    """Columns that differ in a number counting 0.. or 1..: joints, quaternions, poses."""
    labels = [
        (name, place, str(int(word)), "")
        for name in names
        for place, word in enumerate(name.words)
        if word.isdecimal() and len(word) <= 2
    ]
    for words, _, columns in _alike(labels):
        numbers = sorted(map(int, columns))
        if numbers[0] > 1 or numbers != list(range(numbers[0], numbers[0] + len(numbers))):
            continue
        row, about = [columns[str(number)] for number in numbers], {*words}
        in_angles = {name.unit for name in row} in ({"deg"}, {"rad"})
        if len(row) == 4 and (turn := _quaternion(row, about, values)):
            yield turn
        elif (
            len(row) == 6
            and about & WORDS["pose_of_controller"]
            and not about & {"joint", "joints"}
        ):
            yield Group(POSE, role(words), "", dict(zip("123456", row, strict=True)))
        elif len(row) == 3 and about & (_TURN_WORDS - WORDS["joint"]) and in_angles:
            turned = dict(zip(("rx", "ry", "rz"), row, strict=True))
            yield Group(TURN, role(words), _target(row[0], drop=True), turned, ("euler", "XYZ"))
        elif 4 <= len(row) <= 7:
            known = bool(about & WORDS["joint"]) and not about & WORDS["external"]
            if known or len(row) >= 6:
                yield _joints(row, words, weak=not known)


def _quaternion(row: list[Name], about: set[str], values: Values | None) -> Group | None:
    """Four numbered columns as a quaternion, where their names or their length say so."""
    said = bool(about & (_QUATERNION_WORDS - {"q"}))
    if not said and not about & {"q", "rot", "rotation", "ori", "orient", "orientation"}:
        return None
    unit = said
    if values is not None:
        length = np.sqrt(sum(values(name) ** 2 for name in row))
        length = length[np.isfinite(length)]
        unit = length.size > 0 and bool(np.mean(np.abs(length - 1.0) < _UNIT_LENGTH) > 0.9)
    if not unit and not said:
        return None
    told = role([w for w in row[0].words if w not in _QUATERNION_WORDS]) if unit else OTHER
    columns = {f"quat{number}": name for number, name in enumerate(row, 1)}
    return Group(TURN, told, _target(row[0], drop=True), columns, ("quaternion", "XYZ"))


def _joints(row: Sequence[Name], words: Sequence[str], weak: bool = False) -> Group:
    rest = [w for w in words if w not in WORDS["joint"] | WORDS["filling"] and not w.isdigit()]
    rest = [w for w in rest if role([w]) != column_names.CALCULATED]
    said = role(rest)
    if weak and WORDS["external"] & {*words}:
        said = OTHER
    elif column_names.commands(rest):
        said = column_names.NOMINAL
    elif said == column_names.MEASURED:
        said = column_names.REPORTED
    target = "" if all(map(speaks, rest)) else "_".join(rest)
    return Group(JOINTS, said, target, {f"q{n}": name for n, name in enumerate(row, 1)}, weak=weak)


def _named(names: Sequence[Name]) -> Iterator[Group]:
    """Joints by the names that those of some arms have."""
    taken: set[str] = set()
    for series in WORDS["named_joints"]:
        rows: dict[tuple[str, ...], dict[str, list[Name]]] = {}
        for name in names:
            for joint in series:
                words = joint.split("_")
                rest = tuple(w for w in name.words if w not in (*words, "joint", "j"))
                known = all(w in WORDS["joint"] or role([w]) != PLAIN for w in rest)
                own = {*words} <= {*name.words} and name.column not in taken
                if own and (len(joint) > 1 or known):
                    rows.setdefault(rest, {}).setdefault(joint, []).append(name)
        for rest, row in rows.items():
            # The shoulder of one series is part of the other's names.
            if len(row) == len(series) and all(len(each) == 1 for each in row.values()):
                columns = [row[joint][0] for joint in series]
                taken |= {name.column for name in columns}
                yield _joints(columns, rest)


def _by_axis(names: Sequence[Name]) -> Iterator[Group]:
    """Points, orientations and their spreads: columns that differ in x, y, z (and w) alone."""
    labels = [
        (name, place, word[-1], word[:-1])
        for name in names
        for place, word in enumerate(name.words)
        if word[-1] in "xyzw" and word[:-1] in ("", "r", "q", "rv")
    ]
    for words, stem, axes in _alike(labels):
        if not {*"xyz"} <= {*axes}:
            continue
        about, one = {*words}, axes["x"]
        is_turn = stem in ("r", "rv") or bool(about & _TURN_WORDS)
        vector = stem == "rv" or (bool(about & WORDS["vector"]) and is_turn)
        said = role([w for w in words if not (vector and w == "vector")])
        letters = [w for w in one.words[one.words.index(f"{stem}x") + 1 :] if len(w) == 1]
        if said == PLAIN and any(w.isalpha() and w not in _TURN_WORDS for w in letters):
            said = OPEN  # x_n, x_c: what the letter means is anyone's guess
        if stem == "q" or about & _QUATERNION_WORDS or (is_turn and "w" in axes and not stem):
            if "w" in axes:
                columns = {f"q{axis}": axes[axis] for axis in "wxyz"}
                yield Group(TURN, said, _target(one, drop=True), columns, ("quaternion", "XYZ"))
            continue
        units = {axes[axis].unit for axis in "xyz"} - {""}
        is_turn = is_turn or (bool(units) and units <= {"deg", "rad"})
        before = ("std_" if said == SPREAD else "") + ("r" if is_turn else "")
        columns = {f"{before}{axis}": axes[axis] for axis in "xyz"}
        kind = SPREADS if said == SPREAD else TURN if is_turn else POINT
        turn = ("rotation_vector" if vector else "euler" if kind == TURN else "none", "XYZ")
        target = _target(one, drop=is_turn)
        yield Group(kind, said, target, columns, turn, kind == SPREADS and not _one_sigma(one))


def _by_word(names: Sequence[Name], points: set[tuple[str, ...]]) -> Iterator[Group]:
    """Orientations by the names of their angles; single letters only beside x, y, z."""
    for *letters, convention in WORDS["angles"]:
        labels = [
            (name, place, word, "")
            for name in names
            for place, word in enumerate(name.words)
            if word in letters
        ]
        for words, _, columns in _alike(labels):
            if len(columns) < 3 or (len(letters[0]) == 1 and tuple(words) not in points):
                continue
            said = role(words)
            before, kind = ("std_", SPREADS) if said == SPREAD else ("", TURN)
            parts = [columns[letter] for letter in letters]
            turned = dict(zip((f"{before}r{axis}" for axis in "xyz"), parts, strict=True))
            target = _target_of(parts[0], words)
            yield Group(kind, said, target, turned, ("euler", convention), kind == SPREADS)


def _alike(labels: Iterable) -> Iterator[tuple[tuple[str, ...], str, dict[str, Name]]]:
    """Words, stem and columns by label of names that differ in the label alone.

    ``labels``: name, place of the word, label and stem. Where a label is there twice (X and x_mm),
    columns of one unit and spelling go together.
    """
    groups: dict[tuple, dict[str, list[Name]]] = {}
    for name, place, label, stem in labels:
        groups.setdefault((name.without(place), place, stem), {}).setdefault(label, []).append(name)
    for (words, place, stem), columns in groups.items():
        twice = any(len(each) > 1 for each in columns.values())
        kinds: dict[tuple, dict[str, Name]] = {}
        for label, each in columns.items():
            for name in each:
                spelled = name.spelled[:place] + name.spelled[place + 1 :]
                kind = (name.unit, spelled, name.spelled[place].isupper()) if twice else ()
                kinds.setdefault(kind, {})[label] = name
        for row in kinds.values():
            yield words, stem, row


def _target(one: Name, drop: bool = False) -> str:
    """Name of a target from the words its columns share; ``drop`` those of orientations too."""
    words = [w for w in one.words if w[-1] not in "xyzw" or len(w) > 2]
    if drop:
        gone = _TURN_WORDS | _QUATERNION_WORDS | WORDS["vector"]
        gone = gone | {one.words[-1]} if one.words[-1].isdigit() else gone
        words = [w for w in words if w not in gone]
    return _target_of(one, words)


def _target_of(one: Name, words: Sequence[str]) -> str:
    spelling = dict(zip(one.words, one.spelled, strict=True))
    name = ""
    for spelled in (spelling[w] for w in words if not speaks(w) and w not in WORDS["filling"]):
        # As the file has it: smr1, and not smr_1.
        name += spelled if not name or f"{name}{spelled}" in one.column else f"_{spelled}"
    return name or TOOL


def _one_sigma(one: Name) -> bool:
    """Whether a spread is one standard deviation: no interval, no multiple of it."""
    words, sigma = one.words, WORDS["one_sigma"]
    if not ({*words} & sigma or {"standard", "deviation"} <= {*words}):
        return False
    near = [*pairwise(words), *pairwise(words[::-1])]
    return not any(beside.isdigit() for word, beside in near if word in sigma)


def same(one: Group, other: Group, values: Values | None) -> bool:
    """Whether two groups hold the same numbers, their units aside."""
    if values is None or {*one.columns} != {*other.columns}:
        return False
    a = np.stack([values(name) for name in one.columns.values()])
    b = np.stack([values(other.columns[key]) for key in one.columns])
    off = 2e-6 * max(np.nanmax(np.abs(b), initial=0.0), 1e-9)
    factors = (1.0, np.pi / 180.0, 180.0 / np.pi, 1e-3, 1e3)
    return any(np.allclose(a * factor, b, 0.0, off, equal_nan=True) for factor in factors)


def rigid(groups: Sequence[Group], values: Values | None) -> bool:
    """Whether points can be targets of one rigid body: they keep their distances while they turn.

    A nominal point beside its measured one is a millimetre off, or in a frame of its own.
    """
    if values is None:
        return True
    points = [np.stack([values(g.columns[axis]) for axis in "xyz"], axis=1) for g in groups]
    return all(keeps_distance(a, b) for a, b in combinations(points, 2))


def keeps_distance(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two points (n, 3), NaN where unread, keep their distance and turn about each other.

    Fewer than three readings of both tell nothing.
    """
    apart = (one - other)[np.isfinite(one - other).all(axis=1)]
    if len(apart) < 3:
        return False
    length = np.linalg.norm(apart, axis=1)
    usual = float(np.median(length))
    off = float(np.median(np.abs(length - usual)))
    turned = float(np.median(np.linalg.norm(apart - np.median(apart, axis=0), axis=1)))
    return off <= 0.01 * usual and turned >= max(5.0 * off, 1e-3 * usual)
