"""Everything that can be wrong with a measured file, with message and remedy; the report of one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from typing import Any

import numpy as np
import yaml

from kinacc.config.settings import OUTSIDE_LIMITS
from kinacc.measurements.row_names import RowNames
from kinacc.tables.allowed import FINDING_LEVELS

STOPS, WARNING, NOTE = FINDING_LEVELS
TEXTS: dict[str, list[str]] = yaml.safe_load(
    (files("kinacc.checks") / "findings.yaml").read_text("utf-8")
)
_OF_ROWS = {
    "target_swapped",
    "rows_exchanged",
    "duplicate_rows",
    "repeated_reading",
    "outliers",
    OUTSIDE_LIMITS,
}
# These stop a workflow where a reading is far off; all else does, but for the largest rows.
_WARN = {*_OF_ROWS, "commanded_joints"} - {OUTSIDE_LIMITS}
VERDICTS = ("clean", "suspicions")  # by exit code


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a file, or may be.

    Attributes
    ----------
    kind
        Its code, see ``TEXTS``.
    what, fix
        Message and remedy.
    values
        Numbers behind it, units in their names.
    lines
        Lines of the file it concerns, in order.
    level
        Whether it stops a workflow that fits the data, warns, or is a note; a note if not held to.
    where
        These lines in words; empty where it is about no lines.
    """

    kind: str
    what: str
    fix: str
    values: Mapping[str, Any]
    lines: tuple[int, ...] = ()
    level: str = NOTE
    where: str = ""

    @property
    def about(self) -> tuple[object, ...]:
        """What it is about: a second jump concerns rows of the first and is another one."""
        return self.kind, self.values.get("joint"), self.values.get("first_line")

    def of_lines(self, lines: Iterable[int], detail: str = "", **values: Any) -> Finding:
        """The finding at these lines, with more numbers; ``detail`` is appended to its message."""
        values = {**self.values, **values}
        message = self.what + detail.format(**values)
        return replace(self, what=message, lines=tuple(np.unique([*lines]).tolist()), values=values)

    def held_to(self, gross: Iterable[int], names: RowNames) -> Finding:
        """The finding with its level and its lines in words.

        Rows at the lines ``gross`` are too far off for any fit; ``names`` are those of the rows.
        """
        mild = self.kind in _WARN and set(gross).isdisjoint(self.lines)
        level = WARNING if mild or self.kind == "largest_rows" else STOPS
        return replace(self, level=level, where=names.spans(self.lines) if self.lines else "")

    def commands(self, config: str = "FILE.yaml") -> list[str]:
        """Commands to go on with: exclude the rows, or accept the finding."""
        accept = f'kinacc check-data {config} --accept {self.kind} --reason ".."'
        if self.kind not in _OF_ROWS or not self.lines:
            return [accept]
        runs = np.split(self.lines, np.flatnonzero(np.diff(self.lines) > 1) + 1)
        lines = ",".join(f"{run[0]}" if len(run) < 2 else f"{run[0]}-{run[-1]}" for run in runs)
        exclude = f'kinacc exclude {config} --lines {lines} --reason ".."'
        return [exclude] if self.kind == OUTSIDE_LIMITS else [exclude, accept]


def finding(key: str, lines: Iterable[int] = (), **values: Any) -> Finding:
    """The finding ``key`` of ``TEXTS`` at ``lines``, each named once and in order."""
    message, fix = (text.format(**values) for text in TEXTS[key])
    return Finding(key.partition("/")[0], message, fix, values).of_lines(lines)


@dataclass(frozen=True)
class Report:
    """What ``kinacc check-data`` reports of one data set.

    Attributes
    ----------
    facts
        What is in the file, by name; units stand in the names.
    suspicions, notes
        Findings; notes are on what is not used and where the data are thin.
    line, left_mm
        For a picture: lines (n,) of the readings as compared and what a robust fit leaves of
        each, mm; empty where nothing was fitted.
    accepted
        Reasons of the configuration to go on with findings, by their code.
    """

    path: str
    facts: Mapping[str, Any]
    suspicions: tuple[Finding, ...]
    notes: tuple[Finding, ...] = ()
    line: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    left_mm: np.ndarray = field(default_factory=lambda: np.empty(0))
    accepted: Mapping[str, str] = field(default_factory=dict)

    @property
    def stopping(self) -> tuple[Finding, ...]:
        """The findings that stop a workflow, unless they are accepted."""
        return tuple(e for e in self.suspicions if e.level == STOPS and e.kind not in self.accepted)

    def as_dict(self) -> dict[str, object]:
        """For JSON: every finding with all its lines."""
        keys = ("kind", "level", "what", "fix", "lines")
        return {
            "path": self.path,
            "verdict": VERDICTS[bool(self.suspicions)],
            "facts": self.facts,
            "remarks": [item.what for item in self.notes],
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
