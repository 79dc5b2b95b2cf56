"""What gates of the configuration ask that cannot be together, and which a data set has."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from kinacc.config.names import not_in_a_line
from kinacc.config.schema import key
from kinacc.errors import Problem, first_few

Gate = Mapping[str, Any]
BOUND = "bound"
# The figure whose limit the section `tolerance` gives, by what its `of` says.
OF_TOLERANCE = {
    "mean": "residuals.position.mean",
    "quantile_99": "residuals.position.p99",
    BOUND: "bound.upper",
}
_ENDINGS = {"mm": "_mm", "mrad": "_mrad", "1": ""}
LIMITS = ("at_most", "at_least")
COMPARED = "residuals."  # figures of errors, pose by pose: chance can be told of these alone


def units() -> dict[str, str]:
    """Unit of every figure that a gate may name; 1 where it is counted."""
    of_value = next(each for each in key("gates").variants if each.name == "value")
    field = next(each for each in of_value.entries if each.name == "value")
    return {name: unit for name, unit, _ in field.meanings}  # type: ignore[union-attr]


def limit_key(word: str, gate: Gate) -> str:
    """Name of the key that holds a limit in the unit of a gate's figure: ``at_most_mm``."""
    return word + _ENDINGS[units()[gate["value"]]]


def wrong(gates: Mapping[int, Gate], place: Callable[..., str]) -> list[Problem]:
    """What is wrong with gates whose keys are each fine, by their numbers in the list."""
    problems: list[Problem] = []
    first: dict[str, int] = {}
    for number, gate in gates.items():
        name = str(gate["name"])
        problems += not_in_a_line(place(number, "name"), name)
        if name in first:
            what = f"{name!r} is the name of two gates, first of gates[{first[name]}]"
            problems.append(Problem(place(number, "name"), what, "a name for each"))
        first.setdefault(name, number)
        if "value" in gate:
            problems += _wrong_limits(gate, partial(place, number))
    return problems


def wrong_datasets(
    gates: Sequence[Gate], datasets: Collection[str] | None, place: Callable[..., str]
) -> Iterator[Problem]:
    """Gates that are said to be about data sets that are not there.

    ``datasets``: names that a gate at the top level may give; None where the gates stand in the
    section of a data set.
    """
    for number, gate in enumerate(gates):
        yield from _wrong_datasets(gate, datasets, place("gates", number, "datasets"))


def _wrong_datasets(gate: Gate, datasets: Collection[str] | None, where: str) -> Iterator[Problem]:
    named = gate["datasets"]
    if named is None:
        return
    if datasets is None:
        what = "is given inside of a data set, which it is about alone"
        yield Problem(where, what, fix="leave it out, or put the gate at the top level")
        return
    unknown = [each for each in named if each not in datasets]
    if unknown:
        what = f"names {first_few(unknown)}, which no data set is called"
        yield Problem(where, what, first_few(sorted(datasets), 10))


def _wrong_limits(gate: Gate, place: Callable[..., str]) -> Iterator[Problem]:
    words = LIMITS if gate["kind"] == "value" else ("allow",)
    right = [limit_key(word, gate) for word in words]
    every = [word + ending for word in words for ending in _ENDINGS.values()]
    given = [each for each in every if gate.get(each) is not None]
    figure, unit = gate["value"], units()[gate["value"]]
    for each in given:
        if each not in right:
            called = f"in {unit}" if unit != "1" else "counted"
            what = f"{figure} is {called}"
            yield Problem(place(each), what, " or ".join(right))
    if gate["kind"] == "value":
        if len(given) > 1:
            what = f"gives {' and '.join(given)}"
            yield Problem(place(), what, "one limit", "write two gates")
        return
    if not figure.startswith(COMPARED):
        allowed = ", ".join(each for each in units() if each.startswith(COMPARED))
        yield Problem(place("value"), f"chance cannot be told of {figure}", allowed)
    elif not given:
        yield Problem(place(), f"has no {right[0]}", f"{right[0]}: by how much it may be worse")


def without_limit(
    gates: Sequence[Gate], dataset: str, tolerance: Mapping[str, Any], place: Callable[..., str]
) -> Iterator[Problem]:
    """Gates of a data set that leave their limit to ``tolerance``, which has none for them."""
    said = tolerance["mm"]
    for number, gate in enumerate(gates):
        if gate not in about(gates, dataset):
            continue
        if gate["kind"] == "campaign" and gate["tolerance_mm"] is None:
            if said is None or tolerance["of"] != BOUND:
                yield _no_limit(place("gates", number), "tolerance_mm", BOUND, tolerance)
        elif gate["kind"] == "value" and not _has_limit(gate):
            of = next((o for o, name in OF_TOLERANCE.items() if name == gate["value"]), "")
            if said is None or tolerance["of"] != of:
                yield _no_limit(place("gates", number), limit_key(LIMITS[0], gate), of, tolerance)


def _no_limit(where: str, limit: str, of: str, tolerance: Mapping[str, Any]) -> Problem:
    own = f"; or tolerance: {{mm: .., of: {of}}}" if of else ""
    said = tolerance["mm"]
    known = f", and the tolerance of {said:g} mm is of {tolerance['of']}" if said else ""
    return Problem(where, f"has no {limit}{known}", f"{limit}: a number{own}")


def _has_limit(gate: Gate) -> bool:
    return any(gate[word + ending] is not None for word in LIMITS for ending in _ENDINGS.values())


def limited(gate: Gate, tolerance: Mapping[str, Any]) -> tuple[str, float, bool]:
    """The limit of a gate of kind ``value``: at_most or at_least, its size, whether its own."""
    for word in LIMITS:
        size = gate[limit_key(word, gate)]
        if size is not None:
            return word, float(size), True
    return LIMITS[0], float(tolerance["mm"]), False


def about(gates: Sequence[Gate], dataset: str) -> list[Gate]:
    """The gates that are about a data set."""
    return [each for each in gates if each["datasets"] is None or dataset in each["datasets"]]
