"""Results held to the accepted run: what differs, by how much, and what explains it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from kinacc.artifacts import store
from kinacc.artifacts.columns import BY_STD_ERROR
from kinacc.artifacts.contract import ARTEFACTS
from kinacc.errors import InputError, first_few
from kinacc.gate.accepted import held
from kinacc.gate.causes import Causes, in_words
from kinacc.gate.made import Made, datasets_in, made
from kinacc.gate.outcome import (
    CODE,
    CONFIGURATION,
    FAILED,
    PASSED,
    SEED,
    UNEXPLAINED,
    VERSION,
    Cause,
    Difference,
    Outcome,
)
from kinacc.gate.table_comparison import Found, differences, within_chance
from kinacc.workflow.catalogue import STAGES, Stage

if TYPE_CHECKING:
    from kinacc.gate.predicted import Apart

NAME, KIND = "accepted run", "accepted"
# What simulations leave: other numbers by another seed, or by more of them.
_RANDOM = ("study_chunk", "study", "study_summary", "readings", "histories")
_DRAWN_BY = ((SEED, "seed"), (CONFIGURATION, "study.repetitions"))


def compared(
    results: Path, accepted: Path, datasets: Sequence[str] = (), exact: bool = False
) -> tuple[Outcome, ...]:
    """One outcome for each data set, of all that either run has where ``datasets`` names none.

    ``exact`` asks for the bytes of every file, pictures and pages too. Raises InputError where the
    accepted run cannot be used.
    """
    there = held(accepted)
    names = [*datasets] or sorted({*there, *datasets_in(results)})
    found = []
    for name in names:
        before = there.get(name, Made(accepted / name, {}))
        found.append(_outcome(name, _Comparison(before, made(results / name)), exact))
    return tuple(found)


@dataclass(frozen=True)
class _Comparison:
    """A data set of the accepted run, and the same one of the results."""

    before: Made
    now: Made
    causes: Causes = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "causes", Causes(self.before, self.now))

    @cached_property
    def apart(self) -> Mapping[str, Apart]:
        """How far apart the models predict poses; worked out where parameters differ."""
        from kinacc.gate.predicted import apart

        return apart(self.before, self.now)

    def is_drawn_anew(self, stage: Stage) -> bool:
        """Whether simulations are others by their seed or number.

        Other code or versions beside these do not count, other settings and points do.
        """
        why = self.causes.of_stage(stage.name)
        drawn = [each for each in why if (each.kind, each.where) in _DRAWN_BY]
        others = {each.kind for each in why if each not in drawn}
        return bool(drawn) and others <= {CODE, VERSION} and self._has_the_same_points

    @cached_property
    def _has_the_same_points(self) -> bool:
        points = STAGES["assessment_points"]
        return not self.of_table(points.name, points)

    def stages(self) -> dict[str, Stage]:
        """Every table of either run with the stage that makes it, in the order they follow."""
        found = {name: stage for each in (self.before, self.now) for name, stage in each.tables()}
        places = {name: place for place, name in enumerate(STAGES)}
        return dict(sorted(found.items(), key=lambda each: places[each[1].name]))

    def of_table(self, artefact: str, stage: Stage) -> list[Found]:
        """What differs in one table."""
        if not self.before.has(artefact, stage):
            return [Found("", "is not in the accepted run", 0, 0)]
        if not self.now.has(artefact, stage):
            return [Found("", "is in the accepted run and not here", 0, 0)]
        edited = self.edited(artefact, stage)
        if not edited and self.before.digest(artefact, stage) == self.now.digest(artefact, stage):
            return []
        try:
            tables = [_table(each, artefact, stage) for each in (self.before, self.now)]
        except InputError as error:
            return [Found("", error.problems[0].what, 0, 0)]
        if artefact in _RANDOM and not edited and self.is_drawn_anew(stage):
            return within_chance(ARTEFACTS[artefact], *tables)
        if artefact == "claims" and self.is_drawn_anew(stage):
            tables = [_without_simulations(each) for each in tables]
        found = self._by_poses(artefact, differences(ARTEFACTS[artefact], *tables))
        if edited and not found:
            found = [Found("", "is not the file that its stage left", 0, 0)]
        return found

    def edited(self, artefact: str, stage: Stage) -> bool:
        """Whether a table's file is not the one that its record tells of."""
        names = [
            path.relative_to(self.now.folder).as_posix() for path in self.now.paths(artefact, stage)
        ]
        return any(name in self.now.unsound for name in names)

    def _by_poses(self, artefact: str, found: list[Found]) -> list[Found]:
        """Parameters that differ: left out where the poses do not, else with how far these do."""
        if not any(each.held_to_poses for each in found):
            return found
        from kinacc.gate.predicted import models_of

        own = [self.apart[kind] for kind in models_of(artefact) if kind in self.apart]
        if own and all(each.same for each in own):
            return [each for each in found if not each.held_to_poses]
        told = max(own, key=lambda each: each.position_mm, default=None)
        words = f"; {told}" if told else ""
        return [
            replace(each, what=each.what + words) if each.held_to_poses else each for each in found
        ]


