"""The folder of a campaign: its plan, and its journal, written under a lock.

The journal has one line per event, appended and flushed to disk. A line that was confirmed is on
disk. A last line that was cut off, because the process or the machine died while writing it, was
never confirmed and is left out; the next line takes its place. Each line carries a checksum of the
plan, its number and its entry: one that was edited, is missing before others, or belongs to another
plan is noticed.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from kinacc import __version__
from kinacc.campaign import plan as plans
from kinacc.campaign.beside_results import JOURNAL, PLAN
from kinacc.campaign.plan import Plan
from kinacc.campaign.state import Entry, State, restore
from kinacc.config import json_files
from kinacc.errors import InputError, Problem, input_error, refuse, refused
from kinacc.tables.atomic import synchronise, taken, write_whole

LOCK = "lock"
_PATIENCE_S = 5.0
_UNCONFIRMED = "cannot be written, and nothing was confirmed"
_DIGITS = 16  # of a checksum and of a digest


@dataclass(frozen=True)
class Journal:
    """What a journal holds: its entries and its lines as they are on disk.

    ``seed`` is the digest of the plan. ``cut_off``: bytes after the last line, of one that was not
    written to its end.
    """

    entries: tuple[Mapping[str, Any], ...]
    seed: str
    lines: tuple[bytes, ...]
    cut_off: int

    def sha256(self, entries: int | None = None) -> str:
        """SHA-256 of the file up to so many entries, all of them by default."""
        return hashlib.sha256(b"".join(self.lines[:entries])).hexdigest()


def read_journal(path: Path, seed: str) -> Journal:
    """The journal at ``path``, empty where there is no file; ``seed`` is the digest of the plan.

    Raises InputError where a line cannot be read, or is not the one that was written there. Lines
    of earlier versions carry no checksum of their own (``chain``), and are taken as they are.
    """
    if path.exists() and not path.is_file():
        raise _damaged(str(path), "cannot be read: is no file")
    try:
        content = path.read_bytes() if path.exists() else b""
    except OSError as error:
        raise _damaged(str(path), f"cannot be read: {error.strerror}") from None
    entries: list[Mapping[str, Any]] = []
    whole = content.splitlines(keepends=True)
    if whole and not whole[-1].endswith(b"\n"):
        whole.pop()
    for number, line in enumerate(whole, start=1):
        try:
            parsed = json.loads(line)
            entry = parsed["entry"]
            matches = "chain" in parsed or parsed["sum"] == _checksum(seed, number, entry)
        except (ValueError, KeyError, TypeError, RecursionError):
            if number == len(whole) and b"\0" in line:
                break  # a machine that lost power may leave zeros where nothing was written yet
            raise _damaged(f"{path}, line {number}", "cannot be read") from None
        if not matches:
            message = f"was changed, or belongs to another {PLAN}"
            raise _damaged(f"{path}, line {number}", message)
        entries.append(entry)
    lines = tuple(whole[: len(entries)])
    return Journal(tuple(entries), seed, lines, len(content) - sum(map(len, lines)))


def append(path: Path, known: Journal, entry: Mapping[str, Any]) -> None:
    """Add an entry; when this returns, it is on disk. The caller holds the lock.

    Raises InputError where the disk does not take it.
    """
    signed = {"entry": entry, "sum": _checksum(known.seed, len(known.entries) + 1, entry)}
    line = json.dumps(signed, sort_keys=True).encode() + b"\n"
    fresh = not path.exists()
    try:
        with open(path, "ab") as file:
            file.truncate(sum(map(len, known.lines)))
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
        if fresh:
            synchronise(path.parent)
    except OSError as error:
        raise refused(error, path, _UNCONFIRMED) from None


@contextmanager
def locked(folder: Path, patience_s: float = _PATIENCE_S) -> Iterator[None]:
    """Hold the campaign for one writer; the system lets go of it when the process ends.

    Raises InputError where another holds it for longer than ``patience_s``.
    """
    try:
        file = open(folder / LOCK, "a+")  # noqa: SIM115
    except OSError as error:
        raise refused(error, folder / LOCK, _UNCONFIRMED) from None
    with file:
        if not taken(file.fileno(), patience_s):
            message = "another process is writing to this campaign"
            fix = "wait until it is done, then try again"
            raise input_error(str(folder), message, fix=fix)
        yield


def _checksum(seed: str, number: int, entry: Mapping[str, Any]) -> str:
    text = f"{seed} {number} {json.dumps(entry, sort_keys=True)}"
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


def _damaged(where: str, message: str) -> InputError:
    fix = "nothing was done; bring the file back from a copy"
    return input_error(where, message, fix=fix)


@dataclass(frozen=True)
class Opened:
    """A campaign as read: its folder, plan and journal."""

    folder: Path
    plan: Plan
    journal: Journal

    @cached_property
    def state(self) -> State:
        """Readings of the journal as the assessor has them."""
        return restore(self.plan, self.journal.entries, str(self.folder / JOURNAL))

    @property
    def version(self) -> str:
        """The kinacc that it was begun with."""
        return self.plan.about.get("kinacc_version", "an earlier version")

    @property
    def recorded(self) -> tuple[str, ...]:
        """The times of its entries."""
        return tuple(str(entry["at"]) for entry in self.journal.entries if "at" in entry)

    def write(self, entry: Entry) -> None:
        """Append an entry, with the time; on disk when this returns. Only while ``writing``."""
        content = entry.model_dump(exclude_none=True)
        content["at"] = datetime.now(UTC).isoformat(timespec="seconds")
        append(self.folder / JOURNAL, self.journal, content)


def start(folder: Path | str, begun: Plan) -> None:
    """Put a new campaign on disk. Raises InputError where the folder holds one already."""
    message = "a campaign is there already"
    paths = [Path(folder) / name for name in (PLAN, JOURNAL)]
    problems = [Problem(str(path), message, "a new folder") for path in paths if path.exists()]
    refuse(problems, "The campaign was not begun")
    write_whole(Path(folder) / PLAN, plans.to_json(begun), on_disk=True)


def open_(folder: Path | str) -> Opened:
    """Read a campaign.

    Parameters
    ----------
    folder : path
        Folder that ``kinacc campaign start`` made.

    Returns
    -------
    Opened
        Plan and journal.

    Raises
    ------
    InputError
        Where there is no campaign, or a file was damaged or changed.
    """
    folder = Path(folder)
    path = folder / PLAN
    if not path.is_file():
        fix = "begin one: kinacc campaign start"
        raise input_error(str(path), "no such file: no campaign is there", fix=fix)
    text = json_files.bytes_of(path)
    digest = hashlib.sha256(text).hexdigest()[:_DIGITS]
    return Opened(folder, plans.from_json(text, str(path)), read_journal(folder / JOURNAL, digest))


@contextmanager
def writing(folder: Path | str) -> Iterator[Opened]:
    """The campaign, held for this writer alone."""
    require_method(open_(folder))  # no lock file where there is no campaign
    with locked(Path(folder)):
        yield open_(folder)


def require_method(opened: Opened) -> None:
    """Raise InputError where this version computes bounds otherwise than the campaign's."""
    if opened.plan.method != plans.METHOD:
        message = (
            f"uses bounds of method {opened.plan.method}; kinacc {__version__} has {plans.METHOD}"
        )
        fix = f"continue it with kinacc {opened.version}, or begin a new campaign"
        raise input_error(str(opened.folder), message, fix=fix)


