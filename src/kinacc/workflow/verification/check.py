"""Check a results folder: everything there, as the contract says, and made from one another."""

from __future__ import annotations

import os
import shlex
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from kinacc.artifacts import campaign_tables, store
from kinacc.artifacts.campaign_tables import ALL as CAMPAIGN
from kinacc.artifacts.columns import Columns
from kinacc.artifacts.contract import ARTEFACTS, INPUTS_DIGESTS
from kinacc.artifacts.error_models import ALWAYS
from kinacc.artifacts.pictures import as_text
from kinacc.artifacts.records import Record
from kinacc.config import schema
from kinacc.errors import InputError, Problem
from kinacc.workflow.catalogue import (
    CALIBRATION,
    FIGURE_FOLDER,
    HISTORY,
    PAGE,
    STAGES,
    TABLES,
    Stage,
    maker_of,
)
from kinacc.workflow.plan import RESULTS, Plan
from kinacc.workflow.results_lock import undisturbed
from kinacc.workflow.verification.conformity import check_file
from kinacc.workflow.verification.lineage import Found, check_lineage, made_without, parts, strays
from kinacc.workflow.verification.mending import Doubt, Marks, remedy, workflow_command
from kinacc.workflow.verification.pictures import check_picture
from kinacc.workflow.verification.recomputation import Again, computed_again
from kinacc.workflow.verification.recorded import Unit, check_records, folded, records_there
from kinacc.workflow.verification.rules import contradictions

FORMATS = schema.key("figures.formats").choices


