"""Readings that come about otherwise than stated: each world is what its name says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kurtosis

from kinacc.assess.world import drawn_world, key_of
from research.conditions import CONDITIONS, Course

SIGMA = 0.2


def readings(condition, poses=40, visits=50):
    """Deviations (visits, poses, 3) in units of the noise stated, read pose after pose in turn."""
    world = drawn_world(np.ones((poses, 3)), SIGMA, key_of(1), visits)
    course = Course(CONDITIONS[condition], world, poses * visits)
    read = [[course.reading_mm(row, visit) for row in range(poses)] for visit in range(visits)]
    return (np.array(read) - 1.0) / course.stated_mm()[:, None]


@pytest.mark.parametrize(
    ("condition", "scale"), [("noise_1.2", 1.2), ("repeatability", 1.0), ("stated", 1.0)]
)
def test_the_noise_is_as_large_as_the_name_of_the_world_says(condition, scale):
    found = readings(condition)
    assert found.std() == pytest.approx(scale, rel=0.03)
    own = found.std(axis=(0, 2))
    assert own.max() / own.min() > (1.4 if condition == "repeatability" else 1.0)


@pytest.mark.parametrize("condition", ["student_t4", "student_t4_whole"])
def test_heavy_tails_leave_the_variance_as_stated(condition):
    found = readings(condition, visits=400)
    assert found.std() == pytest.approx(1.0, rel=0.04)
    assert kurtosis(found, axis=None) > 2.0
    together = np.corrcoef(*(found[..., axis].ravel() ** 2 for axis in (0, 1)))[0, 1]
    assert (together > 0.1) == (condition == "student_t4_whole")


@pytest.mark.parametrize("condition", ["drift_3", "step_3"])
def test_the_frame_moves_by_three_sigma_over_the_campaign(condition):
    found = readings(condition).mean(axis=1)  # of 40 readings each
    moved = np.linalg.norm(found[-5:].mean(axis=0) - found[:5].mean(axis=0))
    assert moved == pytest.approx(2.7 if condition == "drift_3" else 3.0, abs=0.35)
    half = np.linalg.norm(found[26:30].mean(axis=0) - found[20:24].mean(axis=0))
    assert (half > 2.0) == (condition == "step_3")
