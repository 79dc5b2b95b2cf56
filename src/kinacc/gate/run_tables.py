"""The tables of one data set's results, read when a gate asks for them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from kinacc.calibration.summary import selected
from kinacc.config.error_models import MEASURED, Comparison
from kinacc.errors import InputError, Problem
from kinacc.tables import assessment_tables, store
from kinacc.tables.columns import Columns

SELECTED = "selected"


class Absent(InputError):
    """A table that a gate needs is not there; its problem says what makes it."""


class RunTables(dict[str, Columns]):
    """Tables by artefact, read once. Absent where there is none, InputError where it is none."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder

    def __missing__(self, artefact: str) -> Columns:
        path = self.folder / f"{artefact}.parquet"
        if not path.is_file():
            raise Absent(Problem(str(path), "is not there", fix=maker_of_table(artefact)))
        self[artefact] = store.read(path)
        return self[artefact]

    def model(self, named: str) -> str:
        """The error model a gate names; the one selected where it says so."""
        return selected(self["model_selection"]) if named == SELECTED else named


def maker_of_table(artefact: str) -> str:
    """The command that makes a table, in words."""
    if artefact == "history":
        return "give the data set a series (docs/history.md) and calibrate it"
    studied = any(artefact == each.name for each in assessment_tables.ALL)
    return f"kinacc {'study' if studied else 'calibrate'} FILE.yaml makes it"


def errors_of(
    tables: Mapping[str, Columns], model: str, at: str, quantity: str
) -> tuple[np.ndarray, np.ndarray]:
    """Sizes (n,) of a model's errors, mm or mrad, and their rows (n,) of ``measurements``.

    ``at``: held_out, every row by a fit that has not seen it; validation, those of them in the
    fold kept for it; training, rows that were fitted. Of rows held out those that every model was
    tried on, as ``kinacc summary`` has them. Absent where there are none.
    """
    table = tables["pose_errors"]
    estimate, row = np.asarray(table["estimate"]), np.asarray(table["row"])
    wanted = estimate == ("train" if at == "training" else "cross_validated")
    if at == "validation":
        wanted &= np.asarray(table["subset"]) == "validation"
    own = wanted & (np.asarray(table["comparison"]) == Comparison(MEASURED, model).name)
    common = set(row[own].tolist())
    for each in np.unique(np.asarray(table["comparison"])[wanted].astype(str)):
        common &= set(row[wanted & (np.asarray(table["comparison"]) == each)].tolist())
    own &= np.isin(row, list(common))
    names = [f"e{axis}_mm" if quantity == "position" else f"r{axis}_mrad" for axis in "xyz"]
    sizes = np.linalg.norm([table[name][own] for name in names], axis=0)
    known = np.isfinite(sizes)
    if not known.any():
        what = f"has no {quantity} errors of model {model} at rows {at.replace('_', ' ')}"
        raise Absent(Problem("pose_errors.parquet", what, fix="name another model, or other rows"))
    return sizes[known], row[own][known]
