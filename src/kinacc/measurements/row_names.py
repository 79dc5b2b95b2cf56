"""What a row of measurements is called where a person reads of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kinacc.errors import and_more
from kinacc.tables.columns import texts

_RANGES_SHOWN = 6


@dataclass(frozen=True)
class RowNames:
    """How rows of a file are called: by their line, with the file's own name for the pose.

    ``pose`` are names by line, none where the file only numbers its poses; ``file`` is the file
    the lines are of where there are several, else empty; ``word`` says what they are.
    """

    pose: Mapping[int, str] = field(default_factory=dict)
    file: str = ""
    word: str = "line"

    @classmethod
    def of_columns(cls, columns: Mapping[str, Any]) -> RowNames:
        """From ``row``, ``pose_name``, ``file`` and ``row_kind`` of ``measurements``."""
        names, files = columns.get("pose_name", ()), columns.get("file", ())
        pairs = zip(columns["row"], names, strict=True) if len(names) else ()
        pose = {int(line): str(name) for line, name in pairs if line == line and name}
        word = next((str(kind) for kind in columns.get("row_kind", ()) if kind), cls.word)
        return cls(pose, next((str(file) for file in files if file), ""), word)

    def columns(self, lines: np.ndarray) -> dict[str, np.ndarray]:
        """What ``of_columns`` reads beside ``lines`` (n,); no column that would say nothing."""
        columns = {}
        if self.pose:
            columns["pose_name"] = texts(self.pose.get(int(line)) for line in lines)
        if self.file:
            columns["file"] = texts([self.file] * len(lines))
        if self.word != type(self).word:
            columns["row_kind"] = texts([self.word] * len(lines))
        return columns

    def one(self, line: int) -> str:
        """``line 14 (P12_1) of points.csv``."""
        return self.spans([line])

    def number(self, line: int) -> str:
        """``14 (P12_1)``, behind a word that says what it is."""
        return self._run(int(line), int(line))

    def spans(self, lines: Iterable[int]) -> str:
        """``lines 2-9 (P1 to P8), 12 (P11) and 17 more``."""
        numbers = np.unique(np.array(list(lines), dtype=np.int64))
        if not numbers.size:
            return f"no {self.word}"
        runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
        ranges = ", ".join(self._run(int(run[0]), int(run[-1])) for run in runs[:_RANGES_SHOWN])
        rest = and_more(sum(len(run) for run in runs[_RANGES_SHOWN:]))
        file = f" of {self.file}" if self.file else ""
        return f"{self.word}{'s' * (len(numbers) > 1)} {ranges}{rest}{file}"

    def _run(self, first: int, last: int) -> str:
        lines = f"{first}" if first == last else f"{first}-{last}"
        ends = dict.fromkeys(self.pose[n] for n in (first, last) if n in self.pose)
        return f"{lines} ({' to '.join(ends)})" if ends else lines
