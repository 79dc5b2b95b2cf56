"""Running one stage: read its inputs, call it, write everything it made or nothing.

The same function serves a rule and a command. Whatever goes wrong, and every warning, is on the
screen and in the log.
"""

from __future__ import annotations

import gc
import inspect
import sys
import traceback
import warnings
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from importlib import import_module
from io import FileIO, TextIOWrapper
from pathlib import Path
from types import MappingProxyType
from typing import TextIO

from kinacc import __version__
from kinacc.artifacts import pictures, provenance, records
from kinacc.artifacts.contract import INPUTS_DIGESTS, PROVENANCE_KEYS
from kinacc.errors import InputError, KinaccError, refused
from kinacc.progress import reporting
from kinacc.workflow.inputs import Paths, digests, read_inputs


@dataclass(frozen=True)
class Job:
    """One run of a stage.

    ``inputs`` maps a role to a file, or to the files of a scattered artefact. ``outputs`` maps an
    artefact to its file, or a picture format to its file. ``settings`` are the configuration values
    of the stage, ``part`` which part of how many a scattered stage computes ("1-of-2"), ``uses``
    what its results depend on beside what its module imports, ``kind`` the error model it fits.
    ``label`` begins what is said of faults, ``doing`` what is said of progress. ``record``: the
    file that the run of ``stage`` leaves last; empty where its files stand in no folder of a data
    set. ``remake``: the command that makes an input again, see
    :func:`kinacc.workflow.inputs.read_inputs`.
    """

    module: str
    inputs: Paths
    outputs: Mapping[str, str]
    settings: Mapping[str, object]
    seed: int
    part: str | None = None
    label: str = ""
    doing: str = ""
    log: str | None = None
    uses: tuple[str, ...] = ()
    kind: str = ""
    stage: str = ""
    record: str = ""
    remake: str = ""


def execute(job: Job, bar: bool = False) -> None:
    """Run a stage; on failure print the reason, log it and leave with exit code 1."""
    label = job.label or job.module.rpartition(".")[2]
    with _recording(job.log, label) as log, reporting(job.doing or label, bar) as progress:
        try:
            perform(job, progress)
            return
        except KinaccError as error:
            reason = f"{label}: {error}\n"
        except OSError as error:
            reason = f"{label}: {refused(error)}\n"
        except MemoryError as error:
            reason = f"{label}: there is not enough memory: {error or 'ask for less'}\n"
        except Exception:
            reason = f"{label} failed:\n{traceback.format_exc()}"
        _tell(reason, log)
    raise SystemExit(1)


def _tell(text: str, log: TextIO | None) -> None:
    """Write to the screen and the log, as far as they take it."""
    for stream in filter(None, (sys.stderr, log)):
        with suppress(OSError):
            stream.write(text)
            stream.flush()


def perform(job: Job, progress: object = None) -> None:
    """Run a stage and let its errors through."""
    tables, read = read_inputs(job.inputs, job.remake)
    stage = import_module(job.module)
    if not gc.isenabled():
        # What is imported stays; a collection need not look at it each time.
        gc.freeze()
        gc.enable()
    settings = dict(job.settings)
    if job.part is not None:
        number, _, count = job.part.partition("-of-")
        settings["part"] = {"number": int(number), "of": int(count)}
    more: dict[str, object] = {"kind": job.kind} if job.kind else {}
    if "progress" in inspect.signature(stage.run).parameters:
        more["progress"] = progress
    result = stage.run(tables, settings, **more)
    marks = stage_provenance(job, read)
    records.leave(job.record, _record(job, marks, read), _written(job, result, marks, read))


def stage_provenance(
    job: Job, inputs_digests: Mapping[str, str] | None = None
) -> dict[str, object]:
    """What the artefacts of a run are marked with; see the artefact contract.

    ``inputs_digests``: of its inputs by role, where they are known already. Raises InputError where
    parts of one artefact come from different states.
    """
    found = digests(job.inputs) if inputs_digests is None else inputs_digests
    return {
        "kinacc_version": __version__,
        "config_hash": provenance.config_hash(job.settings),
        "code_hash": provenance.stage_code_hash(job.module, job.uses),
        "inputs_hash": provenance.inputs_hash(found),
        "seed": job.seed,
        INPUTS_DIGESTS: pictures.as_text(found),
    }


def is_done(job: Job) -> bool:
    """Whether the files of a job are there, whole, made from the same inputs, settings and code."""
    try:
        record = records.read(job.record)
        read = digests(job.inputs)
        wanted = _record(job, stage_provenance(job, read), read, record.files)
        return record == wanted and not records.misfits(job.record, record)
    except (InputError, OSError):
        return False


def _record(
    job: Job,
    marks: Mapping[str, object],
    inputs_digests: Mapping[str, str],
    files: Mapping[str, records.Written] = MappingProxyType({}),
) -> records.Record:
    code = provenance.stage_code(job.module, job.uses)
    return records.Record(
        job.stage,
        job.part,
        {key: str(marks[key]) for key in PROVENANCE_KEYS},
        dict(inputs_digests),
        files,
        provenance.told_settings(job.settings),
        code.files,
        code.versions,
    )


def _written(
    job: Job, result: object, marks: Mapping[str, object], read: Mapping[str, str]
) -> dict[str, tuple[bytes, str | None]]:
    """By path the content of every file a stage leaves and, of a table, its columns' digest."""
    if isinstance(result, Mapping):
        from kinacc.artifacts.store import COLUMNS_DIGEST, content_of, to_table

        if set(result) != set(job.outputs):
            made, wanted = ", ".join(sorted(result)), ", ".join(sorted(job.outputs))
            raise RuntimeError(f"{job.module} made {made}; the catalogue says {wanted}")
        tables = {name: to_table(name, columns, marks) for name, columns in result.items()}
        return {
            job.outputs[name]: (
                content_of(table),
                table.schema.metadata[COLUMNS_DIGEST.encode()].decode(),
            )
            for name, table in tables.items()
        }
    if "html" in job.outputs:
        from kinacc.report.page import html

        own = {key: marks[key] for key in PROVENANCE_KEYS}
        return {job.outputs["html"]: (html(result, own, read).encode(), None)}
    from kinacc.figures.save import render

    drawn = render(result, job.outputs, read)
    return {job.outputs[kind]: (content, None) for kind, content in drawn.items()}


@contextmanager
def _recording(path: str | None, label: str) -> Iterator[TextIO | None]:
    """Every warning to the screen and the log; the log is there, and empty if all went well."""
    if path is None:
        yield None
        return
    with _log(path, label) as log, warnings.catch_warnings():
        warnings.simplefilter("default")
        warnings.simplefilter("ignore", ResourceWarning)  # of a file that was open at Ctrl-C

        def show(message, category, filename, lineno, file=None, line=None) -> None:
            # A plain warning speaks to the user; others (overflow, deprecation) to a developer.
            text = f"{label}: {message}\n"
            if category is not UserWarning:
                text = f"{label}: " + warnings.formatwarning(message, category, filename, lineno)
            _tell(text, log)

        warnings.showwarning = show
        yield log


def _log(path: str, label: str) -> AbstractContextManager[TextIO | None]:
    """A log's file, or none where the machine refuses it: a stage can do its work without."""
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        # Nothing is kept back, so that closing a log on a full disk has nothing left to write.
        return TextIOWrapper(FileIO(path, "w"), "utf-8", write_through=True)
    except OSError as error:
        _tell(f"{label}: {refused(error, path, 'no log is written')}\n", None)
        return nullcontext()
