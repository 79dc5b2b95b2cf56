"""What became of every gate of a configuration: tables of a run in, outcomes out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from kinacc.config.gate_rules import LIMITS, limited
from kinacc.errors import InputError
from kinacc.gate.outcome import FAILED, PASSED, UNDECIDED, WARNED, Outcome
from kinacc.gate.run_tables import Absent, RunTables
from kinacc.gate.values import figure

Gate = Mapping[str, Any]
# What a configuration calls a verdict, and the verdict.
_MEANT = {"fail": FAILED, "warn": WARNED, "pass": UNDECIDED}


def judged(
    results: Path, configurations: Mapping[str, Mapping[str, Any]], accepted: Path | None
) -> tuple[Outcome, ...]:
    """The outcome of every gate of every data set, in the order of the configuration.

    ``configurations``: full settings by data set, whose results stand in folders of their names
    below ``results``, as those of the accepted run do below ``accepted`` (None without one).
    """
    return tuple(
        of_gate(gate, name, RunTables(results / name), full["tolerance"], _beside(accepted, name))
        for name, full in configurations.items()
        for gate in full["gates"]
    )


def _beside(accepted: Path | None, dataset: str) -> RunTables | None:
    return None if accepted is None else RunTables(accepted / dataset)


def of_gate(
    gate: Gate,
    dataset: str,
    tables: RunTables,
    tolerance: Mapping[str, Any],
    accepted: RunTables | None,
) -> Outcome:
    """What became of one gate; a table that it needs and is not there is a failure."""
    try:
        found = _KINDS[gate["kind"]](gate, dataset, tables, tolerance, accepted)
    except InputError as error:
        first = error.problems[0]
        says = f"{first.where} {first.what}" if isinstance(error, Absent) else str(first)
        found = _outcome(gate, dataset, FAILED, says, first.fix)
    verdict = found.verdict
    if verdict == UNDECIDED:
        verdict = _MEANT[gate["undecided"]]
    if verdict == FAILED:
        verdict = _MEANT[gate["on_fail"]]
    return replace(found, verdict=verdict)


def _outcome(
    gate: Gate,
    dataset: str,
    verdict: str,
    says: str,
    fix: str = "",
    figures: Mapping[str, Any] | None = None,
) -> Outcome:
    kind = "change" if gate["kind"] == "against" else gate["kind"]
    fix = "" if verdict == PASSED else fix
    return Outcome(dataset, gate["name"], kind, verdict, says, fix, figures or {})


def _value(
    gate: Gate, dataset: str, tables: RunTables, tolerance: Mapping[str, Any], _: object
) -> Outcome:
    word, limit, own = limited(gate, tolerance)
    found = figure(gate["value"], tables, gate)
    whose = "" if own else " by the tolerance of the configuration"
    asked = f"{word.replace('_', ' ')} {found.worded(limit)} is allowed{whose}"
    if word == LIMITS[1]:
        asked = f"at least {found.worded(limit)} is asked for"
    figures = {
        f"value{found.key}": found.size,
        f"{word}{found.key}": limit,
        "of": found.called,
        **found.about,
    }
    held = found.size <= limit if word == LIMITS[0] else found.size >= limit
    says = f"{found.called} is {found.worded(found.size)}; {asked}"
    if found.open and (held or found.size != found.size):
        says = f"undecided: {found.called} cannot be told: {found.open}; {asked}"
        return _outcome(gate, dataset, UNDECIDED, says, "", figures)
    fix = f"off by {found.worded(abs(found.size - limit))}"
    return _outcome(gate, dataset, PASSED if held else FAILED, says, fix, figures)


_KINDS = {"value": _value}
