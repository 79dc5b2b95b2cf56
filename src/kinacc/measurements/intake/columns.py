"""Which columns of a foreign file are read as joints, positions, orientations and the rest.

What was measured beats what was wanted and how far the two are apart; joints read back beat joints
commanded. Where the names leave two readings open nothing is chosen in silence: it is a question.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from kinacc.measurements.column_names import (
    CALCULATED,
    DEVIATION,
    MEASURED,
    NOMINAL,
    OPEN,
    OTHER,
    PLAIN,
    REPORTED,
    SPREAD,
    Name,
    is_own_pose,
    role,
)
from kinacc.measurements.intake import groups
from kinacc.measurements.intake.groups import JOINTS, POINT, POSE, TURN, Group, Values
from kinacc.measurements.layout import TOOL

_LENGTHS, _ANGLES = {"mm", "m"}, {"deg", "rad"}
_NOT_MEASURED = (NOMINAL, CALCULATED, DEVIATION, SPREAD, OTHER)
_MAY_BE_MEASURED = (MEASURED, REPORTED, PLAIN, OPEN)
# Words of records of measurement; a controller writes target, command or set point.
_OF_PROTOCOLS = frozenset(("nominal", "nom", "nominell", "nominale", "nenn", "nennwert"))
_POSE = (
    "a pose in numbered columns, which are not read",
    "the controller's own forward kinematics, never a measurement",
)
NO_SIGMA = f"{SPREAD}, of which nothing says that it is one sigma; --sigma 1 or 2 reads it"
_UNCERTAINTY_TEXT = """
uncertainty uncertainties unc uncert u σ sigma unsicherheit messunsicherheit incertitude
incertidumbre incertezza incerteza u95 std
"""
_UNCERTAINTIES = frozenset(_UNCERTAINTY_TEXT.split())
_RADIUS = "a radius: positions are read as those of the reflectors' centres"
_SINGLE = {
    "pose": {
        *("pose", "config", "configuration", "point", "pt", "no", "nr", "index"),
        *("messung", "messpunkt", "punkt", "konfiguration", "stellung", "mesure", "punto", "pos"),
    },
    "repeat": {
        *("repeat", "repetition", "rep", "reading", "wiederholung", "wdh", "répétition"),
        *("repetición", "repeticion", "ripetizione"),
    },
    "session": {"session", "setup", "station", "series", "campaign"},
    "target": {"target", "marker", "reflector", "smr"},
    "temperature": {"temp", "temperature"},
}
# Payload, as people write it; a mass has to state kg, which a charge of a battery does not.
_PAYLOAD = {"payload", "nutzlast", "traglast", "zuladung", "charge", "carga", "carico"}
_WEIGHT = {"mass", "masse", "masa", "massa", "weight", "gewicht", "poids", "peso", "utile", "util"}
_CENTRE = {"cog", "cg", "com", "centre", "center", "schwerpunkt", "of", "gravity", "mass", "pos"}


@dataclass(frozen=True)
class Question:
    """What the names leave open: ``about`` what, the ``readings`` there are, and ``why`` it is.

    ``without``: none of them is an answer too.
    """

    about: str
    readings: tuple[Group, ...]
    why: str
    without: bool = False


@dataclass(frozen=True)
class NamedColumns:
    """Names of ``measurements.file.columns`` and the columns they mean.

    ``joints`` q1 ..; ``commanded`` the same as commanded, may be empty; ``targets`` by name, each a
    mapping of x, rx, qw, quat1, std_x and the like; ``turn`` kind and convention of the
    orientations as their names have it; ``single`` pose, repeat, session, target, temperature,
    payload, payload_x and so on.
    ``aside``: groups that are not read, and why; ``questions``: what has to be asked first.
    """

    joints: tuple[Name, ...]
    commanded: tuple[Name, ...] = ()
    targets: dict[str, dict[str, Name]] = field(default_factory=dict)
    turn: tuple[str, str] = ("none", "XYZ")
    single: dict[str, Name] = field(default_factory=dict)
    aside: tuple[tuple[Group, str], ...] = ()
    questions: tuple[Question, ...] = ()

    def read(self) -> set[str]:
        """Names of the columns that are read."""
        every = [*self.joints, *self.commanded, *self.single.values()]
        every += [name for target in self.targets.values() for name in target.values()]
        return {name.column for name in every}


def recognise(
    names: Sequence[Name],
    values: Values | None = None,
    take: Sequence[str] = (),
    turned: bool = True,
    sigma: str = "",
) -> NamedColumns:
    """What the columns of these names hold; no joints or no targets where none were found.

    ``values`` gives a column's numbers (n,), NaN where it has none. ``take``: columns whose groups
    are read whatever their names say. ``turned``: orientations are wanted. ``sigma``: how many
    standard deviations an uncertainty is, as answered; "none" for none that is read.
    """
    no_load = [name for name in names if not _of_payload(name)]
    choice = _Choice(groups.found(no_load, values), values, frozenset(take), sigma)
    choice.off = any(groups.is_deviation(name) for name in names)
    joints = choice.joints()
    points = choice.points(joints)
    turns = choice.turns(points) if turned else {}
    targets = {each.target: dict(each.columns) for each in points}
    for target, turn in turns.items():
        targets[target] |= turn.columns
    for target, spread in choice.spreads(points, turns).items():
        targets[target] |= spread
    kinds = [each.turn for each in turns.values()]
    commanded = choice.commanded(joints)
    used = {name.column for target in targets.values() for name in target.values()}
    used |= {name.column for group in (joints, commanded) if group for name in _all(group)}
    single = _singles(name for name in names if name.column not in used)
    return NamedColumns(
        _all(joints),
        _all(commanded),
        targets,
        kinds[0] if kinds else ("none", "XYZ"),
        single,
        tuple((group, why) for group, why in choice.aside if not used & {*group.names}),
        tuple(choice.questions),
    )


def _all(group: Group | None) -> tuple[Name, ...]:
    return tuple(group.columns.values()) if group else ()


class _Choice:
    """One look at the groups of a file: ``aside`` and ``questions`` grow as it goes."""

    off = False  # whether a column by itself says how far off the points were

    def __init__(
        self,
        found: Sequence[Group],
        values: Values | None,
        take: frozenset[str],
        sigma: str = "",
    ) -> None:
        self.values = values
        self.sigma = sigma
        self.take = take
        self.aside: list[tuple[Group, str]] = []
        self.questions: list[Question] = []
        self.groups = [each for each in found if self._can_be(each)]

    def _can_be(self, group: Group) -> bool:
        """Whether its units fit what the group would be."""
        units = {*group.units} - {""}
        fit = {JOINTS: _ANGLES | _LENGTHS, POINT: _LENGTHS, TURN: _ANGLES, POSE: set()}
        allowed = fit.get(group.kind, _ANGLES | _LENGTHS)
        wrong = sorted(units - allowed)
        if group.kind == JOINTS and units and all(map(groups.is_pulse, units)):
            return True
        if group.kind == JOINTS and units and not units & _ANGLES:
            wrong = sorted(units)
        if wrong and group.role not in (DEVIATION, SPREAD, OTHER):
            what = {JOINTS: "joints", POINT: "a position", TURN: "an orientation"}
            self.aside.append((group, f"{what.get(group.kind, 'a pose')} in {' and '.join(wrong)}"))
            return False
        if group.kind == groups.RADIUS and group.role == OTHER:
            self.aside.append((group, _RADIUS))
            return False
        if group.kind == POSE:
            self.aside.append((group, _POSE[group.role == CALCULATED]))
            return False
        return True

    def _of(self, kind: str, *said: str) -> list[Group]:
        return [
            each for each in self.groups if each.kind == kind and (each.role in said or not said)
        ]

    def _taken(self, kind: str) -> list[Group]:
        wrong = (DEVIATION, SPREAD, OTHER, CALCULATED)
        every = [each for each in self._of(kind) if each.role not in wrong]
        return [each for each in every if self.take & {*each.names}]

    def _leave(self, left: Sequence[Group], why: str = "") -> None:
        self.aside += [(each, why or each.role) for each in left]

    def _distinct(self, candidates: list[Group]) -> list[Group]:
        """Without those whose numbers another one has too; those that state a unit stay."""
        kept: list[Group] = []
        for each in sorted(candidates, key=lambda each: each.units == ("",)):
            if any(groups.same(each, other, self.values) for other in kept):
                self._leave([each], "the same numbers as other columns")
            else:
                kept.append(each)
        return [each for each in candidates if each in kept]

    def joints(self) -> Group | None:
        """The joints as reported, else as the file calls them without a word."""
        if taken := self._taken(JOINTS):
            self._leave([e for e in self._of(JOINTS) if e not in taken], "others are taken")
            return taken[0]
        strong = [each for each in self._of(JOINTS) if not each.weak]
        weak = [each for each in self._of(JOINTS, PLAIN, REPORTED, NOMINAL, OPEN) if each.weak]
        self._leave([each for each in strong if each.role in (DEVIATION, SPREAD, OTHER)])
        reported = self._distinct([each for each in strong if each.role == REPORTED])
        plain = self._distinct([each for each in strong if each.role == PLAIN])
        unclear = [each for each in strong if each.role == OPEN]
        wanted = [each for each in strong if each.role == NOMINAL]
        best = reported or plain
        if reported:
            self._leave([*plain, *unclear, *weak], "beside joints that were read back")
        elif best and unclear:
            best = [*best, *unclear]
        elif best:
            self._leave(weak, "nothing says that they are joints")
        if len(best) == 1:
            return best[0]
        if best:
            return self._ask("the joints", best, "several columns may hold them")
        if unclear or weak:
            why = "nothing says that these are the joints of the arm, as they were"
            return self._ask("the joints", [*unclear, *weak], why)
        if wanted:
            why = "the only joints of the file are commanded ones, not those read back"
            return self._ask("the joints", wanted, why)
        return None

    def commanded(self, joints: Group | None) -> Group | None:
        """The joints as commanded beside ``joints``, where there is one such group."""
        wanted = [each for each in self._of(JOINTS, NOMINAL) if each is not joints]
        fit = [
            each
            for each in wanted
            if joints and len(each.columns) == len(joints.columns) and each.units == joints.units
        ]
        strict = [each for each in fit if not {"target", "ref"} & {*_all(each)[0].words}] or fit
        chosen = strict[0] if len(strict) == 1 else None
        self._leave([each for each in wanted if each is not chosen], "commanded")
        return chosen

    def points(self, joints: Group | None) -> list[Group]:
        """The points that were measured, one of each target."""
        if taken := self._taken(POINT):
            self._leave([each for each in self._of(POINT) if each not in taken], "others are taken")
            return self._named_apart(taken)
        for each in self._of(POINT, *_NOT_MEASURED):
            self._leave([each], _POSE[1] if is_own_pose(each.columns["x"].words) else each.role)
        if (radii := self._of(groups.RADIUS)) and (every := self._of(POINT, *_MAY_BE_MEASURED)):
            names = ", ".join(each.in_words() for each in radii)
            why = f"{names}: the radius was not corrected for, so they may not be the centres"
            return self._chosen(every, why)
        measured, reported = self._of(POINT, MEASURED), self._of(POINT, REPORTED)
        plain, unclear = self._of(POINT, PLAIN), self._of(POINT, OPEN)
        if measured:
            self._leave([*reported, *plain, *unclear], "beside a point that was measured")
            return self._one_each(measured)
        if reported:
            wanted = [each for each in unclear if "target" in each.columns["x"].words]
            if plain or len(wanted) < len(unclear):
                why = "the names do not say which of them an instrument measured"
                return self._chosen([*reported, *plain, *unclear], why)
            if joints is not None and joints.role == REPORTED:
                why = "beside joints read back it may be what the controller calculated from them"
                return self._chosen(reported, why)
            if not self._protocol():
                why = "nothing says that an instrument measured it, and no controller calculated it"
                return self._chosen(reported, why)
            self._leave(wanted, NOMINAL)
            return self._one_each(reported)
        if plain and unclear:
            why = "the names do not say which of them an instrument measured"
            return self._chosen([*plain, *unclear], why)
        off = self.off or self._of(POINT, DEVIATION)
        if plain and off and not self._of(POINT, NOMINAL):
            why = "beside a deviation it may be the nominal point as well as the measured one"
            return self._chosen(plain, why)
        if plain:
            return self._one_each(plain)
        if unclear:
            return self._chosen(unclear, "nothing says that an instrument measured it")
        return []

    def _protocol(self) -> bool:
        """Whether actual points stand in a record of measurement: nominal, actual, deviation."""
        nominal = self._of(POINT, NOMINAL)
        named = any({*each.columns["x"].words} & _OF_PROTOCOLS for each in nominal)
        return named or bool(nominal and self._of(POINT, DEVIATION))

    def _one_each(self, candidates: list[Group]) -> list[Group]:
        """The candidates, unless two of them may be the same point."""
        distinct = self._distinct(candidates)
        targets = [each.target for each in distinct]
        if len(targets) > len(set(targets)):
            return self._chosen(distinct, "several columns may hold it")
        if not groups.rigid(distinct, self.values):
            why = "they do not keep their distance as targets on one flange do"
            return self._chosen(distinct, why)
        return distinct

    def _chosen(self, candidates: list[Group], why: str) -> list[Group]:
        first = self._ask("the measured point", candidates, why)
        return self._named_apart(candidates if first else [])

    def _named_apart(self, taken: list[Group]) -> list[Group]:
        """The groups under names of which no two are equal."""
        named: dict[str, Group] = {}
        for each in taken:
            name, number = each.target, 1
            while name in named:
                number += 1
                name = f"{each.target}{number}"
            named[name] = groups.renamed(each, name)
        return list(named.values())

    def _ask(self, about: str, readings: Sequence[Group], why: str, without=False) -> Group:
        self.questions.append(Question(about, tuple(readings), why, without))
        return readings[0]

    def turns(self, points: Sequence[Group]) -> dict[str, Group]:
        """Orientations by target, all of the kind of the first."""
        taken = self._taken(TURN)
        every = taken or self._of(TURN)
        if taken:
            self._leave([each for each in self._of(TURN) if each not in taken], "others are taken")
        else:
            self._leave([each for each in every if each.role in _NOT_MEASURED])
            every = [each for each in every if each.role not in _NOT_MEASURED]
        found: dict[str, Group] = {}
        rest = list(every)
        for point in points:
            own = self._own(point, every, alone=len(points) == 1, taken=bool(taken))
            for each in own:
                rest.remove(each) if each in rest else None
            if own and (chosen := self._turn(point, own, bool(taken))):
                found[point.target] = chosen
        self._leave(rest, "belongs to no point that is read")
        kinds = list(dict.fromkeys(each.turn[0] for each in found.values()))
        units = {unit for each in found.values() for unit in each.units}
        if len(kinds) > 1 or len(units) > 1:
            self._ask("the orientation", list(found.values()), "they are not alike", without=True)
        return found

    def _own(self, point: Group, every: Sequence[Group], alone: bool, taken: bool) -> list[Group]:
        named = [each for each in every if each.target == point.target]
        return named or (list(every) if alone else [])

    def _turn(self, point: Group, own: Sequence[Group], taken: bool) -> Group | None:
        if taken:
            return own[0]
        named = [each for each in own if each.target == point.target]
        certain = self._distinct([each for each in named if each.role == MEASURED])
        one = certain or self._distinct(list(own))
        aside = self._other_points(point)
        if len(one) == 1 and one[0] in named:
            plain = one[0].role == PLAIN and not aside
            if plain or one[0].role in (MEASURED, point.role):
                self._leave([e for e in own if e is not one[0]], "beside the one that is read")
                return one[0]
        why = "the names do not say which was measured with the point"
        return self._ask(f"the orientation of {point.target}", one, why, without=True)

    def _other_points(self, point: Group) -> list[Group]:
        """Points of other roles, whose orientation one without a word may be."""
        every = [each for each in self._of(POINT) if each.role not in (SPREAD, OTHER, point.role)]
        return [e for e in every if not groups.same(e, point, self.values)]

    def spreads(self, points: Sequence[Group], turns: dict[str, Group]) -> dict[str, dict]:
        """Standard deviations by target, in the unit of what they are of."""
        found: dict[str, dict[str, Name]] = {}
        for each in sorted(self._of(groups.SPREAD), key=lambda each: each.weak):
            point = next((p for p in points if p.target == each.target), None)
            point = point or (points[0] if len(points) == 1 and each.target == TOOL else None)
            turned = "std_rx" in each.columns
            of = turns.get(point.target) if point and turned else point
            words = {word for name in each.columns.values() for word in name.words}
            covered = all(name.coverage for name in each.columns.values())
            known = self.sigma != "none" and bool(
                (self.sigma or covered) and words & _UNCERTAINTIES
            )
            if each.weak and not words & _UNCERTAINTIES:
                self._leave([each], SPREAD)
            elif of is None or of.turn[0] == "quaternion" or _wanted(words):
                self._leave([each], f"{SPREAD} of nothing that is read")
            elif each.units != of.units:
                self._leave([each], f"{SPREAD} whose unit is not stated as that of its values")
            elif set(each.columns) & set(found.get(point.target, {})):
                self._leave([each], f"{SPREAD}, there twice")
            elif each.weak and not known:
                self._leave([each], NO_SIGMA)
            else:
                found[point.target] = found.get(point.target, {}) | each.columns
        return found


def _wanted(words: set[str]) -> bool:
    """Whether the words of a spread say that it is of something wanted, or of no point."""
    return role([w for w in words if role([w]) not in (SPREAD, DEVIATION)]) in _NOT_MEASURED


def _singles(names) -> dict[str, Name]:
    found: dict[str, Name] = {}
    for each in names:
        words = [word for word in each.words if word not in ("measurement", "c", "id", "number")]
        for quantity, known in _SINGLE.items():
            if len(words) == 1 and words[0] in known:
                if quantity == "temperature" and each.unit not in ("", "C"):
                    continue
                found.setdefault(quantity, each)
        if quantity := _of_payload(each):
            found.setdefault(quantity, each)
    return found


def _of_payload(name: Name) -> str:
    """payload or payload_x .. where the name says so and states its unit; else nothing."""
    words = {*name.words}
    rest = words - _PAYLOAD - _WEIGHT
    if words & _PAYLOAD and not rest and name.unit == "kg":
        return "payload"
    axis = "".join(rest - _CENTRE)
    if words & _PAYLOAD and axis in ("x", "y", "z") and name.unit in _LENGTHS:
        return f"payload_{axis}"
    return ""
