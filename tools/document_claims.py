"""Write docs/claims.md and its picture: ``python tools/document_claims.py [FOLDER]``.

docs/claims/ holds the tables of ``snakemake choices`` that are part of the documentation. Given the
FOLDER of a data set, as results/mh180, its tables are taken over first.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from kinacc.artifacts.store import read, read_metadata
from kinacc.figures import claims_over_choices, save
from kinacc.study.choices.page import claims_page

DOCS = Path(__file__).parents[1] / "docs"
TABLES = ("choices", "choices_factors", "claim_shares", "claim_reasons")


def tables(docs: Path = DOCS) -> dict[str, Mapping]:
    """The tables in the documentation."""
    return {name: read(docs / "claims" / f"{name}.parquet") for name in TABLES}


def text(docs: Path = DOCS) -> str:
    """The page."""
    marks = read_metadata(docs / "claims" / f"{TABLES[0]}.parquet")
    return claims_page(tables(docs), marks)


def main(given: Iterable[str] = ()) -> None:
    """Take tables over and write page and picture."""
    (DOCS / "claims").mkdir(exist_ok=True)
    for folder in given:
        for name in TABLES:
            shutil.copyfile(Path(folder) / f"{name}.parquet", DOCS / "claims" / f"{name}.parquet")
    (DOCS / "claims.md").write_text(text(), encoding="utf-8")
    told = tables()
    picture = claims_over_choices.draw(told["claim_shares"], told["claim_reasons"])
    save.write(picture, {"png": DOCS / "claims" / "choices.png"})


if __name__ == "__main__":
    main(sys.argv[1:])
