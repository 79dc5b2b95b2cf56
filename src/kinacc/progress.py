"""Telling a person that something long is under way: nothing for two seconds, then every few.

A terminal used by one stage gets a bar; a workflow, where jobs share the screen, and a log file get
plain lines.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterable, Iterator, Sized
from contextlib import contextmanager
from typing import TypeVar

QUIET_S = 2.0
EVERY_S = 5.0
Item = TypeVar("Item")


class Progress:
    """Reports on one stage; call it on an iterable to have its items counted."""

    def __init__(self, label: str, bar: bool = False) -> None:
        self.label = label
        self.bar = bar and sys.stderr.isatty()
        self.state = ""
        self._begun = time.monotonic()

    def __call__(
        self, items: Iterable[Item], what: str = "", total: int | None = None
    ) -> Iterator[Item]:
        """Yield the items, counting them as ``what`` ("simulations", "slices")."""
        total = len(items) if total is None and isinstance(items, Sized) else total
        if self.bar:
            from tqdm import tqdm

            yield from tqdm(items, self.label, total, unit=f" {what}", delay=QUIET_S, leave=False)
            return
        for done, item in enumerate(items):
            self.state = f"{done} of {total} {what}" if total is not None else f"{done} {what}"
            yield item
        self.state = ""

    def line(self) -> str:
        """Where the stage stands, in one line."""
        elapsed = f"{time.monotonic() - self._begun:.0f} s so far"
        return f"{self.label}: {', '.join(filter(None, [self.state, elapsed]))}"


SILENT = Progress("")  # counts and shows nothing


@contextmanager
def reporting(label: str, bar: bool = False) -> Iterator[Progress]:
    """A Progress whose line is printed while the block runs longer than two seconds."""
    progress, over = Progress(label, bar), threading.Event()

    def report() -> None:
        wait = QUIET_S
        while not over.wait(wait):
            wait = EVERY_S
            if not progress.bar:
                print(progress.line(), file=sys.stderr, flush=True)

    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    try:
        yield progress
    finally:
        over.set()
        thread.join()
