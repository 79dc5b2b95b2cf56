"""One optimum from starting values far off, on arms of all builds.

A simulated arm (joint offsets and twists off by 1 mrad, lengths by 0.5 mm) is measured in 80 poses
over its joint limits with 0.05 mm and 0.1 mrad noise, base and tool anywhere. A start has joint
offsets within 5 degrees and lengths within 20 mm of the arm's.
"""

import numpy as np
import pytest
from simulated import POINT, POSE, THREE, disturbed, far_off, joints, measure

from kinacc.calibration import constraints, fitting
from kinacc.kinematics import robot

STARTS = 4
ARMS = ["mh180", "ur10", "irb120", "fanuc_r2000ic_165f", "tx2_90l", "meca500", "iiwa14"]


@pytest.mark.parametrize("kind", [POSE, THREE, POINT])
@pytest.mark.parametrize("name", ARMS)
def test_starts_five_degrees_and_twenty_mm_off_reach_one_optimum(name, kind):
    arm, rng = robot.load(name), np.random.default_rng(0)
    parallel = constraints.parallel_joints(arm.dh)
    free = constraints.free_parameters(arm.dh.joints, parallel, instead=True)
    data = measure(disturbed(arm.dh, free, rng), joints(arm, 80, rng), kind, rng)
    starts = [far_off(arm.dh, np.random.default_rng(1000 + number)) for number in range(STARTS)]
    settings = {"free": free, "rotation_weight_mm_per_rad": 500.0, "threshold": 1e-3}
    costs = [fitting.fit(data, start, **settings).solution.cost for start in starts]
    np.testing.assert_allclose(costs, min(costs), rtol=1e-6)
