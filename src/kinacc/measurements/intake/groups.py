"""Columns of a foreign file that go together, and what their names say of them.

Columns that go together differ in one word only: a number for joints, x, y and z for points. What a
group holds is told by its other words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from kinacc.measurements import column_names
from kinacc.measurements.column_names import READ, WORDS, Name
from kinacc.measurements.layout import TOOL

JOINTS, POINT, TURN, SPREAD, POSE = "joints", "point", "orientation", "spread", "pose"
RADIUS = "radius"
Values = Callable[[Name], np.ndarray]

_JOINT_TEXT = """
q joint joints j axis a theta θ th achse achsen gelenk gelenkwinkel axe eje asse giunto articulacion
articulacao articulation junta jnt jt rax robax jpos jointangle angle angles winkel angulo angolo
jointtarget
"""
_TURN_TEXT = """
r rot rotation rotations rotacion rotazione orientation orient ori orientierung orientacion
orientazione orientamento angle angles winkel angulo angolo euler drehung verdrehung drehwinkel
rotvec rvec rotationvector rpy
"""
_FILLING_TEXT = """
position positions pos posicion posizione xyz coord coordinate coordinates koordinate koordinaten
coordonnee coordonnees coordenada coordenadas coordinata quota quote cota posicao ort lage loc
location translation point pt punkt axis achse axe eje asse mean avg average mittel mittelwert
moyenne media value wert valeur valor valore values of the der die das de du la le del di in pose
data robax standard deviation dev
"""
_JOINT_WORDS = frozenset(_JOINT_TEXT.split())
_TURN_WORDS = frozenset(_TURN_TEXT.split())
_FILLING = frozenset(_FILLING_TEXT.split())
_VECTOR_WORDS = frozenset(("rotvec", "rvec", "rotationvector", "vector"))
_QUATERNION_WORDS = frozenset(("q", "quat", "quaternion", "quaternions"))
_POSE_WORDS = frozenset(("pose", "tcp", "flange", "cartesian", "cart", "kartesisch", "ee", "eef"))
_EXTERNAL = frozenset(("e", "ext", "eax", "extax", "external", "zusatzachse"))
_NAMED_JOINTS = (
    ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"),
    ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3"),
    ("s", "l", "u", "r", "b", "t"),
)
_ANGLES = (  # words of the three angles, their order about x, y, z, and what they usually are
    (("roll", "pitch", "yaw"), "xyz"),
    (("rollen", "nicken", "gieren"), "xyz"),
    (("roulis", "tangage", "lacet"), "xyz"),
    (("alabeo", "cabeceo", "guinada"), "xyz"),
    (("rollio", "beccheggio", "imbardata"), "xyz"),
    (("alpha", "beta", "gamma"), "XYZ"),  # Mecademic
    (("o", "a", "t"), "ZYZ"),  # Kawasaki
    (("w", "p", "r"), "xyz"),  # FANUC: about fixed x, y, z
    (("c", "b", "a"), "ZYX"),  # KUKA: A about z, then B about y, then C about x
)
_RADII = frozenset(("radius", "radii", "rayon", "radio", "raggio", "raio", "halbmesser"))
_NOT_CORRECTED_TEXT = """
uncorrected uncompensated unkorrigiert unkompensiert not nicht non no ohne without sin senza sans
off
"""
_NOT_CORRECTED = frozenset(_NOT_CORRECTED_TEXT.split())
_UNIT_LENGTH = 2e-3  # how far from 1 the length of a quaternion may be, as written


@dataclass(frozen=True)
class Group:
    """Columns that go together.

    ``kind`` is one of those above; ``role`` one of ``roles``; ``columns`` by our names (q1, x, rx,
    qw, quat1, std_x); ``turn`` kind and convention of orientations; ``weak`` where nothing says
    that they are joints.
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

    def in_words(self) -> str:
        """The columns, the inner ones of many left out."""
        names = self.names
        return f"{names[0]} .. {names[-1]}" if len(names) > 4 else ", ".join(names)


