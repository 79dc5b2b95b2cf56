"""The command that makes a results folder good again, as text to be typed.

A plain run of the workflow is no remedy: Snakemake goes by the dates of files, so it leaves a
changed artefact as it is, or takes it for a newer input and carries the change on.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from kinacc.artifacts.provenance import config_hash
from kinacc.errors import InputError
from kinacc.workflow.catalogue import CALIBRATION, PAGE, STAGES, maker_of
from kinacc.workflow.described import CONFIG
from kinacc.workflow.plan import RESULTS, SNAKEFILE, Plan, planned

Marks = Mapping[str, Mapping[str, str]]


class Doubt(NamedTuple):
    """A stage whose files cannot be relied on; of a scattered stage those of one ``part``."""

    stage: str
    part: str | None = None


def remedy(
    folder: Path,
    doubts: Mapping[str, Collection[Doubt]],
    marks: Mapping[str, Marks],
    plan: Plan | None,
    configs: Sequence[str] = (),
) -> str:
    """Sentence and command, on a line of its own, that mend a results folder.

    ``doubts`` and ``marks`` (the provenance of every readable table by artefact) are those of every
    data set with a problem; ``configs`` are the files of the ``plan``. Where no plan is given,
    that of config.yaml serves if the tables not in doubt were made with it; else the configuration
    is asked for, because another one would remake everything differently.
    """
    if plan is None:
        plan = _beside(folder, doubts, marks)
    if plan is None or not set(doubts) <= set(plan.datasets):
        again = shlex.join(["kinacc", "check-results", str(folder)])
        return (
            "Give the configuration file these results were made with (--config, once for each "
            f"file), and the command that mends them is printed: {again} --config FILE"
        )
    made, unmade = _files(folder, doubts, plan)
    commands = [shlex.join(["rm", *unmade])] if unmade else []
    if folder.name == RESULTS:
        whole = any(map(_is_studied, marks.values())) or not any(marks.values())
        commands.append(_snakemake(folder, configs, made, "" if whole else "calibration"))
    else:
        commands += _by_hand(folder, doubts, plan, configs)
    return f"To mend this, run\n  {' && '.join(commands)}"


def workflow_command(configs: Sequence[str], folder: Path | str = ".") -> list[str]:
    """Words of the command that runs the workflow from here, with its results in ``folder``."""
    words, is_here = ["snakemake", "-c2"], os.path.samefile(folder, ".")
    near = Path(folder) / "Snakefile"
    if not is_here or not near.is_file():
        words += ["-s", str(near if near.is_file() else SNAKEFILE)]
    if not is_here:
        words += ["--directory", str(folder)]
    if configs and not (is_here and list(configs) == [CONFIG]):
        words += ["--configfile", *configs]
    return words


def _is_studied(marks: Marks) -> bool:
    """Whether tables go beyond a calibration."""
    makers = {maker_of(each.partition("/")[0]) for each in marks}
    return any(
        not (stage.name in CALIBRATION or stage.fits or stage.leaves == PAGE) for stage in makers
    )


def _snakemake(folder: Path, configs: Sequence[str], made: Sequence[str], target: str) -> str:
    # The target comes first: options may take all words that follow them.
    first, *more = workflow_command(configs, folder.parent)
    words = [first, target, *more] if target else [first, *more]
    return shlex.join([*words, "--forcerun", *made] if made else words)


def _by_hand(
    folder: Path, doubts: Mapping[str, Collection[Doubt]], plan: Plan, configs: Sequence[str]
) -> list[str]:
    """Commands for a folder that only ``kinacc run --results`` leaves."""
    options = [word for name in configs for word in ("--config", name)]
    commands = []
    for dataset, own in doubts.items():
        wanted = {doubt.stage for doubt in own if _is_made(doubt, dataset, plan)}
        stages = plan.stages(dataset)
        for name in sorted(stages, key=lambda each: len(above(each))):
            if name in wanted or (wanted & above(name) and not stages[name].on_request):
                words = ["kinacc", "run", name, "--dataset", dataset, *options]
                commands.append(shlex.join([*words, "--results", str(folder)]))
    return commands


def _files(
    folder: Path, doubts: Mapping[str, Collection[Doubt]], plan: Plan
) -> tuple[list[str], list[str]]:
    """One file of every job to be run again, and files in doubt that no job makes.

    What follows from a job is run again with it and needs no mention.
    """
    made, unmade = [], []
    for dataset, own in doubts.items():
        foreign = {doubt for doubt in own if not _is_made(doubt, dataset, plan)}
        for doubt in foreign:
            paths = plan.outputs(doubt.stage, dataset, doubt.part).values()
            here = [folder / Path(path).relative_to(plan.results) for path in paths]
            unmade += [os.path.relpath(path) for path in here if path.exists()]
        wanted = {doubt.stage for doubt in set(own) - foreign}
        for doubt in sorted(set(own) - foreign, key=_order):
            if wanted & above(doubt.stage):
                continue
            parts = [doubt.part] if doubt.part else plan.part_names(doubt.stage, dataset)
            made += [next(iter(plan.outputs(doubt.stage, dataset, p).values())) for p in parts]
    return list(dict.fromkeys(made)), sorted(unmade)


def _is_made(doubt: Doubt, dataset: str, plan: Plan) -> bool:
    """Whether a run of the plan leaves the files in doubt."""
    parts = (None, *plan.part_names(doubt.stage, dataset))
    return doubt.stage in plan.stages(dataset) and doubt.part in parts


def _order(doubt: Doubt) -> tuple[int, str]:
    return list(STAGES).index(doubt.stage), doubt.part or ""


@cache
def above(name: str) -> frozenset[str]:
    """Names of all stages that a stage follows from."""
    stage = STAGES[name]
    direct = {maker_of(each).name for each in (*stage.inputs, *stage.optional)}
    return frozenset(direct.union(*map(above, direct)))


def _beside(
    folder: Path, doubts: Mapping[str, Collection[Doubt]], marks: Mapping[str, Marks]
) -> Plan | None:
    """The plan of config.yaml, if the folder's workflow runs here and the tables follow from it."""
    if not folder.is_dir() or not os.path.samefile(folder.parent, "."):
        return None
    try:
        plan = planned([CONFIG])
    except InputError:
        return None
    for dataset, own in marks.items():
        if dataset not in plan.datasets:
            return None
        doubtful = {doubt.stage for doubt in doubts.get(dataset, ())}
        for artefact, known in own.items():
            name = maker_of(artefact.partition("/")[0]).name
            if STAGES[name].leaves == PAGE:
                continue  # which may be written by itself, with settings of its own
            expected = config_hash(plan.settings(name, dataset))
            if name not in doubtful and known.get("config_hash") != expected:
                return None
    return plan
