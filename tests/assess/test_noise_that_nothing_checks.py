"""Bounds of campaigns whose readings are too few to check the noise that was stated."""

import numpy as np
import pytest

from kinacc.assess.adaptive import Candidates
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.statement import MEASURED

SIGMA_MM, POINTS = 0.1, 100
MOST = 5  # readings of a pose


def said_at_the_end(settings: SearchAndConfirm, readings_mm: np.ndarray, covariance_mm2):
    """What is said on the measured points; a row's readings are (row, 0), (row, 1), ..."""
    campaign = settings.begin(Candidates(covariance_mm2))
    reads = np.zeros(len(readings_mm), dtype=int)
    while (row := campaign.next()) is not None:
        campaign.record(row, readings_mm[row, reads[row]])
        reads[row] += 1
    (said,) = (each for each in campaign.statements() if each.target == MEASURED)
    return said


@pytest.mark.parametrize("stretch", [np.eye(3), np.diag([4.0, 1.0, 0.25])])
def test_noise_that_few_readings_cannot_check_is_taken_larger_in_both_bounds(stretch):
    chance = np.random.default_rng(21)
    errors_mm = chance.normal(size=(POINTS, 1, 3))
    readings = errors_mm + 0.5 * SIGMA_MM * chance.normal(size=(POINTS, MOST, 3))
    stated = np.tile(SIGMA_MM**2 * stretch, (POINTS, 1, 1))
    margin = said_at_the_end(SearchAndConfirm(POINTS, noise_margin=1.2), readings, stated)
    more = said_at_the_end(SearchAndConfirm(POINTS, noise_margin=1.0), readings, 1.44 * stated)
    assert margin.lower_mm == pytest.approx(more.lower_mm, rel=1e-9)
    assert margin.upper_mm == pytest.approx(more.upper_mm, rel=1e-9)
