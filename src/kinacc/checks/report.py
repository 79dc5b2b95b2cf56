"""The report of a measured file: what is in it and every finding."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

import numpy as np

from kinacc.checks.findings import STOPS, Finding

Progress = Callable[[Iterable[Any], str], Iterable[Any]]
CLEAN, SUSPICIOUS, UNUSABLE = 0, 1, 2
VERDICTS = ("clean", "suspicions", "unusable")


@dataclass(frozen=True)
class Report:
    """What ``kinacc check-data`` reports of one data set.

    Attributes
    ----------
    facts
        What is in the file, by name; units stand in the names.
    remarks
        Sentences on what the file holds.
    suspicions, notes
        Findings; notes are on what is not used and where the data are thin.
    line, left_mm
        For a picture: lines (n,) of the readings as compared and what a robust fit leaves of
        each, mm; empty where nothing was fitted.
    accepted
        Reasons of the configuration to go on with findings, by their code.
    """

    dataset: str
    path: str
    facts: Mapping[str, Any]
    remarks: tuple[str, ...]
    suspicions: tuple[Finding, ...]
    notes: tuple[Finding, ...] = ()
    line: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    left_mm: np.ndarray = field(default_factory=lambda: np.empty(0))
    accepted: Mapping[str, str] = field(default_factory=dict)

    @property
    def stopping(self) -> tuple[Finding, ...]:
        """The findings that stop a workflow, unless they are accepted."""
        return tuple(e for e in self.suspicions if e.level == STOPS and e.kind not in self.accepted)

    @property
    def code(self) -> int:
        """0 clean, 1 with suspicions."""
        return SUSPICIOUS if self.suspicions else CLEAN

    def as_dict(self) -> dict[str, object]:
        """For JSON: every finding with all its lines."""
        keys = ("kind", "level", "what", "fix", "lines")
        return {
            "dataset": self.dataset,
            "path": self.path,
            "verdict": VERDICTS[self.code],
            "facts": self.facts,
            "remarks": [*self.remarks, *(item.what for item in self.notes)],
            "suspicions": [
                {
                    **{key: vars(item)[key] for key in keys},
                    "accepted": self.accepted.get(item.kind),
                    "where": item.where or None,
                    **item.values,
                }
                for item in self.suspicions
            ],
        }

    def as_text(self) -> str:
        """For people, by the template ``report.txt``."""
        from jinja2 import Environment

        text = (files("kinacc.checks") / "report.txt").read_text("utf-8")
        template = Environment(trim_blocks=True, lstrip_blocks=True).from_string(text)
        return template.render(report=self)


def to_json(reports: Sequence[Mapping[str, Any]]) -> str:
    """All data sets in one object, with the worst verdict; numbers that are not finite are null."""
    verdict = max((item["verdict"] for item in reports), key=VERDICTS.index, default=VERDICTS[0])
    text = json.dumps({"verdict": verdict, "datasets": reports}, default=np.ndarray.tolist)
    return json.dumps(json.loads(text, parse_constant=lambda name: None), indent=1)
