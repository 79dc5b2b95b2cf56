"""Digests of what every stage left: ``sums/<rule>.sha256`` in the folder of a data set.

The form is that of ``sha256sum``: a digest and a file a line, files as seen from the folder. Lines
that begin with ``# read`` hold what the stage read, and are comments to ``sha256sum -c``.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from kinacc.errors import InputError, Problem

FOLDER = "sums"
_READ = "# read "


def digest(content: bytes) -> str:
    """SHA-256 of a file's content, 64 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def text_of(written: Mapping[str, bytes], read: Mapping[str, str]) -> bytes:
    """Content of a sums file: contents ``written`` and digests ``read``, both by file name."""
    lines = [f"{digest(content)}  {name}" for name, content in sorted(written.items())]
    lines += [f"{_READ}{value}  {name}" for name, value in sorted(read.items())]
    return "".join(f"{line}\n" for line in lines).encode()


def folder_of(path: Path | str) -> Path:
    """Folder of the data set that a file belongs to: the nearest one above with sums."""
    path = Path(path)
    return next((item for item in path.parents if (item / FOLDER).is_dir()), path.parent)


def stated(folder: Path | str) -> dict[str, str]:
    """Digests of all files that the stages of a data set left, by name in its folder."""
    paths = sorted((Path(folder) / FOLDER).glob("*.sha256"))
    lines = [line for path in paths for line in _parsed(path)]
    return {name: value for name, value in lines if not value.startswith(_READ)}


def outdated(folder: Path | str) -> list[str]:
    """Names of files that were made from files which have changed since, or are gone."""
    return sorted({created for _, whole in _changed_reads(Path(folder)) for created in whole})


def changed_since(folder: Path | str) -> list[str]:
    """Names of files that changed since stages read them, as seen from the current folder."""
    folder = Path(folder)
    names = {name for name, _ in _changed_reads(folder)}
    return sorted(os.path.relpath(folder / name) for name in names)


def _changed_reads(folder: Path) -> Iterator[tuple[str, list[str]]]:
    """Each file that changed since a stage read it, with what that stage left."""
    now = stated(folder)
    for path in sorted((folder / FOLDER).glob("*.sha256")):
        lines = list(_parsed(path))
        remaining = [name for name, value in lines if not value.startswith(_READ)]
        for name, value in lines:
            if value.startswith(_READ) and value != f"{_READ}{_digest_now(folder, name, now)}":
                yield name, remaining


def _digest_now(folder: Path, name: str, stated_now: Mapping[str, str]) -> str:
    """Digest of a file as its stage left it or, of one from outside, as it is now."""
    if name in stated_now or not name.startswith(".."):
        return stated_now.get(name, "")
    path = folder / name
    return digest(path.read_bytes()) if path.is_file() else ""


def hold(path: Path | str, content: bytes) -> None:
    """Raise InputError where a file is not as its stage left it."""
    folder = folder_of(path)
    name = Path(path).relative_to(folder).as_posix()
    remaining = stated(folder).get(name)
    fix = f"rm {path}, then run the workflow again"
    if remaining is None and (folder / FOLDER).is_dir():
        message = f"has no digest in {folder / FOLDER}"
        raise InputError(Problem(str(path), message, fix=fix))
    if remaining is not None and remaining != digest(content):
        raise InputError(Problem(str(path), "changed since its stage wrote it", fix=fix))


def changed(folder: Path | str) -> Iterable[Problem]:
    """Every file of a data set that is missing or not as its stage left it."""
    folder = Path(folder)
    for name, remaining in stated(folder).items():
        path = folder / name
        fix = f"rm {path}, then run the workflow again"
        if not path.is_file():
            yield Problem(str(path), "missing", fix="run the workflow again")
        elif digest(path.read_bytes()) != remaining:
            yield Problem(str(path), "changed since its stage wrote it", fix=fix)


def _parsed(path: Path) -> Iterable[tuple[str, str]]:
    for line in path.read_text("utf-8", errors="replace").splitlines():
        value, separator, name = line.partition("  ")
        if not separator:
            raise InputError(Problem(str(path), f"is not a list of digests: {line[:60]!r}",
                                     fix=f"rm {path}, then run the workflow again"))  # fmt: skip
        yield name, value
