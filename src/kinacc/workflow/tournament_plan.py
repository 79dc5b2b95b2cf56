"""The tournament's jobs: about all data sets at once, so beside the catalogue of their stages.

The command and the workflow's rules ask here for the same files and settings.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from kinacc.artifacts.provenance import stage_code_hash
from kinacc.artifacts.tournament_tables import FOLDER
from kinacc.errors import InputError, Problem
from kinacc.workflow.catalogue import maker_of
from kinacc.workflow.plan import Plan
from kinacc.workflow.runner import Job, stage_provenance

CHUNK = "kinacc.workflow.stages.tournament_chunk"
TABLES = "kinacc.workflow.stages.tournament_tables"
GATHERED = ("tournament_cells", "tournament_verdicts", "tournament_fields")
_MEASURED = ("pose_errors", "measurements")
_MODELLED = ("assessment_points",)


@dataclass(frozen=True)
class TournamentPlan:
    """What a tournament over the data sets of a plan reads and leaves.

    ``size`` is a name of the sizes of :mod:`kinacc.study.tournament.contest`; ``parts`` the number
    of parts, which has no influence on the results; ``assessors`` those that take part, all if
    empty; ``noise_mm`` the only noise simulated, all of the size if empty.
    """

    plan: Plan
    size: str
    parts: int
    assessors: tuple[str, ...]
    noise_mm: tuple[float, ...] = ()

    @property
    def inputs(self) -> dict[str, str]:
        """Tables of the data sets, ``<data set>/<artefact>``, and the robot files they name."""
        found = {}
        for name, config in self.plan.datasets.items():
            measured = config["measurements"]["source"] == "file"
            for artefact in _MEASURED if measured else _MODELLED:
                found[f"{name}/{artefact}"] = f"{self.plan.results}/{name}/{artefact}.parquet"
            for role, path in self.plan.inputs("dh", name).items():
                if role.startswith("robot"):
                    found[f"{name}/{role}"] = path
        return found

    @property
    def part_names(self) -> list[str]:
        """Names of the parts: 1-of-2, 2-of-2."""
        return [f"{number}-of-{self.parts}" for number in range(1, self.parts + 1)]

    @property
    def chunks(self) -> list[str]:
        """Files of the parts."""
        return [self.chunk(part) for part in self.part_names]

    def chunk(self, part: str) -> str:
        """File of one part."""
        return f"{self.plan.results}/{FOLDER}/tournament_chunk/{part}.parquet"

    @property
    def outputs(self) -> dict[str, str]:
        """Tables gathered from the parts."""
        return {name: f"{self.plan.results}/{FOLDER}/{name}.parquet" for name in GATHERED}

    @property
    def settings(self) -> dict[str, object]:
        """What the results depend on beside the tables."""
        robots = {name: config["robot"] for name, config in self.plan.datasets.items()}
        return {
            "seed": self.seed,
            "size": self.size,
            "assessors": list(self.assessors),
            "noise_mm": list(self.noise_mm),
            "robots": robots,
        }

    @property
    def seed(self) -> int:
        """The seed of the first data set."""
        return self.plan.seed(next(iter(self.plan.datasets)))

    def chunk_job(self, part: str) -> Job:
        """The job of one part."""
        outputs = {"tournament_chunk": self.chunk(part)}
        return self._job(CHUNK, self.inputs, outputs, part)

    def tables_job(self) -> Job:
        """The job that gathers the parts."""
        return self._job(TABLES, {**self.inputs, "tournament_chunk": self.chunks}, self.outputs)

    def _job(self, module: str, inputs: Mapping, outputs: Mapping, part: str | None = None) -> Job:
        name = module.rpartition(".")[2]
        log = f"{self.plan.results}/{FOLDER}/logs/{name}{f'.{part}' if part else ''}.log"
        label = " ".join(filter(None, ["tournament", part]))
        return Job(module, inputs, outputs, self.settings, self.seed, part, label, log)

    def code(self, job: Job) -> str:
        """Hash of all code the results of a job depend on."""
        return stage_code_hash(job.module, ("kinacc.assess.registry:PLACES",))

    def check(self) -> None:
        """Raise InputError where a table of a data set is not there yet."""
        problems = [
            Problem(path, "no such file", fix=_fix(role))
            for role, path in self.inputs.items()
            if not os.path.isfile(path)
        ]
        if problems:
            raise InputError(problems, "the tournament lacks tables of the data sets")


def is_done(job: Job) -> bool:
    """Whether the files of a job are there, whole, made from the same inputs, settings and code."""
    from kinacc.artifacts.contract import ARTEFACTS
    from kinacc.artifacts.store import read_metadata
    from kinacc.workflow.verification.conformity import check_file

    wanted = {name: str(value) for name, value in stage_provenance(job).items()}
    try:
        return all(
            read_metadata(path) == wanted and not check_file(Path(path), ARTEFACTS[name])[1]
            for name, path in job.outputs.items()
        )
    except InputError:
        return False


def tournament_plan(
    plan: Plan,
    size: str | None = None,
    parts: int | None = None,
    assessors: Sequence[str] = (),
    noise_mm: Sequence[float] = (),
) -> TournamentPlan:
    """The tournament of a plan; what is not given is as configured, assessors are all there are.

    Raises InputError for an assessor that does not exist.
    """
    if assessors:
        from kinacc.study.tournament.contest import CONTESTANTS

        allowed = ", ".join(CONTESTANTS)
        unknown = [name for name in assessors if name not in CONTESTANTS]
        if unknown:
            raise InputError([Problem(f"assessor {name}", "unknown", allowed) for name in unknown])
        assessors = [name for name in CONTESTANTS if name in assessors]
    configured = plan.tournament
    size, parts = size or configured["size"], parts or configured["chunks"]
    return TournamentPlan(plan, size, parts, tuple(assessors), tuple(noise_mm))


def _fix(role: str) -> str:
    dataset, _, artefact = role.partition("/")
    if artefact.startswith("robot"):
        return "check the path"
    return f"run `snakemake -c2`, or `kinacc run {maker_of(artefact).name} --dataset {dataset}`"
