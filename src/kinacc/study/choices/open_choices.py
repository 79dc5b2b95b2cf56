"""What the paper leaves open: every choice, its keys of the configuration and the values tried.

The only list of them: design, page and picture follow it. A choice is added by one entry.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from kinacc.config.records import value_at

ARM = "arm"


@dataclass(frozen=True)
class Choice:
    """One choice: ``values`` are, by the word for each, the values of its ``keys``.

    ``about`` says in words what is chosen. The paper says nothing of the choices of ``OPEN``; it
    ``states`` those that are varied beside them for its Figs. 5 and 6.
    """

    name: str
    about: str
    keys: tuple[str, ...]
    values: Mapping[str, tuple[Any, ...]]

    def word(self, config: Mapping[str, Any]) -> str | None:
        """The word for what ``config`` chooses; None where that is none of the values tried."""
        own = tuple(value_at(config, key) for key in self.keys)
        return next((word for word, values in self.values.items() if values == own), None)


def _one(name: str, about: str, key: str, *values: Any) -> Choice:
    return Choice(name, about, (key,), {_word(value): (value,) for value in values})


def _word(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(map(_word, value))
    return f"{value:g}" if isinstance(value, (int, float)) else str(value)


OPEN: tuple[Choice, ...] = (
    _one(
        "inner_radius",
        "distance from the first axis at which the evaluation space begins, mm",
        "evaluation.cylinder.inner_radius_mm",
        *(1100.0, 1150.0, 1200.0, 1250.0),
    ),
    _one(
        "search",
        "which bound is the smallest that did not reject",
        "study.search",
        *("from_above", "from_below", "bisection"),
    ),
    _one(
        "vec_order",
        "order of the Chebyshev polynomials of the VEC model",
        "calibration.vec.order",
        *(4, 5, 6, 8),
    ),
)

# Stated by the paper for its single runs: varied with the arm for Figs. 5 and 6 alone.
STATED: tuple[Choice, ...] = (
    _one("alpha", "threshold on the rejection probability", "study.alpha", 0.5, 0.6, 0.7, 0.8),
    _one(
        "fig5_noise",
        "noise of the simulations of Figs. 5 and 6, standard deviation per axis, mm",
        "histories.noise_mm",
        *(0.1, 0.2, 0.3, 0.4),
    ),
    _one("seed", "seed of the random numbers", "seed", *range(20240, 20245)),
)


def named(names: tuple[str, ...] | list[str]) -> tuple[Choice, ...]:
    """The open choices of these names, all of them if there is none."""
    return tuple(each for each in OPEN if not names or each.name in names)
