"""The folder of a campaign: started once, read, and written to under its lock."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from kinacc import __version__
from kinacc.campaign import journal, plan, state
from kinacc.campaign.plan import Plan
from kinacc.campaign.reading import Reading
from kinacc.campaign.state import READINGS, State
from kinacc.config import json_files
from kinacc.errors import InputError, Problem, refuse
from kinacc.tables.atomic import write_whole


@dataclass(frozen=True)
class Opened:
    """A campaign as read: its folder, plan, journal and the digest of the plan."""

    folder: Path
    plan: Plan
    journal: journal.Journal
    digest: str

    def state(self, watch=None) -> State:
        """Return its state; ``watch`` as in ``kinacc.campaign.state.restore``."""
        where = str(self.folder / journal.JOURNAL)
        return state.restore(self.plan, self.journal.entries, watch, where)

    @property
    def recorded(self) -> tuple[str, ...]:
        """The times of its entries."""
        return tuple(str(each["at"]) for each in self.journal.entries if "at" in each)

    def write(self, entry: Mapping) -> None:
        """Append an entry, with the time; on disk when this returns. Only while ``writing``."""
        stamped = {**entry, "at": datetime.now(UTC).isoformat(timespec="seconds")}
        journal.append(self.folder / journal.JOURNAL, self.journal, stamped)


def in_the_way(folder: Path | str) -> list[Problem]:
    """Return a problem for each file of a campaign that a folder holds already."""
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
    begun = plan.from_json(text, str(path))
    return Opened(folder, begun, journal.read(folder / journal.JOURNAL, digest), digest)


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
    """Return the provenance of the tables: plan and journal count as the configuration."""
    made_of = plan.digest(f"{opened.digest} {opened.journal.sha256()}".encode())
    return {"kinacc_version": __version__, "config_hash": made_of, "seed": opened.plan.seed}


def doubts(opened: Opened) -> list[str]:
    """Return what is unusual: begun with another version, or a last line that was cut off."""
    begun = opened.plan.about.get("kinacc_version", "an earlier version")
    lines = [f"begun with kinacc {begun}, this is {__version__}"] if begun != __version__ else []
    if opened.journal.cut_off:
        lines.append(
            "the last entry was cut off while written and never confirmed: is the last reading to "
            "be recorded again?"
        )
    return lines


@dataclass(frozen=True)
class Verification:
    """Whether a journal is whole, and continues the one of a report; ``problems`` where not."""

    campaign: str
    entries: int
    readings: int
    sha256: str
    problems: tuple[str, ...]


def verify(opened: Opened, sha256: str | None = None, readings: int | None = None) -> Verification:
    """Compare a journal with what a report states of it.

    ``readings``: their number; ``sha256``: of the journal up to them. Checksums of the lines are
    checked where a journal is opened.
    """
    known = opened.journal
    counts = [state.readings_in(known.entries[:end]) for end in range(len(known.entries) + 1)]
    ends = [end for end, count in enumerate(counts) if readings is None or count == readings]
    problems = []
    if readings is not None and counts[-1] < readings:
        problems.append(f"{counts[-1]} readings, {readings} reported")
    elif sha256 is not None and sha256 not in map(known.sha256, ends):
        problems.append("not the journal of that report: it was shortened or rewritten")
    return Verification(
        opened.digest, len(known.entries), counts[-1], known.sha256(), tuple(problems)
    )


def readings_entry(
    readings: Sequence[Reading], file: str | None = None, path: str | None = None
) -> dict:
    """Return the entry of readings that are taken together.

    ``file`` is the digest of their file, ``path`` where it lies from the campaign's folder.
    """
    entry: dict = {"kind": READINGS, "readings": [each.as_entry() for each in readings]}
    entry |= {"file": file} if file is not None else {}
    return entry | ({"path": path} if path is not None else {})
