"""Gates: what results are held to, a model for each kind, and what they cannot say together."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    WithJsonSchema,
    computed_field,
    model_validator,
)

from kinacc.config.fields import Distinct, Section, Text, refused, setting
from kinacc.config.names import not_in_a_line
from kinacc.config.reading import Place
from kinacc.config.values import nearest, shown
from kinacc.errors import Problem, first_few

COMPARED = "residuals."  # figures of errors, pose by pose: chance can be told of these alone
_STATISTICS = {
    "mean": "mean {}",
    "rms": "root mean square of the {}s",
    "p99": "empirical 99 % quantile of the {}s",
    "p99_gamma": "99 % gamma quantile: that of a gamma distribution fitted to the {}s",
    "largest": "largest {}",
}
# Figures that a gate may name, with unit (1 where it is counted) and meaning.
FIGURES = {
    f"{COMPARED}{quantity}.{statistic}": (unit, words.format(f"{quantity} error"))
    for quantity, unit in (("position", "mm"), ("orientation", "mrad"))
    for statistic, words in _STATISTICS.items()
} | {
    "bound.upper": ("mm", "upper bound of the newest campaign on this calibration"),
    "data.readings": ("1", "number of readings"),
    "data.poses": ("1", "number of poses"),
    "history.moved": ("mm", "rms movement of the arm since the calibration in force"),
    "history.beyond_chance": ("mm", "by how much that is beyond chance"),
    "history.in_force_mean": (
        "mm",
        "mean position error of the calibration in force at the newest readings",
    ),
    "history.in_force_p99": (
        "mm",
        "empirical 99 % quantile of the position errors of the calibration in force at the "
        "newest readings",
    ),
}
# The figure whose limit the section `tolerance` gives, by what its `of` says.
BOUND = "bound"
OF_TOLERANCE = {
    "mean": "residuals.position.mean",
    "rms": "residuals.position.rms",
    "quantile_99": "residuals.position.p99",
    "gamma_99": "residuals.position.p99_gamma",
    "largest": "residuals.position.largest",
    BOUND: "bound.upper",
}
_ENDINGS = {"mm": "_mm", "mrad": "_mrad", "1": ""}
LIMITS = ("at_most", "at_least")
Model = Literal["selected", "dh", "vec", "compliance", "nominal"]
At = Literal["held_out", "validation", "training"]
Limits = Mapping[str, Any]
_MODEL = "error model whose errors are meant"
_AT = "errors at rows each fit had not seen, at those of the validation fold, or at those fitted"
_MOST, _LEAST = "largest value that passes", "smallest value that passes"


def units() -> dict[str, str]:
    """Unit of every figure that a gate may name; 1 where it is counted."""
    return {name: unit for name, (unit, _) in FIGURES.items()}


def limit_key(word: str, gate: Limits) -> str:
    """Name of the key that holds a limit in the unit of a gate's figure: ``at_most_mm``."""
    return word + _ENDINGS[FIGURES[gate["value"]][0]]


def _name(name: str) -> str:
    for problem in not_in_a_line("", name):
        raise refused(problem.what, problem.allowed)
    return name


def _known(figure: str) -> str:
    if figure not in FIGURES:
        close = nearest(figure, tuple(FIGURES))
        raise refused(f"{figure!r} is not known", f"did you mean {close}?" if close else "")
    return figure


Figure = Annotated[str, AfterValidator(_known), WithJsonSchema({"enum": [*FIGURES]})]


class Gate(Section):
    """What gates of every kind have."""

    name: Annotated[str, AfterValidator(_name)] = setting(..., "what every answer calls the gate")
    on_fail: Literal["fail", "warn"] = setting(
        "fail", "what it is where it does not hold: a failure, or a warning that fails nothing"
    )
    undecided: Literal["fail", "warn", "pass"] = setting(
        "fail",
        "what it is where the data cannot tell: too few poses, or a tolerance between the bounds",
    )
    datasets: Annotated[list[Text], Field(min_length=1, max_length=5000), Distinct] | None = (
        setting(None, "data sets it is about, where it stands at the top level; null for all")
    )

    @computed_field  # type: ignore[prop-decorator]
    @property
    def kind(self) -> str:
        """Name of the kind: that of the key that tells it."""
        return type(self).__name__.lower()

    def limits(self, *words: str) -> list[str]:
        """Limits that are given. Raises where one is in another unit than the gate's figure."""
        given = vars(self)
        right = [limit_key(word, given) for word in words]
        named = [word + ending for word in words for ending in _ENDINGS.values()]
        named = [each for each in named if given.get(each) is not None]
        for each in named:
            if each not in right:
                unit = FIGURES[given["value"]][0]
                called = f"in {unit}" if unit != "1" else "counted"
                raise refused(f"{each}, but {given['value']} is {called}", " or ".join(right))
        return named


