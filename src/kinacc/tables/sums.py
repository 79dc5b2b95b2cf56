"""Digests of what every stage left: ``sums/<rule>.sha256`` in the folder of a data set.

The form is that of ``sha256sum``: a digest and a file a line, files as seen from the folder. Lines
that begin with ``# read`` hold what the stage read, and are comments to ``sha256sum -c``.
"""

from __future__ import annotations

import hashlib
import os
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from kinacc.errors import Problem, input_error

FOLDER = "sums"
_READ = "# read "
AGAIN = "run the workflow again"
_CHANGED = "changed since its stage wrote it, or no stage wrote it"


class _Line(NamedTuple):
    stage: str
    name: str
    digest: str
    is_read: bool


def digest(content: bytes) -> str:
    """SHA-256 of a file's content, 64 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def text_of(written: Mapping[str, bytes], read: Mapping[str, str]) -> bytes:
    """Content of a sums file: contents ``written`` and digests ``read``, both by file name."""
    lines = [f"{digest(content)}  {name}\n" for name, content in sorted(written.items())]
    lines += [f"{_READ}{value}  {name}\n" for name, value in sorted(read.items())]
    return "".join(lines).encode()


def stated(folder: Path | str) -> dict[str, str]:
    """Digests of all files that the stages of a data set left, by name in its folder."""
    return {line.name: line.digest for line in _lines(folder) if not line.is_read}


def outdated(folder: Path | str) -> list[str]:
    """Names of files that were made from files which have changed since, or are gone."""
    stages = {line.stage for line in _changed_reads(folder)}
    return sorted(e.name for e in _lines(folder) if e.stage in stages and not e.is_read)


def changed_since(folder: Path | str) -> list[str]:
    """Names of files that changed since stages read them, as seen from the current folder."""
    names = {line.name for line in _changed_reads(folder)}
    return sorted(os.path.relpath(Path(folder) / name) for name in names)


def hold(path: Path | str, content: bytes) -> None:
    """Raise InputError where a file is not as its stage left it."""
    path = Path(path)
    folder = next((item for item in path.parents if (item / FOLDER).is_dir()), None)
    if folder is None:
        return
    if stated(folder).get(path.relative_to(folder).as_posix()) != digest(content):
        raise input_error(str(path), _CHANGED, fix=remake(path))


def changed(folder: Path | str) -> Iterator[Problem]:
    """Every file of a data set that is missing or not as its stage left it."""
    for name, expected in stated(folder).items():
        path = Path(folder) / name
        if not path.is_file():
            yield Problem(str(path), "missing", fix=AGAIN)
        elif digest(path.read_bytes()) != expected:
            yield Problem(str(path), _CHANGED, fix=remake(path))


def remake(path: Path | str) -> str:
    """What to do about a file of results that is of no use."""
    return f"rm {shlex.quote(str(path))}, then {AGAIN}"


def _changed_reads(folder: Path | str) -> list[_Line]:
    """Lines about files that changed since a stage read them: by digest, or outside as they are."""
    lines, now = _lines(folder), stated(folder)
    for name in {line.name for line in lines if line.name.startswith("..")} - {*now}:
        path = Path(folder) / name
        now[name] = digest(path.read_bytes()) if path.is_file() else ""
    return [line for line in lines if line.is_read and line.digest != now.get(line.name)]


def _lines(folder: Path | str) -> list[_Line]:
    lines = []
    for path in sorted((Path(folder) / FOLDER).glob("*.sha256")):
        for line in path.read_text("utf-8", errors="replace").splitlines():
            value, separator, name = line.partition("  ")
            if not separator:
                message = f"is not a list of digests: {line[:60]!r}"
                raise input_error(str(path), message, fix=remake(path))
            is_read = value.startswith(_READ)
            lines.append(_Line(path.name, name, value.removeprefix(_READ), is_read))
    return lines
