"""What a run of the workflow says at its end. Apart from the answer, which pages depend on."""

from __future__ import annotations

import shlex
from collections.abc import Collection
from pathlib import Path

from kinacc.workflow.answer import answer, read
from kinacc.workflow.fleet import FEW
from kinacc.workflow.measured_files import remarks
from kinacc.workflow.plan import Plan


def last_words(plan: Plan, made: Collection[str]) -> list[str]:
    """What a run says at its end, which was about the files ``made``, up to date ones included.

    Of data sets whose summary was not asked for, only what the check of the data found. Of many
    nobody reads so much of each: the command is named that says what they are worth.
    """
    lines: list[str] = []
    told = [each for each in plan.told if plan.outputs("summary", each)["summary"] in made]
    if len(told) > FEW:
        command = shlex.join(["kinacc", "summary", plan.results])
        return ["", f"{len(told):,} data sets: {command} says what each is worth"]
    for dataset in plan.datasets:
        if dataset in told:
            folder = Path(plan.results) / dataset
            tables = read(folder)
            if plan.outputs("claims", dataset)["claims"] not in made:
                tables.pop("claims", None)
            lines += ["", *answer(folder, tables)]
        elif dataset in plan.told:
            lines += remarks(plan, dataset)
    return lines
