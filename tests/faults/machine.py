"""Faults of a machine, each brought about for one command and taken away again.

They want a mount namespace of their own (``unshare -m``): what is mounted there nobody else sees.
"""

from __future__ import annotations

import ctypes
import os
import resource
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

_BALLAST = ".ballast"
_DISK = ("-o", "size=24m,mode=755")


@dataclass(frozen=True)
class Fault:
    """One fault: what is done to the disk at ``here`` before, undone after, and to the process.

    ``says``: words of which one has to stand in what a command says that stops. ``anew``: it takes
    a process that starts anew, and not one that has everything imported. ``harmless``: the command
    has to succeed all the same.
    """

    says: tuple[str, ...] = ()
    before: Callable[[Path], None] = lambda here: None
    after: Callable[[Path], None] = lambda here: None
    process: Callable[[], None] = lambda: None
    environment: Mapping[str, str | None] = field(default_factory=dict)
    stdout: str = ""
    stderr: str = ""
    anew: bool = False
    harmless: bool = False


def mount_disk(here: Path) -> None:
    """A disk of memory at a folder."""
    here.mkdir(parents=True, exist_ok=True)
    _call("mount", "-t", "tmpfs", *_DISK, "kinacc-faults", str(here))


def _call(*words: str) -> None:
    subprocess.run(words, check=True, capture_output=True)


def filled(left: int) -> Callable[[Path], None]:
    def fill(here: Path) -> None:
        free = os.statvfs(here)
        with open(here / _BALLAST, "wb") as file:
            os.posix_fallocate(file.fileno(), 0, free.f_bavail * free.f_bsize)
            os.truncate(file.fileno(), free.f_bavail * free.f_bsize - left)

    return fill


def emptied(here: Path) -> None:
    (here / _BALLAST).unlink()


def _no_more_files(here: Path) -> None:
    told = os.statvfs(here)
    _call("mount", "-o", f"remount,nr_inodes={told.f_files - told.f_ffree}", str(here))


def _remounted(how: str) -> Callable[[Path], None]:
    return lambda here: _call("mount", "-o", f"remount,{how}", str(here))


def _folders_closed(mode: int) -> Callable[[Path], None]:
    def close(here: Path) -> None:
        for each in (here, *(each for each in here.rglob("*") if each.is_dir())):
            each.chmod(mode)

    return close


def without_privileges() -> None:
    """Take the rights of root from this process, so that permissions count for it."""
    header = (ctypes.c_uint32 * 2)(0x20080522, 0)
    if ctypes.CDLL(None, use_errno=True).capset(header, (ctypes.c_uint32 * 6)()):
        raise OSError(ctypes.get_errno(), "capset")


def _limited(what: int, most: int) -> Callable[[], None]:
    return lambda: resource.setrlimit(what, (most, resource.getrlimit(what)[1]))


def _few_files() -> None:
    there = len(os.listdir("/proc/self/fd"))
    _limited(resource.RLIMIT_NOFILE, there)()


def _logs_closed(here: Path) -> None:
    for logs in here.glob("results/*/logs"):
        _call("mount", "--bind", str(logs), str(logs))
        _call("mount", "-o", "remount,bind,ro", str(logs))


def _logs_opened(here: Path) -> None:
    for logs in here.glob("results/*/logs"):
        _call("umount", str(logs))


_FULL = ("no space left on device",)
FAULTS: dict[str, Fault] = {
    "full disk": Fault(_FULL, filled(0), emptied),
    "disk with 4 kB left": Fault(_FULL, filled(4096), emptied),
    "disk with 16 kB left": Fault(_FULL, filled(16384), emptied),
    "disk with 64 kB left": Fault(_FULL, filled(65536), emptied),
    "disk that takes no more files": Fault(_FULL, _no_more_files, _remounted("nr_inodes=0")),
    "read-only disk": Fault(("read-only file system",), _remounted("ro"), _remounted("rw")),
    "folders without permission to write": Fault(
        ("permission denied",), _folders_closed(0o555), _folders_closed(0o755), without_privileges
    ),
    "files may not grow beyond 1 kB": Fault(
        ("file too large",), process=_limited(resource.RLIMIT_FSIZE, 1000)
    ),
    "no more open files": Fault(("too many open files",), process=_few_files),
    "logs that cannot be written": Fault(("read-only file system",), _logs_closed, _logs_opened),
    "standard output on a full disk": Fault(_FULL, stdout="/dev/full"),
    "nobody reads standard output": Fault(stdout="nobody"),
    "nobody reads standard error": Fault(stderr="nobody", harmless=True),
    "standard error on a full disk": Fault(stderr="/dev/full", harmless=True),
    "standard streams closed": Fault(stdout="closed", stderr="closed", anew=True, harmless=True),
    "no TMPDIR": Fault(environment={"TMPDIR": "/nowhere"}, anew=True, harmless=True),
    "no HOME": Fault(environment={"HOME": None}, anew=True, harmless=True),
    "a HOME that is not there": Fault(environment={"HOME": "/nowhere"}, anew=True, harmless=True),
    "locale C": Fault(environment={"LC_ALL": "C"}, anew=True, harmless=True),
    "locale POSIX": Fault(environment={"LC_ALL": "POSIX", "LANG": None}, anew=True, harmless=True),
    "ASCII alone": Fault(
        environment={"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        anew=True,
        harmless=True,
    ),
}
