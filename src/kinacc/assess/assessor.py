"""Assessors that look back: frozen records of settings that turn a world into an accuracy.

The paper's three. Model Invalidation replays what did not happen, so it cannot be asked live; those
that can are :class:`kinacc.assess.adaptive.AdaptiveAssessor`. To add one: a module with a frozen
dataclass that inherits :class:`Assessor`, and a line in :mod:`kinacc.assess.registry`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import ClassVar, NamedTuple, Protocol, TypeVar

from kinacc.assess.world import World
from kinacc.config.records import of_section


class Assessment(NamedTuple):
    """Assessed accuracy with what it took; bounds are None where the assessor states none."""

    assessed_mm: float
    measurements: int
    points_visited: int
    lower_mm: float | None = None
    upper_mm: float | None = None


class Assessor(Protocol):
    """A method of assessment that looks back at one fixed world.

    ``name`` is its name in tables; ``switches`` maps each field that is a reading of the paper to
    its choices; ``measurements`` is the budget. What is a key of the
    configuration's ``study`` has no default here.
    """

    name: ClassVar[str]
    switches: ClassVar[dict[str, tuple[str, ...]]] = {}
    measurements: int

    def assess(self, world: World) -> Assessment:
        """Assess the accuracy in one world."""
        ...


A = TypeVar("A", bound=Assessor)


def every_reading(cls: type[A], settings: Mapping[str, object]) -> Iterator[A]:
    """An assessor under every combination of its switches, other settings as given."""
    for values in product(*cls.switches.values()):
        switched = dict(zip(cls.switches, values, strict=True))
        yield of_section(cls, {**settings, **switched})
