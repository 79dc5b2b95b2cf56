"""What a run of Snakemake has beside it: the lock of the results, a tidy start, a clear end.

Snakemake's own lock is a file that outlives a run that was killed. Here the system's lock takes its
place, what killed runs left is removed, and Ctrl-C and SIGTERM end a run at once, in one line.
"""

from __future__ import annotations

import atexit
import base64
import json
import logging
import os
import re
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinacc.artifacts.atomic import abandoned, held, sweep, unfinished
from kinacc.errors import KinaccError, refused
from kinacc.workflow.results_lock import forget, joined, running

if TYPE_CHECKING:
    from kinacc.workflow.plan import Plan

_OWN = Path(".snakemake")
_CACHE = "SNAKEMAKE_OUTPUT_CACHE"
_NUMBER = re.compile(r"kinacc-[0-9a-f]{16}-")
# Folders that Snakemake makes for a run: in TMPDIR, and beside its cache of source files.
_MADE = re.compile(r"snakemake[a-z0-9_]{8}|snakemake-runtime-cache/tmp[a-z0-9_]{8}")
_ALL = {"all", "everything"}  # targets that are all of a run
_STOPS = (signal.SIGINT, signal.SIGTERM)
_PATIENCE_S = 2.0  # a compiled kernel keeps a polite signal waiting


def attend(workflow: Any, results: str, plan: Callable[[], Plan]) -> None:
    """Let the workflow that is being read hold its results while jobs run.

    ``results``: where a path in the results folder would be, as rules would write it. ``plan`` is
    asked for when the workflow has been read.
    """
    is_module = bool(workflow.modifier.namespace)  # then all but results is the other workflow's
    elsewhere = workflow.storage_settings.default_storage_provider is not None
    folder = _OWN if elsewhere else Path(str(workflow.modifier.modify_path(results))).parent
    stop = Stop(folder)
    logging.raiseExceptions = False  # a disk that takes no log of Snakemake's is said once
    if not is_module:
        mine = [workflow.snakemake_tmp_dir, Path(workflow.sourcecache.runtime_cache_path)]
        _note_what_this_run_leaves(mine)
        _remove_what_killed_runs_left()
        if workflow.is_main_process:
            _remove_empty_folders(mine)
            stop.listen()
    execute = workflow.execute

    def attended(*args: Any, **named: Any) -> object:
        try:
            if workflow.is_main_process and not is_module:
                _say_what_is_ahead(workflow, plan())
            if (named.get("executor_plugin") or args[0]).common_settings.dryrun_exec:
                return execute(*args, **named)
            # What is no main process is a job: on a node of a cluster, say.
            with running(folder) if workflow.is_main_process else joined():
                if workflow.is_main_process and not is_module:
                    workflow.execution_settings.lock = False
                    stop.replace_snakemakes()
                    _remove_scripts()
                    _doubt_what_snakemake_does_not_know(plan())
                return execute(*args, **named)
        except KinaccError as error:
            print(error, file=sys.stderr)
            raise SystemExit(1) from None
        except BaseException as error:
            stop.end_if_asked()
            if isinstance(error, OSError):
                print(refused(error, error.filename or folder), file=sys.stderr)
                raise SystemExit(1) from None
            raise

    workflow.execute = attended


class Stop:
    """Ctrl-C and SIGTERM: said in a line, after which Snakemake has nothing more to say."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.code = 0
        self.asked_s = 0.0

    def listen(self) -> None:
        """Take the signals, of which jobs of a terminal hear nothing."""
        from snakemake.logging import logger
        from snakemake.shell import shell

        if threading.current_thread() is not threading.main_thread():
            return
        for each in _STOPS:
            signal.signal(each, self)
        logger.addFilter(lambda record: not self.code)
        # Ctrl-C reaches every process of a terminal; a job that begins would show where it stood.
        shell.prefix("trap '' INT; set -euo pipefail; ")

    def replace_snakemakes(self) -> None:
        """End at SIGTERM as well, where Snakemake would finish jobs that may take hours."""
        with suppress(ImportError):
            from snakemake.scheduling.job_scheduler import JobScheduler

            JobScheduler.exit_gracefully = lambda _, *signals: self(*signals)

    def __call__(self, number: int, *_: object) -> None:
        if self.code:
            # A terminal and the command that started this may both say so.
            if time.monotonic() - self.asked_s > _PATIENCE_S:
                os._exit(self.code)
            return
        self.code, self.asked_s = 128 + number, time.monotonic()
        os.write(2, b"stopped; what is finished is kept, and the same command goes on from there\n")
        _end_jobs()
        raise SystemExit(self.code)

    def end_if_asked(self) -> None:
        """Leave with the signal's code, and nothing half-written, if there was one."""
        if self.code:
            sweep(self.folder)
            raise SystemExit(self.code) from None


