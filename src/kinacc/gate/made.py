"""What the folder of a data set says of how it was made: its records, and files held to them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from kinacc.artifacts import records
from kinacc.artifacts.records import Record
from kinacc.errors import InputError, Problem, gathered
from kinacc.workflow.catalogue import STAGES, TABLES, Stage
from kinacc.workflow.inputs import digests


@dataclass(frozen=True)
class Made:
    """A data set by its records; ``by_stage`` holds several of a stage that is scattered.

    ``problems`` are records that cannot be read.
    """

    folder: Path
    by_stage: Mapping[str, tuple[Record, ...]]
    problems: tuple[Problem, ...] = ()

    def record(self, stage: str) -> Record | None:
        """What one run of a stage told; of parts the first: all tell the same of how."""
        found = self.by_stage.get(stage, ())
        return found[0] if found else None

    def stages(self) -> Iterator[Stage]:
        """The stages that left something, in the order in which they follow each other."""
        return (stage for name, stage in STAGES.items() if name in self.by_stage)

    def tables(self) -> Iterator[tuple[str, Stage]]:
        """Every table that a record tells of, with the stage that made it."""
        for stage in self.stages():
            if stage.leaves == TABLES:
                yield from ((name, stage) for name in stage.outputs if self.has(name, stage))

    def has(self, artefact: str, stage: Stage) -> bool:
        """Whether the records tell of a table."""
        files = [name for record in self.by_stage.get(stage.name, ()) for name in record.files]
        ending = f"{artefact}/" if stage.scattered else f"{artefact}.parquet"
        return any(name.startswith(ending) for name in files)

    def paths(self, artefact: str, stage: Stage) -> list[Path]:
        """The files of a table that its records name, one or its parts in their order."""
        if not stage.scattered:
            return [self.folder / f"{artefact}.parquet"]
        parts = sorted((each.part or "" for each in self.by_stage[stage.name]), key=_number)
        return [self.folder / artefact / f"{part}.parquet" for part in parts]

    def digest(self, artefact: str, stage: Stage) -> str:
        """The digest of a table's columns as the records tell it; empty where they do not.

        Of a table in parts that of the whole, as what was gathered from it says, so that the number
        of parts does not count.
        """
        if stage.scattered:
            return self._gathered.get(artefact) or self.joined(artefact, stage)
        record = self.record(stage.name)
        written = record.files.get(f"{artefact}.parquet") if record else None
        return (written.columns_digest if written else None) or ""

    @cached_property
    def _gathered(self) -> dict[str, str]:
        all_ = [each for found in self.by_stage.values() for each in found]
        return {role: digest for each in all_ for role, digest in each.inputs_digests.items()}

    def joined(self, artefact: str, stage: Stage) -> str:
        """The digest of the parts of a table that are there, which are read; empty without."""
        try:
            return digests({artefact: [str(path) for path in self.paths(artefact, stage)]})[
                artefact
            ]
        except (InputError, OSError):
            return ""

    @cached_property
    def unsound(self) -> dict[str, Problem]:
        """By file what is wrong with those that are not as their record tells."""
        found = {}
        for stage, all_ in self.by_stage.items():
            for record in all_:
                place = records.place(self.folder, stage, record.part)
                for problem in records.misfits(place, record):
                    found[Path(problem.where).relative_to(self.folder).as_posix()] = problem
        return found


def made(folder: Path) -> Made:
    """The records of a data set's folder; those that cannot be read are among its problems."""
    by_stage: dict[str, list[Record]] = {}
    problems: list[Problem] = []
    for path in sorted((folder / records.FOLDER).glob("*.json")):
        with gathered(problems):
            record = records.read(path)
            if record.stage in STAGES and not path.name.startswith("."):
                by_stage.setdefault(record.stage, []).append(record)
    kept = {name: tuple(each) for name, each in by_stage.items()}
    return Made(folder, kept, tuple(problems))


def datasets_in(results: Path) -> list[str]:
    """Names of the folders below one that hold records."""
    if not results.is_dir():
        return []
    return sorted(each.name for each in results.iterdir() if (each / records.FOLDER).is_dir())


def _number(part: str) -> int:
    first = part.partition("-")[0]
    return int(first) if first.isdigit() else 0
