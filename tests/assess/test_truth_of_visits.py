"""What a bound on single visits is held to."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import ncx2

from kinacc.assess.simulate import truth_mm
from kinacc.assess.statement import CANDIDATES, Statement


def test_a_bound_on_visits_is_held_to_what_95_percent_of_visits_keep():
    said = Statement(CANDIDATES, error_of="visit", excepted=1)
    size = np.array([0.3, 0.9, 0.8])
    wanted = 0.2 * np.sqrt(ncx2.ppf(0.95, 3, (0.8 / 0.2) ** 2))
    assert truth_mm(said, size, None, 0.2) == pytest.approx(wanted, rel=1e-9)
    rng = np.random.default_rng(1)
    visits = np.linalg.norm([0.8, 0.0, 0.0] + 0.2 * rng.normal(size=(40000, 3)), axis=1)
    assert np.mean(visits <= wanted) == pytest.approx(0.95, abs=0.004)
    assert truth_mm(said, size, None) == 0.8
