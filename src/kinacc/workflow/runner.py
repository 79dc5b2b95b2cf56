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
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from importlib import import_module
from io import FileIO, TextIOWrapper
from pathlib import Path
from typing import TextIO

from kinacc import __version__
from kinacc.artifacts import provenance
from kinacc.errors import InputError, KinaccError, Problem, refused
from kinacc.progress import reporting

Paths = Mapping[str, str | Sequence[str]]


@dataclass(frozen=True)
class Job:
    """One run of a stage.

    ``inputs`` maps a role to a file, or to the files of a scattered artefact. ``outputs`` maps an
    artefact to its file, or a picture format to its file. ``settings`` are the configuration values
    of the stage, ``part`` which part of how many a scattered stage computes ("1-of-2"), ``uses``
    what its results depend on beside what its module imports, ``kind`` the error model it fits.
    ``label`` begins what is said of faults, ``doing`` what is said of progress. ``code``: hash of
    the code, where that is known already.
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
    code: str = ""


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
    tables = read_inputs(job.inputs)
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
    if isinstance(result, Mapping):
        _write_tables(job, result)
    elif "html" in job.outputs:
        from kinacc.artifacts.atomic import write_whole
        from kinacc.report.page import html

        read = {name: _content(name, paths) for name, paths in job.inputs.items()}
        content = html(result, stage_provenance(job), read)
        write_whole(job.outputs["html"], content.encode())
    else:
        from kinacc.figures.save import write

        write(result, {name: Path(path) for name, path in job.outputs.items()})


def stage_provenance(job: Job) -> dict[str, object]:
    """What the artefacts of a run are marked with; see the artefact contract."""
    return {
        "kinacc_version": __version__,
        "config_hash": provenance.config_hash(job.settings),
        "code_hash": job.code or provenance.stage_code_hash(job.module, job.uses),
        "inputs_hash": inputs_hash(job.inputs),
        "seed": job.seed,
    }


def inputs_hash(inputs: Paths) -> str:
    """Hash of what stands in the inputs of a stage.

    Raises InputError where parts of one artefact come from different states.
    """
    return provenance.inputs_hash({name: _content(name, paths) for name, paths in inputs.items()})


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


def read_inputs(inputs: Paths) -> dict[str, object]:
    """Columns of every Parquet input; scattered ones joined in order; other files as paths."""
    from kinacc.artifacts.store import read

    tables: dict[str, object] = {}
    for name, paths in inputs.items():
        if not isinstance(paths, str):
            tables[name] = _joined([read(path) for path in paths])
        elif name.endswith("_file"):
            tables[name] = Path(paths)
        else:
            tables[name] = read(paths)
    return tables


def _joined(parts: Sequence[Mapping[str, object]]) -> dict[str, object]:
    import numpy as np

    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _content(name: str, paths: str | Sequence[str]) -> str:
    """Content hash of an input; parts of one scattered artefact count as where they came from.

    The bytes of parts depend on how many there are, what they were made from does not.
    """
    if isinstance(paths, str):
        return provenance.file_hash(paths)
    from kinacc.artifacts.store import read_metadata, remake

    origins = {tuple(sorted(read_metadata(path).items())) for path in paths}
    if len(origins) != 1:
        raise InputError(
            Problem(
                ", ".join(paths),
                f"parts of {name} made from {len(origins)} different states",
                "parts of one run",
                remake(paths[0]),
            )
        )
    return provenance.inputs_hash({"origin": repr(origins.pop())})


def _write_tables(job: Job, tables: Mapping[str, Mapping[str, object]]) -> None:
    from kinacc.artifacts.store import TableToWrite, write_all

    if set(tables) != set(job.outputs):
        made, wanted = ", ".join(sorted(tables)), ", ".join(sorted(job.outputs))
        raise RuntimeError(f"{job.module} made {made}; the catalogue says {wanted}")
    marks = stage_provenance(job)
    write_all([TableToWrite(job.outputs[name], name, tables[name], marks) for name in tables])


@contextmanager
def _recording(path: str | None, label: str) -> Iterator[TextIO | None]:
    """Every warning to the screen and the log; the log is there, and empty if all went well."""
    if path is None:
        yield None
        return
    with _log(path, label) as log, warnings.catch_warnings():
        warnings.simplefilter("default")

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