class Value(Gate):
    """A figure of the results within a limit; that of `tolerance` where the gate has none."""

    value: Figure = setting(..., "the figure")
    model: Model = setting("selected", _MODEL)
    at: At = setting("held_out", _AT)
    at_most_mm: float | None = setting(None, _MOST, "mm", gt=0, lt=10000)
    at_least_mm: float | None = setting(None, _LEAST, "mm", ge=0, le=10000)
    at_most_mrad: float | None = setting(None, _MOST, "mrad", gt=0, lt=10000)
    at_least_mrad: float | None = setting(None, _LEAST, "mrad", ge=0, le=10000)
    at_most: float | None = setting(None, f"{_MOST}, of what is counted", ge=0, le=1e9)
    at_least: float | None = setting(None, f"{_LEAST}, of what is counted", ge=0, le=1e9)

    @model_validator(mode="after")
    def _one_limit(self) -> Value:
        given = self.limits(*LIMITS)
        if len(given) > 1:
            raise refused(f"gives {' and '.join(given)}", "write two gates, each with one limit")
        return self


class Table(Gate):
    """A number of any table of the results within a limit, in the unit of its column."""

    table: Text = setting(..., "the table")
    row: dict[str, str | int | float | None] = setting(
        {}, "values of columns that one row alone has; null for no value", allowed="{column: value}"
    )
    column: Text = setting(..., "the column")
    at_most: float | None = setting(None, _MOST)
    at_least: float | None = setting(None, _LEAST)

    @model_validator(mode="after")
    def _one_limit(self) -> Table:
        if (self.at_most is None) == (self.at_least is None):
            raise refused("has no limit or two", "give at_most or at_least")
        return self


class Against(Gate):
    """A figure of the errors not worse than that of the accepted run, beyond chance."""

    against: Literal["accepted"] = setting(..., "the run it is held against")
    value: Figure = setting(..., "the figure")
    model: Model = setting("selected", _MODEL)
    at: At = setting("held_out", _AT)
    allow_mm: float | None = setting(
        None, "by how much it may be worse, of positions", "mm", ge=0, le=1000
    )
    allow_mrad: float | None = setting(
        None, "by how much it may be worse, of orientations", "mrad", ge=0, le=1000
    )
    beyond_chance: float = setting(
        0.99,
        "how sure it has to be that it is worse by more, before the gate fails",
        gt=0.5,
        lt=0.9999,
    )

    @model_validator(mode="after")
    def _allowance(self) -> Against:
        if not self.value.startswith(COMPARED):
            allowed = ", ".join(each for each in FIGURES if each.startswith(COMPARED))
            raise refused(f"chance cannot be told of {self.value}", f"give one of {allowed}")
        if not self.limits("allow"):
            right = limit_key("allow", vars(self))
            raise refused(f"has no {right}", f"{right}: by how much it may be worse")
        return self


class Campaign(Gate):
    """The largest error within a tolerance, by the bound of a campaign on this calibration."""

    campaign: Text = setting(
        ..., "the campaign's folder, relative to the folder of the file this stands in"
    )
    tolerance_mm: float | None = setting(
        None, "largest error allowed; null for that of `tolerance`", "mm", gt=0, lt=1000
    )
    confidence: float | None = setting(
        None,
        "confidence the campaign's bound has to have; null for whatever it has",
        gt=0.5,
        lt=1,
    )


class Claims(Gate):
    """The paper's claims agree, but for those excepted."""

    claims: Literal["agree"] = setting(..., "what is asked of them")
    excepted: Annotated[list[Text], Field(max_length=1000), Distinct] = setting(
        [], "names of claims that need not agree", alias="except"
    )


class Suspicions(Gate):
    """The check of the measured data found nothing suspicious."""

    suspicions: Literal["none", "known"] = setting(
        ..., "none at all, or none but those accepted in `data_check.accept`"
    )


class History(Gate):
    """The newest line of the robot's history does not ask for a new calibration."""

    history: Literal["holds"] = setting(..., "what is asked of it")


