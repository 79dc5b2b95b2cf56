"""Which columns of a foreign file are read as joints, positions, orientations and the rest.

Measured points are read before wanted ones and deviations, joints read back before commanded ones.
Where the names allow several readings, they are a question.
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
    WORDS,
    Name,
    name_of,
    role,
)
from kinacc.measurements.intake.choices import TAKE, Answers, Choice
from kinacc.measurements.intake.groups import (
    JOINTS,
    POINT,
    POSE,
    TURN,
    UNCERTAINTY,
    Group,
    all_groups,
    keep_distances,
    same,
)
from kinacc.measurements.layout import ANGLE, TOOL
from kinacc.measurements.table import RawTable

_WRONG = (DEVIATION, SPREAD, OTHER)
_NOT_MEASURED = (NOMINAL, CALCULATED, *_WRONG)
# What a file is read for: joints and points, or one of joints, measured points and wanted poses.
MEASUREMENTS, POINTS, POSES = "measurements", "points", "poses"


@dataclass(frozen=True)
class NamedColumns:
    """Names of ``measurements.file.columns`` and the columns they mean.

    ``joints`` q1 ..; ``commanded`` the same as commanded, may be empty; ``targets`` by name, each a
    mapping of x, rx, qw, quat1, std_x and the like; ``turn`` kind and convention of the
    orientations as their names have it; ``single`` pose, repeat, session, target, temperature.
    ``aside``: groups that are not read; ``on_joints`` and ``questions``: open choices on the joints
    and on the rest.
    """

    joints: tuple[Name, ...] = ()
    commanded: tuple[Name, ...] = ()
    targets: dict[str, dict[str, Name]] = field(default_factory=dict)
    turn: tuple[str, str] = ("none", "XYZ")
    single: dict[str, Name] = field(default_factory=dict)
    aside: tuple[Group, ...] = ()
    on_joints: tuple[Choice, ...] = ()
    questions: tuple[Choice, ...] = ()

    def by_our_names(self) -> dict[str, Name]:
        """The columns that are read, by our names."""
        names = {f"q{n}{suffix}": name
                 for suffix, row in (("", self.joints), ("_cmd", self.commanded))
                 for n, name in enumerate(row, 1)}  # fmt: skip
        for target, parts in self.targets.items():
            prefix = "" if target == TOOL else f"{target}_"
            names |= {f"{prefix}{quantity}": name for quantity, name in parts.items()}
        return names | self.single

    def read(self) -> set[str]:
        """Names of the columns that are read."""
        return {name.column for name in self.by_our_names().values()}


def names_in(table: RawTable) -> list[Name]:
    """The names of a table's columns, with the units stated beside them."""
    return [name_of(column, table.units.get(column, "")) for column in table.columns]


def of_table(
    table: RawTable, answers: Answers | None = None, need: str = MEASUREMENTS
) -> NamedColumns:
    """The meaning of the columns of a table; no joints or no targets where there are none.

    ``answers`` by option: ``take`` (columns whose groups are read whatever their names mean),
    ``orientation`` ("none" is not read), ``sigma`` (how many standard deviations an uncertainty is;
    "none" for none that is read). ``need``: what the table is read for; joints come along with
    points where they are certain, nominal poses are read where poses are wanted.
    """
    answers = answers or {}
    choice = _Choice(table, answers, need)
    joints = choice.joints()
    on_joints, choice.questions = choice.questions, []
    if need in (POINTS, POSES) and on_joints:
        joints, on_joints = None, []
    points = choice.points(joints) if need != JOINTS else []
    turns = choice.turns(points) if answers.get("orientation") != "none" else {}
    spreads = choice.spreads(points)
    targets = {
        point.target: point.columns
        | (turns[point.target].columns if point.target in turns else {})
        | spreads.get(point.target, {})
        for point in points
    }
    commanded = choice.commanded(joints) if need == MEASUREMENTS else None
    result = NamedColumns(
        tuple(joints.columns.values()) if joints else (),
        tuple(commanded.columns.values()) if commanded else (),
        targets,
        next((turn.turn for turn in turns.values()), ("none", "XYZ")),
        on_joints=tuple(on_joints),
        questions=tuple(choice.questions),
    )
    used = result.read()
    single: dict[str, Name] = {}
    for name in choice.names:
        terms = {*name.terms} - {"measurement", "c", "id", "number"}
        for quantity, known in WORDS["single"].items():
            is_unit = name.unit in ("", "C") or quantity != "temperature"
            if len(terms) == 1 and terms <= known and is_unit and name.column not in used:
                single.setdefault(quantity, name)
    aside = tuple(group for group in choice.every if not used & {*group.names})
    return replace(result, single=single, aside=aside)


