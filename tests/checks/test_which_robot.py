"""Every shipped arm, measured with errors of its own, is the one that fits best."""

from dataclasses import replace

import numpy as np
import pytest
from good_files import simulated

from kinacc.checks.meanings import read_as
from kinacc.checks.readings import of_file
from kinacc.kinematics import robot
from kinacc.measurements.reader import read

ARMS = {name: robot.load(name) for name in robot.shipped()}
# Equal but for limits, or for the length of the flange, which the target takes up.
ALIKE = [{"kr120_r2700_2", "kr210_r2700_2"}, {"gp225", "mh180"}]


def reach(name):
    return np.abs([ARMS[name].dh.a_mm, ARMS[name].dh.d_mm]).sum()


@pytest.mark.parametrize("name", ARMS)
def test_the_arm_that_was_measured_fits_best_of_those_nearest_in_size(name, tmp_path):
    simulated(name, poses=24, noise_mm=0.0).write(tmp_path)
    section = {"path": str(tmp_path / "file.csv"), "orientation": {"kind": "none"}}
    measured = of_file(read(section, ARMS[name]), ARMS[name])
    rivals = [other for other in ARMS if ARMS[other].dh.joints == ARMS[name].dh.joints]
    rivals.sort(key=lambda other: abs(np.log(reach(other) / reach(name))))
    misfits = {}
    for other in rivals[:12]:
        seen = replace(measured, q_rad=ARMS[other].dh_joints(measured.q))
        misfits[other] = read_as(seen, ARMS[other], [()])[0].misfit
    best = min(misfits, key=misfits.get)
    assert best == name or {best, name} in ALIKE
