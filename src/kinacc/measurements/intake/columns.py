"""Which columns of a foreign file are read as joints, positions, orientations and the rest.

What was measured beats what was wanted and how far the two are apart; joints read back beat joints
commanded. Where the names leave two readings open nothing is chosen in silence: it is a question.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

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
    name_of,
    role,
)
from kinacc.measurements.intake import groups
from kinacc.measurements.intake.groups import JOINTS, POINT, POSE, RADIUS, TURN, Group, Values
from kinacc.measurements.layout import ANGLE, LENGTH, TOOL
from kinacc.measurements.table import RawTable
from kinacc.measurements.words import WORDS

_WRONG = (DEVIATION, SPREAD, OTHER)
_NOT_MEASURED = (NOMINAL, CALCULATED, *_WRONG)
_OWN_POSE = "the controller's own forward kinematics, never a measurement"
NO_SIGMA = f"{SPREAD}, of which nothing says that it is one sigma; --sigma 1 or 2 reads it"
_WHICH = "the names do not say which of them an instrument measured"


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


def names_in(table: RawTable) -> list[Name]:
    """The names of a table's columns, with the units stated beside them."""
    return [name_of(column, table.units.get(column, "")) for column in table.columns]


def of_table(table: RawTable, take: Sequence[str] = (), turned: bool = True, sigma: str = ""):
    """What the columns of a table hold; see ``recognise``."""
    return recognise(names_in(table), lambda n: table.values(n.column), take, turned, sigma)


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
    choice = _Choice([name for name in names if not _of_payload(name)], values, take, sigma)
    joints = choice.joints()
    points = choice.points(joints)
    turns = choice.turns(points) if turned else {}
    targets = {each.target: dict(each.columns) for each in points}
    for target, turn in turns.items():
        targets[target] |= turn.columns
    for target, spread in choice.spreads(points, turns).items():
        targets[target] |= spread
    commanded = choice.commanded(joints)
    both = [tuple(group.columns.values()) if group else () for group in (joints, commanded)]
    found = NamedColumns(
        both[0],
        both[1],
        targets,
        next((each.turn for each in turns.values()), ("none", "XYZ")),
        questions=tuple(choice.questions),
    )
    used = found.read()
    aside = tuple((g, why) for g, why in choice.aside if not used & {*g.names})
    return replace(found, single=_singles(n for n in names if n.column not in used), aside=aside)


