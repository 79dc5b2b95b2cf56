"""What explains that a result is another: what it was made from, by the records of both runs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from kinacc.artifacts.provenance import PYTHON
from kinacc.artifacts.records import Record
from kinacc.gate.made import Made, made
from kinacc.gate.outcome import (
    CODE,
    CONFIGURATION,
    INPUT,
    SEED,
    UNEXPLAINED,
    VERSION,
    Cause,
)
from kinacc.workflow.catalogue import maker_of

_PACKAGE = "kinacc"
_KINDS = (UNEXPLAINED, INPUT, CONFIGURATION, SEED, VERSION, CODE)
# Keys of the configuration that name the file of a role.
_KEYS = {
    "measurements_file": "measurements.file.path",
    "joints_file": "measurements.file.joints.path",
    "robot_file": "robot",
    "robot_urdf_file": "robot",
}


@dataclass(frozen=True)
class Causes:
    """The causes of what differs between two runs of a data set, worked out once for each stage."""

    before: Made
    now: Made
    known: dict[str, tuple[Cause, ...]] = field(default_factory=dict, init=False, repr=False)
    others: dict[str, Causes] = field(default_factory=dict, init=False, repr=False)

    def of_stage(self, name: str) -> tuple[Cause, ...]:
        """Why the tables of a stage may differ: its own changes, and those of what it read.

        One cause of kind ``unexplained`` where nothing that it was made from has changed.
        """
        if name not in self.known:
            self.known[name] = ()  # no stage follows from itself
            self.known[name] = self._worked_out(name)
        return self.known[name]

    def _worked_out(self, name: str) -> tuple[Cause, ...]:
        old, new = self.before.record(name), self.now.record(name)
        if old is None or new is None:
            return self._more_or_fewer(name)
        found = dict.fromkeys((*changes(old, new), *_files(old, new)))
        for role in {**old.inputs_digests, **new.inputs_digests}:
            was, is_ = old.inputs_digests.get(role, ""), new.inputs_digests.get(role, "")
            if was != is_ and not _is_file(role):
                found |= dict.fromkeys(self._read(role, was, is_))
        found |= dict.fromkeys(self._made_from_others(name, new))
        return _in_order(found) or (Cause(UNEXPLAINED, name),)

    def _read(self, role: str, was: str, is_: str) -> Iterable[Cause]:
        """Causes of another table that was read, of this data set or of another."""
        whose, _, artefact = role.rpartition("/")
        maker, own = maker_of(artefact).name, self._of_dataset(whose)
        if was and is_ and own.before.record(maker) and own.now.record(maker):
            return own.of_stage(maker)
        where = whose or artefact
        return [Cause(INPUT, where, "read" if was else "not read", "read" if is_ else "not read")]

    def _of_dataset(self, name: str) -> Causes:
        if not name:
            return self
        if name not in self.others:
            folders = (each.folder.parent / name for each in (self.before, self.now))
            self.others[name] = Causes(*map(made, folders))
        return self.others[name]

    def _made_from_others(self, name: str, new: Record) -> Iterator[Cause]:
        """Inputs that are not those now in the folder: the file comes from another run."""
        for role, digest in new.inputs_digests.items():
            if _is_file(role) or "/" in role:
                continue
            maker = maker_of(role)
            digest_of = self.now.joined if maker.scattered else self.now.digest
            there = digest_of(role, maker) if self.now.record(maker.name) else ""
            if there and there != digest:
                yield Cause(UNEXPLAINED, name, f"made from {role} {there[:16]}", digest[:16])

    def _more_or_fewer(self, name: str) -> tuple[Cause, ...]:
        """Why one of the runs alone has a stage: what the configurations differ in."""
        found = {
            cause: None
            for stage in self.now.stages()
            if (old := self.before.record(stage.name)) and (new := self.now.record(stage.name))
            for cause in changes(old, new)
            if cause.kind == CONFIGURATION
        }
        return _in_order(found) or (Cause(UNEXPLAINED, name),)

    def own(self) -> tuple[Cause, ...]:
        """All that changed, whether anything differs for it or not."""
        return _in_order(
            dict.fromkeys(
                cause
                for stage in self.now.stages()
                if (old := self.before.record(stage.name)) and (new := self.now.record(stage.name))
                for cause in (*changes(old, new), *_files(old, new))
            )
        )


def changes(old: Record, new: Record) -> Iterator[Cause]:
    """What one run of a stage had otherwise than another, what it read aside."""
    yield from _settings(old, new)
    versions = old.marks.get("kinacc_version", ""), new.marks.get("kinacc_version", "")
    if old.code is None or new.code is None:
        if old.marks.get("code_hash") != new.marks.get("code_hash"):
            if versions[0] != versions[1]:
                yield Cause(VERSION, _PACKAGE, *versions)
            before, after = old.marks.get("code_hash", ""), new.marks.get("code_hash", "")
            yield Cause(CODE, "code or versions", before, after)
        return
    if versions[0] != versions[1]:
        yield Cause(VERSION, _PACKAGE, *versions)
    for name, was, is_ in _unequal(old.versions or {}, new.versions or {}):
        yield Cause(VERSION, "Python" if name == PYTHON else name, was or "", is_ or "")
    for name, was, is_ in _unequal(old.code, new.code):
        if name != _PACKAGE or versions[0] == versions[1]:  # the module that says the version
            yield Cause(CODE, name, (was or "")[:16], (is_ or "")[:16])


def _settings(old: Record, new: Record) -> Iterator[Cause]:
    if old.settings is None or new.settings is None:
        if old.marks.get("config_hash") != new.marks.get("config_hash"):
            before, after = old.marks.get("config_hash", ""), new.marks.get("config_hash", "")
            yield Cause(CONFIGURATION, f"values that {new.stage} depends on", before, after)
        return
    for key, was, is_ in _unequal(_flat(old.settings), _flat(new.settings)):
        kind = SEED if key == "seed" else CONFIGURATION
        yield Cause(kind, key, was or "", is_ or "")


def _flat(settings: Mapping[str, object], above: str = "") -> dict[str, str]:
    """Settings by dotted key, as text."""
    found: dict[str, str] = {}
    for key, value in settings.items():
        if isinstance(value, Mapping) and value:
            found |= _flat(value, f"{above}{key}.")
        else:
            found[above + key] = value if isinstance(value, str) else json.dumps(value)
    return found


def _unequal(
    old: Mapping[str, str], new: Mapping[str, str]
) -> Iterator[tuple[str, str | None, str | None]]:
    for key in sorted({**old, **new}):
        if old.get(key) != new.get(key):
            yield key, old.get(key), new.get(key)


def _in_order(causes: Iterable[Cause]) -> tuple[Cause, ...]:
    """Causes by kind, what a person decides on first, and by name."""
    return tuple(sorted(causes, key=lambda each: (_KINDS.index(each.kind), each.where)))


def _files(old: Record, new: Record) -> Iterator[Cause]:
    """Files from outside that hold something else."""
    for role, was, is_ in _unequal(old.inputs_digests, new.inputs_digests):
        if _is_file(role):
            yield Cause(INPUT, _file(role, new), (was or "")[:16], (is_ or "")[:16])


def _is_file(role: str) -> bool:
    return role.endswith("_file")


def _file(role: str, record: Record) -> str:
    """A file from outside by the key that names it, and its name."""
    key = _KEYS.get(role.rpartition("/")[2])
    if key is None:
        return role
    name: object = record.settings
    for each in key.split("."):
        name = name.get(each) if isinstance(name, Mapping) else None
    return f"{key} ({name})" if isinstance(name, str) else key


def in_words(causes: Iterable[Cause], shown: int = 3) -> str:
    """Causes in one phrase: what changed, of code and versions the first few."""
    by_kind: dict[str, list[Cause]] = {}
    for cause in causes:
        by_kind.setdefault(cause.kind, []).append(cause)
    return "; ".join(
        _WORDS[kind](each[:shown]) + (f" and {len(each) - shown} more" if len(each) > shown else "")
        for kind, each in by_kind.items()
    )


def _from_to(each: Cause) -> str:
    return f"{each.where} ({each.before or 'not there'} before, {each.after or 'not there'} now)"


_WORDS: dict[str, Callable[[list[Cause]], str]] = {
    CONFIGURATION: lambda found: f"configuration: {', '.join(map(_from_to, found))}",
    SEED: lambda found: f"seed: {', '.join(map(_from_to, found))}",
    VERSION: lambda found: f"version: {', '.join(map(_from_to, found))}",
    CODE: lambda found: f"code changed: {', '.join(each.where for each in found)}",
    INPUT: lambda found: f"data changed: {', '.join(each.where for each in found)}",
    UNEXPLAINED: lambda found: f"unexplained: {', '.join(each.where for each in found)}",
}
