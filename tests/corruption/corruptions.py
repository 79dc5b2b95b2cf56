"""Random corruptions of a results folder, and what the check of results says of each.

``tools/corrupt --cases 1000 --seed 1`` prints how many are found, for
each artefact, where nothing is renewed, where the digests inside the file are, and where the
digests, the record and all that is made from the file are as well.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
import traceback
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from itertools import cycle, product
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from whole_project import write_poses

from kinacc.artifacts import pictures, provenance, records, store
from kinacc.artifacts.contract import COLUMNS_DIGEST, INPUTS_DIGESTS
from kinacc.workflow.catalogue import TABLES
from kinacc.workflow.plan import Plan, planned
from kinacc.workflow.runner import perform
from kinacc.workflow.verification import check
from kinacc.workflow.verification.recomputation import Again

ROOT = Path(__file__).resolve().parents[2]
LEVELS = ("nothing", "file", "all")  # what of digests is renewed
SMALL = """\
seed: {seed}
measurements: {{folds: 2, synthetic: {{poses: 80}}}}
calibration: {{vec: {{order: 2}}}}
evaluation: {{points: 12}}
map: {{slices_deg: [0, 30], grid_mm: 250}}
study: {{noise_mm: [0.1, 0.3], repetitions: 4, measurements: 20}}
histories: {{simulations_searched: 20}}
figures: {{formats: [{formats}]}}
datasets:
  own:
    robot: mh180
    calibration: {{compliance: {{joints: [2, 3]}}}}
    evaluation: {{space: measured}}
    measurements:
      source: file
      file:
        path: poses.csv
        orientation: {{kind: quaternion}}
        exclude: [{{lines: [5], reason: the probe was touched}}]
"""


def study(
    folder: Path, seed: int, formats: str = "svg, png, pdf", drawn: Sequence[str] = ("mh180", "own")
) -> Plan:
    """A finished study of a synthetic and of a measured arm, in ``folder``/results.

    ``drawn``: the data sets that have pictures and a page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_poses(folder / "poses.csv", 80 + seed % 7)
    (folder / "small.yaml").write_text(SMALL.format(seed=seed, formats=formats))
    plan = planned([ROOT / "config.yaml", folder / "small.yaml"], results=str(folder / "results"))
    for dataset in plan.datasets:
        for name, stage in plan.stages(dataset).items():
            wanted = not stage.on_request and (dataset in drawn or stage.leaves == TABLES)
            for part in plan.part_names(name, dataset) if wanted else ():
                perform(plan.job(name, dataset, part))
    return plan


# What can happen to bytes: (bytes, generator) -> bytes.


def _cut(content: bytes, draw: np.random.Generator) -> bytes:
    return content[: draw.integers(0, len(content))]


def _bit(content: bytes, draw: np.random.Generator) -> bytes:
    place, bit = int(draw.integers(0, len(content))), int(draw.integers(8))
    return content[:place] + bytes([content[place] ^ 1 << bit]) + content[place + 1 :]


def _zeroed(content: bytes, draw: np.random.Generator) -> bytes:
    first = int(draw.integers(0, max(1, len(content) - 512)))
    return content[:first] + bytes(len(content[first : first + 512])) + content[first + 512 :]


BYTES: dict[str, Callable[[bytes, np.random.Generator], bytes]] = {
    "cut": _cut,
    "bit": _bit,
    "zeroed block": _zeroed,
}

# What can happen to a table: (table, generator) -> table, None where it cannot.


def _renamed(table: pa.Table, draw: np.random.Generator) -> pa.Table:
    place = int(draw.integers(table.num_columns))
    names = [f"{n}_2" if i == place else n for i, n in enumerate(table.column_names)]
    return table.rename_columns(names).replace_schema_metadata(table.schema.metadata)


def _swapped(table: pa.Table, draw: np.random.Generator) -> pa.Table | None:
    pairs = [
        (a, b)
        for a, b in product(range(table.num_columns), repeat=2)
        if a < b and table.schema.field(a).type == table.schema.field(b).type
        if not table.column(a).null_count and not table.column(b).null_count
        if not table.column(a).equals(table.column(b))
    ]
    if not pairs:
        return None
    a, b = pairs[draw.integers(len(pairs))]
    columns = list(table.columns)
    columns[a], columns[b] = columns[b], columns[a]
    return pa.Table.from_arrays(columns, schema=table.schema)


