"""Results held to the accepted run: what differs, by how much, and what explains it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa

from kinacc.artifacts import store
from kinacc.artifacts.contract import ARTEFACTS
from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.gate.causes import Causes, in_words
from kinacc.gate.made import Made, datasets_in, made
from kinacc.gate.outcome import FAILED, PASSED, UNEXPLAINED, Cause, Difference, Outcome
from kinacc.gate.table_comparison import Found, differences
from kinacc.workflow.catalogue import Stage

NAME, KIND = "accepted run", "accepted"


def compared(
    results: Path, accepted: Path, datasets: Sequence[str] = (), exact: bool = False
) -> tuple[Outcome, ...]:
    """One outcome for each data set, of all that either run has where ``datasets`` names none.

    ``exact`` asks for the bytes of every file, pictures and pages too. Raises InputError where the
    accepted run cannot be used.
    """
    there = datasets_in(accepted)
    if not there:
        fix = 'make it by a person\'s word: kinacc accept RESULTS --reason ".."'
        raise InputError(Problem(str(accepted), "holds no accepted run", fix=fix))
    names = [*datasets] or sorted({*there, *datasets_in(results)})
    return tuple(_of_dataset(name, results / name, accepted / name, exact) for name in names)


def _of_dataset(name: str, results: Path, accepted: Path, exact: bool) -> Outcome:
    before, now = made(accepted), made(results)
    refuse(before.problems)
    if not before.by_stage or not now.by_stage:
        where = "has no accepted run" if now.by_stage else "is in the accepted run and not here"
        fix = (
            f'kinacc accept {results.parent} --reason ".."'
            if now.by_stage
            else "run it, or accept a run without it"
        )
        return Outcome(name, NAME, KIND, FAILED, f"{name} {where}", fix)
    causes = Causes(before, now)
    found = tuple(_differences(name, before, now, causes, exact))
    return _outcome(name, results.parent, found, causes, len([*now.tables()]))


def _differences(
    name: str, before: Made, now: Made, causes: Causes, exact: bool
) -> Iterator[Difference]:
    stages = {artefact: stage for made_ in (before, now) for artefact, stage in made_.tables()}
    for artefact, stage in stages.items():
        why = causes.of_stage(stage.name)
        for found in _of_table(artefact, stage, before, now):
            yield Difference(
                name,
                artefact,
                found.column,
                found.what,
                found.rows,
                found.of,
                found.first,
                found.largest,
                found.unit,
                found.allowed,
                why,
            )


def _of_table(artefact: str, stage: Stage, before: Made, now: Made) -> list[Found]:
    if not before.record(stage.name):
        return [Found("", "is not in the accepted run", 0, 0)]
    if not now.record(stage.name):
        return [Found("", "is in the accepted run and not here", 0, 0)]
    if before.digest(artefact, stage) == now.digest(artefact, stage):
        return []
    tables = [_table(each, artefact, stage) for each in (before, now)]
    return differences(ARTEFACTS[artefact], *tables)


def _table(made_: Made, artefact: str, stage: Stage) -> pa.Table:
    return pa.concat_tables([store.read_table(path) for path in made_.paths(artefact, stage)])


def _outcome(
    name: str, results: Path, found: tuple[Difference, ...], causes: Causes, count: int
) -> Outcome:
    changed = causes.own()
    tables = [*dict.fromkeys(each.artefact for each in found)]
    figures = {"tables": count, "tables_that_differ": len(tables)}
    if not found:
        says = f"{count} tables are as in the accepted run"
        if changed:
            says += f", though there changed: {in_words(changed)}"
        return Outcome(name, NAME, KIND, PASSED, says, figures=figures)
    known = [*dict.fromkeys(each.artefact for each in found if each.explained)]
    unknown = [each for each in tables if each not in known]
    parts = []
    if known:
        why = dict.fromkeys(cause for each in found if each.explained for cause in each.causes)
        parts.append(f"{_named(known)} the accepted run; all of it follows from {in_words(why)}")
    if unknown:
        why = dict.fromkeys(
            cause for each in found for cause in each.causes if cause.kind == UNEXPLAINED
        )
        parts.append(f"{_named(unknown)} the accepted run, {_unknown(unknown, [*why])}")
    fix = (
        f'if this is what it should be: kinacc accept {results} --reason ".."'
        if not unknown
        else f"see kinacc check-results {results / name}"
    )
    return Outcome(name, NAME, KIND, FAILED, "; ".join(parts), fix, figures, found)


def _named(tables: Sequence[str]) -> str:
    if len(tables) == 1:
        return f"{tables[0]} differs from"
    return f"{len(tables)} tables ({first_few(tables, 3)}) differ from"


def _unknown(tables: Sequence[str], why: Sequence[Cause]) -> str:
    if any(each.before for each in why):
        return f"and {why[0].where} was {why[0].before}, not from this one"
    return (
        f"though nothing that {'it is' if len(tables) == 1 else 'they are'} made from has changed"
    )
