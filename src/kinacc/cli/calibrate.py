"""``kinacc calibrate``: from a data set to its models and what they are worth."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.cli.choice import CONFIG
from kinacc.cli.exit_codes import STOPPED, TERMINATED

if TYPE_CHECKING:
    from kinacc.workflow.plan import Plan

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
    from kinacc.cli.fitted import summary
    from kinacc.cli.report import written
    from kinacc.workflow.answer import answer, read
    from kinacc.workflow.fleet import FEW

    configs, plan = carried_out("calibration", words, cores, default=None)
    if plan is None:
        return
    folders = {name: f"{plan.results}/{name}" for name in plan.told}
    if as_json:
        answers = {name: summary(folder) for name, folder in folders.items()}
        click.echo(json.dumps(answers, indent=2))
        return
    if len(folders) > FEW:
        show_many([*folders.values()])
        return
    more = shlex.join(["kinacc", "study", *configs])
    for folder in folders.values():
        written(folder, without=STUDIED)
        tables = {name: table for name, table in read(folder).items() if name not in STUDIED}
        click.echo("\n".join(["", *answer(folder, tables, following=[more])]))


def show_many(folders: Sequence[str], more: Sequence[str] = ()) -> None:
    """The table of many data sets, for half pages of all of them would not be read."""
    from kinacc.cli.summary import show
    from kinacc.workflow.fleet import standings

    found = standings([Path(folder) for folder in folders])
    one = shlex.quote(folders[0])
    words = f"kinacc fitted {one} says half a page on one, kinacc report {one} writes its page"
    show(found, [None] * len(found), "", ["", words, *more])


def carried_out(
    target: str, words: tuple[str, ...], cores: int | None, default: Path | None
) -> tuple[tuple[str, ...], Plan | None]:
    """Run the workflow up to a target: the configuration files and, after a real run, the plan.

    ``words`` are configuration files and, from the first that begins with ``-``, Snakemake's;
    without files config.yaml is meant, or the ``default`` where there is none. Leaves with
    Snakemake's exit code where that is not 0. Raises InputError for bad configuration.
    """
    from kinacc.errors import InputError, Problem
    from kinacc.workflow import measured_files
    from kinacc.workflow.plan import SNAKEFILE, planned

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
    plan = planned(configs)
    measured_files.check(plan)
    from kinacc.workflow import cost
    from kinacc.workflow.catalogue import CALIBRATION, STAGES

    only = CALIBRATION if target == "calibration" else STAGES
    if target == "calibration" or not more:  # where it is not quiet, Snakemake says it of a study
        for line in cost.expected(cost.foreseen(plan, only)):
            click.echo(line, err=True)
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(SNAKEFILE)]
    command += ["--cores", str(cores or os.cpu_count() or 1), "--configfile", *configs]
    if "--workflow-profile" not in more:
        command += profile_options()  # Snakemake would say that it uses them
    command += more or ["--quiet", "all"]  # stages say how far they are, and what goes wrong
    command += ["--no-hooks"]  # what a run ends with is said by the command
    # Words for Snakemake may change what is read.
    known = {} if words[first:] else {"KINACC_FILES_READ": "1"}
    code = _carried_out([*command, "--", target], os.environ | known)
    if code:
        raise SystemExit(code)
    ran = not {"-n", "--dry-run", "--dryrun", "--lint"} & set(more)
    return configs, plan if ran else None


def _carried_out(command: Sequence[str], environment: Mapping[str, str]) -> int:
    """The exit code of a command that ends in order where this one is told to stop.

    All processes of a terminal hear Ctrl-C; it does from when it can say so in a line, and until
    then from this process alone.
    """
    from kinacc.cli.group import Terminated

    def deaf() -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    with subprocess.Popen(command, env=environment, preexec_fn=deaf) as started:
        try:
            return started.wait()
        except KeyboardInterrupt as stop:
            with suppress(KeyboardInterrupt):
                started.terminate()
                if started.wait() > 0:  # and it has said so
                    code = TERMINATED if isinstance(stop, Terminated) else STOPPED
                    raise SystemExit(code) from None
            raise


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


def profile_options() -> list[str]:
    """The workflow's own profile as options."""
    import yaml

    from kinacc.workflow.plan import SNAKEFILE

    profile = SNAKEFILE.parent / "profiles" / "default" / "config.yaml"
    options = ["--workflow-profile", "none"]
    for name, value in yaml.safe_load(profile.read_text("utf-8")).items():
        values = value if isinstance(value, list) else [value]
        options += [f"--{name}", *(str(each) for each in values if each is not True)]
    return options