@dataclass(frozen=True)
class DatasetReport:
    """What was found in one data set's folder: files checked, problems, and notes beside them.

    ``again`` are tables whose numbers were computed again.
    ``doubts`` are the stages the problems leave in doubt, ``marks`` the provenance of every
    readable table. ``advice`` says what to do where no stage of the study can help.
    """

    name: str
    checked: tuple[str, ...]
    problems: tuple[Problem, ...]
    notes: tuple[str, ...] = ()
    doubts: frozenset[Doubt] = frozenset()
    marks: Marks = field(default_factory=dict, repr=False)
    advice: str = ""
    again: tuple[str, ...] = ()

    def to_dict(self) -> dict:
        """Plain values for JSON."""
        return {
            "name": self.name,
            "ok": not self.problems,
            "checked": list(self.checked),
            "computed_again": list(self.again),
            "problems": [asdict(problem) for problem in self.problems],
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class Report:
    """What was found in a results folder; ``ok`` if there is no problem anywhere.

    ``advice`` says what to do about the problems. ``digest`` is one of all records.
    """

    folder: str
    datasets: tuple[DatasetReport, ...]
    problems: tuple[Problem, ...] = ()
    advice: str = ""
    digest: str = ""

    @property
    def ok(self) -> bool:
        """Whether all is well."""
        return not self.problems and not any(each.problems for each in self.datasets)

    @property
    def exit_code(self) -> int:
        """0 if all is well, else 1."""
        return 0 if self.ok else 1

    def to_dict(self) -> dict:
        """Plain values for JSON."""
        return {
            "ok": self.ok,
            "folder": self.folder,
            "problems": [asdict(problem) for problem in self.problems],
            "advice": self.advice,
            "digest": self.digest,
            "datasets": [each.to_dict() for each in self.datasets],
        }

    def __str__(self) -> str:
        lines = [f"{self.folder}: {'all is well' if self.ok else 'not as it should be'}"]
        lines += [f"  - {problem}" for problem in self.problems]
        for each in self.datasets:
            count = len(each.problems)
            found = "no problem" if not count else f"{count} problem{'s' if count > 1 else ''}"
            again = f"{len(each.again)} tables computed again, " if each.again else ""
            again = again or ("no number computed again, " if each.marks else "")
            lines.append(f"{each.name}: {len(each.checked)} files checked, {again}{found}")
            lines += [f"  - {problem}" for problem in each.problems]
            lines += [f"  note: {note}" for note in each.notes]
        lines += [self.advice] if self.advice else []
        lines += [f"digest of all records: {self.digest}"] if self.digest and self.ok else []
        return "\n".join(lines)


def check_results(
    results: Path | str,
    plan: Plan | None = None,
    configs: Sequence[str] = (),
    every: bool = False,
    expect: str | None = None,
    again: bool = True,
) -> Report:
    """Check every data set's folder below ``results``.

    Every artefact present, its schema, units and provenance keys as the contract says, values in
    their limits, rows and tables consistent, inputs still those it was made from, claims readable,
    pictures whole. With a ``plan`` (the configuration, read from the files ``configs``) also that
    its data sets are all there and that the artefacts were made with these settings and files.
    Numbers are computed ``again`` (see :mod:`recomputation`), with ``every`` in place of a sample.
    ``expect``: the digest of all records as it was told before. Raises InUse while a run writes.
    """
    folder = Path(results)
    with undisturbed(folder.parent if is_dataset(folder) else folder):
        report = _checked(folder, plan, configs, every if again else None)
    if expect is not None and report.digest != expect:
        what = f"digest of all records is {report.digest or 'none: there are no records'}"
        fix = "the records were written anew since that digest was told, or are of another run"
        problem = Problem(report.folder, what, expect, fix)
        return replace(report, problems=(*report.problems, problem))
    return report


def _checked(folder: Path, plan: Plan | None, configs: Sequence[str], every: bool | None) -> Report:
    if not folder.name.strip("."):
        folder = Path(os.path.abspath(folder))
    if not folder.is_dir():
        is_there = folder.name == RESULTS and folder.parent.is_dir()
        fix = f"run {shlex.join(workflow_command(configs, folder.parent))}" if is_there else ""
        problem = Problem(str(folder), "no such folder", "a results folder", fix)
        return Report(str(folder), (), (problem,))
    if (folder / f"{CAMPAIGN[0].name}.parquet").is_file():
        return _advised(Report(str(folder), (check_campaign(folder),)), folder)
    if is_dataset(folder):
        if plan is not None and folder.name not in plan.datasets:
            allowed = ", ".join(plan.datasets)
            problem = Problem(str(folder), "no data set of the configuration", allowed)
            return Report(str(folder), (), (problem,))
        report = Report(str(folder), (check_dataset(folder, plan, every),), digest=folded([folder]))
        return _advised(report, folder.parent, plan, configs)
    names = sorted(
        path.name for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")
    )
    problems, missing = [], []
    if plan is not None:
        missing = [name for name in plan.datasets if name not in names]
        problems = [Problem(str(folder / name), "no such folder: not run") for name in missing]
        names = [name for name in names if name in plan.datasets]
    elif not names:
        problems = [Problem(str(folder), "holds no data set", "one folder for each data set")]
    reports = [check_dataset(folder / name, plan, every) for name in names]
    digest = folded([folder / each.name for each in reports])
    report = Report(str(folder), tuple(reports), tuple(problems), digest=digest)
    return _advised(report, folder, plan, configs, missing)


def _advised(
    report: Report,
    folder: Path,
    plan: Plan | None = None,
    configs: Sequence[str] = (),
    missing: Sequence[str] = (),
) -> Report:
    """The report with what to do about its problems in the results folder."""
    said = [each.advice for each in report.datasets if each.problems and each.advice]
    wrong = [each for each in report.datasets if each.problems and not each.advice]
    doubts: Mapping[str, Collection[Doubt]] = dict.fromkeys(missing, ()) | {
        each.name: each.doubts for each in wrong
    }
    if doubts:
        marks = {each.name: each.marks for each in wrong}
        said.append(remedy(folder, doubts, marks, plan, configs))
    return replace(report, advice="\n".join(said))


def is_dataset(folder: Path) -> bool:
    """Whether the folder is that of one data set, given in place of the folder of all of them."""
    return any((folder / artefact.file_name).is_file() for artefact in ARTEFACTS.values())


def check_dataset(
    folder: Path, plan: Plan | None = None, every: bool | None = False
) -> DatasetReport:
    """Check the folder of one data set; see :func:`check_results`.

    ``every``: None where no number is computed again.
    """
    checked, found, tables, marks, of_parts = [], [], {}, {}, {}
    behind = _left_behind(folder, plan)
    for name, path in _tables_there(folder):
        if name in behind:
            continue
        checked.append(str(path))
        is_part = path.parent != folder
        doubt = Doubt(maker_of(name).name, path.stem if is_part else None)
        columns, wrong = check_file(path, ARTEFACTS[name])
        found += [(problem, (doubt,)) for problem in wrong]
        # Parts of a table are held to its schema; the whole is held to the rules.
        if is_part:
            of_parts[str(path)] = columns
        elif columns is not None:
            tables[name] = columns
        with suppress(InputError):
            marks[f"{name}/{path.stem}" if is_part else name] = store.read_metadata(path)
    left_out = _left_out(folder, marks, tables, plan)
    unmade = _not_studied(folder)
    is_line = plan is not None and folder.name not in plan.told
    told = {
        name: reason
        for name, reason in left_out.items()
        if not (STAGES[name].by_choice or name in unmade or is_line)
    }
    notes = [
        f"{folder}: {', '.join(name for name in left_out if left_out[name] == reason)} left out, "
        f"{reason}"
        for reason in dict.fromkeys(told.values())
    ]
    notes += [f"{folder / name}.parquet: left from before, {why}" for name, why in behind.items()]
    if unmade and not is_line:
        notes.append(f"{folder}: no study was made: kinacc study FILE.yaml makes one")
    absent = {*left_out, *unmade}
    found += _missing(folder, absent)
    known, wrong_records = records_there(folder)
    for name, picture in _pictures(folder, plan, absent, known):
        checked += [str(picture)] if picture.exists() else []
        found += [(problem, (Doubt(name),)) for problem in check_picture(picture)]
    kept = [s for s in STAGES.values() if not {*s.outputs} & {*behind}]
    names = {stage.name for stage in kept} - set(left_out)
    known = {unit: record for unit, record in known.items() if unit[0] in names}
    wrong_files = {problem.where.partition(", column")[0] for problem, _ in found}
    found += [*wrong_records, *check_records(folder, kept, known, wrong_files)]
    marks |= {
        name: {**record.marks, INPUTS_DIGESTS: as_text(record.inputs_digests)}
        for (name, _), record in known.items()
        if STAGES[name].leaves != TABLES
    }
    for problem, names in contradictions(tables):
        doubts = tuple(Doubt(maker_of(name).name) for name in names)
        found.append((_placed(folder, problem), doubts))
    of_lineage, said = check_lineage(folder, marks, plan)
    found += [*of_lineage, *strays(folder, marks)]
    in_doubt = {doubt.stage for _, doubts in found for doubt in doubts}
    again = Again((), [], [])
    if every is not None:
        joined = tables | _joined(folder, of_parts)
        again = computed_again(folder, joined, marks, in_doubt, plan, every)
    found += again.found
    leftovers = [f"{path}: left over from a run that was stopped" for path in _leftovers(folder)]
    return DatasetReport(
        folder.name,
        tuple(checked),
        tuple(dict.fromkeys(problem for problem, _ in found)),
        (*notes, *said, *again.notes, *leftovers),
        frozenset(doubt for _, doubts in found for doubt in doubts),
        marks,
        again=again.tables,
    )


def _joined(folder: Path, of_parts: Mapping[str, Columns | None]) -> dict[str, Columns]:
    """Scattered tables that are there in all their parts, each as one."""
    joined = {}
    for name in dict.fromkeys(Path(path).parent.name for path in of_parts):
        for own in parts(folder, name):
            held = [columns for columns in map(of_parts.get, own) if columns is not None]
            if len(held) == len(own) and len({frozenset(each) for each in held}) == 1:
                joined[name] = {c: np.concatenate([p[c] for p in held]) for c in held[0]}
    return joined


def not_there(folder: Path) -> tuple[str, ...]:
    """Tables that a data set would have beside those in its folder, for all that these say."""
    tables, marks = {}, {}
    for name in ARTEFACTS:
        path = folder / f"{name}.parquet"
        with suppress(InputError):
            if path.is_file():
                marks[name] = store.read_metadata(path)
                tables |= {name: store.read(path)} if name in ("measurements", "frames") else {}
    left_out = _left_out(folder, marks, tables, None)
    return tuple(Path(problem.where).stem for problem, _ in _missing(folder, left_out))


def check_campaign(folder: Path) -> DatasetReport:
    """Check the report of a measuring campaign: its tables whole, made together, of one mind."""
    checked, problems, tables, marks = [], [], {}, []
    for artefact in CAMPAIGN:
        path = folder / f"{artefact.name}.parquet"
        if not path.is_file():
            problems.append(Problem(str(path), "missing"))
            continue
        checked.append(str(path))
        tables[artefact.name], found = check_file(path, artefact)
        problems += found
        with suppress(InputError):
            marks.append(store.read_metadata(path))
    if any(each != marks[0] for each in marks):
        problems.append(Problem(str(folder), "tables of different states of a campaign"))
    if not problems:
        problems += campaign_tables.contradictions(tables)
    advice = "To mend this, run `kinacc campaign report` again: it writes all of its files anew."
    return DatasetReport(folder.name, tuple(checked), tuple(problems), advice=advice)


def _tables_there(folder: Path) -> Iterator[tuple[str, Path]]:
    """Every table of the contract that is in the folder, parts included."""
    for name in ARTEFACTS:
        path = folder / f"{name}.parquet"
        if path.exists():
            yield name, path
        for own in parts(folder, name):
            yield from ((name, Path(part)) for part in own)


def _left_behind(folder: Path, plan: Plan | None) -> dict[str, str]:
    """Tables that the data set does without now, each with the reason."""
    left_out = _of_paper_alone(folder) if plan is None else plan.left_out(folder.name)
    return {
        name: reason
        for stage, reason in left_out.items()
        for name in STAGES[stage].outputs
        if (folder / f"{name}.parquet").is_file()
    }


def _of_paper_alone(folder: Path) -> dict[str, str]:
    """Stages that only the paper's arm goes through, where the folder is of a measured arm."""
    path = folder / "measurements.parquet"
    with suppress(InputError):
        if path.is_file() and np.isfinite(store.read(path).get("row", np.nan)).any():
            return {"claims": "the paper's claims are about the paper's arm"}
    return {}


def _left_out(folder: Path, marks: dict, tables: dict, plan: Plan | None) -> dict[str, str]:
    """Stages the data set rightly does without, each with the reason."""
    if plan is not None:
        return dict(plan.left_out(folder.name))
    own = _of_paper_alone(folder)
    without = _without_file(folder, tables) | own | _without_map(folder, marks, "claims" in own)
    return without | _without_models(folder, tables) | _without_series(folder)


def _without_file(folder: Path, tables: dict) -> dict[str, str]:
    """Stages of a measured file that a synthetic arm, or one without exclusions, has not."""
    if "measurements" in tables and np.isnan(tables["measurements"]["row"]).all():
        return {
            n: "the measurements are synthetic" for n, stage in STAGES.items() if stage.measured
        }
    if not (folder / "excluded_rows.parquet").exists():
        return {"excluded_rows": "no row is excluded"}
    return {}


def _without_models(folder: Path, tables: dict) -> dict[str, str]:
    """Stages of models that a data set may ask for and of which nothing here knows."""
    known = {str(model) for model in tables.get("frames", {}).get("model", ())}
    return {
        name: "no such model was asked for"
        for name, stage in STAGES.items()
        if stage.fits and stage.fits not in (*ALWAYS, *known)
        if not any((folder / f"{each}.parquet").exists() for each in stage.outputs)
    }


def _without_series(folder: Path) -> dict[str, str]:
    """Stages of a series, where nothing here is of one."""
    there = any(path.exists() for name in HISTORY for path in _files(folder, STAGES[name]))
    return {} if there else dict.fromkeys(HISTORY, "no history of a series is here")


def _without_map(folder: Path, marks: dict, no_claims: bool) -> dict[str, str]:
    drawn = any(path.exists() for path in _files(folder, STAGES["fig3"]))
    if drawn or (folder / "accuracy_map.parquet").exists():
        return {}
    if no_claims:  # the one table that would tell whether there was a map
        return dict.fromkeys(
            ("accuracy_map", "fig3"), "whether a map is missing is known only with --config"
        )
    if not made_without(folder, "accuracy_map", marks):
        return {}
    return dict.fromkeys(("accuracy_map", "fig3"), "the claims were made without a map")


def _not_studied(folder: Path) -> set[str]:
    """Stages beyond a calibration, if no file of theirs is there: a study not made, none lost.

    The page is no sign of a study: a calibration may leave it too.
    """
    beyond = [stage for stage in STAGES.values() if not (stage.name in CALIBRATION or stage.fits)]
    recorded = {stage for stage, _ in records_there(folder)[0]}
    there = {
        stage.name: stage.leaves
        for stage in beyond
        if stage.name in recorded or _has_left(folder, stage)
    }
    if set(there.values()) - {PAGE}:
        return set()
    return {stage.name for stage in beyond} - set(there)


def _has_left(folder: Path, stage: Stage) -> bool:
    """Whether any file of a stage is there, a part of a table included."""
    there = any(each.exists() for each in _files(folder, stage))
    return there or any(any((folder / name).glob("*.parquet")) for name in stage.outputs)


def _files(folder: Path, stage: Stage, formats: Collection[str] = FORMATS) -> list[Path]:
    """Whole files of a stage: its page, the formats of its figure, or its tables."""
    if stage.leaves == PAGE:
        return [folder / f"{stage.name}.html"]
    if stage.is_figure:
        return [folder / FIGURE_FOLDER / f"{stage.name}.{kind}" for kind in formats]
    return [folder / f"{name}.parquet" for name in stage.outputs]


def _missing(folder: Path, left_out: Collection[str]) -> list[Found]:
    return [
        (
            Problem(str(path), "missing", fix=f"made by {stage.message}"),
            (Doubt(stage.name),),
        )
        for stage in STAGES.values()
        if stage.leaves == TABLES
        if not (stage.on_request or stage.scattered or stage.name in left_out)
        for path in _files(folder, stage)
        if not path.exists()
    ]


def _pictures(
    folder: Path, plan: Plan | None, left_out: Collection[str], known: Mapping[Unit, Record]
) -> Iterator[tuple[str, Path]]:
    """Pictures and pages that have to be there: without a plan in the formats that are recorded."""
    for name, stage in STAGES.items():
        if not (stage.leaves == TABLES or stage.on_request or name in left_out):
            record = known.get((name, None))
            told = [Path(file).suffix[1:] for file in record.files] if record else FORMATS
            formats = told if plan is None else plan.formats
            yield from ((name, path) for path in _files(folder, stage, formats))


def _leftovers(folder: Path) -> list[Path]:
    found = [path for mark in ("partial", "part") for path in folder.rglob(f".*.{mark}")]
    return sorted(path for path in found if path.is_file())


def _placed(folder: Path, problem: Problem) -> Problem:
    return Problem(f"{folder}/{problem.where}", problem.what, problem.allowed, problem.fix)
