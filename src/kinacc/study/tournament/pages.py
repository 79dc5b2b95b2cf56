"""The tournament in words: pages in Markdown from its tables and the assessors' docstrings."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import MISSING, fields
from textwrap import dedent

import numpy as np

from kinacc.artifacts.contract import PROVENANCE_KEYS
from kinacc.assess.registry import ASSESSORS, RECOMMENDED
from kinacc.config.schema import defaults
from kinacc.study.tournament.worlds_page import as_stated, has_worlds, section

NAMES = tuple(ASSESSORS)
SHOWN = (200, 200)  # candidates and budget of pictures and tables
_YARDSTICK, _BOUND = "model_invalidation", "single_shot"
_HEAD = 2  # lines of a table before its rows
_BEFORE = (
    "All runs but `workshop` were made before `search_and_confirm`, `sequential` and "
    "`invalidation_calibrated` got the bounds they have now: their rows there are of those before."
)
_TAIL = """
Written by `python tools/document_tournament.py` from the tables here; do not edit.
"""

Tables = Mapping[str, Mapping]


def tournament(known: Mapping[str, Tables]) -> str:
    """docs/tournament.md."""
    head = f"""\
# Tournament of assessors

Every assessor assesses errors that are known, and what it says is held to the truth. One row of
the tables is one assessor, error field, noise (standard deviation per axis), number of candidates
and budget of measurements, over many campaigns; all assessors see the same worlds. Fields are the
paper's, families of synthetic arms with effects outside the models, fields made up of what bounds
find hard, and held-out errors of measured robots, which contain the noise of their instrument.

A statement is graded against its own target: `measured` (the largest error of the points that were
measured), `candidates` (of all that could have been), `region` (a quantile). *Holds* is the share
of upper bounds that are not below the truth; *excess* how far they are above it on average;
*over attainable* that excess over the one of a design that knows all errors beforehand, reads every
point and spends the rest best ([how near a bound can come](limits-of-bounds.md)). An assessor keeps
its confidence if no cell is significantly below it (binomial, family-wise 1 % by Holm) and none of
200 statements or more is further than three points below; fewer cannot tell.

