"""What a run of the workflow says at its end. Apart from the answer, which pages depend on."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from kinacc.workflow.answer import answer, read
from kinacc.workflow.plan import Plan


def last_words(plan: Plan, made: Collection[str]) -> list[str]:
    """What a run says at its end, which was about the files ``made``, up to date ones included.

    Of data sets whose summary was not asked for, only what the check of the data found.
    """
    lines: list[str] = []
    for dataset in plan.datasets:
        if plan.outputs("summary", dataset)["summary"] in made:
            folder = Path(plan.results) / dataset
            tables = read(folder)
            if plan.outputs("claims", dataset)["claims"] not in made:
                tables.pop("claims", None)
            lines += ["", *answer(folder, tables)]
        else:
            lines += plan.remarks(dataset)
    return lines
