"""What a rule is: tables of one data set in, problems out, each with its table and rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.artifacts.store import rows
from kinacc.errors import Problem

Tables = Mapping[str, Columns]
Rule = Callable[[Tables], Iterator[Problem]]

TOLERANCE = 1e-9


def mark(place: str, wrong: np.ndarray, what: str, allowed: str) -> Iterator[Problem]:
    """A problem naming the marked rows, if there are any."""
    if wrong.any():
        yield Problem(f"{place}.parquet", f"{what} in {rows(wrong)}", allowed)
