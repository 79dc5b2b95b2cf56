"""The figures that a gate may name, read from the tables of a run.

Their names, units and meanings stand in the schema of the configuration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from kinacc.calibration.summary import held_out_errors, selected
from kinacc.config.error_models import model_name
from kinacc.config.gate_rules import ERRORS, FIGURES
from kinacc.config.records import Settings
from kinacc.errors import first_few, input_error
from kinacc.gate.chance import STATISTICS, Sample
from kinacc.measurements.folds import configurations_of
from kinacc.tables import store, sums
from kinacc.tables.contract import ARTEFACTS

SELECTED = "selected"
FEWEST_OF_QUANTILE = 100  # rows of which 1 % is one: with fewer, the 99 % quantile is the largest


class RunTables(dict[str, pd.DataFrame]):
    """Tables of one data set by artefact, read once.

    Raises InputError for a table that is missing, naming the command that makes it.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder

    def __missing__(self, artefact: str) -> pd.DataFrame:
        path = self.folder / f"{artefact}.parquet"
        if not path.is_file():
            fix = "kinacc calibrate or kinacc study makes it; a history needs a series of files"
            raise input_error(str(path), "missing", fix=fix)
        self[artefact] = store.read_table(path)
        return self[artefact]

    def model(self, named: str) -> str:
        """The error model of a gate; the selected one for ``selected``."""
        return selected(self["model_selection"]) if named == SELECTED else named

    def errors(self, model: str, quantity: str) -> Sample:
        """Sizes of held-out errors of a model of a gate, mm or mrad, at rows of every model.

        Raises InputError where there are none.
        """
        model = self.model(model)
        table = held_out_errors(self["pose_errors"], model)
        names = [f"e{axis}_mm" if quantity == "position" else f"r{axis}_mrad" for axis in "xyz"]
        sizes = np.linalg.norm(table[names], axis=1)
        known = np.isfinite(sizes)
        if not known.any():
            message = f"has no held-out {quantity} errors of model {model}"
            raise input_error("pose_errors.parquet", message, fix="name another model")
        rows = table["row"].to_numpy()[known]
        return Sample(sizes[known], configurations_of(self["measurements"])[rows])


@dataclass(frozen=True)
class Figure:
    """A figure of a run, NaN where it is not defined; ``unit`` is 1 for counts.

    ``called`` names it within a sentence; ``about`` are further facts by name with unit; ``open``
    is the reason why it cannot pass a limit, empty where it can; ``errors`` are those behind it.
    """

    size: float
    unit: str
    called: str
    about: Mapping[str, float | int | str] = field(default_factory=dict)
    open: str = ""
    errors: Sample | None = None

    @property
    def key(self) -> str:
        """Ending of a name that holds such a figure."""
        return "" if self.unit == "1" else f"_{self.unit}"

    def worded(self, size: float) -> str:
        """A size with the figure's unit."""
        return f"{size:.10g}" if self.unit == "1" else f"{size:.3f} {self.unit}"


def same_measurements(first: Path, second: Path) -> bool:
    """Whether the runs in two folders are of the same measurements."""
    digest = sums.stated(first).get("measurements.parquet")
    return digest is not None and digest == sums.stated(second).get("measurements.parquet")


def figure(tables: RunTables, gate: Settings) -> Figure:
    """The figure of a gate. Raises InputError where its table is missing."""
    name = gate["value"]
    unit, meaning = FIGURES[name]
    if name not in ERRORS:
        pose = tables["measurements"]["pose"]
        count = len(pose) if name == "data.readings" else pose.nunique()
        return Figure(float(count), unit, meaning)
    _, quantity, statistic = name.split(".")
    model = tables.model(gate["model"])
    errors = tables.errors(model, quantity)
    size, count, why = STATISTICS[statistic](errors.sizes), len(errors.sizes), ""
    if statistic == "p99" and count < FEWEST_OF_QUANTILE:
        others = "a limit on mean, rms, largest or p99_gamma needs fewer"
        why = f"{count} rows are too few, {FEWEST_OF_QUANTILE} would do; {others}"
    if np.isnan(size):
        why = "an error is exactly zero: no gamma distribution fits"
    called = f"{meaning}, held out ({model_name(model)} model)"
    return Figure(size, unit, called, {"model": model, "rows": count}, why, errors)


def cell(tables: RunTables, gate: Settings) -> Figure:
    """The number in the one row and column of a table that a gate names.

    Raises InputError where the table is missing, or for another number of rows.
    """
    artefact, column = gate["table"], gate["column"]
    table, where = tables[artefact], f"{artefact}.parquet"
    if unknown := [name for name in (*gate["row"], column) if name not in table]:
        message = f"has no column {first_few(unknown)}"
        raise input_error(where, message, first_few(list(table), 30))
    for name, value in gate["row"].items():
        table = table[table[name].isna() if value is None else table[name] == value]
    if len(table) != 1:
        fix = "name more columns in row" if len(table) else "other values in row"
        raise input_error(where, f"has {len(table)} such rows", "one row", fix)
    row = table.iloc[0]
    known = ARTEFACTS[artefact].in_file(table.columns)
    unit = next(item.unit for item in known if item.name == column)
    unit = str(row["unit"]) if unit == "see unit" else unit
    size = pd.to_numeric(row[column], errors="coerce")
    called = [f"{column} of {artefact}", *(f"{name} {gate['row'][name]}" for name in gate["row"])]
    return Figure(float(size), unit, ", ".join(called), open="no number" if np.isnan(size) else "")
