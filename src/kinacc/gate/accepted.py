"""The accepted run: the tables and records that a person has accepted, by reason and date."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from kinacc import __version__
from kinacc.artifacts import records
from kinacc.artifacts.atomic import synchronise, unfinished, write_whole
from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.gate.made import Made, datasets_in, made
from kinacc.workflow.catalogue import TABLES
from kinacc.workflow.results_lock import RUN, undisturbed
from kinacc.workflow.verification.recorded import folded

FOLDER, NOTE = "accepted", "accepted.json"
_FORMAT = "kinacc accepted 1"
# What build servers set in the environment of what they run.
BUILD_SERVERS = (
    *("CI", "CONTINUOUS_INTEGRATION", "BUILD_ID", "BUILD_NUMBER", "GITHUB_ACTIONS", "GITLAB_CI"),
    *("JENKINS_URL", "TF_BUILD", "TEAMCITY_VERSION", "CIRCLECI", "TRAVIS", "BUILDKITE"),
    *("BITBUCKET_BUILD_NUMBER", "DRONE", "APPVEYOR", "CODEBUILD_BUILD_ID"),
)


@dataclass(frozen=True)
class Acceptance:
    """Who accepted what and why; ``digest`` is that of all records of the accepted run."""

    reason: str
    date: str
    by: str
    digest: str
    kinacc_version: str
    datasets: tuple[str, ...]


@dataclass(frozen=True)
class Accepted:
    """The accepted run, and by ``before`` the acceptances that it took the place of, last first."""

    last: Acceptance
    before: tuple[Acceptance, ...] = ()

    def content(self) -> bytes:
        """The note as JSON."""
        told = {"format": _FORMAT, **asdict(self.last), "before": [*map(asdict, self.before)]}
        return (json.dumps(told, indent=1, ensure_ascii=False) + "\n").encode()


def read(folder: Path) -> Accepted | None:
    """What the note of an accepted run says; None where there is none.

    Raises InputError where it cannot be read.
    """
    place = folder / NOTE
    try:
        told = json.loads(place.read_bytes())
        if told.pop("format") != _FORMAT:
            raise ValueError
        before = tuple(map(_acceptance, told.pop("before")))
        return Accepted(_acceptance(told), before)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InputError(Problem(str(place), f"cannot be read: {error.strerror}")) from None
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise InputError(Problem(str(place), "is no note of an accepted run")) from None


def _acceptance(told: Mapping[str, Any]) -> Acceptance:
    if not all(isinstance(each, str) for key, each in told.items() if key != "datasets"):
        raise ValueError
    return Acceptance(**{**told, "datasets": tuple(map(str, told["datasets"]))})


def held(folder: Path) -> dict[str, Made]:
    """The data sets of an accepted run, or of results, as their records say.

    Raises InputError where there is none, or where anything is not as it was accepted.
    """
    names, note = datasets_in(folder), read(folder)
    if not names:
        raise InputError(Problem(str(folder), "holds no accepted run", fix=_fix_of_none(folder)))
    found = {name: made(folder / name) for name in names}
    problems = [problem for each in found.values() for problem in each.problems]
    digest = folded([folder / name for name in names])
    if note is not None and note.last.digest != digest:
        what = f"is not as it was accepted: the digest of its records is {digest}"
        problems.append(Problem(str(folder), what, note.last.digest, "restore it, or accept anew"))
    problems += [
        problem
        for each in found.values()
        for name, problem in each.unsound.items()
        if name.endswith(".parquet")
    ]
    refuse(problems, "The accepted run cannot be used")
    return found


def _fix_of_none(folder: Path) -> str:
    aside = sorted(folder.parent.glob(f".{folder.name}.*.before"))
    if aside and not folder.exists():
        return f"the last `kinacc accept` was stopped: mv {aside[-1]} {folder}"
    return 'kinacc accept RESULTS --reason ".." makes one'


def refusals(environment: Mapping[str, str]) -> Iterator[Problem]:
    """Why nobody can accept anything here: a run is accepted by a person."""
    servers = [
        name
        for name in BUILD_SERVERS
        if environment.get(name, "").lower() not in ("", "0", "false", "no")
    ]
    fix = "accept it by hand, where you have looked at it"
    if servers:
        yield Problem("environment", f"a build server is at work ({first_few(servers)})", fix=fix)
    if environment.get(RUN):
        yield Problem("environment", f"a workflow runs this ({RUN})", fix=fix)


def accept(
    results: Path,
    folder: Path,
    acceptance: Mapping[str, str],
    datasets: Sequence[str] = (),
    problems: Sequence[Problem] = (),
) -> Accepted:
    """Make results the accepted run in a folder, which is replaced whole or not at all.

    ``datasets``: these alone; of others what was accepted stays. ``acceptance`` holds reason, date
    and who. ``problems`` are those known already: all are said at once by InputError.
    """
    names = [*datasets] or datasets_in(results)
    found = [*problems, *_unusable(results, folder, names, acceptance)]
    before = None
    try:
        before = read(folder)
        kept = [each for each in datasets_in(folder) if datasets and each not in names]
    except InputError as error:
        found += error.problems
    refuse(found, "Nothing was accepted")
    new = unfinished(folder)
    try:
        with undisturbed(results):
            for name in names:
                _copy(made(results / name), new / name)
        for name in kept:
            shutil.copytree(folder / name, new / name)
        digest = folded([new / name for name in (*names, *kept)])
        last = Acceptance(
            **acceptance,
            digest=digest,
            kinacc_version=__version__,
            datasets=tuple(sorted((*names, *kept))),
        )
        chain = () if before is None else (before.last, *before.before)
        note = Accepted(last, chain)
        write_whole(new / NOTE, note.content())
        _on_disk(new)
        _replace(new, folder)
    finally:
        shutil.rmtree(new, ignore_errors=True)
    return note


def _unusable(
    results: Path, folder: Path, names: Sequence[str], acceptance: Mapping[str, str]
) -> Iterator[Problem]:
    there = datasets_in(results)
    if not acceptance["reason"].strip():
        yield Problem("--reason", "is empty", "why this run is as it should be, in words")
    if not there:
        one = (results / records.FOLDER).is_dir()
        fix = f"give {results.parent} and --dataset {results.name}" if one else ""
        yield Problem(str(results), "holds no data set with records", "a results folder", fix)
    elif unknown := [name for name in names if name not in there]:
        yield Problem("--dataset", f"{first_few(unknown)} is none of {results}", ", ".join(there))
    places = results.resolve(), folder.resolve()
    if places[0] in (places[1], *places[1].parents) or places[1] in places[0].parents:
        yield Problem("--to", f"{folder} and {results} are one in the other", "a folder beside it")
    elif (
        folder.exists()
        and not (folder / NOTE).is_file()
        and (not folder.is_dir() or any(folder.iterdir()))
    ):
        what = f"holds no accepted run, and is not empty: {NOTE} is not there"
        yield Problem(str(folder), what, "a folder of its own")


def _copy(data_set: Made, to: Path) -> None:
    """Tables and records of a data set, as they are."""
    for stage in data_set.stages():
        for record in data_set.by_stage[stage.name]:
            place = Path(records.place(data_set.folder, stage.name, record.part))
            names = [*record.files] if stage.leaves == TABLES else []
            for path in (place, *(data_set.folder / name for name in names)):
                target = to / path.relative_to(data_set.folder)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, target)


def _on_disk(folder: Path) -> None:
    for within, _, names in os.walk(folder):
        for name in names:
            synchronise(Path(within, name))
        synchronise(Path(within))


def _replace(new: Path, folder: Path) -> None:
    """Put a folder in the place of another, which comes back where that does not succeed."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    aside = new.with_name(new.name.removesuffix(".partial") + ".before")
    if folder.exists():
        os.rename(folder, aside)
    try:
        os.rename(new, folder)
    except BaseException:
        with suppress(OSError):
            os.rename(aside, folder)
        raise
    shutil.rmtree(aside, ignore_errors=True)