class _Choice:
    """One look at the groups of a file: ``aside`` and ``questions`` grow as it goes."""

    def __init__(self, names: Sequence[Name], values, take: Sequence[str], sigma: str) -> None:
        self.values, self.take, self.sigma = values, {*take}, sigma
        # Whether a column by itself says how far off the points were.
        self.off = any(map(groups.is_deviation, names))
        self.aside: list[tuple[Group, str]] = []
        self.questions: list[Question] = []
        self.groups = [each for each in groups.found(names, values) if self._can_be(each)]

    def _can_be(self, group: Group) -> bool:
        """Whether it may be read, and its units fit what it would be."""
        units, joints = {*group.units} - {""}, group.kind == JOINTS
        if group.kind == RADIUS and group.role == OTHER:
            why = "a radius: positions are read as those of the reflectors' centres"
        elif group.kind == POSE:
            numbered = "a pose in numbered columns, which are not read"
            why = _OWN_POSE if group.role == CALCULATED else numbered
        else:
            fit = {POINT: LENGTH, TURN: ANGLE}.get(group.kind, {**ANGLE, **LENGTH})
            wrong = {unit for unit in units if unit not in fit}
            if joints and units and not units & ANGLE.keys():
                wrong = {unit for unit in units if not groups.is_pulse(unit)}
            if not wrong or group.role in _WRONG or (joints and all(map(groups.is_pulse, units))):
                return True
            what = {POINT: "a position", TURN: "an orientation"}.get(group.kind, group.kind)
            why = f"{what} in {' and '.join(sorted(wrong))}"
        self.aside.append((group, why))
        return False

    def _of(self, kind: str, *said: str) -> list[Group]:
        return [g for g in self.groups if g.kind == kind and (not said or g.role in said)]

    def _taken(self, kind: str) -> list[Group]:
        """Groups that ``take`` names; the others of the kind are left then."""
        every = self._of(kind)
        taken = [g for g in every if g.role not in (*_WRONG, CALCULATED) and self.take & {*g.names}]
        self._leave([g for g in every if taken and g not in taken], "others are taken")
        return taken

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

    def _ask(self, about: str, readings: Sequence[Group], why: str, without=False) -> Group:
        self.questions.append(Question(about, tuple(readings), why, without))
        return readings[0]

    def joints(self) -> Group | None:
        """The joints as reported, else as the file calls them without a word."""
        if taken := self._taken(JOINTS):
            return taken[0]
        strong = {said: [g for g in self._of(JOINTS, said) if not g.weak] for said in
                  (REPORTED, PLAIN, OPEN, NOMINAL, *_WRONG)}  # fmt: skip
        weak = [g for g in self._of(JOINTS, PLAIN, REPORTED, NOMINAL, OPEN) if g.weak]
        for said in _WRONG:
            self._leave(strong[said])
        reported, plain = self._distinct(strong[REPORTED]), self._distinct(strong[PLAIN])
        unclear, why = strong[OPEN], "several columns may hold them"
        if reported:
            self._leave([*plain, *unclear, *weak], "beside joints that were read back")
            best = reported
        elif plain:
            self._leave([] if unclear else weak, "nothing says that they are joints")
            best = [*plain, *unclear]
        else:
            best = [*unclear, *weak]
            why = "nothing says that these are the joints of the arm, as they were"
            if not best:
                best = strong[NOMINAL]
                why = "the only joints of the file are commanded ones, not those read back"
        if len(best) == 1 and (reported or plain):
            return best[0]
        return self._ask("the joints", best, why) if best else None

    def commanded(self, joints: Group | None) -> Group | None:
        """The joints as commanded beside ``joints``, where there is one such group."""
        wanted = [each for each in self._of(JOINTS, NOMINAL) if each is not joints]
        fit = [g for g in wanted if joints and len(g.columns) == len(joints.columns)
               and g.units == joints.units]  # fmt: skip
        fit = [g for g in fit if not {"target", "ref"} & {*g.words}] or fit
        chosen = fit[0] if len(fit) == 1 else None
        self._leave([each for each in wanted if each is not chosen], "commanded")
        return chosen

    def points(self, joints: Group | None) -> list[Group]:
        """The points that were measured, one of each target."""
        if taken := self._taken(POINT):
            return _named_apart(taken)
        for each in self._of(POINT, *_NOT_MEASURED):
            self._leave([each], _OWN_POSE if is_own_pose(each.columns["x"].words) else each.role)
        measured, reported, plain, unclear = (
            self._of(POINT, said) for said in (MEASURED, REPORTED, PLAIN, OPEN)
        )
        every = [*measured, *reported, *plain, *unclear]
        if (radii := self._of(RADIUS)) and every:
            names = ", ".join(each.in_words() for each in radii)
            why = f"{names}: the radius was not corrected for, so they may not be the centres"
            return self._chosen(every, why)
        if measured:
            self._leave([*reported, *plain, *unclear], "beside a point that was measured")
            return self._one_each(measured)
        nominal = self._of(POINT, NOMINAL)
        if reported:
            wanted = [each for each in unclear if "target" in each.columns["x"].words]
            records = any({*each.columns["x"].words} & WORDS["records"] for each in nominal)
            if plain or len(wanted) < len(unclear):
                return self._chosen([*reported, *plain, *unclear], _WHICH)
            if joints is not None and joints.role == REPORTED:
                why = "beside joints read back it may be what the controller calculated from them"
                return self._chosen(reported, why)
            # A record of measurement: nominal, actual, deviation.
            if not records and not (nominal and self._of(POINT, DEVIATION)):
                why = "cannot tell whether it was measured or computed by the controller"
                return self._chosen(reported, why)
            self._leave(wanted, NOMINAL)
            return self._one_each(reported)
        if plain and unclear:
            return self._chosen([*plain, *unclear], _WHICH)
        if plain and (self.off or self._of(POINT, DEVIATION)) and not nominal:
            why = "beside a deviation it may be the nominal point as well as the measured one"
            return self._chosen(plain, why)
        if plain:
            return self._one_each(plain)
        return (
            self._chosen(unclear, "nothing says that an instrument measured it") if unclear else []
        )

    def _one_each(self, candidates: list[Group]) -> list[Group]:
        """The candidates, unless two of them may be the same point."""
        distinct = self._distinct(candidates)
        if len({each.target for each in distinct}) < len(distinct):
            return self._chosen(distinct, "several columns may hold it")
        if not groups.rigid(distinct, self.values):
            why = "they do not keep their distance as targets on one flange do"
            return self._chosen(distinct, why)
        return distinct

    def _chosen(self, candidates: list[Group], why: str) -> list[Group]:
        self._ask("the measured point", candidates, why)
        return _named_apart(candidates)

    def turns(self, points: Sequence[Group]) -> dict[str, Group]:
        """Orientations by target, all of the kind of the first."""
        taken = self._taken(TURN)
        every = taken or [g for g in self._of(TURN) if g.role not in _NOT_MEASURED]
        self._leave([] if taken else self._of(TURN, *_NOT_MEASURED))
        found: dict[str, Group] = {}
        rest = list(every)
        for point in points:
            own = [each for each in every if each.target == point.target]
            own = own or (list(every) if len(points) == 1 else [])
            rest = [each for each in rest if each not in own]
            if own and (chosen := own[0] if taken else self._turn(point, own)):
                found[point.target] = chosen
        self._leave(rest, "belongs to no point that is read")
        kinds = {each.turn[0] for each in found.values()}
        units = {unit for each in found.values() for unit in each.units}
        if len(kinds) > 1 or len(units) > 1:
            self._ask("the orientation", list(found.values()), "they are not alike", without=True)
        return found

    def _turn(self, point: Group, own: Sequence[Group]) -> Group | None:
        named = [each for each in own if each.target == point.target]
        certain = self._distinct([each for each in named if each.role == MEASURED])
        one = certain or self._distinct(list(own))
        if len(one) == 1 and one[0] in named:
            # Points of other roles, whose orientation one without a word may be.
            others = [g for g in self._of(POINT) if g.role not in (SPREAD, OTHER, point.role)]
            alone = all(groups.same(each, point, self.values) for each in others)
            if one[0].role in (MEASURED, point.role) or (one[0].role == PLAIN and alone):
                self._leave([e for e in own if e is not one[0]], "beside the one that is read")
                return one[0]
        why = "the names do not say which was measured with the point"
        return self._ask(f"the orientation of {point.target}", one, why, without=True)

    def spreads(self, points: Sequence[Group], turns: dict[str, Group]) -> dict[str, dict]:
        """Standard deviations by target, in the unit of what they are of."""
        found: dict[str, dict[str, Name]] = {}
        for each in sorted(self._of(groups.SPREADS), key=lambda each: each.weak):
            point = next((p for p in points if p.target == each.target), None)
            point = point or (points[0] if len(points) == 1 and each.target == TOOL else None)
            of = turns.get(point.target) if point and "std_rx" in each.columns else point
            words = {word for name in each.columns.values() for word in name.words}
            uncertain = bool(words & WORDS["uncertainties"])
            covered = self.sigma or all(name.coverage for name in each.columns.values())
            why = role([w for w in words if role([w]) not in (SPREAD, DEVIATION)])
            if each.weak and not uncertain:
                self._leave([each], SPREAD)
            elif of is None or of.turn[0] == "quaternion" or why in _NOT_MEASURED:
                self._leave([each], f"{SPREAD} of nothing that is read")
            elif each.units != of.units:
                self._leave([each], f"{SPREAD} whose unit is not stated as that of its values")
            elif {*each.columns} & {*found.get(point.target, {})}:
                self._leave([each], f"{SPREAD}, there twice")
            elif each.weak and (self.sigma == "none" or not covered):
                self._leave([each], NO_SIGMA)
            else:
                found.setdefault(point.target, {}).update(each.columns)
        return found


