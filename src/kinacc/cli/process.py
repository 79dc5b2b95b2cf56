"""A command as a process: its streams, the signals that stop it, and its exit codes.

docs/commands.md lists the meaning of each code.
"""

from __future__ import annotations

import os
import signal
import sys
from io import TextIOWrapper
from types import FrameType
from typing import NoReturn

from kinacc.errors import refused

DONE, AGAINST, UNUSABLE, UNDECIDED = 0, 1, 2, 3
STOPPED, NOBODY_READS, TERMINATED = 130, 141, 143  # as a shell has them of signals


def main(prog_name: str = "kinacc") -> NoReturn:
    """Run the command line; no signal and no stream ends it in a traceback."""
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:  # as of a command in the background
        signal.signal(signal.SIGINT, _leave)
    for number in range(3):  # the null device stands for closed streams, and no file opened later
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdin = sys.stdin or open(0, closefd=False)  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        from kinacc.cli.group import main as commands

        commands(prog_name=prog_name)
    except OSError as error:  # of the standard output: of --help, or of problems as JSON
        print(refused(error), file=sys.stderr)
        raise SystemExit(AGAINST) from None
    finally:
        try:
            print(end="", flush=True)
        except OSError:  # reported already; the rest has no reader
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    raise SystemExit(DONE)


def _leave(*_: int | FrameType | None) -> NoReturn:
    """Leave at once, before a command has begun or after it has ended: nothing is to be tidied."""
    os.write(2, b"stopped\n")
    os._exit(STOPPED)