class _Choice:
    """Selection among the groups of a file; ``questions`` grow."""

    def __init__(self, table: RawTable, answers: Answers, need: str) -> None:
        self.table, self.names, self.need = table, names_in(table), need
        self.take, self.sigma = {*answers.get("take", ())}, answers.get("sigma", "")
        self.every = all_groups(table, self.names)
        self.groups = [g for g in self.every if g.kind != POSE and not g.wrong_units]
        if need == POSES:
            nominal = [*self._of(POINT, NOMINAL, OPEN), *self._of(TURN, NOMINAL, OPEN)]
            self.take |= {group.names[0] for group in nominal}
        # Whether a column by itself is a deviation: error, 3D deviation.
        grouped = {column for group in self.every for column in group.names}
        self.off = any(role(name.terms) == DEVIATION and name.unit not in ANGLE
                       for name in self.names if name.column not in grouped)  # fmt: skip
        self.questions: list[Choice] = []

    def _of(self, kind: str, *roles: str) -> list[Group]:
        return [g for g in self.groups if g.kind == kind and (not roles or g.role in roles)]

    def _taken(self, kind: str) -> list[Group]:
        """Groups that ``take`` names."""
        fit = self._of(kind, PLAIN, OPEN, MEASURED, REPORTED, NOMINAL)
        return [group for group in fit if self.take & {*group.names}]

    def _distinct(self, candidates: list[Group]) -> list[Group]:
        """Without groups of the same numbers; those that state a unit stay."""
        distinct: list[Group] = []
        for group in sorted(candidates, key=lambda g: g.units == {""}):
            if not any(same(group, before, self.table) for before in distinct):
                distinct.append(group)
        return [group for group in candidates if group in distinct]

    def _ask(self, about: str, groups: Sequence[Group]) -> Group:
        answers = {group.names[0]: group.text for group in groups}
        if len(answers) > 1 or self.need == MEASUREMENTS:
            self.questions.append(Choice(TAKE, about, answers))
        return groups[0]

    def joints(self) -> Group | None:
        """The joints as reported, else those without a term."""
        if taken := self._taken(JOINTS):
            return taken[0]
        every = self._of(JOINTS, REPORTED, PLAIN, OPEN, NOMINAL)
        reported, plain, unclear, nominal = (
            self._distinct([group for group in every if group.role == name and not group.weak])
            for name in (REPORTED, PLAIN, OPEN, NOMINAL)
        )
        certain = reported or ([] if unclear else plain)
        if len(certain) == 1:
            return certain[0]
        best = reported or (plain and [*plain, *unclear])
        best = best or [*unclear, *(group for group in every if group.weak)] or nominal
        about = "the names do not tell the joints as they were read back"
        return self._ask(about, best) if best else None

    def commanded(self, joints: Group | None) -> Group | None:
        """The joints as commanded beside ``joints``, where there is one such group."""
        fit = [g for g in self._of(JOINTS, NOMINAL) if joints and g is not joints
               and len(g.columns) == len(joints.columns) and g.units == joints.units]  # fmt: skip
        return fit[0] if len(fit) == 1 else None

    def points(self, joints: Group | None) -> list[Group]:
        """The points that were measured, one of each target; the first of these rules that fits."""
        if taken := self._taken(POINT):
            return _named_apart(taken)
        measured, reported, plain, unclear, nominal, deviations = (
            self._of(POINT, name) for name in (MEASURED, REPORTED, PLAIN, OPEN, NOMINAL, DEVIATION)
        )
        # A record of measurement: nominal, actual, deviation.
        record = any({*g.columns["x"].terms} & WORDS["records"] for g in nominal)
        record = record or bool(nominal and deviations)
        by_arm = not record or (joints is not None and joints.role == REPORTED)
        candidates, why = measured or reported or plain, ""
        if not measured and reported and by_arm:
            candidates = [*reported, *plain, *unclear]
            why = "cannot tell whether an instrument measured it or the controller computed it"
        elif not measured and not reported and unclear:
            candidates = [*plain, *unclear]
            why = "no name states that an instrument measured it"
        elif plain and candidates is plain and (self.off or deviations) and not nominal:
            why = "beside a deviation it may be the nominal point"
        if candidates and not why:
            candidates = self._distinct(candidates)
            if len({group.target for group in candidates}) < len(candidates):
                why = "several columns may hold it"
            elif not keep_distances(
                [self.table.stacked([g.columns[axis].column for axis in "xyz"]) for g in candidates]
            ):
                why = "they do not keep the distance of targets on a flange"
        if not why and len(candidates) > 1 and self.need != MEASUREMENTS:
            why = "there are several"
        if not why:
            return candidates
        self._ask(f"the names do not tell the measured point ({why})", candidates)
        return candidates

    def turns(self, points: Sequence[Group]) -> dict[str, Group]:
        """Orientations by target; the reader takes those of the kind of the first."""
        taken = self._taken(TURN)
        every = taken or [g for g in self._of(TURN) if g.role not in _NOT_MEASURED]
        turns: dict[str, Group] = {}
        for point in points:
            beside = [g for g in every if g.target == point.target]
            beside = beside or (list(every) if len(points) == 1 else [])
            if beside:
                turns[point.target] = beside[0] if taken else self._turn(point, beside)
        return turns

    def _turn(self, point: Group, beside: Sequence[Group]) -> Group:
        same_target = [g for g in beside if g.target == point.target]
        certain = self._distinct([g for g in same_target if g.role == MEASURED])
        rest = certain or self._distinct(list(beside))
        if len(rest) == 1 and rest[0] in same_target:
            # Points of other roles, whose orientation a group without a term may be.
            others = [g for g in self._of(POINT) if g.role not in (SPREAD, OTHER, point.role)]
            alone = all(same(g, point, self.table) for g in others)
            if rest[0].role in (MEASURED, point.role) or (rest[0].role == PLAIN and alone):
                return rest[0]
        about = f"the names do not tell the orientation measured with {point.target}"
        return self._ask(f"{about} (--orientation none: not read)", rest)

    def spreads(self, points: Sequence[Group]) -> dict[str, dict[str, Name]]:
        """Standard deviations by target, in the unit of the point that they belong to."""
        spreads: dict[str, dict[str, Name]] = {}
        unclear: list[Group] = []
        for group in sorted(self._of(UNCERTAINTY), key=lambda g: g.weak):
            point = next((p for p in points if p.target == group.target), None)
            point = point or (points[0] if len(points) == 1 and group.target == TOOL else None)
            terms = {term for name in group.columns.values() for term in name.terms}
            not_meant = self.sigma == "none" or not terms & WORDS["uncertainties"]
            if (
                point is None
                or (group.weak and not_meant)
                or group.units != point.units
                or point.target in spreads
            ):
                continue
            covered = self.sigma or all(n.coverage for n in group.columns.values())
            if group.weak and not covered:
                unclear.append(group)
            else:
                spreads[point.target] = group.columns
        if unclear:
            names = ", ".join(group.text for group in unclear)
            meant = {"1": "one standard deviation", "2": "two", "none": "not read"}
            about = f"{names} do not state how many standard deviations they are"
            self.questions.append(Choice("--sigma", about, meant))
        return spreads


def _named_apart(groups: list[Group]) -> list[Group]:
    """The groups under names of which no two are equal."""
    named: dict[str, Group] = {}
    for group in groups:
        names = [group.target, *(f"{group.target}{n}" for n in range(2, len(groups) + 1))]
        name = next(name for name in names if name not in named)
        named[name] = replace(group, target=name)
    return list(named.values())
