"""One run at a time in a results folder, by locks of the operating system.

The system lets go of a lock when the process that holds it ends, however it ends. ``.lock`` is held
by a run, whose name stands in it, or shared by commands that make one part each. ``.lock-jobs`` is
shared by the jobs of a run: those that outlive it keep the next one waiting. Both are empty files
when nothing runs. The standard library alone, since every job imports this.
"""

from __future__ import annotations

import fcntl
import json
import os
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from kinacc.artifacts.atomic import sweep, taken
from kinacc.errors import InputError, KinaccError, refused
from kinacc.workflow.catalogue import STAGES

LOCK, JOBS = ".lock", ".lock-jobs"
RUN = "KINACC_RUN"  # in the environment of jobs: the number of their run, and its folder
_PATIENCE_S = 2.0  # a process that was killed a moment ago may still be ending
_JOB_PATIENCE_S = 60.0  # a run that starts is alone while it tidies up
_HELD: list[TextIO] = []  # by this process, and by copies of it until they say whose job they are


class InUse(KinaccError):
    """Somebody else is at work in a results folder."""


def _tell(words: str) -> None:
    print(words, file=sys.stderr, flush=True)


@contextmanager
def running(results: Path | str, tell: Callable[[str], object] = _tell) -> Iterator[None]:
    """Hold a results folder for one run, and remove what runs that were killed left in it.

    Jobs of a run that was killed are waited for. Where the last run did not come to its end, by a
    loss of power perhaps, every file is held to its record first, and the records of those that
    were not written to their end are removed, so that they are made anew. Raises InUse where
    another run, of this or another machine, is at work in the folder.
    """
    with _opened(results, LOCK, tell) as lock, _opened(results, JOBS, tell) as jobs:
        if not _taken(lock, fcntl.LOCK_EX, _PATIENCE_S):
            raise InUse(
                f"{results}: {_whose(lock)}; nothing was done, start this when it has ended"
            )
        if not _taken(jobs, fcntl.LOCK_EX, _PATIENCE_S):
            tell(
                f"{results}: waiting for jobs of a run that was ended, and which are still at work"
            )
            _taken(jobs, fcntl.LOCK_EX)
        number, fell = os.urandom(8).hex(), bool(os.fstat(lock.fileno()).st_size)
        _name(lock, number)
        _HELD[:] = [lock, jobs]
        os.environ[RUN] = f"{number} {Path(results).absolute()}"
        try:
            sweep(results)
            if fell:
                _doubt_torn_files(results, tell)
            _taken(jobs, fcntl.LOCK_UN)
            yield
        finally:
            os.environ.pop(RUN, None)
            _HELD.clear()
            lock.truncate(0)


@contextmanager
def sharing(results: Path | str, tell: Callable[[str], object] = _tell) -> Iterator[None]:
    """Be one of several commands that make a part each. Raises InUse where a run is at work."""
    with _opened(results, LOCK, tell) as lock:
        if not _taken(lock, fcntl.LOCK_SH, _PATIENCE_S):
            raise InUse(
                f"{results}: {_whose(lock)}; nothing was done, start this when it has ended"
            )
        lock.truncate(0)  # what a run that was killed left in it
        sweep(results)
        yield


@contextmanager
def undisturbed(results: Path | str) -> Iterator[None]:
    """Look at a results folder that nobody writes to; holds nobody up.

    Raises InUse where a run is seen to be at work when it begins, ends or fails.
    """
    _refuse_if_at_work(results)
    try:
        yield
    except (KinaccError, OSError):
        _refuse_if_at_work(results)
        raise
    _refuse_if_at_work(results)


def _refuse_if_at_work(results: Path | str) -> None:
    try:
        lock = open(Path(results, LOCK), encoding="utf-8")  # noqa: SIM115 closed by the next block
    except OSError:
        return
    with lock:
        if not _taken(lock, fcntl.LOCK_SH, 0.0):
            raise InUse(f"{results}: {_whose(lock)}; look at it when that has ended")


def refuse_while_running(results: Path | str) -> None:
    """Raise InUse where a run is at work in a folder, or in the one that it stands in."""
    for place in (Path(results), Path(results).resolve().parent):
        with suppress(OSError), open(place / LOCK, encoding="utf-8") as lock:
            if not _taken(lock, fcntl.LOCK_SH, 0.0):
                raise InUse(f"{place}: {_whose(lock)}; start this when it has ended")