def found(names: Sequence[Name], values: Values | None = None) -> list[Group]:
    """Every group of the columns, whatever it holds."""
    groups = [*_numbered(names, values), *_named(names), *_by_axis(names)]
    points = {_words_of(each) for each in groups if each.kind == POINT}
    return [*groups, *_by_word(names, points), *_radii(names)]


def _radii(names: Sequence[Name]) -> Iterator[Group]:
    """Radii of reflectors; ``OPEN`` where the name says that the points are no centres."""
    for name in names:
        if _RADII & {*name.words}:
            open_ = bool(_NOT_CORRECTED & {*name.words})
            said = column_names.OPEN if open_ else column_names.OTHER
            yield Group(RADIUS, said, "", {"radius": name})


def is_pulse(unit: str) -> bool:
    """Whether a unit is pulses of a motor, which mean nothing without their number per degree."""
    return unit.lower() in ("pulse", "pulses", "count", "counts", "tick", "ticks")


def is_deviation(name: Name) -> bool:
    """Whether a column by itself says how far off a point was: error, 3D deviation."""
    told = [
        w for w in name.words if w not in _FILLING and not w.isdigit() and w not in ("d", "total")
    ]
    said = column_names.role(name.words) == column_names.DEVIATION or {*name.words} == {"deviation"}
    return said and len(told) <= 1 and not _EXTERNAL & {*told} and name.unit not in ("deg", "rad")


def _numbered(names: Sequence[Name], values: Values | None) -> Iterator[Group]:
    """Columns that differ in a number counting 0.. or 1..: joints, quaternions, poses."""
    labels = [
        (name, place, str(int(word)), "")
        for name in names
        for place, word in enumerate(name.words)
        if word.isdecimal() and len(word) <= 2
    ]
    for words, _, columns in _alike(labels):
        numbers = sorted(columns, key=int)
        first = int(numbers[0])
        counted = [int(n) for n in numbers] == list(range(first, first + len(numbers)))
        if not counted or first not in (0, 1):
            continue
        row = [columns[number] for number in numbers]
        about = {*words}
        if len(row) == 4 and (turn := _quaternion(row, about, values)):
            yield turn
        elif len(row) == 6 and about & _POSE_WORDS and not about & {"joint", "joints"}:
            yield Group(POSE, column_names.role(words), "", dict(zip("123456", row, strict=True)))
        elif len(row) == 3 and about & (_TURN_WORDS - _JOINT_WORDS) and _in_angles(row):
            columns = dict(zip(("rx", "ry", "rz"), row, strict=True))
            turn = ("euler", "XYZ")
            yield Group(TURN, column_names.role(words), _target(row[0], drop=True), columns, turn)
        elif 4 <= len(row) <= 7:
            known = bool(about & _JOINT_WORDS) and not about & _EXTERNAL
            if known or len(row) >= 6:
                yield _joints(row, words, weak=not known)


def _in_angles(row: Sequence[Name]) -> bool:
    """Whether the columns state a unit of angles, all the same."""
    return {name.unit for name in row} in ({"deg"}, {"rad"})


def _quaternion(row: list[Name], about: set[str], values: Values | None) -> Group | None:
    """Four numbered columns as a quaternion, where their names or their length say so."""
    said = bool(about & (_QUATERNION_WORDS - {"q"}))
    if not said and not about & {"q", "rot", "rotation", "ori", "orient", "orientation"}:
        return None
    if values is None:
        unit = said
    else:
        length = np.sqrt(sum(values(name) ** 2 for name in row))
        length = length[np.isfinite(length)]
        unit = length.size > 0 and bool(np.mean(np.abs(length - 1.0) < _UNIT_LENGTH) > 0.9)
    if not unit and not said:
        return None
    words = row[0].words
    columns = {f"quat{number}": name for number, name in enumerate(row, 1)}
    role = column_names.role([w for w in words if w not in _QUATERNION_WORDS])
    return Group(
        TURN,
        role if unit else column_names.OTHER,
        _target(row[0], drop=True),
        columns,
        ("quaternion", "XYZ"),
    )