def _with(table: pa.Table, column: int, row: int, value: object) -> pa.Table:
    values, field = table.column(column).to_pylist(), table.schema.field(column)
    values[row] = value
    return table.set_column(column, field, pa.array(values, field.type))


def _number(factor: float) -> Callable[[pa.Table, np.random.Generator], pa.Table | None]:
    def change(table: pa.Table, draw: np.random.Generator) -> pa.Table | None:
        for column in draw.permutation(table.num_columns).tolist():
            kind, values = table.schema.field(column).type, table.column(column).to_pylist()
            rows = [i for i, value in enumerate(values) if value and not isinstance(value, str)]
            if rows and kind != pa.int8():
                row = rows[draw.integers(len(rows))]
                new = values[row] * factor
                if pa.types.is_integer(kind):
                    new = max(int(new), values[row] + 1)
                return _with(table, column, row, new)
        return None

    return change


def _word(table: pa.Table, draw: np.random.Generator) -> pa.Table | None:
    for column in draw.permutation(table.num_columns).tolist():
        values = table.column(column).to_pylist()
        if table.schema.field(column).type != pa.string() or not any(values):
            continue
        row = int(draw.integers(len(values)))
        others = [each for each in dict.fromkeys(values) if each and each != values[row]]
        new = others[draw.integers(len(others))] if others else f"{values[row] or ''}x"
        return _with(table, column, row, new)
    return None


def _dropped(table: pa.Table, draw: np.random.Generator) -> pa.Table | None:
    if not table.num_rows:
        return None
    return table.take(np.delete(np.arange(table.num_rows), draw.integers(table.num_rows)))


def _doubled(table: pa.Table, draw: np.random.Generator) -> pa.Table | None:
    if not table.num_rows:
        return None
    row = int(draw.integers(table.num_rows))
    return table.take([*range(row + 1), *range(row, table.num_rows)])


def _shuffled(table: pa.Table, draw: np.random.Generator) -> pa.Table | None:
    return table.take(draw.permutation(table.num_rows)) if table.num_rows > 1 else None


ROWS: dict[str, Callable[[pa.Table, np.random.Generator], pa.Table | None]] = {
    "column renamed": _renamed,
    "columns swapped": _swapped,
    "number by 1 %": _number(1.01),
    "number tenfold": _number(10.0),
    "word": _word,
    "row dropped": _dropped,
    "row doubled": _doubled,
    "rows shuffled": _shuffled,
}
FOREIGN = ("another data set's", "an older run's")


@dataclass(frozen=True)
class Case:
    """One corruption: what happens to which file of which data set, and what is renewed."""

    dataset: str
    file: str
    kind: str
    draw: int
    level: str

    @property
    def artefact(self) -> str:
        """Name of the table, or what else the file is."""
        path = Path(self.file)
        if path.suffix == ".parquet":
            return path.parent.name if "/" in self.file else path.stem
        return {".json": "records", ".html": "page"}.get(path.suffix, f"pictures {path.suffix}")