@contextmanager
def joined() -> Iterator[None]:
    """Be a job of the run that the environment names, if it names one that is seen from here.

    Raises InUse where that run has ended, and another one is at work.
    """
    for file in _HELD:  # a copy of the run's process would hold the folder after the run's end
        os.close(file.fileno())
    _HELD.clear()
    number, _, folder = os.environ.get(RUN, "").partition(" ")
    try:
        jobs = open(Path(folder, JOBS), encoding="utf-8") if folder else None  # noqa: SIM115
    except OSError:  # in a container, or on a machine with other folders
        jobs = None
    if jobs is None:
        yield
        return
    with jobs:
        _taken(jobs, fcntl.LOCK_SH, _JOB_PATIENCE_S)
        now = _read(Path(folder, LOCK)).get("run", number)
        if now != number:
            raise InUse(f"{folder}: the run that started this job was ended, and another one began")
        yield


@contextmanager
def _opened(results: Path | str, name: str, tell: Callable[[str], object]) -> Iterator[TextIO]:
    """A lock's file; says so where the file system cannot lock it."""
    path = Path(results, name)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = open(path, "a+", encoding="utf-8")  # noqa: SIM115 closed by the next block
    except OSError as error:
        raise refused(error, path, "cannot be written") from None
    with file:
        try:
            if taken(file.fileno(), fcntl.LOCK_SH, 0.0):
                fcntl.flock(file, fcntl.LOCK_UN)
        except OSError:
            if name == LOCK:
                tell(f"{results}: this file system has no locks: see that nothing else runs in it")
        yield file


def _taken(file: TextIO, how: int, patience_s: float | None = None) -> bool:
    """Whether a lock was had; a file system without locks has every lock for everybody."""
    try:
        return taken(file.fileno(), how, patience_s)
    except OSError:
        return True


def _name(lock: TextIO, number: str) -> None:
    """Say in a lock's file whose it is."""
    program = Path(sys.argv[0])
    program = program.parent if program.stem == "__main__" else program
    words = shlex.join([program.name, *sys.argv[1:]])
    told = {"run": number, "host": os.uname().nodename, "process": os.getpid()}
    lock.truncate(0)
    lock.write(json.dumps(told | {"command": words if len(words) < 80 else words[:77] + "..."}))
    lock.flush()
    with suppress(OSError):  # not on a device that cannot
        os.fsync(lock.fileno())  # after a loss of power it tells that a run was at work


def _doubt_torn_files(results: Path | str, tell: Callable[[str], object]) -> None:
    """Forget every run whose record does not fit its files: what goes by it is made anew."""
    from kinacc.artifacts import records

    for place in sorted(Path(results).glob(f"*/{records.FOLDER}/*.json")):
        try:
            torn = records.misfits(place, records.read(place))
        except InputError as error:
            torn = list(error.problems)
        if torn:
            tell(f"{torn[0].where} {torn[0].what}: after a run that did not end, it is made anew")
            forget(place)


def forget(place: Path) -> None:
    """Remove the record of a run and the files it is about, so that Snakemake makes them anew."""
    from kinacc.artifacts import records

    folder = records.folder_of(place)
    try:
        names = list(records.read(place).files)
    except InputError:  # by where files of its stage are
        stage, _, part = place.stem.partition(".")
        pictures = folder.glob(f"figures/{stage}.*")
        names = [f"{stage}.html", *(str(path.relative_to(folder)) for path in pictures)]
        for artefact in STAGES[stage].outputs if stage in STAGES else ():
            names.append(f"{artefact}/{part}.parquet" if part else f"{artefact}.parquet")
    for name in names:
        if not Path(name).is_absolute() and ".." not in Path(name).parts:
            (folder / name).unlink(missing_ok=True)
    place.unlink(missing_ok=True)


def _whose(lock: TextIO) -> str:
    told = _read(Path(lock.name))
    if not told:
        return "commands that make single parts are at work in it"
    by = f"process {told.get('process')} on {told.get('host')}"
    return f"another run is at work in it: {told.get('command')} ({by})"


def _read(path: Path) -> dict[str, object]:
    try:
        told = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return told if isinstance(told, dict) else {}