def _joints(row: Sequence[Name], words: Sequence[str], weak: bool = False) -> Group:
    rest = [w for w in words if w not in _JOINT_WORDS | _FILLING and not w.isdigit()]
    rest = [w for w in rest if column_names.role([w]) != column_names.CALCULATED]
    said = column_names.role(rest)
    if column_names.commands(rest):
        said = column_names.NOMINAL
    elif said == column_names.MEASURED:
        said = column_names.REPORTED
    if weak and _EXTERNAL & {*words}:
        said = column_names.OTHER
    strange = any(not column_names.speaks(word) for word in rest)
    columns = {f"q{number}": name for number, name in enumerate(row, 1)}
    return Group(JOINTS, said, "_".join(rest) if strange else "", columns, weak=weak)


def _named(names: Sequence[Name]) -> Iterator[Group]:
    """Joints by the names that those of some arms have."""
    taken: set[str] = set()
    for series in _NAMED_JOINTS:
        rows: dict[tuple[str, ...], dict[str, list[Name]]] = {}
        for name in names:
            for joint in series:
                words = joint.split("_")
                rest = tuple(w for w in name.words if w not in words and w not in ("joint", "j"))
                whole = len(joint) > 1 or all(w in _JOINT_WORDS or w in WORDS for w in rest)
                if whole and {*words} <= {*name.words} and name.column not in taken:
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
        if word[-1] in "xyzw" and word[:-1] in ("", "r", "q")
    ]
    for words, stem, axes in _alike(labels):
        if not {"x", "y", "z"} <= set(axes):
            continue
        about = {*words}
        one = axes["x"]
        units = {axes[axis].unit for axis in "xyz"} - {""}
        vector = bool(about & _VECTOR_WORDS) and (stem == "r" or bool(about & _TURN_WORDS))
        told = [w for w in words if not (vector and w == "vector")]
        role = column_names.role(told)
        letter = [w for w in one.words[one.words.index(f"{stem}x") + 1 :] if len(w) == 1]
        if role == column_names.PLAIN and any(w.isalpha() and w not in _TURN_WORDS for w in letter):
            role = column_names.OPEN  # x_n, x_c: what the letter means is anyone's guess
        is_turn = stem == "r" or bool(about & _TURN_WORDS)
        quaternion = stem == "q" or bool(about & _QUATERNION_WORDS)
        if quaternion or (is_turn and "w" in axes and stem == ""):
            if "w" in axes:
                columns = {f"q{axis}": axes[axis] for axis in "wxyz"}
                target = _target(one, drop=True)
                yield Group(TURN, role, target, columns, ("quaternion", "XYZ"))
            continue
        is_turn = is_turn or (bool(units) and units <= {"deg", "rad"})
        if role == column_names.SPREAD:
            kept = "r" if is_turn else ""
            columns = {f"std_{kept}{axis}": axes[axis] for axis in "xyz"}
            yield Group(SPREAD, role, _target(one, drop=is_turn), columns, weak=not _one_sigma(one))
        elif is_turn:
            columns = {f"r{axis}": axes[axis] for axis in "xyz"}
            turn = ("rotation_vector" if vector else "euler", "XYZ")
            yield Group(TURN, role, _target(one, drop=True), columns, turn)
        else:
            yield Group(POINT, role, _target(one), {axis: axes[axis] for axis in "xyz"})


def _by_word(names: Sequence[Name], points: set[tuple[str, ...]]) -> Iterator[Group]:
    """Orientations by the names of their angles; single letters only beside x, y, z."""
    for letters, convention in _ANGLES:
        labels = [
            (name, place, word, "")
            for name in names
            for place, word in enumerate(name.words)
            if word in letters
        ]
        for words, _, columns in _alike(labels):
            if len(columns) < 3 or (len(letters[0]) == 1 and tuple(words) not in points):
                continue
            parts = [columns[letter] for letter in letters]
            named = dict(zip(("rx", "ry", "rz"), parts, strict=True))
            role = column_names.role(words)
            if role == column_names.SPREAD:
                named = {f"std_{axis}": name for axis, name in named.items()}
                yield Group(SPREAD, role, _target_of(parts[0], words), named, weak=True)
            else:
                target = _target_of(parts[0], words)
                yield Group(TURN, role, target, named, ("euler", convention))


