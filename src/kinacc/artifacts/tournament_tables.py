"""Contract of the tournament's tables, in the folder ``tournament`` beside the data sets."""

from __future__ import annotations

from kinacc.artifacts.allowed import ASSESSOR_PATTERN
from kinacc.artifacts.columns import (
    ERROR_MM,
    Artefact,
    Column,
    length,
    magnitude,
    real,
    text,
    whole,
)

FOLDER = "tournament"
TARGETS = ("measured", "candidates", "region")
FIELD_KINDS = ("paper", "synthetic", "made_up", "measured")
_ASSESSOR = text("assessor", "method of assessment", pattern=ASSESSOR_PATTERN)
_TARGET = text("target", "what the statements are about", TARGETS)
_NAME_PATTERN = "[a-z][a-z0-9_.]*"
_SETUP = text("setup", "settings that assessors had, by name", pattern=_NAME_PATTERN)
_WORLD = text("world", "how readings came about: `stated`, or otherwise", pattern=_NAME_PATTERN)
_CONFIDENCE = magnitude("confidence", "1", "confidence stated; null where none is", 1.0, True)


def _share(name: str, meaning: str, nullable: bool = True) -> Column:
    return magnitude(name, "1", meaning, 1.0, nullable)


_CELL = (
    _ASSESSOR,
    _TARGET,
    text("field", "error field, see tournament_fields"),
    whole("candidates", "points that may be measured", 1),
    magnitude("noise_mm", "mm", "standard deviation of the noise per axis", 10.0),
    whole("budget", "measurements that may be spent", 1),
    _SETUP,
    _WORLD,
    whole("repetitions", "campaigns simulated", 1),
    length("true_mm", "mean of what values and lower bounds are graded against", ERROR_MM),
    length("bias_mm", "mean of stated value minus truth; null without a value", ERROR_MM, True),
    magnitude("rmse_mm", "mm", "root mean square of the same", ERROR_MM, True),
    _CONFIDENCE,
    whole("stated", "campaigns that state an upper bound"),
    whole("broken", "of these, how many rest on an assumption that is not true of the field"),
    whole("sound", "campaigns, stated or not, whose assumption, if any, is true of the field"),
    _share("upper_holds", "share of upper bounds at or above the truth, `broken` left out"),
    _share("broken_holds", "share of the `broken` upper bounds at or above the truth"),
    _share("upper_low", "lower end of its exact 95 % interval"),
    _share("upper_high", "upper end of its exact 95 % interval"),
    whole("lower_stated", "campaigns that state a lower bound"),
    _share("lower_holds", "share of lower bounds at or below the truth"),
    whole("alarmed", "campaigns whose readings contradict what the statements rest on"),
    real("excepted", "1", "mean number of points that an upper bound leaves out", 0, nullable=True),
    length("excess_mm", "mean of upper bound minus truth, `broken` left out", ERROR_MM, True),
    length("width_mm", "mean of upper minus lower bound", ERROR_MM, True),
    magnitude(
        "attainable_mm",
        "mm",
        "excess with all errors known beforehand, every point read "
        "and the rest spent best, mean of the first 20 campaigns; null where it has no bound",
        ERROR_MM,
        True,
    ),
    magnitude(
        "proven_mm",
        "mm",
        "excess below which no rule stays whose bounds hold, the same mean",
        ERROR_MM,
        True,
    ),
    real("measurements", "1", "mean number of measurements spent", 0),
    real("points_visited", "1", "mean number of distinct points measured", 0),
)
_KEY = ("assessor", "target", "field", "candidates", "noise_mm", "budget", "setup", "world")
TOURNAMENT_CHUNK = Artefact(
    "tournament_chunk", "Some of the cells of the tournament of assessors.", _CELL, _KEY
)
TOURNAMENT_CELLS = Artefact(
    "tournament_cells",
    "Tournament of assessors: a row per assessor, target, field, candidates, noise, budget, setup "
    "and world.",
    _CELL,
    _KEY,
)
TOURNAMENT_VERDICTS = Artefact(
    "tournament_verdicts",
    "Whether every assessor keeps the confidence it states, over all cells of a target, setup and "
    "world.",
    (
        _ASSESSOR,
        _TARGET,
        _SETUP,
        _WORLD,
        whole("cells", "cells with statements", 1),
        whole("statements", "statements in them, those on a broken assumption left out", 1),
        whole("rejected", "cells with coverage below the confidence (Holm, family-wise 1 %)"),
        whole("below", "cells of 200 statements or more with coverage three points below it"),
        _share("worst_holds", "smallest coverage of a cell", False),
        _share(
            "worst_begun", "the same of all campaigns begun: no statement is no false one", False
        ),
        _share("mean_holds", "coverage over all statements", False),
        whole("lower_rejected", "cells whose lower bounds are below the confidence, as `rejected`"),
        _share("lower_worst", "smallest coverage of the lower bounds of a cell"),
        _share("lower_holds", "coverage over all lower bounds"),
        _share("withheld", "share of campaigns that state no upper bound", False),
        _share("withheld_sound", "the same of campaigns counted as `sound`, worst cell"),
        _share("alarmed", "share of campaigns whose readings contradict what is stated", False),
    ),
    ("assessor", "target", "setup", "world"),
)
TOURNAMENT_FIELDS = Artefact(
    "tournament_fields",
    "The error fields of the tournament.",
    (
        text("field", "name"),
        text("kind", "where it comes from", FIELD_KINDS),
        text("meaning", "what it is"),
        whole("points", "configurations to draw candidates from", 1),
        magnitude("mean_mm", "mm", "mean size of the errors", ERROR_MM),
        magnitude("median_mm", "mm", "median size", ERROR_MM),
        magnitude("quantile_99_mm", "mm", "size that 99 % do not exceed", ERROR_MM),
        magnitude("max_mm", "mm", "largest size", ERROR_MM),
    ),
    ("field",),
)
ALL = (TOURNAMENT_CHUNK, TOURNAMENT_CELLS, TOURNAMENT_VERDICTS, TOURNAMENT_FIELDS)