What each assessor does: [assessors](assessors.md#the-assessors). Which to use:
[choosing an assessor](choosing-an-assessor.md). Why the bounds hold: [theory](assessors.md).
The recommended one is `{RECOMMENDED}`. Your own robot takes part when it is in the configuration:
`kinacc tournament --config config.yaml --config my-robot.yaml`.

{_BEFORE}
"""
    return (
        "\n".join([head, *(_run(name, tables) for name, tables in known.items()), _TAIL.strip()])
        + "\n"
    )


def assessor(name: str, known: Mapping[str, Tables]) -> str:
    """docs/assessors/<name>.md: docstring, settings and how it fared."""
    cls = ASSESSORS[name]
    parts = [f"# {name}", "", _prose(cls), "", "## Settings", "", _settings(cls)]
    for run, tables in known.items():
        rows = _fared(name, as_stated(tables["tournament_cells"]))
        if rows:
            parts += ["", f"## In the tournament ({run})", "", _scale(tables), "", *rows]
    return "\n".join([*parts, _TAIL])


def _prose(cls: type) -> str:
    first, _, rest = inspect.getdoc(cls).partition("\n\n")
    module = dedent(inspect.getmodule(cls).__doc__ or "").strip().partition("\n\n")[0]
    source = inspect.getmodule(cls).__name__.replace(".", "/")
    said = "\n\n".join(filter(None, [module, first, rest])).replace("``", "`")
    said = said.replace(":mod:", "").replace(":class:", "").replace(":data:", "")
    return f"{said}\n\nCode: `src/{source}.py`."


def _settings(cls: type) -> str:
    lines = ["| setting | default |", "|---|---|"]
    study = defaults()["study"]
    for each in fields(cls):
        default = study[each.name] if each.default is MISSING else each.default
        lines.append(f"| `{each.name}` | `{default}` |")
    return "\n".join(lines)


def _scale(tables: Tables) -> str:
    candidates, budget = SHOWN
    return f"{candidates} candidates, budget {budget}; median over fields, worst field in brackets."


def _fared(name: str, cells: Mapping) -> list[str]:
    """Rows of one assessor by target and noise."""
    mine = _shown(cells) & (cells["assessor"] == name)
    if not mine.any():
        return []
    lines = [
        "| about | noise | bias | rmse | bound stated | holds | excess | over attainable "
        "| points visited |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for target in dict.fromkeys(cells["target"][mine]):
        for noise in np.unique(cells["noise_mm"][mine]):
            rows = mine & (cells["target"] == target) & (cells["noise_mm"] == noise)
            stated = cells["stated"][rows].sum() / cells["repetitions"][rows].sum()
            lines.append(
                f"| {target} | {1e3 * noise:g} um | {_middle(cells['bias_mm'][rows], _far)} "
                f"| {_middle(cells['rmse_mm'][rows], np.max)} | {stated:.0%} "
                f"| {_middle(cells['upper_holds'][rows], np.min)} "
                f"| {_middle(cells['excess_mm'][rows], np.max)} "
                f"| {_middle(_over_attainable(cells)[rows], np.max, 2)} "
                f"| {np.mean(cells['points_visited'][rows]):.0f} |"
            )
    return lines


def _run(name: str, tables: Tables) -> str:
    every, marks = tables["tournament_cells"], tables["provenance"]
    cells = as_stated(every)
    counts = sorted({int(cells["repetitions"].min()), int(cells["repetitions"].max())})
    repetitions = " to ".join(f"{each:,}" for each in counts)
    levels = ", ".join(f"{1e3 * each:g}" for each in np.unique(cells["noise_mm"]))
    shown, worlds = [], []
    if has_worlds(every):
        worlds = [*section(every), "", f"![Worlds](tournament/{name}/worlds.png)", ""]
    if is_pictured(cells):
        quantities = ("bias", "rmse", "coverage", "width")
        drawn = [f"![{quantity}](tournament/{name}/{quantity}.png)" for quantity in quantities]
        shown = [*_by_field(cells), "", *drawn, ""]
    return "\n".join(
        [
            f"## {name}",
            "",
            f"Noise {levels} um, {repetitions} campaigns per cell. Provenance: "
            + ", ".join(f"{key} `{marks[key]}`" for key in PROVENANCE_KEYS if key in marks)
            + f". Tables: `docs/tournament/{name}/`.",
            "",
            "### Is the confidence kept?",
            "",
            "Statements whose named assumption is not true of the field are left out of the "
            "verdict. The readings do not always show that it is untrue; the last column counts "
            "these statements as well.",
            "",
            *_verdicts(as_stated(tables["tournament_verdicts"]), cells),
            "",
            *worlds,
            *_beside(cells),
            *shown,
            "### Fields",
            "",
            *_fields(tables["tournament_fields"]),
            "",
        ]
    )


def _verdicts(table: Mapping, cells: Mapping) -> list[str]:
    lines = [
        "| assessor | about | cells | statements | hold | worst cell | rejected (Holm) "
        "| more than 3 points below | no statement | though its assumption is true, worst cell "
        "| worst cell, untrue assumptions counted |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in _rows(table):
        lines.append(
            f"| [{row['assessor']}](assessors/{row['assessor']}.md) | {row['target']} "
            f"| {row['cells']} | {row['statements']} | {row['mean_holds']:.3f} "
            f"| {row['worst_holds']:.3f} | {row['rejected']} | {row['below']} "
            f"| {row['withheld']:.1%} | {_share(row['withheld_sound'])} "
            f"| {_worst_of_all(cells, row)} |"
        )
    return lines


def _worst_of_all(cells: Mapping, row: Mapping) -> str:
    """Smallest share of all upper bounds of a cell that hold, whatever they assume; and where."""
    mine = (cells["assessor"] == row["assessor"]) & (cells["target"] == row["target"])
    mine &= cells["stated"] > 0
    stated, broken = cells["stated"][mine], cells["broken"][mine]
    held = np.nan_to_num(cells["upper_holds"][mine]) * (stated - broken)
    held = (held + np.nan_to_num(cells["broken_holds"][mine]) * broken) / stated
    least = int(np.argmin(held))
    noise = 1e3 * cells["noise_mm"][mine][least]
    return f"{held[least]:.3f} ({cells['field'][mine][least]}, {noise:g} um)"


def _beside(cells: Mapping) -> list[str]:
    """How the recommended assessor compares, where those it is compared with take part."""
    ratios = _ratios(cells)
    if len(ratios) == _HEAD:
        return []
    return [
        f"### {RECOMMENDED} beside {_YARDSTICK} and {_BOUND}",
        "",
        "RMS error of the value for all candidates, over that of model invalidation with the "
        "same budget; mean excess of the upper bounds over that of the single-shot bound, "
        "where both state one; excess on the measured points over the attainable one.",
        "",
        *ratios,
        "",
    ]


def _ratios(cells: Mapping) -> list[str]:
    """Recommended over yardstick by candidates, budget and noise: median and worst field."""
    lines = [
        "| candidates | budget | noise | rmse, median field | rmse, worst field | excess, measured "
        "points | excess, all candidates | over attainable, median (worst) |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for candidates, budget, noise in sorted(
        set(zip(cells["candidates"], cells["budget"], cells["noise_mm"], strict=True))
    ):
        here = (cells["candidates"] == candidates) & (cells["budget"] == budget)
        here &= cells["noise_mm"] == noise
        rmse = _over(cells, here, "rmse_mm", "candidates", _YARDSTICK)
        excess = _over(cells, here, "excess_mm", "measured", _BOUND)
        of_all = _over(cells, here, "excess_mm", "candidates", _BOUND)
        if not rmse or not excess:
            continue
        worst = max(rmse, key=rmse.get)
        ours = here & (cells["assessor"] == RECOMMENDED) & (cells["target"] == "measured")
        lines.append(
            f"| {candidates} | {budget} | {1e3 * noise:g} um | {np.median([*rmse.values()]):.2f} "
            f"| {rmse[worst]:.2f} ({worst}) | {np.mean([*excess.values()]):.2f} "
            f"| {f'{np.mean([*of_all.values()]):.2f}' if of_all else '-'} "
            f"| {_middle(_over_attainable(cells)[ours], np.max, 2)} |"
        )
    return lines


def _by_field(cells: Mapping) -> list[str]:
    """Every field at the shown size: both rmse and both excesses."""
    lines = [
        f"| field | noise | true | rmse {_YARDSTICK} | rmse {RECOMMENDED} | excess {_BOUND} "
        f"| excess {RECOMMENDED} | over attainable | holds | candidates: stated "
        "| assumption untrue | then holds |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    shown = _shown(cells)
    for field, noise in sorted(
        set(zip(cells["field"][shown], cells["noise_mm"][shown], strict=True))
    ):
        here = shown & (cells["field"] == field) & (cells["noise_mm"] == noise)
        ours = _row(cells, here, RECOMMENDED, "candidates")
        measured = _row(cells, here, RECOMMENDED, "measured")
        paper = _row(cells, here, _YARDSTICK, "candidates")
        single = _row(cells, here, _BOUND, "measured")
        if None in (ours, measured, paper, single):
            continue
        lines.append(
            f"| {field} | {1e3 * noise:g} um | {ours['true_mm']:.2f} | {paper['rmse_mm']:.3f} "
            f"| {ours['rmse_mm']:.3f} | {single['excess_mm']:.3f} | {measured['excess_mm']:.3f} "
            f"| {_plain(_over_attainable(measured))} | {measured['upper_holds']:.3f} "
            f"| {ours['stated'] / ours['repetitions']:.0%} "
            f"| {ours['broken'] / max(ours['stated'], 1):.0%} | {_share(ours['broken_holds'])} |"
        )
    return lines


def _fields(table: Mapping) -> list[str]:
    lines = [
        "| field | kind | meaning | poses | median | 99 % empirical | largest |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in _rows(table):
        lines.append(
            f"| {row['field']} | {row['kind']} | {row['meaning']} | {row['points']} "
            f"| {row['median_mm']:.2f} | {row['quantile_99_mm']:.2f} | {row['max_mm']:.2f} |"
        )
    return lines


def _over_attainable(cells: Mapping) -> np.ndarray:
    """Excess over what is attained with the errors known; NaN without, and in older tables."""
    excess = np.asarray(cells["excess_mm"], dtype=float)
    known = np.asarray(cells.get("attainable_mm", np.full_like(excess, np.nan)), dtype=float)
    return np.divide(excess, known, out=np.full_like(excess, np.nan), where=known > 0.0)


def _plain(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.2f}"


def _over(cells: Mapping, here, column: str, target: str, other: str) -> dict[str, float]:
    """By field: a column of the recommended assessor over that of another."""
    found = {}
    for field in dict.fromkeys(cells["field"][here]):
        own = here & (cells["field"] == field)
        ours, theirs = (_row(cells, own, name, target) for name in (RECOMMENDED, other))
        if ours and theirs and theirs[column] > 0.0 and not np.isnan(ours[column]):
            found[field] = float(ours[column] / theirs[column])
    return found


def _row(cells: Mapping, here, name: str, target: str) -> dict | None:
    places = np.flatnonzero(here & (cells["assessor"] == name) & (cells["target"] == target))
    return {key: column[places[0]] for key, column in cells.items()} if places.size else None


def is_pictured(cells: Mapping) -> bool:
    """Whether a tournament holds the size of pictures and of the table by field, all assessors."""
    known = _shown(cells) & np.isin(cells["assessor"], (_YARDSTICK, _BOUND))
    return bool(known.any())


def _shown(cells: Mapping) -> np.ndarray:
    candidates, budget = SHOWN
    return (cells["candidates"] <= candidates) & (cells["budget"] == budget)


def _rows(table: Mapping) -> list[dict]:
    return [dict(zip(table, each, strict=True)) for each in zip(*table.values(), strict=True)]


def _share(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.0%}"


def _far(values: np.ndarray) -> float:
    return values[np.argmax(np.abs(values))]


def _middle(values: np.ndarray, worst, digits: int = 3) -> str:
    values = values[~np.isnan(values)]
    if not values.size:
        return "-"
    return f"{np.median(values):.{digits}f} ({worst(values):.{digits}f})"
