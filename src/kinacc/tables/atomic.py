"""Files that appear whole or not at all: written under a temporary name, then renamed."""

from __future__ import annotations

import errno
import fcntl
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from kinacc.errors import Problem, and_more, refuse, refused

_ENDING = ".partial"


def unfinished(path: Path | str) -> Path:
    """Where to write a file before it is whole: a name of this machine and process, used once.

    Two machines may write to one folder, and containers number their processes alike.
    """
    by = f"{os.uname().nodename[:40]}.{os.getpid()}.{os.urandom(4).hex()}"
    return Path(path).with_name(f".{Path(path).name}.{by}{_ENDING}")


def taken(handle: int, how: int, patience_s: float | None = None) -> bool:
    """Take a lock of an open file.

    Parameters
    ----------
    handle
        Descriptor of the file.
    how
        ``fcntl.LOCK_EX`` or ``LOCK_SH``.
    patience_s
        Seconds to wait; None for as long as it takes.

    Returns
    -------
    bool
        Whether the lock was had.

    Raises
    ------
    OSError
        Where the file system of the file has no locks.
    """
    until = None if patience_s is None else time.monotonic() + patience_s
    while True:
        try:
            fcntl.flock(handle, how if until is None else how | fcntl.LOCK_NB)
            return True
        except OSError as error:
            if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                raise
            if until is not None and time.monotonic() > until:
                return False
        time.sleep(0.05)


@contextmanager
def replacing(paths: Sequence[Path | str], on_disk: bool = False) -> Iterator[list[Path]]:
    """Temporary paths beside ``paths``; renamed to them on success, removed on any failure.

    Parameters
    ----------
    paths
        Files that appear together.
    on_disk
        Whether files have reached the disk when this returns, and not only the system.

    Raises
    ------
    MachineError
        Naming the file, where the system does not take one.
    """
    targets = [Path(path) for path in paths]
    temporary = [unfinished(path) for path in targets]
    try:
        for path in targets:
            path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        for source in temporary if on_disk else ():
            synchronise(source)
        for source, target in zip(temporary, targets, strict=True):
            os.replace(source, target)
        for folder in {target.parent for target in targets} if on_disk else ():
            synchronise(folder)
    except OSError as error:
        by_name = dict(zip(map(str, temporary), targets, strict=True))
        place = by_name.get(str(error.filename), error.filename)
        where = place or f"{targets[0]}{and_more(len(targets) - 1)}"
        raise refused(error, where, "cannot be written") from None
    finally:
        for source in temporary:
            with suppress(OSError):
                source.unlink(missing_ok=True)


def write_whole(path: Path | str, content: bytes, on_disk: bool = False) -> None:
    """Write a file so that it appears whole or not at all; see ``replacing``."""
    write_together({path: content}, on_disk)


def write_together(contents: Mapping[Path | str, bytes], on_disk: bool = False) -> None:
    """Write files so that all of them appear or none; see ``replacing``."""
    with replacing([*contents], on_disk) as temporary:
        for content, part in zip(contents.values(), temporary, strict=True):
            try:
                part.write_bytes(content)
            except OSError as error:
                error.filename = str(part)  # which the system does not name for a full disk
                raise


def write_new(contents: Mapping[Path | str, bytes], force: bool) -> list[str]:
    """Write files together; InputError naming those already there, unless ``force``."""
    refuse(
        [
            Problem(str(path), "is there already", fix="give --force to replace it")
            for path in contents
            if Path(path).exists() and not force
        ],
        "Nothing was written",
    )
    write_together(contents)
    return [*map(str, contents)]


def synchronise(path: Path) -> None:
    """Wait until what was written to a file, or named in a folder, is on disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
