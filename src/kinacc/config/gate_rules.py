"""Gates: what results are held to, a model for each kind, and what they cannot say together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    WithJsonSchema,
    computed_field,
    model_validator,
)

from kinacc.config.fields import Distinct, Section, Text, distinct, refused, setting
from kinacc.config.names import not_in_a_line
from kinacc.config.values import did_you_mean
from kinacc.errors import first_few

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
    f"{COMPARED}{quantity}.{statistic}": (unit, text.format(f"{quantity} error"))
    for quantity, unit in (("position", "mm"), ("orientation", "mrad"))
    for statistic, text in _STATISTICS.items()
} | {
    "bound.upper": ("mm", "upper bound of the newest campaign on this calibration"),
    "data.readings": ("1", "number of readings"),
    "data.poses": ("1", "number of poses"),
    "history.moved": ("mm", "rms movement of the arm since the calibration in force"),
    "history.beyond_chance": ("mm", "movement since the calibration in force beyond chance"),
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
OF_TOLERANCE = {
    "mean": "residuals.position.mean",
    "quantile_99": "residuals.position.p99",
    "bound": "bound.upper",
}
_ENDINGS = {"mm": "_mm", "mrad": "_mrad", "1": ""}
LIMITS = ("at_most", "at_least")
Model = Literal["selected", "dh", "vec", "compliance", "nominal"]
At = Literal["held_out", "validation", "training"]
Limits = Mapping[str, Any]
_MODEL = "error model whose errors are meant"
_AT = "errors at rows each fit had not seen, at those of the validation fold, or at those fitted"
_MOST, _LEAST = "largest value that passes", "smallest value that passes"


def limit_key(word: str, gate: Limits) -> str:
    """Name of the key that holds a limit in the unit of a gate's figure: ``at_most_mm``."""
    return word + _ENDINGS[FIGURES[gate["value"]][0]]


def limited(gate: Limits, tolerance_mm: float) -> tuple[str, float, bool]:
    """The limit of a gate of kind ``value``: at_most or at_least, its size, whether its own."""
    for word in LIMITS:
        size = gate[limit_key(word, gate)]
        if size is not None:
            return word, size, True
    return LIMITS[0], tolerance_mm, False


def _name(name: str) -> str:
    for problem in not_in_a_line("", name):
        raise refused(problem.what, problem.allowed)
    return name


def _known(figure: str) -> str:
    if figure not in FIGURES:
        raise refused(f"{figure!r} is not known", did_you_mean(figure, FIGURES))
    return figure


def _data_sets(names: list[str], info: ValidationInfo) -> list[str]:
    known = (info.context or {}).get("datasets", names)
    if unknown := {*names} - {*known}:
        fix = f"known: {first_few([*map(str, known)], 10)}"
        raise refused(f"names {first_few(sorted(unknown))}, which no data set is called", fix)
    return names


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
    datasets: (
        Annotated[
            list[Text], Field(min_length=1, max_length=5000), Distinct, AfterValidator(_data_sets)
        ]
        | None
    ) = setting(None, "data sets it is about, where it stands at the top level; null for all")

    @computed_field  # type: ignore[prop-decorator]
    @property
    def kind(self) -> str:
        """Name of the kind: that of the key that tells it."""
        return type(self).__name__.lower()

    def one_limit(self, *words: str, needed: bool = False) -> None:
        """Raise where there are two limits, or one in another unit than the gate's figure."""
        right = [limit_key(word, vars(self)) for word in words]
        named = [f"{word}{ending}" for word in words for ending in _ENDINGS.values()]
        named = [item for item in named if vars(self).get(item) is not None]
        if len(named) > 1 or not {*named} <= {*right} or len(named) < needed:
            unit = FIGURES[vars(self)["value"]][0]
            message = f"{' and '.join(named) or 'no limit'}, where the figure is in {unit}"
            raise refused(message, f"give one of {' or '.join(right)}")


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
    def _limit(self) -> Self:
        self.one_limit(*LIMITS)
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
    def _limit(self) -> Self:
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
    def _allowance(self) -> Self:
        if not self.value.startswith(COMPARED):
            message = f"chance cannot be told of {self.value}"
            raise refused(message, f"give a figure that begins with {COMPARED}")
        self.one_limit("allow", needed=True)
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


# A change has the key ``value`` as well: it comes first.
KINDS = {
    item.__name__.lower(): item
    for item in (Against, Value, Table, Campaign, Claims, Suspicions, History)
}


def _kind(gate: Any) -> str | None:
    """Tag of the kind of a gate, None where it has the keys of none or several."""
    if isinstance(gate, Gate):
        return f"[{gate.kind}]"
    kinds = [item for item in KINDS if isinstance(gate, dict) and item in gate]
    return f"[{kinds[0]}]" if len(kinds) == 1 or kinds == ["against", "value"] else None


def _names_once(gates: list[Gate]) -> list[Gate]:
    distinct([item.name for item in gates])
    return gates


Gates = Annotated[
    list[
        Annotated[
            Annotated[Against, Tag("[against]")]
            | Annotated[Value, Tag("[value]")]
            | Annotated[Table, Tag("[table]")]
            | Annotated[Campaign, Tag("[campaign]")]
            | Annotated[Claims, Tag("[claims]")]
            | Annotated[Suspicions, Tag("[suspicions]")]
            | Annotated[History, Tag("[history]")],
            Discriminator(_kind, "kind", f"is not of one kind: give one of {', '.join(KINDS)}"),
        ]
    ],
    Field(max_length=100),
    AfterValidator(_names_once),
]


def require_limits(gates: Sequence[Gate], tolerance_mm: float | None, of: str) -> None:
    """Raise for a gate that leaves its limit to the tolerance, which has none for its figure."""
    for number, gate in enumerate(gates):
        if isinstance(gate, Value):
            figure, open_ = gate.value, not limited(vars(gate), 0.0)[2]
        elif isinstance(gate, Campaign):
            figure, open_ = OF_TOLERANCE["bound"], gate.tolerance_mm is None
        else:
            continue
        if open_ and (tolerance_mm is None or OF_TOLERANCE[of] != figure):
            message = f"has no limit, and tolerance has none for {figure}"
            raise refused(message, "write one into the gate", "gates", number)
