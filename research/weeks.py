"""How often check-results calls a week worse.

    .venv/bin/python research/weeks.py [SAME] [OTHER] [POSES] [FIRST SEED]

Pairs of weeks of one arm (an accepted draw of the synthetic arm, POSES full poses, tracker noise
of 0.02 mm, set up anew, warmed up differently), each calibrated with a DH model, held out in five
shares. SAME pairs have no change; in OTHER pairs joint 4 is off by 2 mrad in the second week.
Worse is what `--against` fails for: held-out errors, or the accepted calibration holds no more.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace

import numpy as np

from kinacc.calibration import fitting
from kinacc.calibration.dh_estimator import free_parameters, parallel_joints
from kinacc.calibration.frames import frame_terms, known
from kinacc.calibration.observations import Observations, full_poses
from kinacc.deployment.history import SAME, Session, history
from kinacc.deployment.record import Calibration
from kinacc.gate import accepted, chance
from kinacc.geometry import Pose, compose, exp_so3, invert
from kinacc.kinematics import robot as robots
from kinacc.measurements.folds import assign
from kinacc.synthetic import plan
from kinacc.synthetic.accepted import accepted_draw
from kinacc.synthetic.draw import physical_robot
from kinacc.synthetic.physical import Visits

WEIGHT, FOLDS = 500.0, 5
ARM = robots.load("mh180")


def measured(seed: int, week: int, q_rad: np.ndarray, offset_rad: np.ndarray) -> Observations:
    """A week's readings: the tracker anywhere, the arm as warm as it is."""
    poses = len(q_rad)
    draw, rng = accepted_draw(seed % 21), np.random.default_rng([seed, week])
    visits = Visits(
        q_rad + offset_rad,
        plan.directions(q_rad),
        plan.time_h(poses) + rng.uniform(0.0, 6.0),
        rng.standard_normal((poses, 6)),
    )
    run = plan.Run(visits, *rng.standard_normal((2, poses, 3)))
    arm = physical_robot(100_000 + seed, draw.scales, draw.geometry)
    seen = full_poses(q_rad, plan.measured(arm, run, 0.02), plan.directions(q_rad))
    anywhere = Pose(exp_so3(rng.normal(size=3)), 2000.0 * rng.normal(size=3))
    placed = compose(invert(anywhere), seen.measured)
    seen = replace(seen, position_mm=placed.position_mm, rotation=placed.rotation)
    return replace(seen, fold=assign(seen.pose, FOLDS, 0))


def session(seen: Observations, name: str) -> Session:
    """The DH calibration of a week and its held-out errors."""
    free = free_parameters(ARM.dh.joints, parallel_joints(ARM.dh))

    def fit(part: Observations):
        terms = frame_terms(part, known(ARM.base, robots.carried(ARM)))
        terms = replace(terms, free=np.array(["base" in each for each in terms.names]))
        return fitting.fit(part, ARM.dh, free=free, rotation_weight_mm_per_rad=WEIGHT,
                          threshold=1e-4, frames=terms)  # fmt: skip

    held_out_mm = np.zeros(len(seen))
    for fold in range(FOLDS):
        found = fit(seen.select(seen.fold != fold))
        out = seen.fold == fold
        at = compose(found.frames.base, compose(found.model.pose(seen.at), found.frames.tool))
        held_out_mm[out] = np.linalg.norm(seen.position_mm - at.position_mm, axis=1)[out]
    whole = fit(seen)
    own = Calibration(name, ARM, "dh", whole.model, whole.frames.base, {"tool": whole.frames.tool})
    base = SAME if name == "1" else "moved"
    return Session(name, name, base, SAME, own, whole.model, seen, held_out_mm)


def verdict(seed: int, changed: bool, poses: int) -> str:
    """What a pair of weeks is called."""
    rng = np.random.default_rng([seed, 99])
    pool = plan.configurations(ARM, 4 * poses)
    first, second = (pool[rng.choice(len(pool), poses, replace=False)] for _ in range(2))
    knock = 2e-3 * (np.arange(6) == 3) * changed
    weeks = session(measured(seed, 1, first, np.zeros(6)), "1")
    later = session(measured(seed, 2, second, knock), "2")
    samples = [chance.Sample(each.held_out_mm, np.arange(poses)) for each in (later, weeks)]
    worse = chance.change("mean", *samples, False, accepted.CONFIDENCE)
    if not worse.open and worse.least > 0.0:
        return "worse: held-out errors"
    row = history([weeks, later], WEIGHT, level=accepted.ARM_LEVEL)
    return {"holds": "same", "recalibrate": "worse: arm"}.get(row["verdict"][1], "undecided")


def main(same: int, other: int, poses: int, first: int) -> None:
    """Print how many pairs are called what."""
    for name, count, changed in (("no change", same, False), ("joint 4", other, True)):
        found = Counter(verdict(seed, changed, poses) for seed in range(first, first + count))
        print(f"{name}, {poses} poses: {dict(found)}", flush=True)


if __name__ == "__main__":
    given = [int(each) for each in sys.argv[1:]]
    main(*given, *(1000, 100, 60, 0)[len(given) :])
