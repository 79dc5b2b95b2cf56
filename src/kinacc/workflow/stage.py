"""One stage as a job of the workflow, whose rules start it by one command in a shell.

Snakemake goes by the command and by a job's text where it decides what to make anew, and what a
shared cache has already: neither says where anything is, only what results depend on.
"""

from __future__ import annotations

import gc
import json
import os
import re
import shlex
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from kinacc.starting import ONE_THREAD, without_tools_of_numpy
from kinacc.workflow.catalogue import STAGES, TABLES
from kinacc.workflow.inputs import Paths
from kinacc.workflow.results_lock import InUse, joined
from kinacc.workflow.runner import Job, execute

if TYPE_CHECKING:
    from logging import LogRecord

COMMAND = (
    'exec "$KINACC_PYTHON" -P "$KINACC_STAGE" "$KINACC_FOLDER" --job {params.job:q}'
    " --input {input:q} --output {output:q} --log {log:q}"
)
_AS_SAID = re.compile(r'exec "\$KINACC_PYTHON".* --log .*(?=\' (?:returned|died))', re.DOTALL)


def job_of(
    name: str,
    dataset: str,
    part: str | None,
    inputs: Paths,
    outputs: Mapping[str, str],
    settings: Mapping[str, object],
    seed: int,
    log: str,
    record: str,
) -> Job:
    """One run of a stage, with what the catalogue says of it; see :class:`Job`."""
    stage = STAGES[name]
    return Job(
        stage.module,
        inputs,
        outputs,
        settings,
        seed,
        part,
        label=label(name, dataset, part),
        doing=doing(name, dataset, part),
        log=log,
        uses=stage.used(settings, inputs),
        kind=stage.fits,
        stage=name,
        record=record,
    )


def label(name: str, dataset: str, part: str | None = None) -> str:
    """What lines on screen about one run of a stage begin with."""
    return " ".join(filter(None, [dataset, name, part]))


def doing(name: str, dataset: str, part: str | None = None) -> str:
    """What one run of a stage is doing, in words."""
    return ", ".join(filter(None, [f"{dataset}: {STAGES[name].message}", part and f"part {part}"]))


def to_text(
    name: str,
    dataset: str,
    part: str | None,
    inputs: Paths,
    settings: Mapping[str, object],
    seed: int,
    code: str,
) -> str:
    """A job without its files; of inputs their roles and, where they are in parts, how many.

    ``code`` is the hash of the code for Snakemake alone: who carries the job out works it out anew,
    since another Python, as of a conda environment, has other libraries.
    """
    reads = {role: 0 if isinstance(each, str) else len(each) for role, each in inputs.items()}
    told = {"stage": name, "dataset": dataset, "part": part, "reads": reads, "seed": seed}
    # The order of keys is kept: where settings are a list of things, they are done in that order.
    return json.dumps(told | {"code": code, "settings": settings}, separators=(",", ":"))


def from_words(words: Sequence[str]) -> Job:
    """The job of the command's options.

    Files stand in the order of their roles; inputs before them have to be there and are not read.
    The last output is the record.
    """
    given = {option: list(values) for option, values in _by_option(words)}
    (text,), (log,) = given["--job"], given["--log"]
    told = json.loads(text)
    stage, reads = STAGES[told["stage"]], told["reads"]
    files = given["--input"]
    read = iter(files[len(files) - sum(max(count, 1) for count in reads.values()) :])
    inputs = {
        role: [next(read) for _ in range(count)] if count else next(read)
        for role, count in reads.items()
    }
    *outputs, record = given["--output"]
    roles = stage.outputs if stage.leaves == TABLES else [Path(each).suffix[1:] for each in outputs]
    job = job_of(
        told["stage"],
        told["dataset"],
        told["part"],
        inputs,
        dict(zip(roles, outputs, strict=True)),
        told["settings"],
        told["seed"],
        log,
        record,
    )
    return replace(job, remake=os.environ.get("KINACC_REMAKE", ""))


def _by_option(words: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    places = [words.index(option) for option in ("--job", "--input", "--output", "--log")]
    for begin, end in zip(places, [*places[1:], len(words)], strict=True):
        yield words[begin], list(words[begin + 1 : end])


def main(words: Sequence[str]) -> None:
    """Carry out the job of a command; a signal to stop leaves nothing half-written.

    Imports leave nothing to collect, and at the end the system takes back all memory at once: a
    tenth of a short stage went into looking.
    """
    gc.disable()
    os.environ.update(ONE_THREAD)
    without_tools_of_numpy()
    signal.signal(signal.SIGTERM, _stop)
    try:
        with joined():
            execute(from_words(words))
        gc.freeze()
    except InUse as error:
        raise SystemExit(str(error)) from None
    except (KeyboardInterrupt, _Stopped) as stop:
        _end(signal.SIGTERM if isinstance(stop, _Stopped) else signal.SIGINT)


def python_of_stages(workflow: Any) -> str:
    """The Python that carries out the stages of a Snakemake workflow: its own, or an environment's.

    Where it is not its own, the environment has it in its PATH.
    """
    methods = {method.name for method in workflow.deployment_settings.deployment_method}
    image = "APPTAINER" in methods and workflow.modifier.global_container_img
    return "python" if "CONDA" in methods or image else sys.executable


def remaking(workflow: Any) -> str:
    """The command that makes one {file} of a run of Snakemake again, and what follows from it.

    Jobs of a cluster start Snakemake anew: what the first one said of itself holds.
    """
    if workflow.remote_exec and "KINACC_REMAKE" in os.environ:
        return os.environ["KINACC_REMAKE"]
    elsewhere = workflow.overwrite_workdir
    put = os.path.abspath if elsewhere else os.path.relpath
    words = ["snakemake", "-c2"]
    if elsewhere or put(workflow.main_snakefile) not in ("Snakefile", "workflow/Snakefile"):
        words += ["-s", put(workflow.main_snakefile)]
    if elsewhere:
        words += ["--directory", str(elsewhere)]
    if workflow.overwrite_configfiles:
        words += ["--configfile", *map(put, workflow.overwrite_configfiles)]
    if given := workflow.config_settings.config:
        words += ["--config", *(f"{key}={json.dumps(value)}" for key, value in given.items())]
    return f"{shlex.join(words)} --forcerun {{file}}{{target}}"


def without_commands(record: LogRecord) -> bool:
    """Leave the command that starts a stage out of what Snakemake says of one that failed.

    The stage has said what is wrong; the command's text of settings would fill the screen.
    """
    if getattr(record, "event", None) in ("job_error", "error"):
        if hasattr(record, "shellcmd"):
            record.shellcmd = None
        if isinstance(record.msg, str):
            record.msg = _AS_SAID.sub("kinacc.workflow.stage", record.msg)
    return True


class _Stopped(BaseException):
    """The job was told to stop."""


def _stop(*_: object) -> NoReturn:
    raise _Stopped


def _end(by: signal.Signals) -> None:
    """End as a process does that a signal ends, so that whoever started it hears of that."""
    signal.signal(by, signal.SIG_DFL)
    os.kill(os.getpid(), by)


if __name__ == "__main__":
    main(sys.argv[1:])
