"""Measurements that choosing them by what was read saves, on measured robots.

Width between the bounds on the measured points: of one reading at each of 200 candidates, and of
the adaptive assessors with 60 % of these readings. A ratio of at most 1 says that the same width
took at most 60 % of the measurements.

    snakemake -c2 --configfile config.yaml examples/ur10.yaml
    python benchmarks/measurements_saved.py config.yaml examples/ur10.yaml
"""

from __future__ import annotations

import sys

import numpy as np

from kinacc.config.schema import defaults
from kinacc.study.tournament.contest import SIZES, Cell, Contest, Job, campaigns
from kinacc.study.tournament.fields import ErrorField, of_tables
from kinacc.study.tournament.summary import summed
from kinacc.workflow.catalogue import TOURNAMENT
from kinacc.workflow.inputs import read_inputs
from kinacc.workflow.plan import planned

CANDIDATES, SHARE, SEED, CAMPAIGNS = 200, 0.6, 1, 40
NOISE_MM = (0.05, 0.1, 0.2, 0.3)
WHOLE, ADAPTIVE = "single_shot", ("search_and_confirm", "sequential", "two_stage")


def measured(configs: list[str]) -> list[ErrorField]:
    """The error fields of all measured data sets of the configurations."""
    job = planned(configs).job("tournament_chunk", TOURNAMENT, "1-of-1")
    found = of_tables(read_inputs(job.inputs).tables, job.settings["robots"], ())
    return [field for field in found if field.kind == "measured"]


def width_mm(field: ErrorField, noise_mm: float, name: str, budget: int) -> float:
    """Mean width between the bounds on the measured points."""
    job = Job(Cell(field, min(CANDIDATES, field.points), noise_mm), budget)
    alone = Contest(SIZES["default"], SEED, (name,), defaults()["study"])
    cells = summed(campaigns(job, range(CAMPAIGNS), alone)[0])
    return float(cells["width_mm"][np.asarray(cells["target"]) == "measured"][0])


def main(configs: list[str]) -> None:
    """Print the table."""
    print("field     noise  " + "".join(f"{name:>20s}" for name in ADAPTIVE))
    for field in measured(configs):
        budget = min(CANDIDATES, field.points)
        few = round(SHARE * budget)
        for noise in NOISE_MM:
            whole = width_mm(field, noise, WHOLE, budget)
            ratios = [width_mm(field, noise, name, few) / whole for name in ADAPTIVE]
            print(f"{field.name:8s} {noise:6.2f}  " + "".join(f"{each:20.2f}" for each in ratios))


if __name__ == "__main__":
    main(sys.argv[1:])
