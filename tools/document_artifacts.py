"""Write docs/artifacts.md from the contract: ``python tools/document_artifacts.py``."""

from __future__ import annotations

from inspect import cleandoc
from pathlib import Path

from kinacc.artifacts.digests import columns_digest
from kinacc.workflow.catalogue import STAGES
from kinacc.workflow.verification import recomputation

from kinacc.artifacts.columns import (
    BY_POSES,
    BY_ROW,
    BY_STD,
    BY_STD_ERROR,
    SAME_AMONG,
    SAME_WITHIN,
    Artefact,
    Column,
)
from kinacc.artifacts.contract import ARTEFACTS, METADATA_KEYS

_HEAD = """\
# Artefacts

What a run leaves in `results/<dataset>/`, one folder per data set. Tables are Parquet, long and
tidy. Lengths are in mm, angles of joints and frames in rad, orientation errors in mrad, noise is
the standard deviation per axis. A value that does not apply is null, never zero.

Unit and meaning of a column stand in its field metadata. The schema metadata holds exactly
{keys}:
the version of the package, hashes of the configuration values the stage depends on, of the code it
runs and of the artefacts it read, the seed, the digest of each input (JSON, by role, which
`inputs_hash` folds) and that of the table's own columns. There is no time stamp: equal inputs and
versions give equal bytes. A table appears under its name only when it is whole, and its pages have
checksums.

`q*` stands for `q1`, `q2`, ... for every joint of the arm, `s*` likewise. Rows are unique in the
columns named as key. `figures/fig*` are pictures (.svg, .png, .pdf).

`kinacc campaign report` leaves the tables named `campaign_*` in the campaign's own folder.

`kinacc check-results results/` holds a folder to all of this; `kinacc show` prints any of it
([looking at results](workflow.md#looking-at-results)).

Written from the contract by `python tools/document_artifacts.py`.

## Digests

`columns_digest`: {digest}

`inputs_digests` are that digest for every table read, of a table in parts for the whole of them in
the order of its key (ascending, null last), so that their number does not count; of other files
SHA-256 of their bytes. Pictures and pages state them too: metadata of SVG (`dc:source`), a `tEXt`
chunk of PNG, `Keywords` in the Info of PDF, `kinacc:read:` in HTML.

`records/<stage>.json` (`<stage>.<part>.json` of a stage in parts) is what a run of a stage leaves
last: its name and part, the five marks, its `inputs_digests`, and for every file that it wrote the
SHA-256 of its bytes and, of a table, its `columns_digest`. It tells as well what two of the marks
fold: `settings`, the configuration values of the stage (of files the names alone), which are
`config_hash`; `code`, SHA-256 of every module and data file of the package that the stage depends
on, and `versions` of the libraries and of Python, which are `code_hash`. Files without a record
that fits are those of a run that did not come to its end, or were changed since: no stage reads
them.

## What is the same

`kinacc gate --against` holds a run to the accepted one. Column *same within* says what a number
may differ by, in its unit: rounding differs from machine to machine. Without a reason for another:
{same}.
A pure number is held to as much as a radian, which is one too, and 1e-9 rad is 1e-6 mm at a
metre. *{by_row}* is the one that the row states; {among:g} for pure numbers, which may be
thousands there. Whole numbers and words are equal, and null is
where null was. Rows belong together by their key, in which numbers count to nine digits.

*{by_poses}*: where these columns differ by more than their unit allows, what counts is the pose
of every measured target at the measured joints, by model and frames together: 1e-6 mm, and 1e-6
mrad where orientations were measured. So parameters that the poses do not tell apart may trade with
each other. *{by_std}*: an entry of a covariance may differ as it does when both standard deviations
differ by what their units allow. In `*_fit` the rows `undetermined_direction` (one basis of many of
what the poses leave open), `gap` and `last_step` (both decided by rounding) are not compared.

Simulations are equal where seed and repetitions are. Where these changed, and neither other
settings of the study nor its points, `study_summary.mean_mm` is held to the standard errors of both
runs, `{std_error}`: allowed are t standard errors of the difference, t of
Student's distribution (degrees of freedom of the mean of fewer repetitions) so that one in a
thousand such tables is said to differ by chance alone, whatever its number of rows (Bonferroni):
4.2 standard errors with 18 rows of 100 repetitions. Single simulations, smallest and largest
values, `histories` and the claims on these are not compared then; nor is a study of one repetition.

## What a check computes again

`kinacc check-results` runs the functions of the stages again, on the tables that are there, and
compares column by column: text has to be the same, a number within {relative:g} of itself or
{of_largest:g} of the largest in its column. So a table that was rewritten is found although all
digests were renewed. Settings are those of `--config`, of a `config.yaml` beside the results, or
the defaults, where their hash is the one that a table carries; a note names the tables for which
they are not known. Pictures and pages are not drawn again: they are held to their records, and to
the digests of what they show.

| tables | computed again |
|---|---|
{again}
"""


def artifacts_markdown() -> str:
    """The text of docs/artifacts.md: one table per artefact."""
    keys = ", ".join(f"`{key}`" for key in METADATA_KEYS)
    digest = cleandoc(columns_digest.__doc__ or "").partition("\n\nRaises")[0].replace("``", "`")
    again = recomputation.described().items()
    head = _HEAD.format(
        keys=keys,
        digest=digest,
        relative=recomputation.RELATIVE,
        of_largest=recomputation.OF_LARGEST,
        same=", ".join(
            f"{within:g} {unit}" for unit, within in SAME_WITHIN.items() if len(unit) < 5
        ),
        by_row=BY_ROW,
        among=SAME_AMONG["1"],
        by_poses=BY_POSES,
        by_std=BY_STD,
        std_error=BY_STD_ERROR,
        again="\n".join(f"| {_tables(stage)} | {words} |" for stage, words in again),
    )
    return "\n".join([head, *map(_section, ARTEFACTS.values())])


def _tables(stage: str) -> str:
    return ", ".join(f"`{name}`" for name in STAGES[stage].outputs)


def _section(artefact: Artefact) -> str:
    makers = [stage for stage in STAGES.values() if artefact.name in stage.outputs]
    made = f" Made by stage `{makers[0].name}`." if makers else ""
    if makers and makers[0].scattered:
        made += f" One file per part, `{artefact.name}/<part>-of-<parts>.parquet`."
    if makers and makers[0].on_request:
        made += " Made on request."
    lines = [
        f"## {artefact.file_name}",
        "",
        f"{artefact.meaning}{made} Key: {', '.join(f'`{name}`' for name in artefact.key)}.",
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