def _named_apart(taken: list[Group]) -> list[Group]:
    """The groups under names of which no two are equal."""
    named: dict[str, Group] = {}
    for each in taken:
        name, number = each.target, 1
        while name in named:
            number += 1
            name = f"{each.target}{number}"
        named[name] = replace(each, target=name)
    return list(named.values())


def _singles(names) -> dict[str, Name]:
    found: dict[str, Name] = {}
    for each in names:
        words = [word for word in each.words if word not in ("measurement", "c", "id", "number")]
        for quantity, known in WORDS["single"].items():
            if len(words) == 1 and words[0] in known and (
                quantity != "temperature" or each.unit in ("", "C")
            ):  # fmt: skip
                found.setdefault(quantity, each)
        if quantity := _of_payload(each):
            found.setdefault(quantity, each)
    return found


def _of_payload(name: Name) -> str:
    """payload or payload_x .. where the name says so and states its unit; else nothing."""
    words = {*name.words}
    if not words & WORDS["payload"]:
        return ""
    rest = words - WORDS["payload"] - WORDS["weight"]
    if not rest and name.unit == "kg":  # a charge of a battery states none
        return "payload"
    axis = "".join(rest - WORDS["centre"])
    return f"payload_{axis}" if axis in ("x", "y", "z") and name.unit in LENGTH else ""
