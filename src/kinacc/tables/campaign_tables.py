"""Contract of the tables a measuring campaign reports: points, readings, bounds as they grew."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kinacc.errors import Problem
from kinacc.tables.columns import (
    ERROR_MM,
    JOINTS,
    REACH_MM,
    Artefact,
    error_vector,
    length,
    magnitude,
    real,
    text,
    unstated,
    whole,
)

TARGETS = ("measured", "candidates", "region")
CAMPAIGN_POINTS = Artefact(
    "campaign_points",
    "Candidates of a measuring campaign, in the order in which they are visited.",
    (
        text("point", "name of the candidate"),
        whole("visit", "place in the visiting order, from 1; null where left out", 1, None, True),
        *JOINTS,
        *(
            length(f"{axis}_mm", f"{axis} of the modelled position, robot base frame", REACH_MM)
            for axis in "xyz"
        ),
        whole("readings", "readings used"),
        *unstated(error_vector("the mean of measured minus modelled position")),
        magnitude("error_mm", "mm", "size of that mean; null without readings", ERROR_MM, True),
        magnitude("noise_mm", "mm", "standard deviation per axis of that mean", ERROR_MM, True),
        magnitude("lower_mm", "mm", "lower limit on the true size", ERROR_MM, True),
        magnitude("upper_mm", "mm", "upper limit on the true size", ERROR_MM, True),
        text("left_out", "why the point was left out; null where it was not", nullable=True),
    ),
    ("point",),
)
CAMPAIGN_READINGS = Artefact(
    "campaign_readings",
    "Readings of a measuring campaign, in the order in which they were taken.",
    (
        whole("reading", "number of the reading, from 1", 1),
        text("point", "name of the candidate"),
        whole(
            "used",
            "place among the readings used, from 1; null where in hand or void",
            1,
            None,
            True,
        ),
        text("instrument", "instrument that measured"),
        text("frame", "frame of the measured position", ("base", "instrument")),
        *(length(f"{axis}_mm", f"{axis} as measured, in that frame", REACH_MM) for axis in "xyz"),
        *error_vector("measured minus modelled position"),
        magnitude("error_mm", "mm", "size of the error", ERROR_MM),
        magnitude("noise_mm", "mm", "standard deviation per axis, root mean square", ERROR_MM),
        text("struck", "why the reading is void; null where it is not", nullable=True),
    ),
    ("reading",),
)
CAMPAIGN_BOUNDS = Artefact(
    "campaign_bounds",
    "What a measuring campaign allowed to say after some numbers of readings.",
    (
        whole("readings", "readings used so far", 0),
        whole("points_measured", "distinct points measured so far", 0),
        text("target", "what the statement is about", TARGETS),
        real("share", "1", "share of the region it is about, else 1", 0.0, 1.0),
        magnitude("value_mm", "mm", "estimate", ERROR_MM, True),
        magnitude("lower_mm", "mm", "lower bound", ERROR_MM, True),
        magnitude("upper_mm", "mm", "upper bound", ERROR_MM, True),
        whole("excepted", "candidates that the upper bound leaves out, whichever they are", 0),
        real("confidence", "1", "confidence of each bound", 0.0, 1.0, True),
        text("assumption", "what the bounds rest on beside the noise", nullable=True),
        text("withheld", "why no upper bound is stated", nullable=True),
    ),
    ("readings", "target", "share"),
)
ALL = (CAMPAIGN_POINTS, CAMPAIGN_READINGS, CAMPAIGN_BOUNDS)


def contradictions(tables: Mapping[str, Mapping[str, Any]]) -> list[Problem]:
    """What the three tables of one campaign say of each other that cannot be."""
    points, readings, bounds = (tables[each.name] for each in ALL)
    used = [name for name, place in zip(readings["point"], readings["used"], strict=True)
            if place == place]  # fmt: skip
    problems = []
    for name, count in zip(points["point"], points["readings"], strict=True):
        if used.count(name) != count:
            what = f"{count} readings, {used.count(name)} in campaign_readings"
            problems.append(Problem(f"campaign_points, point {name}", what))
    if unknown := sorted(set(readings["point"]) - set(points["point"])):
        what = f"points that are no candidates: {', '.join(unknown[:5])}"
        problems.append(Problem("campaign_readings", what))
    if (last := int(max(bounds["readings"]))) != len(used):
        what = f"ends at {last} readings, {len(used)} were used"
        problems.append(Problem("campaign_bounds", what))
    return problems