def _say_what_is_ahead(workflow: Any, plan: Plan) -> None:
    """Say what a run of everything costs where that is a lot.

    Raises InputError where this machine cannot hold it; nodes of a cluster may have more memory.
    """
    from snakemake.logging import logger

    from kinacc.workflow import cost

    if set(workflow.dag_settings.targets) <= _ALL:
        for line in cost.expected(cost.foreseen(plan), workflow.resource_settings.nodes is None):
            logger.info(line)


def _end_jobs() -> None:
    """Ask the processes of jobs to end; they have to after a while."""
    import psutil

    def end(how: str) -> None:
        for each in jobs:
            with suppress(psutil.Error):
                getattr(each, how)()

    jobs = psutil.Process().children(recursive=True)
    end("terminate")
    late = threading.Timer(_PATIENCE_S, end, ["kill"])
    late.daemon = True
    late.start()


def _note_what_this_run_leaves(folders: Sequence[Path]) -> None:
    """Write down the temporary folders of this process, in a file held until it ends."""
    number = f"kinacc-{os.urandom(8).hex()}-"
    tempfile.template = number  # begins the names of folders that the shared cache is filled from
    note = unfinished(_OWN / "run")
    told = {"host": os.uname().nodename, "folders": [*map(str, folders)], "cache": number}
    with suppress(OSError):  # nothing can be noted in a folder that cannot be written
        _OWN.mkdir(exist_ok=True)
        kept = ExitStack()
        handle = kept.enter_context(held(note))
        atexit.register(note.unlink, missing_ok=True)
        atexit.register(kept.close)
        os.write(handle, json.dumps(told).encode())


def _remove_what_killed_runs_left() -> None:
    """Remove temporary folders of runs of this machine that did not come to their end."""
    for note in _OWN.glob(".run.*.partial"):
        try:
            told = json.loads(note.read_bytes())
            folders, number = [*map(Path, told["folders"])], str(told["cache"])
            here = told["host"] == os.uname().nodename
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            folders, number, here = [], "", True
        if not here or not abandoned(note):
            continue
        if _NUMBER.fullmatch(number) and os.environ.get(_CACHE):
            folders += Path(os.environ[_CACHE]).glob(f"{number}*")
        for folder in folders:
            if _is_made(folder) or _NUMBER.match(folder.name):
                _remove(folder)
        note.unlink(missing_ok=True)


def _remove_empty_folders(mine: Sequence[Path]) -> None:
    """Remove folders like ``mine`` of runs that were killed before they could note them.

    They are empty, and older than any Snakemake at work that shares them. One that is at work
    nevertheless, on another machine, makes them anew when it needs them.
    """
    with suppress(OSError):
        found = [
            folder
            for place in {each.parent for each in mine}
            for folder in place.iterdir()
            if _is_made(folder) and folder not in mine and not any(folder.iterdir())
        ]
        oldest_s = _oldest_start_s() if found else 0.0
        for folder in found:
            if folder.stat().st_mtime < oldest_s:
                folder.rmdir()


def _oldest_start_s() -> float:
    """When the oldest Snakemake at work began that puts temporary files where this one does."""
    import psutil

    begun = [psutil.Process().create_time()]
    for each in psutil.process_iter():
        with suppress(psutil.Error):
            if "snakemake" not in " ".join(each.cmdline()) or each.uids().real != os.getuid():
                continue
            if each.environ().get("TMPDIR") == os.environ.get("TMPDIR"):
                begun.append(each.create_time())
    return min(begun)


def _is_made(folder: Path) -> bool:
    """Whether a name is one that Snakemake gives to a folder of its own."""
    within = folder.parent.name == "snakemake-runtime-cache"
    name = f"{folder.parent.name}/{folder.name}" if within else folder.name
    return _MADE.fullmatch(name) is not None


def _remove_scripts() -> None:
    """Remove scripts that Snakemake wrote for jobs of runs that were killed; none runs now."""
    for pattern in ("scripts/tmp*", "shell_tmp.*"):
        for path in _OWN.glob(pattern):
            _remove(path)


def _doubt_what_snakemake_does_not_know(plan: Plan) -> None:
    """Forget runs of other settings, code or inputs, which Snakemake would not compare."""
    try:
        names = set(os.listdir(_OWN / "metadata"))
    except OSError:
        names = set()

    def known(path: str) -> bool:
        return base64.urlsafe_b64encode(path.encode()).decode() in names

    for path in plan.others(known):
        forget(Path(path))


def _remove(path: Path) -> None:
    with suppress(OSError):
        if path.is_symlink() or path.stat().st_uid != os.geteuid():
            return
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
