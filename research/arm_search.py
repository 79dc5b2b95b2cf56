"""The search for arms like the paper's: seeds in order, one rule, every try counted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np

from kinacc.calibration.observations import from_columns
from kinacc.calibration.vec_estimator import VECEstimator
from kinacc.kinematics import robot, vec
from kinacc.kinematics.robot import Robot
from kinacc.study import in_memory
from kinacc.study.claims.claim import number_claims
from kinacc.synthetic import columns
from kinacc.synthetic.accepted import GEOMETRY, AcceptedDraw, geometry_columns
from kinacc.synthetic.draw import TABLE_II, Scales
from kinacc.synthetic.plan import Run, calibration_run
from kinacc.synthetic.source import attitude, split
from research import arm_acceptance as acceptance
from research.response import Response, linearise
from research.tuning import Targets, targets_of, tuned

# Arms whose linear prediction misses a number by more than this are not measured: near the 10 % of
# the tolerances it is within 1.2 % of what measuring and fitting give.
_HOPELESS = 0.15
_UNTUNED = AcceptedDraw(0, Scales(1.0, 1.0, 1.0, 1.0), TABLE_II)


@dataclass(frozen=True)
class Trial:
    """One seed tried: its arm, the numbers it gave by claim id, and whether it was accepted.

    No numbers where the arm was too far off to be measured.
    """

    draw: AcceptedDraw
    numbers: Mapping[str, float]
    accepted: bool


@dataclass(frozen=True)
class Bench:
    """What every draw of a search shares: the arm, the configuration, both fits' response."""

    robot: Robot
    config: Mapping
    response: Response
    targets: Targets

    @property
    def poses(self) -> int:
        """Number of calibration poses."""
        return int(self.config["measurements"]["synthetic"]["poses"])

    @property
    def tracker_noise_mm(self) -> float:
        """Standard deviation of the tracker per axis."""
        return float(self.config["measurements"]["synthetic"]["tracker_noise_mm"])

    def run(self, seed: int) -> Run:
        """The calibration run with the chance of draw ``seed``, as the workflow plans it."""
        return calibration_run(self.robot, self.poses, seed, attitude(self.config["evaluation"]))


def bench_of(config: Mapping) -> Bench:
    """The bench for the complete configuration of a data set of the synthetic arm."""
    targets = targets_of({claim.id: claim.paper for claim in number_claims()})
    bench = Bench(robot.load(config["robot"]), config, None, targets)
    # Poses, folds, joint range and points are those of any arm on the geometry of Table II.
    start = {"measurements": measured(bench, _UNTUNED)}
    made = in_memory.run(acceptance.STAGES, config, start)
    fitted = vec.VECModel.from_columns(made["vec_model"], TABLE_II)
    empty = vec.without_errors(TABLE_II, fitted.q_min_rad, fitted.q_max_rad, fitted.order)
    seen = made["measurements"]
    every = from_columns(seen, bench.robot)
    estimator = VECEstimator.of(config["calibration"], bench.robot, every)
    weight = estimator.common.rotation_weight_mm_per_rad
    response = linearise(
        empty,
        estimator.prior.std(empty),
        targets.noise_mm(weight),
        weight,
        _stacked(seen, "q"),
        _stacked(seen, "s") * estimator.travel_direction,
        np.asarray(seen["subset"]) == "train",
        _stacked(made["assessment_points"], "q"),
    )
    return Bench(bench.robot, config, response, targets)


def trial(bench: Bench, seed: int) -> Trial:
    """Draw, tune, measure and fit the arm of ``seed``, and judge it."""
    run = bench.run(seed)
    draw, miss = tuned(seed, run, bench.response, bench.targets, bench.tracker_noise_mm)
    return Trial(draw, {}, False) if miss > _HOPELESS else judged(bench, draw)


def judged(bench: Bench, draw: AcceptedDraw) -> Trial:
    """Measure and fit an arm as the workflow does, and judge it."""
    found = acceptance.numbers(bench.config, measured(bench, draw))
    return Trial(draw, found, acceptance.accepted(found))


def measured(bench: Bench, draw: AcceptedDraw) -> dict[str, np.ndarray]:
    """Columns of ``measurements`` of an arm, split as the workflow splits them."""
    seen = columns(draw, bench.run(draw.seed), bench.tracker_noise_mm)
    return split(seen, bench.config)


def search(bench: Bench, wanted: int, seeds: int | None = None) -> list[Trial]:
    """The first ``wanted`` accepted trials of the seeds 0, 1, 2, ..., of ``seeds`` at most."""
    found: list[Trial] = []
    for seed in range(seeds) if seeds is not None else count():
        tried = trial(bench, seed)
        found += [tried] if tried.accepted else []
        if len(found) >= wanted:
            break
    return found


def as_csv(found: Sequence[Trial]) -> str:
    """The table of accepted draws as shipped: remarks, then one row per draw."""
    tried = found[-1].draw.seed + 1
    names = ["seed", *Scales._fields, *geometry_columns(), *found[0].numbers]
    remarks = (
        "Accepted draws of the synthetic arm; made by the rule `arms` of research/Snakefile.",
        "Seeds 0, 1, 2, ... were tried in order under the default configuration. Accepted: every",
        "number of Tables I to III and the true accuracy within its tolerance, nothing else looked",
        f"at. {tried} seeds were tried for {len(found)} draws, {found[0].draw.seed + 1} for the "
        "first.",
    )
    lines = [*(f"# {remark}" for remark in remarks), ",".join(names)]
    lines += [",".join(map(str, _row(each))) for each in found]
    return "\n".join(lines) + "\n"


def _row(found: Trial) -> list:
    draw = found.draw
    geometry = np.stack([getattr(draw.geometry, name) for name in GEOMETRY], axis=1)
    numbers = (f"{value:.6g}" for value in found.numbers.values())
    return [draw.seed, *draw.scales, *(geometry.ravel() + 0.0).tolist(), *numbers]


def _stacked(columns_: Mapping, letter: str) -> np.ndarray:
    return np.stack([columns_[f"{letter}{joint}"] for joint in range(1, 7)], axis=1).astype(float)
