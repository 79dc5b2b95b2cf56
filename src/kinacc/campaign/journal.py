"""The journal of a campaign: one line per event, appended, flushed to disk, chained by hashes.

A line that was confirmed is on disk. A last line that was cut off, because the process or the
machine died while writing it, was never confirmed and is left out; the next line takes its place.
Each line carries a hash of itself and the line before, the first of the plan: a file that was
edited, or belongs to another plan, is noticed. What was confirmed last stands in a file beside it:
a journal that has lost whole lines at its end is noticed too.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from kinacc.artifacts.atomic import synchronise, taken, write_whole
from kinacc.config import json_files
from kinacc.errors import InputError, MachineError, Problem, refused

PLAN, JOURNAL, LOCK, HEAD = "campaign.json", "readings.jsonl", "lock", "head.json"
_PATIENCE_S = 5.0
_HASH = 16
_MOST_BYTES = 400_000_000  # of a million readings, the largest budget, with joints


@dataclass(frozen=True)
class Journal:
    """What a journal holds: its entries, the hash of every line, and where the last one ends.

    ``seed`` is what the hash of the first line hangs on. ``cut_off``: bytes after the last line, of
    one that was not written to its end.
    """

    entries: tuple[Mapping, ...]
    seed: str
    chain: tuple[str, ...]
    end: int
    cut_off: int

    @property
    def last(self) -> str:
        """Hash of the last line, which all lines before it go into."""
        return self.chain[-1] if self.chain else self.seed


def read(path: Path, seed: str) -> Journal:
    """The journal at ``path``, empty where there is no file; ``seed`` is the digest of the plan.

    Raises InputError where a line does not follow from the one before, and where lines are missing
    at the end that were confirmed.
    """
    content = _content(path)
    entries: list[Mapping] = []
    chain, end, headed = [seed], 0, 0
    whole = content.split(b"\n")[:-1]
    for number, line in enumerate(whole, start=1):
        try:
            parsed = json.loads(line)
            entry, said = parsed["entry"], parsed["chain"]
            follows = _chained(chain[-1], entry)
        except (ValueError, KeyError, TypeError, RecursionError):
            if number == len(whole) and b"\0" in line:
                break  # a machine that lost power may leave zeros where nothing was written yet
            raise _damaged(f"{path}, line {number}", "cannot be read") from None
        if said != follows:
            what = "was changed, or belongs to another campaign"
            what += f", or {PLAN} was changed" if number == 1 else ""
            raise _damaged(f"{path}, line {number}", what)
        headed += "head" in parsed
        entries.append(entry)
        chain.append(follows)
        end += len(line) + 1
    _require_confirmed(path, chain, headed)
    return Journal(tuple(entries), seed, tuple(chain[1:]), end, len(content) - end)


def _content(path: Path) -> bytes:
    """Bytes of a file; none where there is no file. InputError where it is no plain file."""
    try:
        about = path.stat()
        if not stat.S_ISREG(about.st_mode):  # a pipe would be waited for
            raise _damaged(str(path), "is not a file but a folder, a pipe or a device")
        if about.st_size > _MOST_BYTES:
            size = f"{about.st_size / 1e6:.0f} MB"
            raise _damaged(str(path), f"is {size}, more than a campaign writes")
        return path.read_bytes()
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise _damaged(str(path), f"cannot be read: {error.strerror}") from None


def _require_confirmed(path: Path, chain: list[str], headed: int) -> None:
    """Raise InputError where a journal does not go as far as was confirmed.

    ``headed``: lines after which the head was written; the last of them may not have come to that.
    """
    beside = path.with_name(HEAD)
    if not beside.exists():
        if headed > 1:
            raise _damaged(str(beside), "is missing")
        return  # begun by an earlier version, or nothing was confirmed yet
    try:
        head = json.loads(_content(beside))
        count, last = head["entries"], head["chain"]
        known = isinstance(count, int) and count > 0
    except (ValueError, KeyError, TypeError, RecursionError):
        known = False
    if not known:
        raise _damaged(str(beside), "cannot be read")
    if count >= len(chain):
        what = f"ends after entry {len(chain) - 1}, and entry {count} was confirmed"
        raise _damaged(str(path), what)
    if chain[count] != last:
        raise _damaged(str(path), f"entry {count} is not the one that was confirmed")


def append(path: Path, known: Journal, entry: Mapping) -> None:
    """Add an entry; when this returns, it is on disk. The caller holds the lock.

    Raises InputError where the disk does not take it.
    """
    chain = _chained(known.last, entry)
    told = {"chain": chain, "entry": entry, "head": HEAD}
    line = json.dumps(told, sort_keys=True).encode() + b"\n"
    head = json.dumps({"chain": chain, "entries": len(known.entries) + 1}).encode() + b"\n"
    fresh = not path.exists()
    try:
        with open(path, "ab") as file:
            if known.cut_off:
                file.truncate(known.end)
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
        if fresh:
            synchronise(path.parent)
        write_whole(path.with_name(HEAD), head, on_disk=True)
    except (OSError, MachineError) as error:
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


def _chained(before: str, entry: Mapping) -> str:
    text = before + json.dumps(entry, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:_HASH]


def _damaged(where: str, what: str) -> InputError:
    fix = "nothing was done; bring the file back from a copy"
    return InputError(Problem(where, what, fix=fix))


def _not_written(path: Path, error: OSError | MachineError) -> MachineError:
    told = refused(error, path, "cannot be written") if isinstance(error, OSError) else error
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
