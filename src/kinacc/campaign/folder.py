"""A campaign's folder: started once, opened, written to under its lock."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from kinacc import __version__
from kinacc.campaign import journal, plan, state
from kinacc.campaign.plan import Plan
from kinacc.campaign.reading import Reading
from kinacc.campaign.state import LEAVE_OUT, READINGS, STRIKE, State
from kinacc.config import json_files
from kinacc.errors import InputError, Problem, refuse
from kinacc.tables.atomic import write_whole

_CLOCKS_DIFFER = timedelta(minutes=10)  # of two computers that write to one campaign


@dataclass(frozen=True)
class Opened:
    """A campaign as read: its folder, plan, journal and the digest both hang on."""

    folder: Path
    plan: Plan
    journal: journal.Journal
    digest: str

    def state(self, watch=None) -> State:
        """Where it stands; ``watch`` as in ``kinacc.campaign.state.restore``."""
        return state.restore(self.plan, self.journal.entries, watch)

    @property
    def recorded(self) -> tuple[str, ...]:
        """When its entries were made, as the journal has it."""
        return tuple(str(each["at"]) for each in self.journal.entries if "at" in each)

    def clock_went_back(self) -> list[Problem]:
        """What is wrong with the time of this computer, if it lies before the last entry's."""
        last, now = max(self.recorded, default=""), _stamp()
        if not last or now >= _stamp(datetime.fromisoformat(last) - _CLOCKS_DIFFER):
            return []
        what = f"says {now}, and the campaign has an entry of {last}"
        fix = "set the clock; where that entry's was wrong, give --accept-implausible"
        return [Problem("the clock of this computer", what, fix=fix)]

    def write(self, entry: Mapping) -> None:
        """Append an entry, with the time; on disk when this returns. Only while ``writing``."""
        stamped = {**entry, "at": _stamp()}
        journal.append(self.folder / journal.JOURNAL, self.journal, stamped)


def _stamp(time: datetime | None = None) -> str:
    return (time or datetime.now(UTC)).isoformat(timespec="seconds")


def in_the_way(folder: Path | str) -> list[Problem]:
    """Files of a campaign that a folder holds already."""
    paths = [Path(folder) / name for name in (journal.PLAN, journal.JOURNAL)]
    what = "a campaign is there already"
    return [Problem(str(path), what, "a new folder") for path in paths if path.exists()]


def start(folder: Path | str, begun: Plan) -> None:
    """Put a new campaign on disk. Raises InputError where the folder holds one already."""
    refuse(in_the_way(folder), "The campaign was not begun")
    write_whole(Path(folder) / journal.PLAN, plan.to_json(begun), on_disk=True)


def open_(folder: Path | str) -> Opened:
    """Read a campaign. Raises InputError where there is none, or it was damaged."""
    folder = Path(folder)
    path = folder / journal.PLAN
    if not path.is_file():
        fix = "begin one: kinacc campaign start"
        raise InputError(Problem(str(path), "no such file: no campaign is there", fix=fix))
    text = json_files.bytes_of(path)
    digest = plan.digest(text)
    begun, journal_at = plan.from_json(text, str(path)), folder / journal.JOURNAL
    known = journal.read(journal_at, digest)
    state.require_readable(begun, known.entries, str(journal_at))
    return Opened(folder, begun, known, digest)


@contextmanager
def writing(folder: Path | str) -> Iterator[Opened]:
    """The campaign, held for this writer alone."""
    require_method(open_(folder))  # no lock file where there is no campaign
    with journal.writing(Path(folder)):
        yield open_(folder)


def require_method(opened: Opened) -> None:
    """Raise InputError where this version computes bounds otherwise than the campaign's."""
    if opened.plan.method != plan.METHOD:
        begun = opened.plan.about.get("kinacc_version", "an earlier version")
        what = f"uses bounds of method {opened.plan.method}; kinacc {__version__} has {plan.METHOD}"
        fix = f"continue it with kinacc {begun}, or begin a new campaign"
        raise InputError(Problem(str(opened.folder), what, fix=fix))


def marks_of(opened: Opened) -> dict[str, object]:
    """What the tables of a campaign are marked with: the plan counts as the configuration."""
    own = {"kinacc_version": __version__, "config_hash": opened.digest}
    return {**own, "seed": opened.plan.seed}


def doubts(opened: Opened) -> list[str]:
    """What to know of a campaign as it was read: another version, a last line that was cut off."""
    lines = []
    begun = opened.plan.about.get("kinacc_version", "an earlier version")
    if begun != __version__:
        lines.append(f"begun with kinacc {begun}, this is {__version__}: bounds may differ")
    if opened.journal.cut_off:
        lines.append(
            "the last entry was cut off while it was written and never confirmed; it is left out: "
            "look whether the last reading has to be recorded again"
        )
    return lines


def held_to(opened: Opened, sha256: str | None, readings: int | None) -> list[Problem]:
    """What speaks against a journal being the one of a report, or going on from it.

    ``readings``: how many the report states; ``sha256``: of the journal up to them.
    """
    path, known = str(opened.folder / journal.JOURNAL), opened.journal
    counts = [state.readings_in(known.entries[:end]) for end in range(len(known.entries) + 1)]
    if readings is not None and counts[-1] < readings:
        return [Problem(path, f"{counts[-1]} readings", f"{readings} as reported")]
    ends = [end for end, count in enumerate(counts) if readings is None or count == readings]
    if sha256 is not None and sha256 not in map(known.sha256, ends):
        what = "is not the journal of that report: it was shortened or rewritten"
        return [Problem(path, what, f"its SHA-256 is {known.sha256()}")]
    return []


def readings_entry(
    readings: Sequence[Reading],
    file: str | None = None,
    path: str | None = None,
) -> dict:
    """The entry of readings that are taken together.

    ``file`` is the digest of their file, ``path`` where it lies from the campaign's folder.
    """
    entry: dict = {"kind": READINGS, "readings": [each.as_entry() for each in readings]}
    entry |= {"file": file} if file is not None else {}
    return entry | ({"path": path} if path is not None else {})


def strike_entry(number: int, reason: str) -> dict:
    """The entry of a reading declared void, by its number from 1."""
    return {"kind": STRIKE, "reading": number, "reason": reason}


def leave_out_entry(point: int, reason: str) -> dict:
    """The entry of a point that cannot be measured."""
    return {"kind": LEAVE_OUT, "point": point, "reason": reason}
