"""False alarms of a robot's history over simulated years, and how small a change it sees.

    python research/history_years.py --same 1000 --other 100 --out docs/history

Without a number of years the picture alone is drawn.

A simulated year: one physical arm (the geometry and the sizes of effects of an accepted draw, all
effects drawn anew), calibrated twelve times with POSES poses of the synthetic calibration plan: the
same every month, or others every month. Each time the tracker is set up anew, its noise and the
arm's repeatability are drawn anew, and the run of RUN_H hours begins at a random time up to RUN_H
after the cold start: the arm warms up differently each time. Between months the hall differs by
HALL_K, and all lengths of the arm grow with it. Nothing else happens, so every "recalibrate" is a
false alarm; after one, the new calibration is in force. Fits are linear ones about the draw's
geometry; all else is the code that makes a history.

A change of a joint moves the estimate by as much and changes nothing else, as a change of the
second series is a free unknown beside all variances. So every month in which nothing happened
says as well which sizes of a change would have been seen in it.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from kinacc.calibration.frames import known
from kinacc.calibration.observations import Observations, full_poses
from kinacc.deployment import history_model
from kinacc.deployment.history import LEVEL
from kinacc.deployment.history_model import Pair
from kinacc.kinematics import robot as robots
from kinacc.synthetic import plan
from kinacc.synthetic.accepted import accepted_draw, rows
from kinacc.synthetic.draw import physical_robot
from kinacc.synthetic.physical import PhysicalRobot, Visits

POSES, MONTHS = 100, 12
NOISE_MM, WEIGHT_MM_PER_RAD = 0.02, 500.0
HALL_K, GROWTH_PER_K = 5.0, 1.2e-5  # standard deviation of months; of steel
MOVED = {"base"}
SAME, OTHER = "same", "other"
POOL = 20_000


@cache
def pool() -> np.ndarray:
    """Configurations that programmes are drawn of."""
    return plan.configurations(robots.load("mh180"), POOL)


def grown(arm: PhysicalRobot, warmer_k: float) -> PhysicalRobot:
    """The arm with all lengths grown by a change of temperature."""
    longer = 1.0 + GROWTH_PER_K * warmer_k
    geometry = replace(arm.dh, a_mm=arm.dh.a_mm * longer, d_mm=arm.dh.d_mm * longer)
    return replace(arm, dh=geometry)


class Arm:
    """One physical arm and its measuring programme."""

    def __init__(self, number: int, plans: str) -> None:
        draw = accepted_draw(number % len(rows()))
        self.rng = np.random.default_rng([16, number, plans == SAME])
        self.true = physical_robot(100_000 + number, draw.scales, draw.geometry)
        self.plans = plans
        self.programme = self._programme()

    def _programme(self) -> np.ndarray:
        return pool()[self.rng.choice(len(pool()), POSES, replace=False)]

    def series(self, true: PhysicalRobot | None = None) -> Observations:
        """One calibration run, of this arm or of what became of it."""
        q_rad = self.programme if self.plans == SAME else self._programme()
        time_h = plan.time_h(POSES) + self.rng.uniform(0.0, plan.RUN_H)
        s, normal = plan.directions(q_rad), self.rng.standard_normal((3, POSES, 6))
        visits = Visits(q_rad, s, time_h, normal[0])
        run = plan.Run(visits, normal[1, :, :3], normal[2, :, :3])
        arm = grown(true or self.true, self.rng.normal(0.0, HALL_K))
        return full_poses(q_rad, plan.measured(arm, run, NOISE_MM), s)

    def pair(self, first: Observations, second: Observations) -> Pair:
        """Both, about the arm's geometry."""
        both = history_model.joined(first, second, MOVED)
        frames = known(sessions=len(both.session_names))
        return history_model.about(self.true.dh, frames, both, len(first), WEIGHT_MM_PER_RAD)

    def misfit_factor(self, *every: Observations) -> float:
        """What halves of series say of the misfit; nothing where all poses are shared."""
        if self.plans == SAME:
            return 1.0
        return history_model.misfit_factor(
            self.pair(*half) for series in every for half in history_model.halves(series)
        )


# Names of DH parameters by the error they are: (of this joint or the next, place among ERRORS).
PARAMETERS = {"theta": (0, 5), "d": (0, 2), "a": (1, 0), "alpha": (1, 3)}
JOINTS = 6
CHANGES = [(joint, name) for joint in range(JOINTS) for name in PARAMETERS]
UNSEEN_MM = 1e-3  # what base and tool take up
SIZES_MM = np.arange(0.0, 1.001, 0.02)


def year(arm: Arm) -> tuple[list[dict], np.ndarray, np.ndarray]:
    """Decisions; how often CHANGES of SIZES_MM were seen; rms mm of CHANGES by one mm or mrad."""
    force = arm.series()
    decisions, seen, size = [], np.zeros((len(CHANGES), len(SIZES_MM))), []
    for month in range(1, MONTHS):
        series = arm.series()
        factor = arm.misfit_factor(force, series)
        found = history_model.moved(arm.pair(force, series), factor)
        probability, chance_mm = found.test(LEVEL)
        alarm = found.moved_mm > chance_mm
        decisions.append({
            "plans": arm.plans, "month": month + 1, "moved_mm": found.moved_mm,
            "chance_mm": chance_mm, "probability": probability,
            "factor": factor, "alarm": int(alarm),
        })  # fmt: skip
        hits, sizes = _seen(found, chance_mm)
        seen += hits
        size.append(sizes)
        if alarm:
            force = series
    return decisions, seen, np.mean(size, axis=0)


