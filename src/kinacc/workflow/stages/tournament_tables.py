"""Stage: gather the cells of the tournament and judge every assessor by them."""

from __future__ import annotations

from collections.abc import Mapping

from kinacc.study.tournament import contest, summary
from kinacc.study.tournament.fields import described


def run(inputs: Mapping, settings: Mapping) -> dict[str, dict]:
    """Return ``tournament_cells``, ``tournament_verdicts`` and ``tournament_fields``."""
    cells = summary.in_order(inputs["tournament_chunk"])
    fields = contest.contested(inputs, settings["robots"], contest.Contest.of(settings).size)
    return {
        "tournament_cells": cells,
        "tournament_verdicts": summary.judged(cells),
        "tournament_fields": described(fields),
    }
