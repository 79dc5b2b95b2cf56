"""Which stages a data set goes through, with which files and settings.

What the workflow's rules and the command line share: both ask here for a stage's paths, values and
hashes, so that either leaves the same bytes. Importing it costs nothing but the standard library.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, wraps
from pathlib import Path
from typing import Any

from kinacc.artifacts import records
from kinacc.artifacts.error_models import asked_for
from kinacc.artifacts.provenance import config_hash, file_hash, stage_code_hash
from kinacc.campaign.journal import JOURNAL, PLAN, of_each
from kinacc.errors import InputError, Problem, refuse
from kinacc.workflow.boundary import leading_out
from kinacc.workflow.catalogue import (
    CALIBRATION,
    FIGURE_FOLDER,
    HISTORY,
    PAGE,
    STAGES,
    Stage,
    maker_of,
)
from kinacc.workflow.configured import in_use, words_read
from kinacc.workflow.inputs import digests
from kinacc.workflow.runner import Job
from kinacc.workflow.stage import job_of, to_text

RESULTS = "results"
# Installed, the rules stand in the package; in a clone beside src/.
_INSTALLED = Path(__file__).parent / "snakemake"
SNAKEFILE = (_INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[3]) / "Snakefile"


def planned(
    paths: Sequence[str | os.PathLike],
    overrides: Mapping[str, object] | None = None,
    results: str = RESULTS,
) -> Plan:
    """The plan for configuration files and values given on the command line.

    Raises InputError listing every problem in them.
    """
    from kinacc.config.schema import without_execution_keys
    from kinacc.workflow.contradictions import load

    full = load(paths, words_read(overrides or {}))
    formats = {name: tuple(config["figures"]["formats"]) for name, config in full.items()}
    first = next(iter(formats.values()))
    problems = [
        Problem(
            f"datasets.{name}.figures.formats",
            f"{', '.join(own)} here, {', '.join(first)} elsewhere",
            "the same formats for every data set",
        )
        for name, own in formats.items()
        if own != first
    ]
    refuse([*problems, *leading_out(results, full)])
    return Plan(
        {name: in_use(without_execution_keys(config)) for name, config in full.items()},
        {name: config["study"]["chunks"] for name, config in full.items()},
        first,
        results,
    )


def _once(method: Callable) -> Callable:
    """A method of a plan that goes by its configuration alone, worked out once for each argument.

    A run of many data sets asks for the same of every stage a dozen times.
    """

    @wraps(method)
    def kept(self: Plan, *given: str) -> object:
        key = (method.__name__, *given)
        if key not in self.known:
            self.known[key] = method(self, *given)
        return self.known[key]

    return kept


@dataclass(frozen=True)
class Plan:
    """The validated configuration of every data set, and where results go.

    ``datasets`` maps a data set's name to its complete configuration (defaults filled in, without
    values that only say how a run is carried out); ``parts`` to the number of parts its scattered
    stages are computed in; ``formats`` are the picture formats. ``files_absolute``: files from
    outside are named in full, as a module of another workflow needs them, whose results may have a
    folder put before them. ``known`` keeps what was worked out, and which tables were up to date
    when that was asked first.
    """

    datasets: Mapping[str, Mapping[str, object]]
    parts: Mapping[str, int]
    formats: tuple[str, ...]
    results: str = RESULTS
    files_absolute: bool = False
    known: dict[tuple, object] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def told(self) -> list[str]:
        """Data sets that a run tells of: all but those that are a line of another's series."""
        return [name for name, config in self.datasets.items() if "line_of" not in config]

    def lines(self, dataset: str) -> list[str]:
        """Data sets of the lines of a data set's series, by date; none where it has no series."""
        series: Any = self.datasets[dataset].get("series", ())
        return [line["name"] for line in series]

    @_once
    def stages(self, dataset: str) -> dict[str, Stage]:
        """The stages a data set goes through, in order."""
        missing = self.left_out(dataset)
        return {name: stage for name, stage in STAGES.items() if name not in missing}

    @_once
    def left_out(self, dataset: str) -> dict[str, str]:
        """Stages a data set cannot go through, each with the reason."""
        config = self.datasets[dataset]
        whose = config.get("line_of")
        space = config["evaluation"]["space"]
        reasons: dict[str, str] = {}
        if whose:
            beyond = (name for name in STAGES if name not in CALIBRATION and not STAGES[name].fits)
            reasons |= dict.fromkeys(beyond, f"a line of the series of {whose} is calibrated only")
        if not self.lines(dataset):
            reasons |= dict.fromkeys(HISTORY, "the data set has no series")
        if space != "cylinder":
            for name in ("accuracy_map", "fig3"):
                reasons[name] = f"no map: the evaluation space is '{space}', not a cylinder"
        if config["measurements"]["source"] != "synthetic":
            reasons["claims"] = "the paper's claims are about the paper's arm"
            for name, stage in STAGES.items():
                if stage.on_request:
                    reasons[name] = "no further draws of a measured arm"
            if "exclude" not in config["measurements"]["file"]:
                reasons["excluded_rows"] = "no row is excluded"
        else:
            made_here = (name for name, stage in STAGES.items() if stage.measured)
            reasons |= dict.fromkeys(made_here, "the measurements are synthetic")
        for name, stage in STAGES.items():
            if stage.fits and stage.fits not in asked_for(config["calibration"]):
                reasons[name] = f"calibration.{stage.fits} asks for no such model"
        return {name: reason for name, reason in reasons.items() if name in STAGES}

    def targets(
        self, dataset: str, only: Collection[str] = STAGES, also: Collection[str] = ()
    ) -> list[str]:
        """Every file the data set leaves in a plain run, and what the stages ``also`` leave.

        ``only``: the stages of a plain run whose files are meant.
        """
        return [
            path
            for name, stage in self.stages(dataset).items()
            if not stage.scattered and (name in also or (name in only and not stage.on_request))
            for path in (*self.outputs(name, dataset).values(), self.record(name, dataset))
        ]

    def inputs(
        self, name: str, dataset: str, on_request: bool = False
    ) -> dict[str, str | list[str]]:
        """Files a stage reads: artefact -> path, or paths of its parts; role -> other file.

        An optional artefact counts if the data set has it; one made on request, once it is there or
        where ``on_request`` says that this run makes it.
        """
        stage = STAGES[name]
        if stage.of_lines:
            return self._inputs_of_lines(stage, dataset)
        there = (each for each in stage.optional if self._is_there(each, dataset, on_request))
        found = {artefact: self._made(artefact, dataset) for artefact in (*stage.inputs, *there)}
        return found | self._files(stage, dataset)

    def _is_there(self, artefact: str, dataset: str, on_request: bool) -> bool:
        maker = maker_of(artefact)
        made = on_request or not maker.on_request or os.path.exists(self._table(artefact, dataset))
        return made and maker.name in self.stages(dataset)

    def absent(self, name: str, dataset: str) -> list[Problem]:
        """Files a stage reads that are not there."""
        return [
            Problem(path, "no such file", fix=_fix(role, len(self.datasets) > 1 and dataset))
            for role, given in self.inputs(name, dataset).items()
            for path in ([given] if isinstance(given, str) else given)
            if not os.path.isfile(path)
        ]

    @_once
    def gates(self, name: str, dataset: str) -> list[str]:
        """Tables that have to be there before a stage runs, and that it does not read.

        Those of the stages whose tables it reads are among them.
        """
        stages = {} if STAGES[name].of_lines else self.stages(dataset)
        made = {each: stage for stage in stages.values() for each in stage.outputs}
        found: dict[str, None] = {}
        waiting, seen = [STAGES[name]], {name}
        while waiting:
            stage = waiting.pop()
            found |= dict.fromkeys(each for each in stage.after if each in made)
            read = {made[each].name for each in (*stage.inputs, *stage.optional) if each in made}
            waiting += [STAGES[each] for each in sorted(read - seen)]
            seen |= read
        return [self._table(each, dataset) for each in found]

    def waited_for(
        self, name: str, dataset: str, part: str | None, untouched: Callable[[str], str]
    ) -> dict[str, list[str]]:
        """``gates`` as inputs: through ``untouched`` unless they and the stage are to be made anew.

        A gate alone does not make a stage anew. Snakemake asks for no other reason below a job that
        runs, so that a stage whose settings changed together with those of a gate would stay as it
        is if the gate were ``ancient``.
        """
        gates = self.gates(name, dataset)
        if (
            not gates
            or all(self._is_made(Path(each).stem, dataset) for each in gates)
            or self._is_made(name, dataset, part)
        ):
            gates = [untouched(gate) for gate in gates]
        return {"gates": gates}

    def _is_made(self, name: str, dataset: str, part: str | None = None) -> bool:
        """Whether the files of a run are there, of what they are now made of, by its record."""
        known = ("made", name, dataset, part)
        if known not in self.known:
            self.known[known] = self._is_recorded(name, dataset, part)
        return self.known[known]

    def _is_recorded(self, name: str, dataset: str, part: str | None) -> bool:
        wanted = {
            "config_hash": config_hash(self.settings(name, dataset)),
            "code_hash": self.code(name, dataset),
            "seed": str(self.seed(dataset)),
        }
        try:
            record = records.read(self.record(name, dataset, part))
            if not record.marks.items() >= wanted.items():
                return False
            # A run may have ended after what it reads was made anew.
            made_of_these = record.inputs_digests == digests(self.inputs(name, dataset))
        except (InputError, OSError):
            return False
        return made_of_these and all(
            os.path.isfile(path) for path in self.outputs(name, dataset, part).values()
        )

    def others(self, known: Callable[[str], bool]) -> Iterator[str]:
        """Records that are there, not ``known`` to Snakemake, and not of what would be made now.

        Where a machine was lost, jobs of a cluster leave files that Snakemake knows nothing of, and
        would take for made by whatever settings it is asked for next.
        """
        for dataset in self.datasets:
            for name in self.stages(dataset):
                for part in self.part_names(name, dataset):
                    path = self.record(name, dataset, part)
                    there = not known(path) and os.path.exists(path)
                    if there and not self._is_recorded(name, dataset, part):
                        yield path

    def contents(self, name: str, dataset: str) -> dict[str, str]:
        """Content hashes of the files from outside that a stage reads."""
        files = self._files(STAGES[name], dataset)
        return {
            role: _hash(os.path.abspath(path), os.stat(path).st_mtime_ns)
            for role, path in files.items()
        }

    def outputs(self, name: str, dataset: str, part: str | None = None) -> dict[str, str]:
        """Files a stage leaves: artefact -> path, or picture format -> path."""
        stage = STAGES[name]
        if stage.is_figure:
            folder = f"{self.results}/{dataset}/{FIGURE_FOLDER}"
            return {kind: f"{folder}/{name}.{kind}" for kind in self.formats}
        if stage.leaves == PAGE:
            return {"html": f"{self.results}/{dataset}/{name}.html"}
        return {artefact: self._table(artefact, dataset, part) for artefact in stage.outputs}

    def record(self, name: str, dataset: str, part: str | None = None) -> str:
        """File that a run of a stage leaves last: what it wrote, and from what."""
        return records.place(f"{self.results}/{dataset}", name, part)

    def records_read(self, name: str, dataset: str) -> list[str]:
        """Records that the tables a stage reads are held to."""
        roles = [role for role in self.inputs(name, dataset) if not role.endswith("_file")]
        found: dict[str, None] = {}
        for whose, _, artefact in (role.rpartition("/") for role in roles):
            maker = maker_of(artefact)
            owner = whose or dataset
            parts = self.part_names(maker.name, owner)
            found |= dict.fromkeys(self.record(maker.name, owner, part) for part in parts)
        return [*found]

    def part_names(self, name: str, dataset: str) -> list[str | None]:
        """Names of the parts a stage is computed in: 1-of-2, 2-of-2; None where it is whole."""
        if not STAGES[name].scattered:
            return [None]
        config = self.datasets[dataset]
        draws, repetitions = config["robustness"]["draws"], config["study"]["repetitions"]
        count = min(self.parts[dataset], draws if "robustness" in name else repetitions)
        return [f"{number}-of-{count}" for number in range(1, count + 1)]

    def message(self, name: str, dataset: str) -> str:
        """What the stage is doing, for a Snakemake rule, whose wildcards may be in ``dataset``."""
        part = ", part {wildcards.part}" if STAGES[name].scattered else ""
        whose = dataset.replace("{dataset}", "{wildcards.dataset}")
        return f"{whose}: {STAGES[name].message}{part}"

    def log(self, name: str, dataset: str, part: str | None = None) -> str:
        """Log file of a stage."""
        return f"{self.results}/{dataset}/logs/{name}{f'.{part}' if part else ''}.log"

    @_once
    def settings(self, name: str, dataset: str) -> dict[str, object]:
        """The configuration values a stage depends on, nested as in the configuration."""
        config, chosen, stage = self.datasets[dataset], {}, STAGES[name]
        synthetic = config["measurements"]["source"] == "synthetic"
        for path in (*stage.settings, *(stage.synthetic_settings if synthetic else ())):
            if path == "dataset" or path.partition(".")[0] in config:  # else it is not in use
                _copy({**config, "dataset": dataset}, chosen, path.split("."))
        return chosen

    def job(self, name: str, dataset: str, part: str | None = None) -> Job:
        """One run of a stage, as a command carries it out."""
        return job_of(
            name,
            dataset,
            part,
            self.inputs(name, dataset),
            self.outputs(name, dataset, part),
            self.settings(name, dataset),
            self.seed(dataset),
            self.log(name, dataset, part),
            self.record(name, dataset, part),
        )

    def job_text(
        self, name: str, dataset: str, part: str | None = None, on_request: bool = False
    ) -> str:
        """One run of a stage without its files, as the workflow hands it over."""
        return to_text(
            name,
            dataset,
            part,
            self.inputs(name, dataset, on_request),
            self.settings(name, dataset),
            self.seed(dataset),
            self.code(name, dataset),
        )

    def code(self, name: str, dataset: str) -> str:
        """Hash of all code and package data a stage's results depend on."""
        stage = STAGES[name]
        used = stage.used(self.settings(name, dataset), self.inputs(name, dataset))
        return stage_code_hash(stage.module, used)

    def seed(self, dataset: str) -> int:
        """Seed of the data set."""
        return self.datasets[dataset]["seed"]

    def _inputs_of_lines(self, stage: Stage, dataset: str) -> dict[str, str | list[str]]:
        """Tables of the lines of a series, ``<data set>/<artefact>``, and their files."""
        found: dict[str, str | list[str]] = {}
        for other in self.lines(dataset):
            there = (each for each in stage.optional if self._is_there(each, other, False))
            for artefact in (*stage.inputs, *there):
                found[f"{other}/{artefact}"] = self._made(artefact, other)
        return found | self._files(stage, dataset)

    def _made(self, artefact: str, dataset: str) -> str | list[str]:
        """File of a table, or files of the parts of one that is scattered."""
        maker = maker_of(artefact)
        paths = [
            self._table(artefact, dataset, part) for part in self.part_names(maker.name, dataset)
        ]
        return paths if maker.scattered else paths[0]

    def _table(self, artefact: str, dataset: str, part: str | None = None) -> str:
        folder = f"{self.results}/{dataset}"
        return f"{folder}/{artefact}/{part}.parquet" if part else f"{folder}/{artefact}.parquet"

    @cached_property
    def _campaigns(self) -> dict[Path, list[Path]]:
        """Campaigns on the calibration of every data set, by its results folder, sought once."""
        return of_each(Path(self.results) / dataset for dataset in self.datasets)

    def _files(self, stage: Stage, dataset: str) -> dict[str, str]:
        """Files from outside by role; of stages about several data sets ``<data set>/<role>``."""
        if not stage.of_lines:
            return self._own_files(stage, dataset)
        # Campaigns of a series may have been begun on what was the newest line then.
        whose = [dataset, *self.lines(dataset)]
        return {
            f"{name}/{role}": path
            for name in whose
            for role, path in self._own_files(stage, name).items()
        }

    def _own_files(self, stage: Stage, dataset: str) -> dict[str, str]:
        config, found = self.datasets[dataset], {}
        if stage.leaves == PAGE or stage.of_lines:
            found |= campaign_files(self._campaigns[Path(self.results) / dataset])
        for path in stage.files:
            value: object = config
            for key in path.split("."):
                value = value.get(key) if isinstance(value, Mapping) else None
            if path == "robot":
                if isinstance(value, str) and os.path.isfile(value):
                    from kinacc.kinematics.robot import files

                    roles = ("robot_file", "robot_urdf_file")
                    read = zip(roles, files(value), strict=False)
                    found |= {role: str(file) for role, file in read}
            elif value is not None and config["measurements"]["source"] == "file":
                found["joints_file" if "joints" in path else "measurements_file"] = value
        if self.files_absolute:
            return {role: os.path.abspath(file) for role, file in found.items()}
        return found


@cache
def _hash(path: str, changed_ns: int) -> str:
    """Content hash of a file, which several stages read."""
    return file_hash(path)


def campaign_files(campaigns: Iterable[Path]) -> dict[str, str]:
    """Files of campaigns on the calibration of a data set, by role."""
    found = {}
    for number, campaign in enumerate(campaigns, 1):
        found[f"campaign_{number}_file"] = str(campaign / PLAN)
        if (campaign / JOURNAL).is_file():
            found[f"readings_{number}_file"] = str(campaign / JOURNAL)
    return found


def _fix(role: str, dataset: str | bool) -> str:
    """What makes the file of a role, ``<artefact>`` or ``<data set>/<artefact>``."""
    whose, _, artefact = role.rpartition("/")
    if artefact.endswith("_file"):
        return "check the path"
    where = f" --dataset {whose or dataset}" if whose or dataset else ""
    return f"make it first: kinacc run {maker_of(artefact).name}{where}"


def _copy(source: Mapping[str, object], target: dict[str, object], keys: list[str]) -> None:
    """Copy one value into a nested dictionary, with the sections around it."""
    for key in keys[:-1]:
        source, target = source[key], target.setdefault(key, {})
    target[keys[-1]] = source[keys[-1]]
