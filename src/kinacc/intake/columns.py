"""Which columns of a foreign file hold joints, positions, orientations and the rest.

Columns that go together differ in one word only: a number for joints, x, y and z for points. What a
group holds is told by its other words; groups of commanded or wanted values are left aside.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from kinacc.data.layout import TOOL
from kinacc.intake.names import Name

WANTED = {"goal", "cmd", "command", "commanded", "soll", "nominal", "nom", "set", "desired", "ref"}
_SPREAD = {"std", "sigma", "stddev", "stdev", "sd", "uncertainty"}
_TURN = {"r", "rot", "rotation", "orientation", "angle", "euler", "rotvec"}
_JOINT = ("q", "joint", "j", "axis", "a", "theta")
_NO_JOINT = {*_SPREAD, "dir", "direction", "velocity", "vel", "qd", "dq", "torque", "current", "s"}
_NAMED_JOINTS = (
    ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"),
    ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3"),
)
_TURNS = (  # words of the three angles, their order about x, y, z, and what they usually are
    (("roll", "pitch", "yaw"), "xyz"),
    (("w", "p", "r"), "xyz"),  # FANUC: about fixed x, y, z
    (("c", "b", "a"), "ZYX"),  # KUKA: A about z, then B about y, then C about x
)
_SINGLE = {
    "pose": {"pose", "config", "configuration", "point", "pt", "no", "nr", "index"},
    "repeat": {"repeat", "repetition", "rep", "reading"},
    "session": {"session", "setup", "station", "series", "campaign"},
    "target": {"target", "marker", "reflector", "smr"},
    "temperature": {"temp", "temperature"},
}


@dataclass(frozen=True)
class Columns:
    """Names of ``measurements.file.columns`` and the columns they mean.

    ``joints`` q1 ..; ``commanded`` the same as commanded, may be empty; ``targets`` by name, each a
    mapping of x, rx, qw, std_x and the like; ``turn`` kind and convention of the orientations as
    their names have it; ``single`` pose, repeat, session, target, temperature.
    """

    joints: tuple[Name, ...]
    commanded: tuple[Name, ...] = ()
    targets: dict[str, dict[str, Name]] = field(default_factory=dict)
    turn: tuple[str, str] = ("none", "XYZ")
    single: dict[str, Name] = field(default_factory=dict)


def recognise(names: Sequence[Name]) -> Columns:
    """What the columns of these names hold; no joints or no targets where none were found."""
    rows = _numbered(names) or _named(names)
    joints = next((r for r in rows if not WANTED & _words(r)), ())
    commanded = next((r for r in rows if WANTED & _words(r) and len(r) == len(joints)), ())
    rest = [each for each in names if each not in joints and each not in commanded]
    targets: dict[str, dict[str, Name]] = {}
    turn = ("none", "XYZ")
    turns: dict[tuple[str, ...], dict[str, Name]] = {}
    spreads: dict[tuple[str, ...], dict[str, Name]] = {}
    for words, stem, axes in _by_axis(rest):
        about = {*words, stem}
        if WANTED & about:
            continue
        if _SPREAD & about:
            spun = "r" if _TURN & about or stem == "stdr" else ""
            plain = tuple(w for w in words if w not in (*_SPREAD, *_TURN))
            found = {f"std_{spun}{axis}": axes[axis] for axis in "xyz"}
            spreads[plain] = spreads.get(plain, {}) | found
        elif "w" in axes or stem == "q" or {"quat", "quaternion"} & about:
            if "w" in axes:
                plain = tuple(w for w in words if w not in ("quat", "quaternion", *_TURN))
                turns[plain] = {f"q{axis}": axes[axis] for axis in "wxyz"}
                turn = ("quaternion", "XYZ")
        elif _TURN & about:
            plain = tuple(w for w in words if w not in _TURN)
            turns[plain] = {f"r{axis}": axes[axis] for axis in "xyz"}
            vector = {"rotvec", "vector", "rvec"} & about
            turn = ("rotation_vector" if vector else "euler", "XYZ")
        else:
            targets[_target(words, names)] = {axis: axes[axis] for axis in "xyz"}
    for letters, convention in _TURNS:
        for words, found in _by_word(rest, letters).items():
            if not WANTED & {*words} and not _SPREAD & {*words} and words not in turns:
                turns[words] = dict(zip(("rx", "ry", "rz"), found, strict=True))
                turn = ("euler", convention)
    for extra in (turns, spreads):
        for words, found in extra.items():
            if (target := _target(words, names)) in targets:
                targets[target] |= found
    if not any({"rx", "qw"} & set(each) for each in targets.values()):
        turn = ("none", "XYZ")
    used = {each for target in targets.values() for each in target.values()}
    single = _singles(each for each in rest if each not in used)
    return Columns(joints, commanded, targets, turn, single)


def _words(names: Iterable[Name]) -> set[str]:
    return {word for each in names for word in each.words}


def _target(words: tuple[str, ...], names: Sequence[Name]) -> str:
    """Name of a target from the words its columns share; those that only say 'measured' drop."""
    spelling = {w: s for each in names for w, s in zip(each.words, each.spelled, strict=True)}
    told = [w for w in words if w not in ("measurement", "measured", "pos", "position", "actual")]
    return "_".join(spelling[w] for w in told) or TOOL


def _numbered(names: Sequence[Name]) -> list[tuple[Name, ...]]:
    """Rows of columns that differ in a number counting 0.. or 1.., those of joints first."""
    rows: dict[tuple, dict[int, Name]] = {}
    for each in names:
        for place, word in enumerate(each.words):
            if word.isdigit() and len(word) == 1:
                rows.setdefault((place, each.without(place)), {})[int(word)] = each
    found = []
    for (_, words), columns in rows.items():
        numbers = sorted(columns)
        counted = numbers == list(range(numbers[0], numbers[0] + len(numbers)))
        if counted and numbers[0] in (0, 1) and 4 <= len(numbers) <= 7 and not _NO_JOINT & {*words}:
            rank = next((i for i, word in enumerate(_JOINT) if word in words), len(_JOINT))
            if rank < len(_JOINT) or len(numbers) >= 6:
                found.append((-len(numbers), rank, tuple(columns[n] for n in numbers)))
    return [row for _, _, row in sorted(found, key=lambda each: each[:2])]


def _named(names: Sequence[Name]) -> list[tuple[Name, ...]]:
    """Rows of columns with the names joints of some arms have."""
    rows = []
    for series in _NAMED_JOINTS:
        row = []
        for joint in series:
            words = set(joint.split("_"))
            hits = [
                n for n in names if words <= {*n.words} and not (WANTED | _NO_JOINT) & {*n.words}
            ]
            row += hits[:1]
        if len(row) == len(series) and len(set(row)) == len(row):
            rows.append(tuple(row))
    return rows


def _by_axis(names: Sequence[Name]):
    """Words, stem and columns by axis of names that differ in x, y, z (and w) alone."""
    groups: dict[tuple, dict[str, Name]] = {}
    for each in names:
        for place, word in enumerate(each.words):
            if word[-1] in "xyzw" and len(word) <= 4:
                key = (each.without(place), word[:-1])
                groups.setdefault(key, {}).setdefault(word[-1], each)
    for (words, stem), axes in groups.items():
        if {"x", "y", "z"} <= set(axes):
            yield words, stem, axes


def _by_word(names: Sequence[Name], letters: tuple[str, ...]) -> dict[tuple, list[Name]]:
    """Columns that differ in these words alone, in their order, by the words they share."""
    groups: dict[tuple, dict[str, Name]] = {}
    for each in names:
        for place, word in enumerate(each.words):
            if word in letters:
                groups.setdefault(each.without(place), {})[word] = each
    return {k: [g[w] for w in letters] for k, g in groups.items() if len(g) == 3}


def _singles(names: Iterable[Name]) -> dict[str, Name]:
    found: dict[str, Name] = {}
    for each in names:
        words = [word for word in each.words if word not in ("measurement", "c", "id", "number")]
        for quantity, known in _SINGLE.items():
            if len(words) == 1 and words[0] in known:
                found.setdefault(quantity, each)
    return found
