"""The picture of a planned campaign: every kind of errors has its band, every line its name."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from kinacc.figures.campaign_plan import Curve, draw

INF = np.inf


@pytest.fixture
def curves():
    budget = np.array([50.0, 100.0, 200.0])
    narrow = np.array([[INF, INF, INF], [0.4, 0.5, 0.6], [0.2, 0.2, 0.2]])
    unstated = np.array([[INF, INF, INF], [0.3, 0.4, INF], [0.1, INF, INF]])
    power = np.array([0.0, 0.5, 1.0])
    return [Curve("workshop", budget, narrow, power), Curve("defect", budget, unstated, power)]


def test_bands_reach_the_top_where_some_campaigns_state_no_bound(curves):
    left, _ = draw(curves, 0.3, 0.8, 200).axes
    top = left.get_ylim()[1]
    bands = [each for each in left.collections if isinstance(each, PolyCollection)]
    assert len(bands) == 2
    first, second = (np.vstack([path.vertices for path in each.get_paths()]) for each in bands)
    assert first[:, 1].max() == pytest.approx(0.6)
    assert second[:, 1].max() == pytest.approx(top)
    assert second[:, 0].min() == 100.0  # no bound at all with 50


def test_the_lines_of_the_aim_are_named(curves):
    left, right = draw(curves, 0.3, 0.8, 200).axes
    assert "wanted" in [each.get_text() for each in left.texts]
    assert "80%\nwanted" in [each.get_text() for each in right.texts]
    left, right = draw(curves, None, None, None).axes
    assert not [*left.texts, *right.texts]
