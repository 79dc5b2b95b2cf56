"""Write the tournament's pages: ``python tools/document_tournament.py [NAME=FOLDER ...]``.

docs/tournament/<name>/ holds the tables of a tournament that are part of the documentation. Given
``NAME=FOLDER`` the tables of a results folder are taken over under that name first. Then the pages
are written anew from all of them: docs/tournament.md with its pictures, and one page for every
assessor in docs/assessors/, from its docstring, its settings and its rows.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from kinacc.artifacts.store import read, read_metadata
from kinacc.assess.registry import RECOMMENDED
from kinacc.assess.statement import CONFIDENCE
from kinacc.figures import save, tournament, tournament_worlds
from kinacc.study.tournament import pages, worlds_page

DOCS = Path(__file__).parents[1] / "docs"
TABLES = ("tournament_cells", "tournament_verdicts", "tournament_fields")


def take_over(given: Iterable[str], docs: Path = DOCS) -> None:
    """Copy the tables of NAME=FOLDER into the documentation."""
    for each in given:
        name, _, folder = each.partition("=")
        target = docs / "tournament" / name
        target.mkdir(parents=True, exist_ok=True)
        for table in TABLES:
            shutil.copyfile(Path(folder) / f"{table}.parquet", target / f"{table}.parquet")


def runs(docs: Path = DOCS) -> dict[str, dict[str, Mapping]]:
    """Tables of every tournament in the documentation by its name, with ``provenance``."""
    found = {}
    for folder in sorted((docs / "tournament").glob("*")):
        if not (folder / f"{TABLES[0]}.parquet").is_file():
            continue
        tables = {table: read(folder / f"{table}.parquet") for table in TABLES}
        found[folder.name] = tables | {"provenance": read_metadata(folder / f"{TABLES[0]}.parquet")}
    return found


def texts(known: Mapping[str, Mapping]) -> dict[str, str]:
    """Every page by its path below docs/."""
    found = {"tournament.md": pages.tournament(known)}
    found |= {f"assessors/{name}.md": pages.assessor(name, known) for name in pages.NAMES}
    return found


def main(given: Iterable[str] = ()) -> None:
    """Take tables over and write all pages and pictures."""
    take_over(given)
    known = runs()
    for path, text in texts(known).items():
        (DOCS / path).parent.mkdir(exist_ok=True)
        (DOCS / path).write_text(text, encoding="utf-8")
    for name, tables in known.items():
        every = tables["tournament_cells"]
        if worlds_page.has_worlds(every):
            rows = [row for row in worlds_page.of_kinds(every) if row["assessor"] == RECOMMENDED]
            picture = tournament_worlds.draw(rows, CONFIDENCE)
            save.write(picture, {"png": DOCS / "tournament" / name / "worlds.png"})
        cells = worlds_page.as_stated(every)
        if not pages.is_pictured(cells):
            continue
        for quantity in tournament.QUANTITIES:
            picture = tournament.draw(cells, quantity, *pages.SHOWN, pages.NAMES)
            save.write(picture, {"png": DOCS / "tournament" / name / f"{quantity}.png"})


if __name__ == "__main__":
    main(sys.argv[1:])