def _seen(found: history_model.Moved, chance_mm: float) -> tuple[np.ndarray, np.ndarray]:
    units = np.zeros((36, len(CHANGES)))
    for number, (joint, name) in enumerate(CHANGES):
        after, error = PARAMETERS[name]
        if joint + after < JOINTS:
            units[6 * (joint + after) + error, number] = 1.0
    along = found.by_error @ units
    size = np.linalg.norm(along, axis=0)
    unit = along / np.where(size > UNSEEN_MM, size, np.inf)
    weighted = found.precision @ unit
    statistic = found.change @ found.precision @ found.change
    limit = statistic * (chance_mm / found.moved_mm) ** 2
    linear, square = found.change @ weighted, np.sum(unit * weighted, axis=0)
    changed = statistic + 2.0 * np.outer(linear, SIZES_MM) + np.outer(square, SIZES_MM**2)
    return changed > limit, size


def run(same: int, other: int, out: Path, cores: int) -> None:
    """Simulate years of each kind; tables are written now and again."""
    years = [(plans, n) for plans, count in ((SAME, same), (OTHER, other)) for n in range(count)]
    decisions: list[dict] = []
    seen, per_unit = defaultdict(list), defaultdict(list)
    out.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(cores) as workers:
        for (plans, number), found in zip(years, workers.map(_year_of, years), strict=True):
            decisions += [{"year": number} | each for each in found[0]]
            seen[plans].append(found[1])
            per_unit[plans].append(found[2])
            done = sum(map(len, seen.values()))
            if done % 20 == 0 or done == len(years):
                table = _years(pd.DataFrame(decisions))
                _write(table, out / "years.csv")
                _write(_power(seen, per_unit), out / "power.csv")
                alarms = (table["false_alarms"] > 0).groupby(table["plans"]).agg(["sum", "count"])
                print(f"years with a false alarm, of years: {alarms.T.to_dict('list')}", flush=True)


def _year_of(which: tuple[str, int]) -> tuple[list[dict], np.ndarray, np.ndarray]:
    plans, number = which
    return year(Arm(number, plans))


def _years(decisions: pd.DataFrame) -> pd.DataFrame:
    """A row a year: how many of its decisions were false alarms, and how near the others came."""
    years = decisions.groupby(["plans", "year"], sort=False)
    return years.agg(
        decisions=("alarm", "size"),
        false_alarms=("alarm", "sum"),
        least_probability=("probability", "min"),
        median_moved_mm=("moved_mm", "median"),
        median_chance_mm=("chance_mm", "median"),
    ).reset_index()


def _power(seen: dict, per_unit: dict) -> pd.DataFrame:
    """How often a change of each size was seen, of those the readings can show."""
    rows = []
    for plans, hits in seen.items():
        shares, units = np.mean(hits, axis=0) / (MONTHS - 1), np.mean(per_unit[plans], axis=0)
        for (joint, name), share, unit in zip(CHANGES, shares, units, strict=True):
            if unit > UNSEEN_MM:
                rows += [
                    (plans, joint + 1, name, unit, size, each)
                    for size, each in zip(SIZES_MM, share, strict=True)
                ]
    names = ["plans", "joint", "parameter", "mm_per_unit", "moved_mm", "seen"]
    return pd.DataFrame(rows, columns=names)


def _write(table: pd.DataFrame, path: Path) -> None:
    table.to_csv(path, index=False, float_format="%.5g", lineterminator="\n")


def draw(out: Path) -> None:
    """``power.png`` from ``power.csv``: offsets of joints, one panel for each kind of plan."""
    rows = pd.read_csv(out / "power.csv").query("parameter == 'theta' and joint > 1")
    figure = Figure(figsize=(8.0, 3.9), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    titles = {SAME: ("the same poses every month", 1.0), OTHER: ("other poses every month", 4.0)}
    for panel, (plans, (title, most)) in zip(panels, titles.items(), strict=True):
        for joint, own in rows[rows["plans"] == plans].groupby("joint"):
            mrad = own["moved_mm"] / own["mm_per_unit"]
            label = f"joint {joint} ({own['mm_per_unit'].iloc[0]:.2f} mm per mrad)"
            panel.plot(mrad, 100.0 * own["seen"], label=label)
        panel.axhline(80.0, color="0.6", linewidth=0.8)
        panel.set(title=title, xlabel="change of one joint's offset, mrad")
        panel.set(xlim=(0.0, most), ylim=(0.0, 102.0))
    panels[0].set_ylabel("months that say recalibrate, %")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.savefig(out / "power.png", dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--same", type=int, default=0, help="years of the same poses")
    parser.add_argument("--other", type=int, default=0, help="years of other poses each month")
    parser.add_argument("--out", type=Path, required=True, help="folder of tables and picture")
    parser.add_argument("--cores", type=int, default=2, help="processes; of no influence")
    asked = parser.parse_args()
    if asked.same or asked.other:
        run(asked.same, asked.other, asked.out, asked.cores)
    draw(asked.out)


if __name__ == "__main__":
    main()
