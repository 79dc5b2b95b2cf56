"""What the scripts of the workflow share: inputs held to their digests, a log, outputs and sums."""

from __future__ import annotations

import os
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from kinacc import __version__
from kinacc.errors import KinaccError, Problem, gathered, refuse, refused
from kinacc.progress import reporting
from kinacc.tables import store, sums
from kinacc.tables.atomic import write_together
from kinacc.workflow.code import config_hash


@dataclass(frozen=True)
class Stage:
    """One job: ``inputs`` are tables (columns) and other files (paths) by role.

    ``read`` are the digests of its inputs by their name in the folder of the data set.
    """

    dataset: str
    inputs: dict[str, Any]
    settings: Mapping[str, Any]
    seed: int
    outputs: Mapping[str, str]
    folder: Path
    read: Mapping[str, str]

    def marks(self) -> dict[str, str]:
        """What the artefacts of this job are marked with, see the artefact contract."""
        digest = config_hash(self.settings)
        return {"kinacc_version": __version__, "config_hash": digest, "seed": str(self.seed)}

    def write_tables(self, tables: Mapping[str, Mapping[str, Any]]) -> None:
        """Check every table against its schema, then write all of them and their digests."""
        marks = self.marks()
        self.write_files(
            {
                name: store.content_of(store.to_table(name, columns, marks))
                for name, columns in tables.items()
            }
        )

    def write_files(self, contents: Mapping[str, bytes]) -> None:
        """Write the files of this job by the names of its outputs, and their digests."""
        files: dict[Path | str, bytes] = {self.outputs[name]: c for name, c in contents.items()}
        listed = {os.path.relpath(path, self.folder): content for path, content in files.items()}
        write_together(files | {self.outputs["sums"]: sums.text_of(listed, self.read)})


@contextmanager
def stage(snakemake: Any) -> Iterator[Stage]:
    """The job of a script. Errors and warnings go to its log, in one line each to the terminal."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends compiled loops too, and without a traceback
    dataset, (log,) = snakemake.wildcards.dataset, snakemake.log
    label = " ".join([dataset, snakemake.rule, snakemake.wildcards.get("scatteritem", "")]).strip()
    Path(log).write_text("")
    with warnings.catch_warnings():

        def tell(text: str, details: str = "") -> None:
            print(f"{label}: {text}", file=sys.stderr, flush=True)
            with suppress(OSError), open(log, "a", encoding="utf-8") as file:  # a full disk
                file.write(f"{text}\n{details}")

        def show(
            message: Any, category: type[Warning], filename: str, lineno: int, *_: Any
        ) -> None:
            kind = "" if category is UserWarning else f"{category.__name__}: "
            tell(f"{kind}{message}", f"{filename}:{lineno}\n")

        warnings.simplefilter("default")
        warnings.showwarning = show  # type: ignore[assignment]
        try:
            with reporting(label):
                yield _opened(snakemake, dataset)
            return
        except Exception as error:
            text = f"{type(error).__name__}: {error} (a fault of kinacc; see {log})"
            if isinstance(error, (KinaccError, OSError)):
                text = str(refused(error) if isinstance(error, OSError) else error)
            elif isinstance(error, MemoryError):
                text = f"not enough memory: {error or 'ask for less'}"
            tell(text, traceback.format_exc())
    raise SystemExit(1)


def _opened(snakemake: Any, dataset: str) -> Stage:
    sums_file = Path(snakemake.output.sums)
    folder = next(item for item in sums_file.parents if item.name == sums.FOLDER).parent
    inputs, read = _read(dict(snakemake.input.items()), folder)
    settings, seed = snakemake.params.settings, snakemake.params.seed
    outputs = dict(snakemake.output.items())
    return Stage(dataset, inputs, settings, seed, outputs, folder, read)


def _read(
    paths: Mapping[str, str | Sequence[str]], folder: Path
) -> tuple[dict[str, Any], dict[str, str]]:
    """Tables of inputs by role, parts joined, other files as paths; and the digests of all."""
    inputs: dict[str, Any] = {}
    read: dict[str, str] = {}
    problems: list[Problem] = []
    for role, source in paths.items():
        listed = [source] if isinstance(source, str) else list(source)
        contents = {path: Path(path).read_bytes() for path in listed}
        read |= {os.path.relpath(path, folder): sums.digest(contents[path]) for path in contents}
        if role.endswith("_file"):
            inputs[role] = Path(listed[0])
            continue
        with gathered(problems):
            parts = []
            for path, content in contents.items():
                sums.hold(path, content)
                parts.append(store.read_arrow(path, content))
            inputs[role] = store.columns_in(pa.concat_tables(parts))
    refuse(problems)
    return inputs, read


def part_of(snakemake: Any) -> dict[str, int]:
    """Number and count of the part that a scattered job computes."""
    number, _, count = snakemake.wildcards.scatteritem.partition("-of-")
    return {"number": int(number), "of": int(count)}
