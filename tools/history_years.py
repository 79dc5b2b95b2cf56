"""False alarms of a robot's history over simulated years, and how small a change it sees.

    python tools/history_years.py --same 600 --other 400 --out docs/history

A simulated year: one physical arm (the geometry and the sizes of effects of an accepted draw, all
effects drawn anew), calibrated twelve times with POSES poses of the synthetic calibration plan: the
same every month, or others every month. Each time the tracker is set up anew, its noise and the
arm's repeatability are drawn anew, and the run of RUN_H hours begins at a random time up to RUN_H
after the cold start: the arm warms up differently each time. Nothing else happens, so every
"recalibrate" is a false alarm; after one, the new calibration is in force. Fits are linear ones
about the draw's geometry; all else is the code that makes a history.

A change of a joint moves the estimate by as much and changes nothing else, as a change of the
second series is a free unknown beside all variances. So every month in which nothing happened
says as well which sizes of a change would have been seen in it.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from kinacc.calibration.frames import known
from kinacc.calibration.observations import Observations, full_poses
from kinacc.deployment import drift_chance, drift_pairs
from kinacc.deployment.drift import LEVEL, factor
from kinacc.deployment.drift_pairs import Pair, Setup
from kinacc.kinematics import robot as robots
from kinacc.synthetic import plan, tracker
from kinacc.synthetic.accepted import accepted_draw, rows
from kinacc.synthetic.draw import physical_robot
from kinacc.synthetic.physical import PhysicalRobot, Visits

POSES, MONTHS = 100, 12
NOISE_MM, WEIGHT_MM_PER_RAD = 0.02, 500.0
SETUP = Setup(same_base=False, same_tool=True)
SAME, OTHER = "same", "other"
POOL = 20_000


class Arm:
    """One physical arm and its measuring programme."""

    def __init__(self, number: int, plans: str, pool: np.ndarray) -> None:
        draw = accepted_draw(number % len(rows()))
        self.rng = np.random.default_rng([16, number, plans == SAME])
        self.true = physical_robot(100_000 + number, draw.scales, draw.geometry)
        self.plans, self.pool = plans, pool
        self.programme = self._programme()

    def _programme(self) -> np.ndarray:
        return self.pool[self.rng.choice(len(self.pool), POSES, replace=False)]

    def series(self, true: PhysicalRobot | None = None) -> Observations:
        """One calibration run, of this arm or of what became of it."""
        q_rad = self.programme if self.plans == SAME else self._programme()
        time_h = plan.time_h(POSES) + self.rng.uniform(0.0, plan.RUN_H)
        s, normal = plan.directions(q_rad), self.rng.standard_normal((3, POSES, 6))
        visits = Visits(q_rad, s, time_h, normal[0])
        run = tracker.Run(visits, normal[1, :, :3], normal[2, :, :3])
        return full_poses(q_rad, tracker.measured(true or self.true, run, NOISE_MM), s)

    def pair(self, first: Observations, second: Observations) -> Pair:
        """Both, about the arm's geometry."""
        both = drift_pairs.joined(first, second, SETUP)
        frames = known(sessions=len(both.session_names))
        return drift_pairs.about(self.true.dh, frames, both, len(first), WEIGHT_MM_PER_RAD)

    def understated(self, series: Observations) -> float:
        """What halves of a series say of the misfit; nothing where all poses are shared."""
        if self.plans == SAME:
            return 1.0
        alone = drift_pairs.about(self.true.dh, known(), series, len(series), WEIGHT_MM_PER_RAD)
        cuts = drift_pairs.halves(alone, np.repeat(series.q_rad, 6, axis=0), SETUP)
        return drift_chance.understated([*cuts], self.rng)


# Names of DH parameters by the error they are: (of this joint or the next, place among ERRORS).
PARAMETERS = {"theta": (0, 5), "d": (0, 2), "a": (1, 0), "alpha": (1, 3)}
SIZES_MM = np.arange(0.0, 1.001, 0.02)


def year(arm: Arm) -> tuple[list[dict], np.ndarray, np.ndarray]:
    """Decisions; how often sizes (24, SIZES) were seen; rms mm (24,) by one mm or mrad."""
    force = arm.series()
    wide = arm.understated(force)
    decisions, seen, size = [], np.zeros((24, len(SIZES_MM))), []
    for month in range(1, MONTHS):
        series = arm.series()
        own = arm.understated(series)
        found = drift_chance.moved(arm.pair(force, series), factor(wide, own), arm.rng)
        chance_mm = found.chance_mm(LEVEL)
        alarm = found.moved_mm > chance_mm
        decisions.append({
            "plans": arm.plans, "month": month + 1, "moved_mm": found.moved_mm,
            "chance_mm": chance_mm, "probability": found.probability,
            "factor": factor(wide, own), "alarm": int(alarm),
        })  # fmt: skip
        hits, sizes = _seen(found, chance_mm)
        seen += hits
        size.append(sizes)
        if alarm:
            force, wide = series, own
    return decisions, seen, np.mean(size, axis=0)


def _seen(found: drift_chance.Moved, chance_mm: float) -> tuple[np.ndarray, np.ndarray]:
    units = np.zeros((36, 24))
    for number, (joint, name) in enumerate((j, n) for j in range(6) for n in PARAMETERS):
        after, error = PARAMETERS[name]
        if joint + after < 6:
            units[6 * (joint + after) + error, number] = 1e-3 if error > 2 else 1.0
    along = found.along(units)
    size = np.linalg.norm(along, axis=0)
    unit = along / np.where(size > 1e-3, size, np.inf)
    square = found.moved_mm**2 + 2.0 * np.outer(found.change @ unit, SIZES_MM) + SIZES_MM**2
    return square > chance_mm**2, size


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--same", type=int, required=True, help="years of the same poses")
    parser.add_argument("--other", type=int, required=True, help="years of other poses each month")
    parser.add_argument("--out", type=Path, required=True, help="folder of the tables")
    asked = parser.parse_args()
    pool = plan.configurations(robots.load("mh180"), POOL)
    years = [(n / max(asked.same, 1), SAME, n) for n in range(asked.same)]
    years += [(n / max(asked.other, 1), OTHER, n) for n in range(asked.other)]
    done, seen, size = [], {}, {}
    begin = time.process_time()
    for _, plans, number in sorted(years):
        decisions, hits, per_unit = year(Arm(number, plans, pool))
        done += [{"year": number} | each for each in decisions]
        seen[plans] = seen.get(plans, 0) + hits
        size.setdefault(plans, []).append(per_unit)
        if len(done) % (20 * (MONTHS - 1)) == 0:
            _write(asked.out, done, seen, size)
            alarms = {
                p: len({d["year"] for d in done if d["alarm"] and d["plans"] == p}) for p in seen
            }
            of = {p: len(size[p]) for p in seen}
            print(
                f"{time.process_time() - begin:.0f} s of CPU: years with an alarm {alarms} of {of}",
                flush=True,
            )
    _write(asked.out, done, seen, size)


def _write(folder: Path, done: list[dict], seen: dict, size: dict) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(
        folder / "power.npz",
        **{f"seen_{p}": seen[p] for p in seen},
        **{f"size_{p}": np.mean(size[p], axis=0) for p in size},
        **{f"of_{p}": len(size[p]) * (MONTHS - 1) for p in size},
    )
    with open(folder / "decisions.csv", "w") as file:
        file.write(",".join(done[0]) + "\n")
        for each in done:
            file.write(
                ",".join(f"{v:.5g}" if isinstance(v, float) else str(v) for v in each.values())
                + "\n"
            )


if __name__ == "__main__":
    main()