@dataclass
class Study:
    """A finished study to be corrupted, and an older one whose files may take the place of its."""

    plan: Plan
    older: Path

    def __post_init__(self) -> None:
        """Remember every file as it is."""
        self.folder = Path(self.plan.results)
        self.files = {
            path.relative_to(self.folder).as_posix(): path.read_bytes()
            for path in sorted(self.folder.rglob("*"))
            if path.is_file() and "logs" not in path.parts
        }

    def cases(self, count: int, seed: int, level: str) -> list[Case]:
        """As many cases, an equal quota for each artefact and kind; every one changes its file."""
        generator = np.random.default_rng([seed, LEVELS.index(level)])
        places: dict[tuple[str, str], list[tuple[str, str]]] = {}
        for name in self.files:
            dataset, _, file = name.partition("/")
            if file.endswith(".json") and level == "all":
                continue  # a record that says what is there is no corruption
            kinds = (*BYTES, *FOREIGN, *(ROWS if file.endswith(".parquet") else ()))
            for kind in kinds:
                artefact = Case(dataset, file, kind, 0, level).artefact
                places.setdefault((artefact, kind), []).append((dataset, file))
        found: list[Case] = []
        for key in cycle([*generator.permutation(np.array(list(places), dtype=object))]):
            kind, where = key[1], places[tuple(key)]
            dataset, file = where[generator.integers(len(where))]
            case = Case(dataset, file, kind, int(generator.integers(2**31)), level)
            if self.corrupted(case) is not None:
                found.append(case)
            if len(found) == count:
                return found
        raise ValueError("nothing to corrupt")

    def corrupted(self, case: Case) -> bytes | None:
        """Content of the file after a case; None where it would be as it was."""
        name, draw = f"{case.dataset}/{case.file}", np.random.default_rng(case.draw)
        before = self.files[name]
        if case.kind in BYTES:
            after = BYTES[case.kind](before, draw)
            unsaid = case.level == "all" and _says(name, after) == _says(name, before)
            return None if after == before or unsaid else after
        if case.kind in FOREIGN:
            other = self._foreign(case)
            content = other.read_bytes() if other.is_file() else before
            if not name.endswith(".parquet"):
                return None if content == before else content
            old, new = _table(before), _table(content)
            if case.level == "all":
                new = new.replace_schema_metadata(old.schema.metadata)
        else:
            old = _table(before)
            changed = ROWS[case.kind](old, draw)
            if changed is None:
                return None
            new = changed
        if store.columns_digest(new) == store.columns_digest(old):
            return None
        if case.level != "nothing":
            new = signed(new)
        return store.content_of(new)

    def _foreign(self, case: Case) -> Path:
        if case.kind == "an older run's":
            return self.older / case.dataset / case.file
        other = next(name for name in self.plan.datasets if name != case.dataset)
        return self.folder / other / case.file

    def told(self, case: Case) -> list[str]:
        """Problems that the check finds after a case; the folder is as it was afterwards."""
        name, content = f"{case.dataset}/{case.file}", self.corrupted(case)
        assert content is not None
        changed = {name: content}
        if case.level == "all":
            changed |= renewed(self.folder, self.files, case.dataset, name, content)
        try:
            for each, new in changed.items():
                (self.folder / each).write_bytes(new)
            with ExitStack() as stack:
                if case.level != "all":  # found before anything is computed again
                    nothing = lambda *_: Again((), [], [])  # noqa: E731
                    stack.enter_context(patch.object(check, "computed_again", nothing))
                report = check.check_results(self.folder / case.dataset, self.plan)
            return [str(each) for one in report.datasets for each in one.problems]
        except Exception:
            traceback.print_exc()  # no way to tell of a corruption
            return []
        finally:
            for each in changed:
                (self.folder / each).write_bytes(self.files[each])


def _table(content: bytes) -> pa.Table:
    return pq.read_table(pa.BufferReader(content))


def _says(name: str, content: bytes) -> object:
    """What a table says, whatever its bytes; of other files the bytes."""
    if not name.endswith(".parquet"):
        return content
    try:
        with pq.ParquetFile(pa.BufferReader(content), page_checksum_verification=True) as file:
            table = file.read()
        return table.schema.metadata, store.columns_digest(table)
    except Exception:
        return content


def signed(table: pa.Table) -> pa.Table:
    digest = {COLUMNS_DIGEST.encode(): store.columns_digest(table).encode()}
    return table.replace_schema_metadata({**(table.schema.metadata or {}), **digest})


def renewed(
    folder: Path, files: dict[str, bytes], dataset: str, name: str, content: bytes
) -> dict[str, bytes]:
    """All that someone renews who knows every digest, after a file of a data set has changed.

    What was made from a table states its new digest, records state the new files.
    """
    changed = {name: content}
    record = _record_of(folder, name)
    own = {each: text for each, text in files.items() if each.startswith(f"{dataset}/")}
    if name.endswith(".parquet"):
        artefact = Case(dataset, name.partition("/")[2], "", 0, "").artefact
        try:
            digest = _joined_digest(own | changed, dataset, artefact)
        except Exception:  # not a table any more
            digest = ""
        for place in [each for each in own if "/records/" in each] if digest else []:
            known = json.loads(own[place])
            if known["inputs_digests"].get(artefact, digest) != digest:
                changed |= _from_another(own, dataset, place, known, artefact, digest)
    known = json.loads(changed.get(record, own[record]))
    place = name.partition("/")[2]
    known["files"][place]["sha256"] = records.Written.of(content).sha256
    if name.endswith(".parquet"):
        with suppress(Exception):  # where it is no table any more
            known["files"][place]["columns_digest"] = store.columns_digest(_table(content))
    changed[record] = _content(known)
    return changed


