"""Jobs of a command: one after another, or several at a time in processes that it outlives."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import Process, connection
from pathlib import Path

from kinacc.workflow.runner import Job, execute

_STOPS = (signal.SIGINT, signal.SIGTERM)


def execute_all(jobs: Sequence[Job], cores: int = 1) -> Iterator[Job]:
    """Run jobs, at most ``cores`` at a time, and yield each when it is done.

    On one core, and a job alone, in this process, with a bar of its progress. However the iteration
    ends, also by Ctrl-C, processes still at work are ended at once, and what they had begun to
    write is removed. Raises SystemExit where a job fails, which it says itself.
    """
    if cores == 1 or len(jobs) < 2:
        for job in jobs:
            execute(job, bar=True)
            yield job
        return
    waiting = list(jobs)[::-1]
    running: dict[int, tuple[Process, Job]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < cores:
                with _uninterrupted():
                    process, job = Process(target=_alone, args=(waiting[-1],)), waiting.pop()
                    process.start()
                    running[process.sentinel] = process, job
            for sentinel in connection.wait(list(running)):
                process, job = running[sentinel]
                process.join()
                del running[sentinel]
                if process.exitcode:
                    if process.exitcode < 0:  # it could not say so itself
                        name = signal.Signals(-process.exitcode).name
                        print(f"{job.label}: was ended from outside ({name})", file=sys.stderr)
                    raise SystemExit(1)
                yield job
    finally:
        with _uninterrupted():
            _end(running.values())


def _alone(job: Job) -> None:
    """One job in its process. Ctrl-C reaches all processes of a terminal; the first one decides."""
    from kinacc.workflow.results_lock import joined

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _STOPS)
    with joined():
        execute(job)


def _end(running: Iterable[tuple[Process, Job]]) -> None:
    from kinacc.artifacts.atomic import sweep

    for process, _ in running:
        process.kill()  # a compiled kernel would keep a politer signal waiting
    for process, job in running:
        process.join()
        for folder in {Path(path).parent for path in job.outputs.values()}:
            sweep(folder)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Signals to stop wait until the block is over."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
