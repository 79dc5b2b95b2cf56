"""Gates: what results are held to, a model for each kind, and what they cannot say together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    Tag,
    computed_field,
    model_validator,
)

from kinacc.config.fields import Distinct, Section, Text, distinct, refused, setting
from kinacc.config.names import not_in_a_line

_STATISTICS = {
    "mean": "mean {}",
    "rms": "root mean square of the {}s",
    "p99": "empirical 99 % quantile of the {}s",
    "p99_gamma": "99 % gamma quantile: that of a gamma distribution fitted to the {}s",
    "largest": "largest {}",
}
# Figures that a gate may name, with unit (1 where it is counted) and meaning.
ERRORS = {
    f"residuals.{quantity}.{statistic}": (unit, text.format(f"{quantity} error"))
    for quantity, unit in (("position", "mm"), ("orientation", "mrad"))
    for statistic, text in _STATISTICS.items()
}
FIGURES = ERRORS | {
    "data.readings": ("1", "number of readings"),
    "data.poses": ("1", "number of poses"),
}
# The figure whose limit the section `tolerance` gives, by what its `of` says.
_OF_TOLERANCE = {"mean": "residuals.position.mean", "quantile_99": "residuals.position.p99"}
_LIMITS = ("at_most", "at_least", "allow")
_MOST, _LEAST = "largest value that passes", "smallest value that passes"


def _name(name: str) -> str:
    for problem in not_in_a_line("", name):
        raise refused(problem.what, problem.allowed)
    return name


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

    @computed_field  # type: ignore[prop-decorator]
    @property
    def kind(self) -> str:
        """Name of the kind: that of the key that tells it."""
        return type(self).__name__.lower()

    @computed_field  # type: ignore[prop-decorator]
    @property
    def limit(self) -> dict[str, float]:
        """The limit by its key; empty where there is none."""
        return {n: v for n, v in vars(self).items() if n.startswith(_LIMITS) and v is not None}


class OfFigure(Gate):
    """What gates of a figure have; a limit is in the unit of the figure."""

    limit_word: ClassVar[str] = "at_most"
    value: Literal[*FIGURES] = setting(..., "the figure")  # type: ignore[valid-type]
    model: Literal["selected", "dh", "vec", "compliance", "nominal"] = setting(
        "selected", "error model whose held-out errors are meant"
    )

    @model_validator(mode="after")
    def _one_limit(self) -> Self:
        unit = FIGURES[self.value][0]
        key = "at_least" if unit == "1" else f"{self.limit_word}_{unit}"
        if not {*self.limit} <= {key}:
            raise refused(f"{' and '.join(self.limit)} is no limit of {self.value}", f"give {key}")
        return self


class Value(OfFigure):
    """A figure of the results within a limit; that of `tolerance` where the gate has none."""

    at_most_mm: float | None = setting(None, _MOST, "mm", gt=0, lt=10000)
    at_most_mrad: float | None = setting(None, _MOST, "mrad", gt=0, lt=10000)
    at_least: float | None = setting(None, f"{_LEAST}, of what is counted", ge=0, le=1e9)


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
    def _one_limit(self) -> Self:
        if len(self.limit) != 1:
            raise refused("has no limit or two", "give at_most or at_least")
        return self


class Against(OfFigure):
    """A figure of the errors not worse than that of the accepted run, beyond chance."""

    limit_word = "allow"
    value: Literal[*ERRORS] = setting(..., "the figure")  # type: ignore[valid-type]
    against: Literal["accepted"] = setting(..., "the run it is held against")
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
        if not self.limit:
            raise refused("has no allowance", "give allow_mm or allow_mrad")
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
KINDS = ("against", "value", "table", "campaign", "claims", "suspicions", "history")


def _kind(gate: Any) -> str | None:
    """Tag of the kind of a gate, None where it has the keys of none or several."""
    if isinstance(gate, Gate):
        return f"[{gate.kind}]"
    kinds = [kind for kind in KINDS if isinstance(gate, dict) and kind in gate]
    return f"[{kinds[0]}]" if len(kinds) == 1 or kinds == ["against", "value"] else None


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
    distinct(lambda gates: [gate.name for gate in gates]),
]


def require_limits(gates: Sequence[Gate], tolerance_mm: float | None, of: str) -> None:
    """Raise for a gate that leaves its limit to the tolerance, which has none for its figure."""
    for number, gate in enumerate(gates):
        if isinstance(gate, Value):
            lacks, fits = not gate.limit, gate.value == _OF_TOLERANCE.get(of)
        elif isinstance(gate, Campaign):
            lacks, fits = gate.tolerance_mm is None, of == "bound"
        else:
            continue
        if lacks and (tolerance_mm is None or not fits):
            message = "has no limit, and tolerance has none for its figure"
            raise refused(message, "write one into the gate", "gates", number)
