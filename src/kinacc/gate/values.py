"""The figures that a gate may name: how each is read from the tables of a run, and its words.

Their names, units and meanings stand in the schema of the configuration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kinacc.config.error_models import model_name
from kinacc.config.gate_rules import COMPARED, units
from kinacc.errors import Problem
from kinacc.gate import chance
from kinacc.gate.chance import STATISTICS
from kinacc.gate.run_tables import Absent, RunTables, errors_of
from kinacc.measurements.folds import configurations_of
from kinacc.tables import sums

_AT = {
    "held_out": "held out",
    "validation": "of the fold kept for validation",
    "training": "at rows that were fitted",
}


FEWEST_OF_QUANTILE = 100  # rows of which 1 % is one: with fewer, the 99 % quantile is the largest


@dataclass(frozen=True)
class Figure:
    """A figure of a run, NaN where it cannot be told; ``unit`` is 1 of what is counted.

    ``called`` names it within a sentence; ``about`` are further facts by name with unit, ``open``
    is why no limit can be told of it though it has a size; empty where it can.
    """

    size: float
    unit: str
    called: str
    about: Mapping[str, float | int | str] = field(default_factory=dict)
    open: str = ""

    @property
    def key(self) -> str:
        """Ending of a name that holds such a figure."""
        return "" if self.unit == "1" else f"_{self.unit}"

    def worded(self, size: float) -> str:
        """A size in the figure's unit, as it is told."""
        return f"{size:.10g}" if self.unit == "1" else f"{size:.3f} {self.unit}"


def figure(name: str, tables: RunTables, gate: Mapping[str, Any]) -> Figure:
    """The figure of a name. Absent where the table it stands in is not there."""
    if name.startswith(COMPARED):
        return _of_errors(name, tables, gate)
    topic, _, word = name.partition(".")
    return _OTHERS[topic](word, tables, units()[name])


def _of_errors(name: str, tables: RunTables, gate: Mapping[str, Any]) -> Figure:
    _, quantity, statistic = name.split(".")
    model = tables.model(gate["model"])
    sizes, rows = errors_of(tables, model, gate["at"], quantity)
    of, words = STATISTICS[statistic]
    called = f"{words} of the {quantity} errors {_AT[gate['at']]}"
    about = {"model": model, "statistic": words, "at": gate["at"], "rows": len(rows)}
    size, why = of(sizes), ""
    if statistic == "p99" and len(rows) < FEWEST_OF_QUANTILE:
        why = f"{len(rows)} rows are too few to tell of 1 % of them"
    if np.isnan(size):
        why = "an error is exactly zero, to which no gamma distribution can be fitted"
    return Figure(size, units()[name], f"{called} ({model_name(model)} model)", about, why)


@dataclass(frozen=True)
class Compared:
    """How a figure of errors differs from that of another run: see :class:`chance.Change`.

    ``paired``: both were held out at the same measurements; ``drawn`` says what was resampled.
    """

    difference: float
    least: float
    paired: bool
    drawn: str
    open: str


def change_of(
    name: str, now: RunTables, before: RunTables, gate: Mapping[str, Any], confidence: float
) -> Compared:
    """How a figure of errors in one run differs from that in another, and what chance makes."""
    statistic = name.rpartition(".")[2]
    samples = [_sample(each, name, gate) for each in (now, before)]
    paired = _digest(now) == _digest(before) is not None
    found = chance.change(statistic, samples[0], samples[1], paired, confidence)
    one, other = (each.count for each in samples)
    drawn = f"by resampling {one} poses of the same measurements"
    if not paired:
        drawn = f"by resampling {one} poses and the accepted run's {other}"
    return Compared(found.difference, found.least, paired, drawn, found.open)


def _digest(tables: RunTables) -> str | None:
    return sums.stated(tables.folder).get("measurements.parquet")


def _sample(tables: RunTables, name: str, gate: Mapping[str, Any]) -> chance.Sample:
    quantity = name.split(".")[1]
    sizes, rows = errors_of(tables, tables.model(gate["model"]), gate["at"], quantity)
    return chance.Sample(sizes, configurations_of(tables["measurements"])[rows])


def _of_data(word: str, tables: RunTables, unit: str) -> Figure:
    pose = tables["measurements"]["pose"]
    count = len(pose) if word == "readings" else len(np.unique(pose))
    return Figure(float(count), unit, f"number of {word}")


_HISTORY = {
    "moved": ("moved_mm", "rms by which the arm moved since the calibration in force"),
    "beyond_chance": ("beyond_mm", "movement since the calibration in force beyond chance"),
    "in_force_mean": (
        "in_force_mean_mm",
        "mean position error of the calibration in force at the newest readings",
    ),
    "in_force_p99": (
        "in_force_quantile_99_mm",
        "empirical 99 % quantile of the position errors of the calibration in force at the newest "
        "readings",
    ),
}


def _of_history(word: str, tables: RunTables, unit: str) -> Figure:
    column, called = _HISTORY[word]
    size = float(tables["history"][column][-1])
    why = "the history has no earlier calibration in force" if np.isnan(size) else ""
    return Figure(size, unit, called, open=why)


def _of_bound(word: str, tables: RunTables, unit: str) -> Figure:
    from kinacc.campaign import journal, of_calibration
    from kinacc.deployment import folder

    known = folder.read_tables(tables.folder, "robot")
    name, places = tables.folder.resolve().name, journal.of_results(tables.folder)
    sought = of_calibration.sought(name, known, places)
    found = sought.assessed
    if found is None:
        what = "; ".join(sought.remarks) or "there is no campaign on this calibration"
        fix = f"kinacc campaign start FOLDER --calibration {tables.folder} begins one"
        raise Absent(Problem(str(tables.folder), what, fix=fix))
    size = found.said.upper_mm if found.said else float("nan")
    why = "its campaign states no upper bound so far" if np.isnan(size) else ""
    if found.said and found.said.excepted:
        why = f"its upper bound leaves {found.said.excepted} candidates out"
    called = f"{word} bound on the largest error, by campaign {found.place}"
    about: dict[str, Any] = {"campaign": str(found.place)}
    if found.said:
        about |= {"confidence": found.said.confidence}
    return Figure(size, unit, called, about, why)


_OTHERS = {"data": _of_data, "history": _of_history, "bound": _of_bound}
