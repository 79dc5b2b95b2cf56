"""Stages of the workflow on the tables of a results folder, as their rules would run them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path

from kinacc.calibration import stages
from kinacc.checks import check
from kinacc.report import summarise
from kinacc.study import evaluation, histories, monte_carlo
from kinacc.study.claims.evaluate import table_of
from kinacc.synthetic import source
from kinacc.tables import store, sums
from kinacc.tables.atomic import write_together
from kinacc.workflow.code import config_hash
from kinacc.workflow.data_sets import CALIBRATION, read_data_sets

STAGES = {
    "measurements": source.run,
    "data_check": check.run,
    **{kind: partial(stages.fit_model, kind=kind) for kind in ("vec", "compliance", "dh")},
    "residuals": stages.compare_models,
    "excluded_rows": stages.excluded_rows,
    "summary": summarise.run,
    "accuracy_map": evaluation.mapped,
    "assessment_points": evaluation.points,
    "study": monte_carlo.summed_up,
    "histories": histories.run,
    "claims": table_of,
}
CALIBRATED = ("measurements", "vec", "dh", "residuals")
# Of the synthetic arm, all but its figures.
STUDIED = (
    *CALIBRATED,
    "summary",
    "accuracy_map",
    "assessment_points",
    "study",
    "histories",
    "claims",
)


def tables_in(folder: Path) -> dict:
    """All tables of a folder, by name."""
    return {path.stem: store.read(path) for path in folder.glob("*.parquet")}


def made(name: str, tables: dict, settings: dict) -> dict:
    """Tables that a stage makes of others."""
    if name == "study":
        tables = tables | monte_carlo.simulated(tables, settings)
    return STAGES[name](tables, settings)


def run_stages(
    names: Iterable[str],
    configs: Iterable[object],
    results: Path = Path("results"),
    dataset: str | None = None,
) -> Path:
    """Run stages and write their tables and their digests; the folder of the data set."""
    data = read_data_sets(list(map(str, configs)))
    dataset = dataset or next(iter(data.settings))
    settings, folder = data.settings[dataset], results / dataset
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        own = data.chosen(dataset, *CALIBRATION) if name == "summary" else settings
        marks = {"kinacc_version": "0", "config_hash": config_hash(own), "seed": settings["seed"]}
        contents = {
            f"{table}.parquet": store.content_of(store.to_table(table, columns, marks))
            for table, columns in made(name, tables_in(folder), settings).items()
        }
        left = {folder / file: content for file, content in contents.items()}
        write_together({**left, folder / "sums" / f"{name}.sha256": sums.text_of(contents, {})})
    return folder