def _from_another(
    own: dict[str, bytes], dataset: str, place: str, known: dict, artefact: str, digest: str
) -> dict[str, bytes]:
    """The files of a record, and the record, as made from another table."""
    before, old = known["inputs_digests"][artefact], known["marks"]["inputs_hash"]
    known["inputs_digests"][artefact] = digest
    new = known["marks"]["inputs_hash"] = provenance.inputs_hash(known["inputs_digests"])
    changed = {}
    for file, told in known["files"].items():
        each = f"{dataset}/{file}"
        if each.endswith(".parquet"):
            table = _table(own[each])
            stated = {
                INPUTS_DIGESTS: pictures.as_text(known["inputs_digests"]),
                "inputs_hash": new,
            }
            metadata = table.schema.metadata | {k.encode(): v.encode() for k, v in stated.items()}
            changed[each] = store.content_of(table.replace_schema_metadata(metadata))
        else:
            text = own[each].replace(before.encode(), digest.encode())
            text = text.replace(old.encode(), new.encode())
            changed[each] = _with_checksums(text) if each.endswith(".png") else text
        told["sha256"] = records.Written.of(changed[each]).sha256
    return changed | {place: _content(known)}


def _content(known: dict) -> bytes:
    files = {name: records.Written(**told) for name, told in known["files"].items()}
    return replace(records.Record(**{**known, "files": {}}), files=files).content()


def _record_of(folder: Path, name: str) -> str:
    dataset, _, file = name.partition("/")
    for path in sorted((folder / dataset / records.FOLDER).iterdir()):
        if file in json.loads(path.read_bytes())["files"]:
            return path.relative_to(folder).as_posix()
    raise LookupError(name)


def _joined_digest(files: dict[str, bytes], dataset: str, artefact: str) -> str:
    whole = f"{dataset}/{artefact}.parquet"
    if whole in files:
        return store.columns_digest(_table(files[whole]))
    parts = [files[each] for each in sorted(files) if each.startswith(f"{dataset}/{artefact}/")]
    table = pa.concat_tables([_table(each) for each in parts])
    key = store.artefact_named(artefact).key
    return store.columns_digest(table.sort_by([(name, "ascending") for name in key]))


def _with_checksums(content: bytes) -> bytes:
    """A PNG whose chunks have the checksums of what they hold."""
    made, place = content[:8], 8
    while place < len(content):
        length = int.from_bytes(content[place : place + 4], "big")
        chunk = content[place + 4 : place + 8 + length]
        made += content[place : place + 4] + chunk + zlib.crc32(chunk).to_bytes(4, "big")
        place += 12 + length
    return made


RULES = {  # words of a problem, and what found it
    "computed again": "computed again",
    "Parquet file": "page checksum",
    "columns_digest": "digest of columns",
    "SHA-256": "record",
    "inputs_digests": "digests of inputs",
}


def rule_of(problems: Sequence[str]) -> str:
    """What found a corruption, by the first problem that is told; nothing where none is."""
    if not problems:
        return ""
    return next((rule for words, rule in RULES.items() if words in problems[0]), "contract")


def table_of(outcomes: Sequence[tuple[Case, list[str]]]) -> Iterator[str]:
    """Lines: for each artefact how many of how many are found at each level, and by what."""
    yield f"{'artefact':24}" + "".join(f"{f'renewed: {level}':>20}" for level in LEVELS)
    for artefact in sorted({case.artefact for case, _ in outcomes}):
        own = [(case, told) for case, told in outcomes if case.artefact == artefact]
        cells = []
        for level in LEVELS:
            of_level = [told for case, told in own if case.level == level]
            cells.append(f"{sum(map(bool, of_level))} of {len(of_level)}")
        by = Counter(rule_of(told) for case, told in own if case.level == "all" and told)
        said = ", ".join(f"{rule} {number}" for rule, number in by.most_common())
        yield f"{artefact:24}" + "".join(f"{cell:>20}" for cell in cells) + f"  {said}"
    for level in LEVELS:
        told = [told for case, told in outcomes if case.level == level]
        yield f"renewed: {level}: {sum(map(bool, told))} of {len(told)} found"


def main() -> None:
    """Print what is found of many corruptions, and each that is not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--levels", nargs="+", choices=LEVELS, default=LEVELS)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        study(Path(place) / "older", 5)
        own = Study(study(Path(place) / "own", 20), Path(place) / "older" / "results")
        outcomes, began = [], time.process_time()
        for level in given.levels:
            for case in own.cases(given.cases, given.seed, level):
                told = own.told(case)
                outcomes.append((case, told))
                if not told:
                    print(f"not found: {case}", flush=True)
    print(*table_of(outcomes), sep="\n")
    print(f"{(time.process_time() - began) / len(outcomes):.2f} s of CPU time a case")


if __name__ == "__main__":
    main()
