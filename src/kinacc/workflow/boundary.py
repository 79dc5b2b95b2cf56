"""What a results folder holds stays in it: no link leads what a run writes to somewhere else."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from kinacc.errors import Problem

_CACHE = "SNAKEMAKE_OUTPUT_CACHE"


def leading_out(results: str, names: Iterable[str]) -> Iterator[Problem]:
    """A problem for each link, among what data sets have in a results folder, that leads out of it.

    The folder itself may be a link; artefacts may be links into the shared cache there is.
    """
    inside = [Path(os.path.realpath(results))]
    if os.environ.get(_CACHE):
        inside.append(Path(os.path.realpath(os.environ[_CACHE])))
    for name in names:
        for link in _links(f"{results}/{name}"):
            target = Path(os.path.realpath(link))
            if not any(target.is_relative_to(each) for each in inside):
                yield Problem(
                    link,
                    f"is a link to {target}, outside of the results",
                    f"links into the shared cache ({_CACHE}) and within {results}",
                    f"remove it, and it is made again; or set {_CACHE}, if it leads there",
                )


def _links(folder: str) -> Iterator[str]:
    """The folder of a data set if it is a link, and links in it and in its folders."""
    if os.path.islink(folder):
        yield folder
        return
    try:
        entries = list(os.scandir(folder))
    except OSError:
        return
    for entry in entries:
        if entry.is_symlink():
            yield entry.path
        elif entry.is_dir():
            yield from _links(entry.path)
