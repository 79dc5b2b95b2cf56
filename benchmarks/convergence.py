"""How often the DH fit finds the same optimum from starting values far off, on every shipped arm.

    python benchmarks/convergence.py            # 100 starts per arm and kind of measurement
    python benchmarks/convergence.py 10 ur10    # fewer, of one arm

A simulated arm (joint offsets and twists off by 1 mrad, lengths by 0.5 mm) is measured in 80
poses over its joint limits with 0.05 mm and 0.1 mrad noise, base and tool anywhere. Every fit
starts from a description whose joint offsets are anywhere within 5 degrees of the arm's and d
and a within 20 mm, and knows nothing of base and tool.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "calibration"))

from simulated import POINT, POSE, THREE, disturbed, far_off, joints, measure

from kinacc.calibration import constraints, fitting
from kinacc.errors import FitError
from kinacc.kinematics import robot

POSES = 80
SAME = 1e-6  # relative difference of the costs of one optimum


def costs(name: str, kind: str, starts: int) -> np.ndarray:
    """Costs (starts,) the fits end at, NaN where one does not converge."""
    arm, rng = robot.load(name), np.random.default_rng(0)
    free = constraints.free_parameters(
        arm.dh.joints, constraints.parallel_joints(arm.dh), instead=True
    )
    data = measure(disturbed(arm.dh, free, rng), joints(arm, POSES, rng), kind, rng)
    found = np.full(starts, np.nan)
    for number in range(starts):
        start = far_off(arm.dh, np.random.default_rng(1000 + number))
        try:
            fit = fitting.fit(
                data,
                start,
                free=free,
                rotation_weight_mm_per_rad=500.0,
                threshold=1e-3,
            )
        except FitError:
            continue
        found[number] = fit.solution.cost
    return found


def reached(found: np.ndarray) -> int:
    """How many of the costs (n,) are that of the best one."""
    return int(np.sum(found <= np.nanmin(found) * (1.0 + SAME)))


def main() -> None:
    """Print a table of arms and kinds of measurement."""
    starts = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print("| robot | measured | starts | same optimum | s per fit |\n|---|---|---|---|---|")
    for name in sys.argv[2:] or robot.shipped():
        for kind in (POSE, THREE, POINT):
            begin = time.perf_counter()
            same = reached(costs(name, kind, starts))
            each = (time.perf_counter() - begin) / starts
            print(f"| {name} | {kind} | {starts} | {same} | {each:.3f} |", flush=True)


if __name__ == "__main__":
    main()
