"""Hold every file of a data set to the record of the run that wrote it, and records to the files.

A file without a record, a record without its files, and a byte that is another are all found; so
is one that states other marks or inputs than the record.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from kinacc.artifacts import pictures, records, store
from kinacc.artifacts.contract import INPUTS_DIGESTS
from kinacc.artifacts.records import Record
from kinacc.errors import InputError, Problem
from kinacc.workflow.catalogue import FIGURE_FOLDER, PAGE, STAGES, TABLES, Stage
from kinacc.workflow.verification.lineage import Found
from kinacc.workflow.verification.mending import Doubt

Unit = tuple[str, str | None]  # a stage, and the part of it
_PART = re.compile(r"\d+-of-\d+")


def files_of(folder: Path, stages: Collection[Stage]) -> dict[Unit, list[Path]]:
    """Files of stages that are in a folder, by the run that leaves them."""
    found: dict[Unit, list[Path]] = {}
    for stage in stages:
        for name in stage.outputs:
            if stage.leaves == PAGE:
                there = [folder / f"{name}.html"]
            elif stage.is_figure:
                there = sorted((folder / FIGURE_FOLDER).glob(f"{name}.*"))
            elif stage.scattered:
                there = sorted((folder / name).glob("*.parquet"))
            else:
                there = [folder / f"{name}.parquet"]
            for path in there:
                if path.exists():
                    part = path.stem if stage.scattered else None
                    found.setdefault((stage.name, part), []).append(path)
    return found


def records_there(folder: Path) -> tuple[dict[Unit, Record], list[Found]]:
    """Records of a folder by the run they are about, and what is wrong with these files."""
    known, found = {}, []
    for path in sorted((folder / records.FOLDER).glob("*")):
        if path.name.startswith("."):
            continue  # of a run that is writing, or was stopped
        name, _, part = path.stem.partition(".")
        unit = (name, part or None)
        told = path.suffix == ".json" and name in STAGES
        if not told or (part and not _PART.fullmatch(part)) or bool(part) != STAGES[name].scattered:
            found.append((Problem(str(path), "is the record of no stage", fix="remove it"), ()))
            continue
        try:
            record = records.read(path)
        except InputError as error:
            found += [(each, (Doubt(*unit),)) for each in error.problems]
            continue
        if path.read_bytes() != record.content():
            what = "is not written as records are"
            found.append((Problem(str(path), what), (Doubt(*unit),)))
        elif (record.stage, record.part) != unit:
            said = f"{record.stage} {record.part or ''}".strip()
            problem = Problem(str(path), f"is the record of {said}", f"{name} {part}".strip())
            found.append((problem, (Doubt(*unit),)))
        else:
            known[unit] = record
    return known, found


def check_records(
    folder: Path,
    stages: Collection[Stage],
    known: Mapping[Unit, Record],
    in_doubt: Collection[str],
) -> list[Found]:
    """Problems of files and records with each other; paths ``in_doubt`` have problems already."""
    found: list[Found] = []
    there = files_of(folder, stages)
    if there and not (folder / records.FOLDER).is_dir():
        what = "missing: no record says what these files have to be"
        doubts = tuple(Doubt(*unit) for unit in there)
        return [(Problem(str(folder / records.FOLDER), what), doubts)]
    for unit in dict.fromkeys((*there, *known)):
        place = Path(records.place(folder, *unit))
        if unit not in known:
            if not place.exists():
                names = ", ".join(each.name for each in there[unit])
                what = f"missing: it is lost, or the run that wrote {names} did not come to its end"
                found.append((Problem(str(place), what), (Doubt(*unit),)))
            continue
        own = _held(folder, place, known[unit], there.get(unit, []), in_doubt)
        found += [(problem, (Doubt(*unit),)) for problem in own]
    return found


def _held(
    folder: Path, place: Path, record: Record, there: Collection[Path], in_doubt: Collection[str]
) -> Iterator[Problem]:
    stage = STAGES[record.stage]
    if other := record.misfolded():
        yield Problem(str(place), f"{', '.join(other)} is not that of what it tells")
    names = {path.relative_to(folder).as_posix() for path in there}
    may = {
        f"{stage.name}.html"
        if stage.leaves == PAGE
        else f"{FIGURE_FOLDER}/{name}{kind}"
        if stage.is_figure
        else f"{name}/{record.part}.parquet"
        if record.part
        else f"{name}.parquet"
        for name in stage.outputs
        for kind in (".svg", ".png", ".pdf")
    }
    if strange := sorted(set(record.files) - may):
        yield Problem(str(place), f"names {', '.join(strange)}", f"files of stage {stage.name}")
    if stage.leaves == TABLES and (lacking := sorted(may - set(record.files))):
        yield Problem(str(place), f"does not name {', '.join(lacking)}", "all files of the stage")
    for name in sorted(names - set(record.files)):
        yield Problem(str(folder / name), f"is none of the files that {place} says were written")
    for name in sorted(set(record.files) & may):
        path = folder / name
        if str(path) in in_doubt:
            continue
        if name not in names:
            yield Problem(str(path), "missing", f"as in {place}")
        elif problems := records.misfit(place, record, path, path.read_bytes()):
            yield from problems
        else:
            yield from _stated(place, record, path, record.files[name].columns_digest)


def _stated(place: Path, record: Record, path: Path, digest: str | None) -> Iterator[Problem]:
    """What a file says of itself otherwise than its record does."""
    marks = {**record.marks, INPUTS_DIGESTS: pictures.as_text(record.inputs_digests)}
    if path.suffix == ".parquet":
        said, wanted = store.read_metadata(path), dict(marks)
        if store.stated_digest(path) != digest:
            yield Problem(str(place), f"states another columns_digest than {path}")
    else:
        read = pictures.inputs_digests(path.suffix[1:], path.read_bytes())
        said = {INPUTS_DIGESTS: pictures.as_text(read or {})}
        wanted = {INPUTS_DIGESTS: marks[INPUTS_DIGESTS]}
    if other := sorted(key for key in {*said, *wanted} if said.get(key) != wanted.get(key)):
        yield Problem(str(path), f"states another {', '.join(other)} than {place}")


def folded(folders: Collection[Path]) -> str:
    """One digest of all that the records of data sets say, to be kept where nobody rewrites it.

    Of a table in parts the stage that gathers them says what they hold together, so that it does
    not depend on their number. Empty where there is no record.
    """
    digest, any_ = hashlib.sha256(), False
    for folder in sorted(folders, key=lambda each: each.name):
        for path in sorted((folder / records.FOLDER).glob("*.json")):
            if not _PART.search(path.stem):
                content = hashlib.sha256(path.read_bytes()).hexdigest()
                digest.update(f"{folder.name}/{path.name} {content}\n".encode())
                any_ = True
    return digest.hexdigest() if any_ else ""
