"""One stage of the workflow on the tables of a results folder, as its rule would run it."""

from __future__ import annotations

import warnings
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


def run_stages(
    names: Iterable[str],
    configs: Iterable[object],
    results: Path = Path("results"),
    dataset: str | None = None,
) -> str:
    """Run stages one after another; their warnings."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for name in names:
            perform(name, list(map(str, configs)), results, dataset)
    return "\n".join(str(each.message) for each in told)


def perform(name: str, configs: list[str], results: Path, dataset: str | None = None) -> Path:
    """Run a stage and write its tables and their digests; the folder of the data set."""
    data = read_data_sets(configs)
    dataset = dataset or next(iter(data.settings))
    settings, folder = data.settings[dataset], results / dataset
    folder.mkdir(parents=True, exist_ok=True)
    tables = {path.stem: store.read(path) for path in folder.glob("*.parquet")}
    if name == "study":
        tables |= monte_carlo.simulated(tables, settings)
    own = data.chosen(dataset, *CALIBRATION) if name == "summary" else settings
    marks = {"kinacc_version": "0", "config_hash": config_hash(own), "seed": settings["seed"]}
    contents = {
        f"{table}.parquet": store.content_of(store.to_table(table, columns, marks))
        for table, columns in STAGES[name](tables, settings).items()
    }
    left = {folder / file: content for file, content in contents.items()}
    write_together({**left, folder / "sums" / f"{name}.sha256": sums.text_of(contents, {})})
    return folder
