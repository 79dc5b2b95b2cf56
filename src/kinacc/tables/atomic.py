"""Files that appear whole or not at all: written under a temporary name, then renamed."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from kinacc.errors import Problem, refuse, refused

_ENDING = ".partial"


def unfinished(path: Path | str) -> Path:
    """Where to write a file before it is whole: a name of this machine and process, used once.

    Two machines may write to one folder, and containers number their processes alike.
    """
    by = f"{os.uname().nodename[:40]}.{os.getpid()}.{os.urandom(4).hex()}"
    return Path(path).with_name(f".{Path(path).name}.{by}{_ENDING}")


def taken(handle: int, patience_s: float) -> bool:
    """Take the lock of an open file for one writer.

    Parameters
    ----------
    handle
        Descriptor of the file.
    patience_s
        Seconds to wait for another that has it.

    Returns
    -------
    bool
        Whether the lock was had.

    Raises
    ------
    OSError
        Where the file system of the file has no locks.
    """
    until = time.monotonic() + patience_s
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except (BlockingIOError, PermissionError):
            if time.monotonic() > until:
                return False
        time.sleep(0.05)


def write_whole(path: Path | str, content: bytes, on_disk: bool = False) -> None:
    """Write a file so that it appears whole or not at all; see ``write_together``."""
    write_together({path: content}, on_disk)


def write_together(contents: Mapping[Path | str, bytes], on_disk: bool = False) -> None:
    """Write files so that all of them appear or none.

    Parameters
    ----------
    contents
        What the files hold, by path; folders are made.
    on_disk
        Whether files have reached the disk when this returns, and not only the system.

    Raises
    ------
    MachineError
        Naming the file, where the system does not take one.
    """
    parts = {Path(path): unfinished(path) for path in contents}
    target = Path()
    try:
        for (target, part), content in zip(parts.items(), contents.values(), strict=True):
            target.parent.mkdir(parents=True, exist_ok=True)
            part.write_bytes(content)
            if on_disk:
                synchronise(part)
        for target, part in parts.items():
            os.replace(part, target)
        for folder in {path.parent for path in parts} if on_disk else ():
            synchronise(folder)
    except OSError as error:
        raise refused(error, target, "cannot be written") from None
    finally:
        for part in parts.values():
            with suppress(OSError):
                part.unlink(missing_ok=True)


def write_new(contents: Mapping[Path | str, bytes], force: bool) -> list[str]:
    """Write files together, after :func:`require_writable`; their paths as text."""
    require_writable(contents, force)
    write_together(contents)
    return [*map(str, contents)]


def require_writable(
    paths: Iterable[Path | str | None], force: bool, kinds: Sequence[str] = ()
) -> None:
    """Raise InputError where a file could not or should not be written."""
    problems = []
    for path in [Path(item) for item in paths if item is not None]:
        if path.is_dir():
            problems.append(Problem(str(path), "is a folder", "a file"))
        elif kinds and path.suffix not in kinds:
            problems.append(Problem(str(path), f"ends in {path.suffix!r}", ", ".join(kinds)))
        elif path.exists() and not force:
            problems.append(Problem(str(path), "is there already", fix="give --force"))
    refuse(problems, "Nothing was written")


def synchronise(path: Path) -> None:
    """Wait until what was written to a file, or named in a folder, is on disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
