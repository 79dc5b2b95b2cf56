"""Stage: every claim over the choices that the paper leaves open, one part of the runs."""

from __future__ import annotations

from collections.abc import Mapping

from kinacc.artifacts.contract import columns_of
from kinacc.artifacts.error_models import ALWAYS
from kinacc.artifacts.provenance import config_hash
from kinacc.errors import InputError
from kinacc.study.choices.design import Run, runs
from kinacc.study.choices.open_choices import FIG_5
from kinacc.study.choices.properties import of_tables
from kinacc.study.claims.evaluate import evaluate
from kinacc.workflow import in_memory

_POINTS = ("measurements", *ALWAYS, "assessment_points")
_FOLLOWED = (*_POINTS, "histories")
_STAGES = (*_POINTS, "residuals", "accuracy_map", "study_chunk", "study", "histories")


def run(inputs: Mapping, settings: Mapping, progress=None) -> dict[str, dict]:
    """Return ``choices_chunk``, ``choices_factors_chunk`` for ``settings["part"]`` (default: all).

    Runs that share settings stand side by side, so that what these make is made once.
    Raises InputError where fewer arms were accepted than are wanted.
    """
    config = {name: value for name, value in settings.items() if name != "part"}
    part = settings.get("part") or {"number": 1, "of": 1}
    memory = in_memory.Memory()
    alike = sorted(runs(config), key=lambda each: _shared(each.configured(config)))
    first, last = (len(alike) * end // part["of"] for end in (part["number"] - 1, part["number"]))
    chosen = alike[first:last]
    judged, factors = [], []
    for each in progress(chosen, "runs") if progress else chosen:
        more, about = _judged(each, config, memory)
        judged += more
        factors += about
    return {
        "choices_chunk": columns_of("choices_chunk", judged),
        "choices_factors_chunk": columns_of("choices_factors_chunk", factors),
    }


def _shared(config: Mapping) -> tuple[str, ...]:
    """A key that brings configurations with the same settings of their first stages together."""
    return tuple(config_hash(in_memory.settings_of(name, config)) for name in _STAGES)


def _judged(
    each: Run, config: Mapping, memory: in_memory.Memory
) -> tuple[list[tuple], list[tuple]]:
    """Rows of both tables of one run."""
    tables: dict = {}
    why = None
    try:
        memory.fill(tables, _FOLLOWED if each.varied == FIG_5 else _STAGES, each.configured(config))
    except InputError as error:
        why = str(error)
    claims = evaluate(tables, paper_arm=True)
    followed_only = each.varied == FIG_5
    judged = [
        (each.number, each.varied, each.value, claim, verdict, statistic, why)
        for claim, evidence, verdict, statistic in zip(
            *(claims[name] for name in ("claim", "evidence", "verdict", "reproduced")), strict=True
        )
        if not followed_only or evidence == "histories.parquet"
    ]
    factors = [
        (each.number, name, "choice", word, None) for name, word in sorted(each.chosen.items())
    ]
    factors += [
        (each.number, name, "property", None, number) for name, number in of_tables(tables).items()
    ]
    return judged, factors