def _alike(labels) -> Iterator[tuple[tuple[str, ...], str, dict[str, Name]]]:
    """Words, stem and columns by label of names that differ in the label alone.

    ``labels``: name, place of the word, label and stem. Where a label is there twice (X and x_mm),
    columns of one unit and spelling go together.
    """
    groups: dict[tuple, dict[str, list[tuple[Name, int]]]] = {}
    for name, place, label, stem in labels:
        key = (name.without(place), place, stem)
        groups.setdefault(key, {}).setdefault(label, []).append((name, place))
    for (words, _, stem), columns in groups.items():
        if all(len(each) == 1 for each in columns.values()):
            yield words, stem, {label: each[0][0] for label, each in columns.items()}
            continue
        kinds: dict[tuple, dict[str, Name]] = {}
        for label, each in columns.items():
            for name, place in each:
                spelled = name.spelled[:place] + name.spelled[place + 1 :]
                kinds.setdefault((name.unit, spelled, name.spelled[place].isupper()), {})[label] = (
                    name
                )
        for row in kinds.values():
            yield words, stem, row


def _words_of(group: Group) -> tuple[str, ...]:
    one = group.columns["x"]
    return one.without(one.words.index("x"))


def _target(one: Name, drop: bool = False) -> str:
    """Name of a target from the words its columns share; ``drop`` those of orientations too."""
    words = [w for w in one.words if w[-1] not in "xyzw" or len(w) > 2]
    if drop:
        gone = _TURN_WORDS | _QUATERNION_WORDS | _VECTOR_WORDS
        numbered = [w for w in words if w.isdigit()][-1:] if one.words[-1].isdigit() else []
        words = [w for w in words if w not in gone and w not in numbered]
    return _target_of(one, words)


def _target_of(one: Name, words: Sequence[str]) -> str:
    spelling = dict(zip(one.words, one.spelled, strict=True))
    told = [w for w in words if not column_names.speaks(w) and w not in _FILLING]
    name = ""
    for spelled in (spelling[w] for w in told):
        # As the file has it: smr1, and not smr_1.
        glue = "" if not name or f"{name}{spelled}" in one.column else "_"
        name += f"{glue}{spelled}"
    return name or TOOL


def _one_sigma(one: Name) -> bool:
    """Whether a spread is one standard deviation: no interval, no multiple of it."""
    words = one.words
    if not ({*words} & column_names.ONE_SIGMA or {"standard", "deviation"} <= {*words}):
        return False
    places = [place for place, word in enumerate(words) if word in column_names.ONE_SIGMA]
    beside = {words[p + step] for p in places for step in (-1, 1) if 0 <= p + step < len(words)}
    return not any(each.isdigit() for each in beside)


def same(one: Group, other: Group, values: Values | None) -> bool:
    """Whether two groups hold the same numbers, their units aside."""
    if values is None or set(one.columns) != set(other.columns):
        return False
    a = np.stack([values(name) for name in one.columns.values()])
    b = np.stack([values(other.columns[key]) for key in one.columns])
    scale = np.nanmax(np.abs(b), initial=0.0)
    factors = (1.0, np.pi / 180.0, 180.0 / np.pi, 1e-3, 1e3)
    gaps = np.isnan(a) == np.isnan(b)
    return bool(gaps.all()) and any(
        np.nanmax(np.abs(a * f - b), initial=0.0) <= 2e-6 * max(scale, 1e-9) for f in factors
    )


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
    apart = one - other
    apart = apart[np.isfinite(apart).all(axis=1)]
    if len(apart) < 3:
        return False
    length = np.linalg.norm(apart, axis=1)
    usual = float(np.median(length))
    off = float(np.median(np.abs(length - usual)))
    turned = float(np.median(np.linalg.norm(apart - np.median(apart, axis=0), axis=1)))
    return off <= 0.01 * usual and turned >= 5.0 * off and turned >= 1e-3 * usual


def unread(group: Group) -> str:
    """The first unit of the group that is none that is read, empty where all are."""
    strange = [unit for unit in group.units if unit and unit not in READ]
    return strange[0] if strange else ""


def renamed(group: Group, target: str) -> Group:
    """The group as one of another target."""
    return replace(group, target=target)
