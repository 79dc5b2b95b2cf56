"""What settings are made of: sections, keys with unit and range, and kinds of values."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Annotated, Any, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    model_validator,
)
from pydantic_core import PydanticCustomError

from kinacc.errors import first_few


class Section(BaseModel):
    """A named group of keys and further sections; its docstring is its line of text."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _empty(cls, value: Any) -> Any:
        return {} if value is None else value


def setting(
    default: Any,
    about: str,
    unit: str = "",
    execution: bool = False,
    allowed: str = "",
    **more: Any,
) -> Any:
    """A key of a section: its default (``...`` where it has to be given), one line of text, unit.

    ``execution`` marks what changes only how a run is carried out or judged, and no hash.
    ``allowed`` says in words what is taken where its type does not; ``more`` is for
    ``pydantic.Field``: ``ge``, ``le``, ``gt``, ``lt``, ``min_length``, ``max_length``, ``alias``.
    """
    extra: dict[str, Any] = {"unit": unit, "execution": execution, "allowed": allowed}
    extra = {name: value for name, value in extra.items() if value}
    return Field(default, description=about, json_schema_extra=extra, **more)


def refused(message: str, fix: str = "", *keys: str | int) -> PydanticCustomError:
    """An error of a validator: what is wrong, what to do, and the keys below where it stands."""
    return PydanticCustomError("refused", "{what}", {"what": message, "fix": fix, "keys": keys})


def is_there(path: str, info: ValidationInfo) -> bool:
    """Whether there is such a file, as seen from the folder that the context of loading names."""
    return os.path.isfile(os.path.join((info.context or {}).get("folder", ""), path))


def distinct(parts: Callable[[Any], Iterable[Any]]) -> AfterValidator:
    """Validator of values, none of whose ``parts`` may stand there more than once."""

    def check(value: Any) -> Any:
        if repeated := [part for part, count in Counter(parts(value)).items() if count > 1]:
            raise refused(f"names {first_few(repeated)} more than once")
        return value

    return AfterValidator(check)


def _rising(values: list[float]) -> list[float]:
    if values != sorted(set(values)):
        raise refused(f"{values} is not rising", "put smaller numbers first, each once")
    return values


Text = Annotated[str, Field(min_length=1)]
Distinct = distinct(iter)
Rising = AfterValidator(_rising)
Pair = Annotated[
    list[Annotated[float, Field(ge=-720, le=720)]],
    Field(min_length=2, max_length=2, json_schema_extra={"pair": True}),
    Rising,
]
_T = TypeVar("_T")
_Word = TypeVar("_Word")
# A value, or one of some words; which of them is meant, its type tells.
OrWord = Annotated[
    Annotated[_T, Tag("[value]")] | Annotated[_Word, Tag("[word]")],
    Discriminator(lambda value: "[word]" if isinstance(value, str) else "[value]"),
]
