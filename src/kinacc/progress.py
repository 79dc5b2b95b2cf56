"""Telling a person that something long is under way: nothing for two seconds, then every few."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterable, Iterator, Sized
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TypeVar

QUIET_S = 2.0
EVERY_S = 5.0
Item = TypeVar("Item")


@dataclass
class _Stage:
    """A stage under way: how many items of what are done."""

    state: str = ""


_CURRENT: ContextVar[_Stage | None] = ContextVar("stage", default=None)


def with_progress(items: Iterable[Item], what: str) -> Iterator[Item]:
    """Yield the items; the lines of :func:`reporting` count them as ``what`` ("simulations")."""
    stage = _CURRENT.get() or _Stage()
    total = f" of {len(items)}" if isinstance(items, Sized) else ""
    for done, item in enumerate(items):
        stage.state = f"{done}{total} {what}, "
        yield item
    stage.state = ""


@contextmanager
def reporting(label: str) -> Iterator[None]:
    """Print a line every few seconds while the block runs longer than two."""
    stage, over, begun = _Stage(), threading.Event(), time.monotonic()

    def report() -> None:
        wait = QUIET_S
        while not over.wait(wait):
            wait, elapsed_s = EVERY_S, time.monotonic() - begun
            line = f"{label}: {stage.state}{elapsed_s:.0f} s so far"
            print(line, file=sys.stderr, flush=True)

    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    token = _CURRENT.set(stage)
    try:
        yield
    finally:
        _CURRENT.reset(token)
        over.set()
        thread.join()
