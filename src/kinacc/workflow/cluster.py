"""What stages ask for on a cluster, and which of them share a job there.

Snakemake starts anew for every job of a cluster, so that the stages of a data set share one, and
only parts of scattered work that take over a minute have jobs of their own. Times and memory were
measured on one core (docs/clusters.md). Importing this costs nothing but the standard library.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING

from kinacc.workflow import cost
from kinacc.workflow.catalogue import STAGES, maker_of

if TYPE_CHECKING:
    from kinacc.workflow.plan import Plan

ALONE_S = 60.0  # a part of scattered work that takes longer has a job of its own
_MARGIN = 4.0  # slower nodes, a shared file system, kernels compiled at first use
_MEMORY_MB = 600  # measured: 100 to 280 in a stage, 150 in the Snakemake of its job
# These grow with the poses: 100,000 of them fit.
_MORE_MEMORY_MB = dict.fromkeys(("vec", "compliance", "residuals", "history"), 1000)
_STAGE_S = 3.0


def _simulations(config: Mapping) -> float:
    return cost.simulations(config) * config["study"]["measurements"] / 200


# Seconds of all parts together, by the configuration of the data set.
_SECONDS: Mapping[str, Callable[[Mapping], float]] = {
    "vec": lambda config: 60.0 if config["calibration"]["vec"]["order"] == "auto" else 5.0,
    "compliance": lambda config: 10.0,
    "residuals": lambda config: 5.0,
    "accuracy_map": lambda config: 2.0 + 3e-4 * cost.cells(config),
    "study_chunk": lambda config: 0.01 * _simulations(config),
    "report": lambda config: 5.0,
    "robustness_chunk": lambda config: cost.of_stage("robustness_chunk", config).seconds,
}


def seconds(plan: Plan, name: str, dataset: str) -> float:
    """About how long one run of a stage takes on one core, a part where it is scattered."""
    work = _SECONDS.get(name, lambda config: 0.0)
    whole = work(plan.datasets[dataset])
    return _STAGE_S + whole / len(plan.part_names(name, dataset))


def runtime_min(plan: Plan, name: str, dataset: str, attempt: int = 1) -> int:
    """Limit on the time of one run; an attempt after a failure gets more."""
    return attempt * math.ceil(_MARGIN * seconds(plan, name, dataset) / 60)


def memory_mb(name: str, attempt: int = 1) -> int:
    """Limit on the memory of a job with this stage; an attempt after a failure gets more."""
    return attempt * _MORE_MEMORY_MB.get(name, _MEMORY_MB)


def group(plan: Plan, name: str, dataset: str) -> str | None:
    """Name of the job that a stage shares with those it is connected with; None for its own.

    What is made from parts that have jobs of their own is a group of its own too: a job cannot wait
    for another one in its middle.
    """
    if _is_alone(plan, name, dataset) or STAGES[name].of_lines:  # lines have a job each
        return None
    if STAGES[name].on_request:  # what the data set's job reads of it has to be there at its start
        return "on_request"
    if not STAGES[name].inputs and STAGES[name].is_figure:
        return "examples"  # of no data, the same for all
    after = any(_is_alone(plan, each, dataset) for each in _below(name))
    return "assessment" if after else "calibration"


def _is_alone(plan: Plan, name: str, dataset: str) -> bool:
    return STAGES[name].scattered and seconds(plan, name, dataset) > ALONE_S


@cache
def _below(name: str) -> set[str]:
    """Every stage of a plain run whose tables a stage reads, itself or through others."""
    found: set[str] = set()
    waiting = [name]
    while waiting:
        stage = STAGES[waiting.pop()]
        makers = {maker_of(each) for each in (*stage.inputs, *stage.optional)}
        read = {maker.name for maker in makers if not maker.on_request}
        waiting += read - found
        found |= read
    return found
