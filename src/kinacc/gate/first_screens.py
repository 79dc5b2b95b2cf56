"""The first screen of every data set's report as plain text, for what the gate hands on."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from kinacc.calibration.summary import TABLES
from kinacc.errors import InputError
from kinacc.report.plain_text import plain_text
from kinacc.workflow.answer import campaign_of, read
from kinacc.workflow.first_screen import first_screen
from kinacc.workflow.verification.lineage import outdated


def first_screens(results: Path, datasets: Iterable[str]) -> dict[str, str]:
    """By data set what its page says first; where it cannot be said, why.

    Tables that were made from others than are there are left out, as on the page.
    """
    return {dataset: _one(results / dataset, dataset) for dataset in datasets}


def _one(folder: Path, name: str) -> str:
    try:
        tables = read(folder)
        old = outdated(folder, tables.keys() - {*TABLES})
        kept = {role: table for role, table in tables.items() if role not in old}
        screen, _ = first_screen(folder, name, kept, campaign_of(folder, kept), sorted(old))
    except InputError as error:
        return "".join(f"not told: {each}\n" for each in error.problems)
    return plain_text(screen)
