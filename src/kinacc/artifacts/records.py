"""The record a run of a stage leaves, last of all: which files it wrote, what from, by what.

Its several files are one step by it: a run that ended before its end leaves no record that fits.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from kinacc.artifacts import provenance
from kinacc.artifacts.atomic import replacing
from kinacc.errors import InputError, Problem

FOLDER = "records"
_FOLDED = ("settings", "code", "versions")


@dataclass(frozen=True)
class Written:
    """One file: SHA-256 of its bytes and, of a table, the digest of its columns."""

    sha256: str
    columns_digest: str | None = None

    @classmethod
    def of(cls, content: bytes, columns_digest: str | None = None) -> Written:
        """What a record says of a file with this content."""
        return cls(hashlib.sha256(content).hexdigest(), columns_digest)


@dataclass(frozen=True)
class Record:
    """One run of a stage, or of a part of one that is scattered.

    ``marks`` are those of its tables (PROVENANCE_KEYS), ``inputs_digests`` say by role what it
    read; ``files`` are all it left, by their names in the folder of the data set. What the marks
    fold: ``settings`` are the configuration values of the stage without the folders of files,
    ``code`` digests of its modules and data files, ``versions`` those of libraries and Python;
    None in records of before they were told.
    """

    stage: str
    part: str | None
    marks: Mapping[str, str]
    inputs_digests: Mapping[str, str]
    files: Mapping[str, Written]
    settings: Mapping[str, Any] | None = None
    code: Mapping[str, str] | None = None
    versions: Mapping[str, str] | None = None

    def content(self) -> bytes:
        """The record as JSON: the same bytes for the same record."""
        told = {name: value for name, value in asdict(self).items() if name not in self._untold()}
        return (json.dumps(told, sort_keys=True, indent=1) + "\n").encode()

    def misfolded(self) -> list[str]:
        """Marks that do not fold what the record tells of settings and code."""
        folds = {}
        if self.settings is not None:
            folds["config_hash"] = provenance.config_hash(self.settings)
        if self.code is not None and self.versions is not None:
            folds["code_hash"] = provenance.Code(self.code, self.versions).folded()
        return [key for key, hash_ in folds.items() if self.marks.get(key) != hash_]

    def _untold(self) -> set[str]:
        return {name for name in _FOLDED if getattr(self, name) is None}


def place(folder: Path | str, stage: str, part: str | None = None) -> str:
    """Where the record of a stage is, or of one of its parts, in the folder of a data set."""
    return f"{folder}/{FOLDER}/{stage}{f'.{part}' if part else ''}.json"


def folder_of(place: Path | str) -> Path:
    """The folder of the data set that a record at this place is about."""
    return Path(place).parent.parent


def leave(place: Path | str, record: Record, files: Mapping[str, tuple[bytes, str | None]]) -> None:
    """Write the files of a run and, last, its record, to which ``files`` are added.

    ``files`` holds by path the content and, of a table, the digest of its columns. All of them
    appear or none; the record that was there before is gone before the first of them changes.
    ``place`` is empty where the files stand in no folder of a data set: they have no record.
    """
    contents = {path: content for path, (content, _) in files.items()}
    if place:
        written = {_name(place, path): Written.of(*told) for path, told in files.items()}
        contents[str(place)] = replace(record, files=written).content()
    with replacing(list(contents)) as temporary:
        for content, each in zip(contents.values(), temporary, strict=True):
            each.write_bytes(content)
        if place:
            Path(place).unlink(missing_ok=True)


def read(place: Path | str) -> Record:
    """A record; InputError where it is absent or is none."""
    try:
        known = json.loads(Path(place).read_bytes())
        files = {name: Written(**told) for name, told in known.pop("files").items()}
        record = Record(**known, files=files)
        texts = [record.marks, record.inputs_digests, record.code or {}, record.versions or {}]
        if not (all(map(_texts, texts)) and isinstance(record.settings or {}, dict)):
            raise ValueError
        record.misfolded()  # what cannot be folded is no record
    except FileNotFoundError:
        raise InputError(Problem(str(place), "no such file")) from None
    except OSError as error:
        raise InputError(Problem(str(place), f"cannot be read: {error.strerror}")) from None
    except (ValueError, TypeError, AttributeError, KeyError, RecursionError):
        raise InputError(Problem(str(place), "is no record of a stage")) from None
    return record


def misfits(place: Path | str, record: Record) -> list[Problem]:
    """Files of the record at a place that are not there, or not as they were written."""
    found = []
    for name in record.files:
        path = folder_of(place) / name
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            found.append(Problem(str(path), "missing"))
        except OSError as error:
            found.append(Problem(str(path), f"cannot be read: {error.strerror}"))
        else:
            found += misfit(place, record, path, content)
    return found


def misfit(place: Path | str, record: Record, path: Path | str, content: bytes) -> list[Problem]:
    """What is wrong with the content of a file, by the record of the run that wrote it."""
    written, found = record.files.get(_name(place, path)), Written.of(content)
    if written is None:
        return [Problem(str(path), f"is none of the files that {place} says were written")]
    if written.sha256 == found.sha256:
        return []
    what = f"is not the file that stage {record.stage} wrote: its SHA-256 is {found.sha256}"
    return [Problem(str(path), what, f"{written.sha256}, as in {place}")]


def _name(place: Path | str, path: Path | str) -> str:
    return Path(os.path.relpath(path, folder_of(place))).as_posix()


def _texts(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(each, str) for each in value.values())
