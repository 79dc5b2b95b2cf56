"""Single runs of model invalidation in full: Figs. 5 and 6, and the remark about a larger bound.

Simulations are the study's own worlds, looked through from repetition 0; the first that satisfies
the rule of an example is shown.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from kinacc.assess.model_invalidation import ModelInvalidation
from kinacc.assess.world import World, checked_errors, error_vectors
from kinacc.config.records import Settings, of_section
from kinacc.progress import with_progress
from kinacc.study.monte_carlo import Visits, world_of
from kinacc.tables.columns import Columns, Tables
from kinacc.tables.contract import columns_from

REJECTED, LARGER, KEPT = "rejected", "rejected_larger_eta", "not_rejected"

RULES = {
    REJECTED: (
        "first simulation that rejects at eta, does not reject at the slightly larger eta, and "
        "ends measuring the point of the largest true error again"
    ),
    LARGER: "the simulation of 'rejected', at the slightly larger eta",
    KEPT: "first simulation that does not reject although a point was measured again",
}
FALLBACK = "first simulation decided so, else the first: none searched obeys the rule"


class Example(NamedTuple):
    """One run to show: its name, simulation and bound, and the rule it was chosen by."""

    example: str
    simulation: int
    eta_mm: float
    rule: str
    rule_met: bool


def histories(
    error_mm: ArrayLike,
    section: Settings,
    visits: Visits,
    assessor: ModelInvalidation,
    seed: int,
    point: ArrayLike | None = None,
) -> Columns:
    """Columns of ``histories``: each example measurement by measurement.

    error_mm: (m, 3) true errors at the operating points, robot base frame, mm; point: (m,) their
    numbers, default 0 .. m-1. ``section``: the configuration's ``histories``; ``visits`` and
    ``assessor`` are the study's. Raises InputError for errors that cannot be used.
    """
    errors = checked_errors(error_mm)
    numbers = np.arange(len(errors)) if point is None else np.asarray(point, np.int64)
    sizes, tables = np.linalg.norm(errors, axis=1), []
    settled = {name: getattr(assessor, name) for name in ("alpha", "distance", "covariance")}
    for example in examples(errors, section, visits, assessor, seed):
        world = world_of(errors, section["noise_mm"], example.simulation, visits, seed)
        steps = assessor.history(world, example.eta_mm)
        rows = world.point[steps.pop("row")]
        columns = {**example._asdict(), **settled, "noise_mm": section["noise_mm"]}
        columns |= {"iteration": np.arange(len(steps)) + 1, "rule_met": int(example.rule_met)}
        tables.append(steps.assign(**columns, point=numbers[rows], true_mm=sizes[rows]))
    return columns_from("histories", pd.concat(tables))


def examples(
    error_mm: np.ndarray,
    section: Settings,
    visits: Visits,
    assessor: ModelInvalidation,
    seed: int,
) -> list[Example]:
    """The runs to show, each the first simulation that satisfies its rule (see RULES).

    Where none of the simulations searched does, the closest thing that exists is shown and said to
    be that (FALLBACK), with ``rule_met`` false.
    """
    sizes = np.linalg.norm(error_mm, axis=1)
    truth, worst = float(sizes.max()), int(sizes.argmax())
    larger = truth * section["eta_ratio_larger"]

    def shows_fig5(world: World, eta: float) -> bool:
        if assessor.run(world, larger).rejected:
            return False
        last = assessor.history(world, eta).iloc[-1]
        return bool(last["repeat"] > 1 and world.point[int(last["row"])] == worst)

    def shows_fig6(world: World, eta: float) -> bool:
        outcome = assessor.run(world, eta)
        return outcome.measurements > outcome.points_visited

    def search(name: str, eta: float, shows: Callable[[World, float], bool]) -> Example:
        """The first simulation rejected (or not, for Fig. 6) at eta that shows what it is for."""
        nearest, simulations = None, range(section["simulations_searched"])
        for number in with_progress(simulations, "simulations searched"):
            world = world_of(error_mm, section["noise_mm"], number, visits, seed)
            if assessor.run(world, eta).rejected != (name == REJECTED):
                continue
            if shows(world, eta):
                return Example(name, number, eta, RULES[name], True)
            nearest = number if nearest is None else nearest
        return Example(name, nearest or 0, eta, FALLBACK, False)

    fig5 = search(REJECTED, truth * section["eta_ratio_rejected"], shows_fig5)
    fig6 = search(KEPT, truth * section["eta_ratio_kept"], shows_fig6)
    return [fig5, fig5._replace(example=LARGER, eta_mm=larger, rule=RULES[LARGER]), fig6]


def run(
    inputs: Tables,
    settings: Settings,
) -> Tables:
    """Return ``histories``."""
    points, study = inputs["assessment_points"], settings["study"]
    rows = histories(
        error_vectors(points),
        settings["histories"],
        of_section(Visits, study),
        of_section(ModelInvalidation, study),
        settings["seed"],
        points["point"],
    )
    return {"histories": rows}
