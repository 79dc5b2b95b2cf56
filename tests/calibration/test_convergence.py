"""One optimum from far off, on every shipped arm; benchmarks/convergence.py takes 100 starts."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from kinacc.kinematics import robot

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import convergence


@pytest.mark.parametrize("kind", ["pose", "three", "point"])
@pytest.mark.parametrize("name", robot.shipped())
def test_starts_five_degrees_and_twenty_mm_off_reach_one_optimum(name, kind):
    assert convergence.reached(convergence.costs(name, kind, 4)) == 4
