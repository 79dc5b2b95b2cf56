"""Assessors that look back: frozen records of settings that turn a world into an accuracy.

The paper's three. Model Invalidation replays what did not happen, so it cannot be asked live; those
that can are :class:`kinacc.assess.adaptive.AdaptiveAssessor`. To add one: a module with a frozen
dataclass that inherits :class:`Assessor`, and a line in :mod:`kinacc.assess.registry`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from numbers import Integral
from typing import ClassVar, NamedTuple, Protocol, TypeVar

from kinacc.assess.world import World
from kinacc.errors import Problem, refuse


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
    its choices, the default first; ``measurements`` is the budget; ``is_slow``: an assessment of
    200 measurements takes more than 50 ms.
    """

    name: ClassVar[str]
    switches: ClassVar[dict[str, tuple[str, ...]]] = {}
    is_slow: ClassVar[bool] = False
    measurements: int

    def assess(self, world: World) -> Assessment:
        """Assess the accuracy in one world."""
        ...


def check(assessor: Assessor, more: list[Problem] | None = None) -> None:
    """Raise InputError with everything wrong with the settings, ``more`` included."""
    problems = list(more or [])
    budget = assessor.measurements
    if not isinstance(budget, Integral) or budget < 1:
        problems.append(Problem("measurements", f"{budget!r}", "a whole number, at least 1"))
    for switch, choices in assessor.switches.items():
        if getattr(assessor, switch) not in choices:
            found = f"{getattr(assessor, switch)!r}"
            problems.append(Problem(switch, found, ", ".join(choices)))
    refuse(problems, f"{assessor.name} cannot work with these settings")


A = TypeVar("A", bound=Assessor)


def every_reading(assessor: A) -> Iterator[A]:
    """The assessor under every combination of its switches, other settings kept."""
    for values in product(*assessor.switches.values()):
        yield replace(assessor, **dict(zip(assessor.switches, values, strict=True)))
