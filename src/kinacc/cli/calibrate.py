"""``kinacc calibrate``: from a data set to its models and what they are worth."""

from __future__ import annotations

import json
import os
import shlex
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.cli.choice import CONFIG

if TYPE_CHECKING:
    from kinacc.workflow.data_sets import DataSets

# Made by a study, perhaps of an earlier calibration.
STUDIED = (
    *("accuracy_map", "assessment_points", "study", "study_summary", "readings", "histories"),
    "claims",
)
WORDS = {"ignore_unknown_options": True}
CORES = click.option(
    "--cores", "-c", type=click.IntRange(1), help="Processor cores to use. [all there are]"
)
JSON = click.option("--json", "as_json", is_flag=True, help="Print the answer as JSON.")
TARGETS = click.argument("words", nargs=-1, type=click.UNPROCESSED, metavar="[FILE.yaml|FOLDER]...")


@click.command("calibrate", context_settings=WORDS)
@CORES
@JSON
@TARGETS
def calibrate(words: tuple[str, ...], cores: int | None, as_json: bool) -> None:
    """Fit the models of the data sets of FILE.yaml, and say what they are worth.

    Checks the measurements, fits the VEC and the DH model, holds poses out to judge them, and
    leaves all tables in results/, in the folder it is called in. What is up to date is not made
    again. Several files, or all of a FOLDER, are merged in order. Of many data sets a table is
    shown, that of `kinacc summary`, and no pages are written. Words after -- go to Snakemake.

    \b
    Example:
      kinacc calibrate tracker.yaml
      kinacc calibrate robots
      kinacc calibrate tracker.yaml -- --dry-run
    """
    from kinacc.cli.report import written
    from kinacc.cli.summary import as_plain
    from kinacc.report.summarise import summarise_all
    from kinacc.report.terminal import FEW, print_summaries
    from kinacc.workflow.data_sets import RESULTS

    configs, data = carried_out("calibration", words, cores, default=None)
    if data is None:
        return
    folders = [Path(RESULTS, name) for name in data.told]
    if as_json:
        found = summarise_all(folders)
        click.echo(json.dumps(as_plain(found), indent=2))
        return
    pages = [written(str(each), without=STUDIED) for each in folders if len(folders) <= FEW]
    print_summaries(folders, without=STUDIED)
    if pages:
        click.echo(f"Page: {', '.join(map(str, pages))}")
    click.echo(f"Accuracy map, study and claims: {shlex.join(['kinacc', 'study', *configs])}")


def carried_out(
    target: str, words: tuple[str, ...], cores: int | None, default: Path | None
) -> tuple[tuple[str, ...], DataSets | None]:
    """Run the workflow up to a target: the configuration files and, after a real run, the data.

    ``words`` are configuration files and, from the first that begins with ``-``, Snakemake's;
    without files config.yaml is meant, or the ``default`` where there is none. Leaves with
    Snakemake's exit code where that is not 0. Raises InputError for bad configuration.
    """
    from kinacc.errors import InputError, Problem
    from kinacc.workflow.data_sets import RESULTS, read_data_sets
    from kinacc.workflow.running import held
    from kinacc.workflow.start import run_workflow

    first = next((i for i, word in enumerate(words) if word.startswith("-")), len(words))
    configs, more = words[:first], list(words[first:])
    if not configs and Path(CONFIG).is_file():
        configs = (CONFIG,)
    elif not configs and default is not None:
        configs = (str(default),)
    elif not configs:
        what = f"no configuration file is given, and there is no {CONFIG} here"
        fix = "kinacc init MEASUREMENTS writes one; then: kinacc calibrate NAME.yaml"
        raise InputError(Problem("FILE.yaml", what, fix=fix))
    configs = tuple(each for word in configs for each in _files(word))
    data = read_data_sets(configs)
    ran = not {"-n", "--dry-run", "--dryrun", "--lint"} & set(more)
    with held(RESULTS) if ran else nullcontext():  # --no-hooks leaves out what holds them
        code = run_workflow(target, configs, cores or os.cpu_count() or 1, more)
    if code:
        raise SystemExit(code)
    return configs, data if ran else None


def _files(word: str) -> list[str]:
    """The configuration files of a word: itself, or those in a folder, without robot files.

    Raises InputError for a folder without any.
    """
    from kinacc.errors import InputError, Problem

    if not Path(word).is_dir():
        return [word]
    found = sorted(str(each) for each in Path(word).glob("*.yaml"))
    found = [each for each in found if not each.endswith(".robot.yaml")]
    if not found:
        fix = "kinacc init MEASUREMENTS --out FOLDER writes one"
        raise InputError(Problem(word, "is a folder without configuration files", "*.yaml", fix))
    return found
