"""Single runs of model invalidation in full: Figs. 5 and 6, and the remark about a larger bound.

Simulations are the study's own worlds, looked through from repetition 0; the first that satisfies
the rule of an example is shown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from kinacc.assess.model_invalidation import ModelInvalidation
from kinacc.assess.world import World, checked_errors, error_vectors
from kinacc.config.records import of_section
from kinacc.study.monte_carlo import Visits, world_of
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

REJECTED, LARGER, KEPT = "rejected", "rejected_larger_eta", "not_rejected"

RULES = {
    REJECTED: (
        "first simulation that rejects at eta, does not reject at the slightly larger eta, and "
        "ends measuring the point of the largest true error again"
    ),
    LARGER: "the simulation of 'rejected', at the slightly larger eta",
    KEPT: "first simulation that does not reject although a point was measured again",
}
FALLBACKS = {
    REJECTED: (
        "first simulation that rejects at eta",
        "first simulation; none searched rejects at eta",
    ),
    KEPT: (
        "first simulation that does not reject",
        "first simulation; all searched reject at eta",
    ),
}


@dataclass(frozen=True)
class HistorySettings:
    """The ``histories`` section of the configuration.

    noise_mm: standard deviation per axis; eta_ratio_*: bound over true accuracy of the run that
    rejects, of the larger bound on its world, and of the run that does not reject;
    simulations_searched: how many repetitions are looked through.
    """

    noise_mm: float
    eta_ratio_rejected: float
    eta_ratio_larger: float
    eta_ratio_kept: float
    simulations_searched: int


@dataclass(frozen=True)
class Example:
    """One run to show: its simulation, its bound, and the rule it was chosen by."""

    name: str
    simulation: int
    eta_mm: float
    rule: str
    rule_met: bool


def histories(
    error_mm: ArrayLike,
    settings: HistorySettings,
    visits: Visits,
    assessor: ModelInvalidation,
    seed: int,
    point: ArrayLike | None = None,
    progress=None,
) -> Columns:
    """Columns of ``histories``: each example measurement by measurement.

    error_mm: (m, 3) true errors at the operating points, robot base frame, mm; point: (m,) their
    numbers, default 0 .. m-1. ``visits`` and ``assessor`` are the study's. Raises InputError for
    errors that cannot be used.
    """
    errors = checked_errors(error_mm)
    numbers = np.arange(errors.shape[0]) if point is None else np.asarray(point, np.int64)
    sizes = np.sqrt(np.sum(errors**2, axis=1))
    tables = []
    for example in examples(errors, settings, visits, assessor, seed, progress):
        world = world_of(errors, settings.noise_mm, example.simulation, visits, seed)
        steps = pd.DataFrame(assessor.history(world, example.eta_mm))
        rows = world.index[steps["row"]]
        columns = {
            "example": example.name,
            "simulation": example.simulation,
            "rule": example.rule,
            "rule_met": int(example.rule_met),
            "noise_mm": settings.noise_mm,
            "alpha": assessor.alpha,
            "distance": assessor.distance,
            "covariance": assessor.covariance,
            "iteration": np.arange(len(steps)) + 1,
            "point": numbers[rows],
            "eta_mm": example.eta_mm,
            "true_mm": sizes[rows],
        }
        tables.append(steps.drop(columns="row").assign(**columns))
    return columns_of("histories", pd.concat(tables).to_dict("records"))


def examples(
    error_mm: np.ndarray,
    settings: HistorySettings,
    visits: Visits,
    assessor: ModelInvalidation,
    seed: int,
    progress=None,
) -> list[Example]:
    """The runs to show, each the first simulation that satisfies its rule (see RULES).

    Where none of the simulations searched does, the closest thing that exists is shown and said to
    be that (FALLBACKS), with ``rule_met`` false.
    """
    sizes = np.sqrt(np.sum(error_mm**2, axis=1))
    truth, worst = float(sizes.max()), int(sizes.argmax())
    eta, larger = truth * settings.eta_ratio_rejected, truth * settings.eta_ratio_larger
    smaller = truth * settings.eta_ratio_kept

    def rejects(world: World) -> bool:
        return assessor.run(world, eta).rejected

    def shows_fig5(world: World) -> bool:
        if not rejects(world) or assessor.run(world, larger).rejected:
            return False
        last = assessor.history(world, eta)[-1]
        return last.repeat > 1 and world.index[last.row] == worst

    def keeps(world: World) -> bool:
        return not assessor.run(world, smaller).rejected

    def shows_fig6(world: World) -> bool:
        outcome = assessor.run(world, smaller)
        return not outcome.rejected and outcome.measurements > outcome.points_visited

    def search(name: str, bound: float, wanted: Callable, less: Callable) -> Example:
        second = None
        simulations = range(settings.simulations_searched)
        for number in progress(simulations, "simulations searched") if progress else simulations:
            world = world_of(error_mm, settings.noise_mm, number, visits, seed)
            if wanted(world):
                return Example(name, number, bound, RULES[name], True)
            if second is None and less(world):
                second = number
        return Example(name, second or 0, bound, FALLBACKS[name][second is None], False)

    fig5 = search(REJECTED, eta, shows_fig5, rejects)
    fig6 = search(KEPT, smaller, shows_fig6, keeps)
    return [fig5, Example(LARGER, fig5.simulation, larger, RULES[LARGER], fig5.rule_met), fig6]


def run(inputs: Mapping, settings: Mapping, progress=None) -> dict[str, dict]:
    """Return ``histories``."""
    points = inputs["assessment_points"]
    error_mm = error_vectors(points)
    rows = histories(
        error_mm,
        of_section(HistorySettings, settings["histories"]),
        of_section(Visits, settings["study"]),
        of_section(ModelInvalidation, settings["study"]),
        settings["seed"],
        points["point"],
        progress,
    )
    return {"histories": rows}
