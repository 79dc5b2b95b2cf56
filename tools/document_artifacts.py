"""Write docs/artifacts.md from the contract: ``python tools/document_artifacts.py``."""

# ruff: noqa: E501
from __future__ import annotations

from pathlib import Path

from kinacc.tables.columns import SAME_WITHIN, Artefact, Column
from kinacc.tables.contract import ARTEFACTS, PROVENANCE_KEYS

_HEAD = """\
# Artefacts

What a run leaves in `results/<dataset>/`, one folder per data set. Tables are Parquet, long and
tidy. Lengths are in mm, angles of joints and frames in rad, orientation errors in mrad, noise is
the standard deviation per axis. A value that does not apply is null, never zero.

Unit and meaning of a column stand in its field metadata. The schema metadata holds exactly
{keys}:
the version of the package, a hash of the configuration values of the stage, and the seed. There is
no time stamp: equal inputs and versions give equal bytes. A table appears under its name only when
it is whole.

`q*` stands for `q1`, `q2`, ... for every joint of the arm, `s*` likewise. Rows are unique in the
columns named as key. `figures/fig*` are pictures (.svg, .png, .pdf).

`kinacc campaign report` leaves the tables named `campaign_*` in the campaign's own folder.

`kinacc check-results results/` holds a folder to all of this; `kinacc show` prints any of it
([looking at results](workflow.md#looking-at-results)).

Written from the contract by `python tools/document_artifacts.py`.

## Digests

Every stage leaves `sums/<rule>.sha256`: SHA-256 of its files, in the form of `sha256sum`. Lines that
begin with `# read` hold what the stage read. The next stage and `kinacc check-results` refuse a file
that is not as its stage left it. `SHA256SUMS` holds them all: `sha256sum -c SHA256SUMS` in the folder.

## What is the same

`kinacc check-results --against FOLDER` compares with an accepted run. Column *same within* has what a
number may differ by, in its unit: {same}. Whole numbers and words are equal, null is where null was.
Rows belong together by their key.
"""


def artifacts_markdown() -> str:
    """The text of docs/artifacts.md: one table per artefact."""
    keys = ", ".join(f"`{key}`" for key in PROVENANCE_KEYS)
    same = ", ".join(f"{within:g} {unit}" for unit, within in SAME_WITHIN.items() if len(unit) < 5)
    head = _HEAD.format(keys=keys, same=same)
    return "\n".join([head, *map(_section, ARTEFACTS.values())])


def _section(artefact: Artefact) -> str:
    lines = [
        f"## {artefact.file_name}",
        "",
        f"{artefact.meaning} Key: {', '.join(f'`{name}`' for name in artefact.key)}.",
        "",
        "| column | type | unit | allowed | same within | meaning |",
        "|---|---|---|---|---|---|",
        *map(_row, artefact.columns),
        "",
    ]
    return "\n".join(lines)


def _row(column: Column) -> str:
    cells = (
        f"`{column.name}`",
        column.kind,
        column.unit or "-",
        column.limits or "any",
        _same(column),
        column.meaning,
    )
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _same(column: Column) -> str:
    within = column.same_within
    return within if isinstance(within, str) else f"{within:g}" if within else "equal"


def main() -> None:
    """Rewrite docs/artifacts.md of the repository the package lies in."""
    path = Path(__file__).parents[1] / "docs" / "artifacts.md"
    path.parent.mkdir(exist_ok=True)
    path.write_text(artifacts_markdown(), encoding="utf-8")


if __name__ == "__main__":
    main()
