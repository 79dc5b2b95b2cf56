"""The journal of a campaign: one line per event, appended and flushed to disk.

A line that was confirmed is on disk. A last line that was cut off, because the process or the
machine died while writing it, was never confirmed and is left out; the next line takes its place.
Each line carries a checksum of the plan, its number and its entry: one that was edited, is missing
before others, or belongs to another plan is noticed.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from kinacc.config import json_files
from kinacc.errors import InputError, MachineError, Problem, refused
from kinacc.tables.atomic import synchronise, taken

PLAN, JOURNAL, LOCK = "campaign.json", "readings.jsonl", "lock"
_PATIENCE_S = 5.0
_DIGITS = 16  # of a checksum


@dataclass(frozen=True)
class Journal:
    """What a journal holds: its entries and its lines as they are on disk.

    ``seed`` is the digest of the plan. ``cut_off``: bytes after the last line, of one that was not
    written to its end.
    """

    entries: tuple[Mapping, ...]
    seed: str
    lines: tuple[bytes, ...]
    cut_off: int

    def sha256(self, entries: int | None = None) -> str:
        """SHA-256 of the file up to so many entries, all of them by default."""
        return hashlib.sha256(b"".join(self.lines[:entries])).hexdigest()


def read(path: Path, seed: str) -> Journal:
    """The journal at ``path``, empty where there is no file; ``seed`` is the digest of the plan.

    Raises InputError where a line cannot be read, or is not the one that was written there. Lines
    of earlier versions carry no checksum of their own (``chain``), and are taken as they are.
    """
    content = _content(path)
    entries: list[Mapping] = []
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
            what = "was changed, or belongs to another campaign"
            what += f", or {PLAN} was changed" if number == 1 else ""
            raise _damaged(f"{path}, line {number}", what)
        entries.append(entry)
    lines = tuple(whole[: len(entries)])
    return Journal(tuple(entries), seed, lines, len(content) - sum(map(len, lines)))


def _content(path: Path) -> bytes:
    """Bytes of a file; none where there is no file. InputError where it cannot be read."""
    try:
        return path.read_bytes() if path.is_file() or not path.exists() else b"not a file\n"
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise _damaged(str(path), f"cannot be read: {error.strerror}") from None


def append(path: Path, known: Journal, entry: Mapping) -> None:
    """Add an entry; when this returns, it is on disk. The caller holds the lock.

    Raises InputError where the disk does not take it.
    """
    told = {"entry": entry, "sum": _checksum(known.seed, len(known.entries) + 1, entry)}
    line = json.dumps(told, sort_keys=True).encode() + b"\n"
    fresh = not path.exists()
    try:
        with open(path, "ab") as file:
            if known.cut_off:
                file.truncate(sum(map(len, known.lines)))
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
        if fresh:
            synchronise(path.parent)
    except OSError as error:
        raise _not_written(path, error) from None


@contextmanager
def writing(folder: Path, patience_s: float = _PATIENCE_S) -> Iterator[None]:
    """Hold the campaign for one writer; the system lets go of it when the process ends.

    Raises InputError where another holds it for longer than ``patience_s``.
    """
    try:
        lock = open(folder / LOCK, "a+")  # noqa: SIM115 closed by the next line's block
    except OSError as error:
        raise _not_written(folder / LOCK, error) from None
    with lock as file:
        try:
            held = taken(file.fileno(), fcntl.LOCK_EX, patience_s)
        except OSError as error:
            what = f"the file system of this folder holds no locks: {error.strerror}"
            fix = "two writers could spoil the campaign: move its folder to a local disk"
            raise InputError(Problem(str(folder), what, fix=fix)) from None
        if not held:
            what = "another process is writing to this campaign"
            fix = "wait until it is done, then try again"
            raise InputError(Problem(str(folder), what, fix=fix))
        yield


def _checksum(seed: str, number: int, entry: Mapping) -> str:
    text = f"{seed} {number} {json.dumps(entry, sort_keys=True)}"
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


def _damaged(where: str, what: str) -> InputError:
    fix = "nothing was done; bring the file back from a copy"
    return InputError(Problem(where, what, fix=fix))


def _not_written(path: Path, error: OSError) -> MachineError:
    told = refused(error, path, "cannot be written")
    fix = "nothing was confirmed: look at `kinacc campaign status` before trying again"
    return MachineError([replace(each, fix=fix) for each in told.problems])


def of_results(results: Path) -> list[Path]:
    """Folders of campaigns on the calibration in a results folder, by the name they have of it.

    They are sought beside it, beside all results, and in the folder one stands in; each is named
    as a person there would.
    """
    return of_each([results])[results]


def of_each(folders: Iterable[Path]) -> dict[Path, list[Path]]:
    """The same for each of many results folders; every place is looked through once."""
    there: dict[Path, dict[str, list[Path]]] = {}
    found = {}
    for results in folders:
        within = results.absolute().parent
        near = {within.resolve(): results.parent, within.parent.resolve(): results.parent / ".."}
        places = [*(near | {Path.cwd(): Path()}).values()]
        for place in places:
            if place not in there:
                there[place] = _by_calibration(place)
        name = results.resolve().name
        found[results] = [each for place in places for each in there[place].get(name, ())]
    return found


def _by_calibration(place: Path) -> dict[str, list[Path]]:
    """Campaigns in the folders of a place, by the name of the calibration they are about."""
    found: dict[str, list[Path]] = {}
    for plan in sorted(place.glob(f"*/{PLAN}")):
        try:
            content = json_files.values_of(json_files.bytes_of(plan), str(plan))
            name = content["about"]["calibration"]
        except (InputError, OSError, ValueError, LookupError, TypeError, RecursionError):
            continue  # no campaign, or one that cannot say whose it is
        if isinstance(name, str):
            found.setdefault(name, []).append(plan.parent)
    return found