def _table(made_: Made, artefact: str, stage: Stage) -> pa.Table:
    return pa.concat_tables([store.read_table(path) for path in made_.paths(artefact, stage)])


def _without_simulations(claims: pa.Table) -> pa.Table:
    """The claims that rest on other tables than those of simulations."""
    names = {f"{name}.parquet" for name in _RANDOM}
    rests = [names.isdisjoint(each.split(", ")) for each in claims["evidence"].to_pylist()]
    return claims.filter(pa.array(rests))


def _differences(name: str, both: _Comparison, exact: bool) -> Iterator[Difference]:
    for problem in both.now.problems:
        place = Path(problem.where).name
        yield Difference(name, place, "", problem.what, causes=(Cause(UNEXPLAINED, place),))
    for artefact, stage in both.stages().items():
        found = both.of_table(artefact, stage)
        why = both.causes.of_stage(stage.name) if found else ()
        if found and both.now.has(artefact, stage) and both.edited(artefact, stage):
            why = (Cause(UNEXPLAINED, artefact),)
        for each in found:
            yield Difference(
                name,
                artefact,
                each.column,
                each.what,
                each.rows,
                each.of,
                each.first,
                each.largest,
                each.unit,
                each.allowed,
                why,
            )
    if exact:
        yield from _bytes(name, both)


def _bytes(name: str, both: _Comparison) -> Iterator[Difference]:
    """Files whose bytes are others, by the records; parts depend on their number."""
    for stage in STAGES.values():
        old, new = both.before.record(stage.name), both.now.record(stage.name)
        if old is None or new is None or stage.scattered:
            continue
        for file in sorted({**old.files, **new.files}):
            was, is_ = old.files.get(file), new.files.get(file)
            if was is None or is_ is None:
                what = "is not there" if is_ is None else "is new"
            elif was.sha256 != is_.sha256:
                what = f"other bytes: SHA-256 {is_.sha256[:16]}, {was.sha256[:16]} was accepted"
            elif file in both.now.unsound:
                what = "is not the file that its stage left"
            else:
                continue
            why = both.causes.of_stage(stage.name)
            yield Difference(name, file, "", what, causes=why)


def _outcome(name: str, both: _Comparison, exact: bool) -> Outcome:
    results = both.now.folder.parent
    accept = f'kinacc accept {results} --reason ".."'
    if not both.now.by_stage:
        says = f"{name} is in the accepted run and not in {results}"
        return Outcome(name, NAME, KIND, FAILED, says, "run it, or accept a run without it")
    if not both.before.by_stage:
        return Outcome(name, NAME, KIND, FAILED, f"{name} is not in the accepted run", accept)
    found = tuple(_differences(name, both, exact))
    count = len(both.stages())
    artefacts = [*dict.fromkeys(each.artefact for each in found)]
    figures = {"tables": count, "artefacts_that_differ": len(artefacts)}
    anew = ""
    study = STAGES["study_chunk"]
    there = both.before.record(study.name) and both.now.record(study.name)
    if there and both.is_drawn_anew(study):
        anew = f" (the study is drawn anew: its means are held to {BY_STD_ERROR}, no single run is)"
    if not found:
        says = f"{count} tables are as in the accepted run{' to the byte' if exact else ''}{anew}"
        if changed := both.causes.own():
            says += f", although something changed: {in_words(changed)}"
        return Outcome(name, NAME, KIND, PASSED, says, figures=figures)
    known = [*dict.fromkeys(each.artefact for each in found if each.explained)]
    unknown = [each for each in artefacts if each not in known]
    why = dict.fromkeys(cause for each in found if each.explained for cause in each.causes)
    parts = []
    if unknown:
        parts.append(f"{_named(unknown)} the accepted run, {_unknown(unknown, found)}")
    if known:
        all_of_it = "it follows" if len(known) == 1 else "all of it follows"
        parts.append(f"{_named(known)} the accepted run; {all_of_it} from {in_words(why)}")
    fix = f"if that is as it should be: {accept}"
    if unknown:
        fix = f"kinacc check-results {results / name} says what is not as its stage left it"
    return Outcome(name, NAME, KIND, FAILED, "; ".join(parts) + anew, fix, figures, found)


def _named(artefacts: Sequence[str]) -> str:
    if len(artefacts) == 1:
        return f"{artefacts[0]} differs from"
    return f"{len(artefacts)} tables ({first_few(artefacts, 3)}) differ from"


def _unknown(artefacts: Sequence[str], found: Sequence[Difference]) -> str:
    causes = [cause for each in found for cause in each.causes if cause.kind == UNEXPLAINED]
    if told := [each for each in causes if each.before]:
        return f"and {told[0].where} was not made from what is here: {told[0].before}"
    made_from = "it is" if len(artefacts) == 1 else "they are"
    return f"though nothing that {made_from} made from has changed"