KINDS = {each.__name__.lower(): each for each in Gate.__subclasses__()}
_ONE_OF = f"give one of {', '.join(KINDS)}"


def _kinds(gate: Any) -> list[str]:
    """Kinds that the keys of a gate tell: a change has the key ``value`` as well."""
    told = [each for each in KINDS if each in gate]
    return ["against"] if set(told) == {"value", "against"} else told


def _of_one_kind(gate: Any) -> Any:
    if not isinstance(gate, dict):
        raise refused(f"{shown(gate)} is not a mapping", _ONE_OF)
    told = _kinds(gate)
    if len(told) > 1:
        raise refused(f"is of {len(told)} kinds", _ONE_OF)
    if not told:
        close = [near for each in gate if (near := nearest(each, tuple(KINDS)))]
        fix = f"did you mean {close[0]}?" if close else _ONE_OF
        raise refused("names nothing to hold results to", fix)
    return gate


def _names_once(gates: list[Gate]) -> list[Gate]:
    names = [each.name for each in gates]
    for name in names:
        if names.count(name) > 1:
            raise refused(f"{name!r} is the name of two gates", "give each a name of its own")
    return gates


Gates = Annotated[
    list[
        Annotated[
            Annotated[Value, Tag("value")]
            | Annotated[Table, Tag("table")]
            | Annotated[Against, Tag("against")]
            | Annotated[Campaign, Tag("campaign")]
            | Annotated[Claims, Tag("claims")]
            | Annotated[Suspicions, Tag("suspicions")]
            | Annotated[History, Tag("history")],
            Discriminator(lambda gate: getattr(gate, "kind", None) or _kinds(gate)[0]),
            BeforeValidator(_of_one_kind),
        ]
    ],
    Field(max_length=100),
    AfterValidator(_names_once),
]


def wrong_datasets(
    gates: Sequence[Limits], datasets: Collection[str] | None, place: Place
) -> Iterator[Problem]:
    """Gates that name data sets that are not there.

    ``datasets``: names that a gate at the top level may give; None where the gates stand in the
    section of a data set.
    """
    for number, gate in enumerate(gates):
        named, where = gate.get("datasets"), place(("gates", number, "datasets"))
        if named and datasets is None:
            what = "is given inside of a data set, which it is about alone"
            yield Problem(where, what, fix="leave it out, or put the gate at the top level")
        elif unknown := [each for each in named or () if each not in (datasets or ())]:
            what = f"names {first_few(unknown)}, which no data set is called"
            yield Problem(where, what, first_few(sorted(datasets or ()), 10))


def without_limit(
    gates: Sequence[Limits], dataset: str, tolerance: Limits, place: Callable[..., str]
) -> Iterator[Problem]:
    """Gates of a data set that leave their limit to ``tolerance``, which has none for them."""
    for number, gate in enumerate(gates):
        if gate not in about(gates, dataset) or gate["kind"] not in ("campaign", "value"):
            continue
        if gate["kind"] == "campaign":
            limit, of, own = "tolerance_mm", BOUND, gate["tolerance_mm"]
        else:
            limit, own = limit_key(LIMITS[0], gate), _own(gate)
            of = next((o for o, name in OF_TOLERANCE.items() if name == gate["value"]), "")
        if own is None and (tolerance["mm"] is None or tolerance["of"] != of):
            known = f", and tolerance is of {tolerance['of']}" if tolerance["mm"] else ""
            fix = f"; or tolerance: {{mm: .., of: {of}}}" if of else ""
            where = place("gates", number)
            yield Problem(where, f"has no {limit}{known}", f"{limit}: a number{fix}")


def _own(gate: Limits) -> tuple[str, float] | None:
    sizes = [(word, gate[limit_key(word, gate)]) for word in LIMITS]
    return next(((word, size) for word, size in sizes if size is not None), None)


def limited(gate: Limits, tolerance: Limits) -> tuple[str, float, bool]:
    """The limit of a gate of kind ``value``: at_most or at_least, its size, whether its own."""
    own = _own(gate)
    return (*own, True) if own else (LIMITS[0], float(tolerance["mm"]), False)


def about(gates: Sequence[Limits], dataset: str) -> list[Limits]:
    """The gates that are about a data set."""
    return [each for each in gates if each["datasets"] is None or dataset in each["datasets"]]