def marks_of(opened: Opened) -> dict[str, object]:
    """Return the provenance of the tables: plan and journal count as the configuration."""
    content = f"{opened.journal.seed} {opened.journal.sha256()}".encode()
    config_hash = hashlib.sha256(content).hexdigest()[:_DIGITS]
    return {"kinacc_version": __version__, "config_hash": config_hash, "seed": opened.plan.seed}


def doubts(opened: Opened) -> list[str]:
    """Return what is unusual: a last line that was cut off."""
    message = (
        "the last entry was cut off while written and never confirmed: is the last reading to be "
        "recorded again?"
    )
    return [message] if opened.journal.cut_off else []


@dataclass(frozen=True)
class Verification:
    """A journal whose lines are whole, and whether it ``continues`` the one of a report."""

    campaign: str
    entries: int
    readings: int
    sha256: str
    continues: bool


def verify(opened: Opened, sha256: str | None = None) -> Verification:
    """Compare a journal with the SHA-256 that a report states of it.

    Checksums of the lines are checked where a journal is opened.
    """
    journal, count = opened.journal, len(opened.journal.entries)
    readings = len(opened.state.taken)
    continues = sha256 is None or sha256 in map(journal.sha256, range(count + 1))
    return Verification(journal.seed, count, readings, journal.sha256(), continues)
