"""A command as a process: its standard streams, the signals that stop it, and how it ends."""

from __future__ import annotations

import os
import signal
import sys
from io import BufferedWriter, FileIO, TextIOWrapper
from types import FrameType
from typing import NoReturn

from kinacc.cli.exit_codes import DONE, STOPPED


def main(prog_name: str = "kinacc") -> NoReturn:
    """Run the command line; no signal and no stream ends it in a traceback."""
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:  # as of a command in the background
        signal.signal(signal.SIGINT, _leave)
    _stand_in_for_closed()
    sys.stdout = _stream(1, "standard output")
    sys.stderr = _stream(2)
    from kinacc.cli.group import main as commands

    commands(prog_name=prog_name)
    raise SystemExit(DONE)


class _Standard(FileIO):
    """A standard stream. One that fails says so once, by its name; none is silent about it."""

    said_as = ""
    failed = False

    def write(self, data) -> int:
        """Hand bytes to the system, or drop them after it has refused some."""
        if not self.failed:
            try:
                return super().write(data)
            except OSError as error:
                self.failed = True
                if self.said_as:
                    raise OSError(error.errno, error.strerror, self.said_as) from None
        return len(data)


def _stream(number: int, said_as: str = "") -> TextIOWrapper:
    """A standard stream by its number, without a name one whose failure nobody is told of.

    What its encoding lacks is written in the ASCII of Python's ``\\xb5``.
    """
    raw = _Standard(number, "w", closefd=False)
    raw.said_as = said_as
    before = sys.stdout if number == 1 else sys.stderr
    encoding = "utf-8" if before is None else before.encoding
    lines = number == 2 or raw.isatty()
    return TextIOWrapper(BufferedWriter(raw), encoding, "backslashreplace", line_buffering=lines)


def _stand_in_for_closed() -> None:
    """Where a standard stream is closed, have the null device for it, and no file opened later."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    if sys.stdin is None:
        sys.stdin = TextIOWrapper(FileIO(0, closefd=False))


def _leave(*_: int | FrameType | None) -> NoReturn:
    """Leave at once, before a command has begun or after it has ended: nothing is to be tidied."""
    os.write(2, b"stopped\n")
    os._exit(STOPPED)
