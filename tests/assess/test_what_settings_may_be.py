"""The limits of every assessor's settings: the last value that is taken, the first refused."""

from __future__ import annotations

import numpy as np
import paper_settings as paper
import pytest

from kinacc.assess.adaptive import Candidates
from kinacc.assess.error_effects import joint_errors
from kinacc.assess.registry import ADAPTIVE
from kinacc.assess.statement import CANDIDATES, MEASURED
from kinacc.errors import InputError
from kinacc.kinematics import robot

TAKEN, REFUSED = "taken", "refused"
WITH_CONFIDENCE = ("region_share", "single_shot", "invalidation_calibrated", "search_and_confirm")
WITH_VISITED = ("model_invalidation_full", "invalidation_calibrated")
LIMITS = [
    *((name, "measurements", 0, REFUSED) for name in ADAPTIVE),
    *((name, "measurements", 1, TAKEN) for name in ADAPTIVE),
    *((name, "measurements", 2.5, REFUSED) for name in ADAPTIVE),
    *((name, "confidence", 0.5, TAKEN) for name in WITH_CONFIDENCE),
    *((name, "confidence", 0.49, REFUSED) for name in WITH_CONFIDENCE),
    *((name, "confidence", 1.0, REFUSED) for name in WITH_CONFIDENCE),
    *((name, "visited", 0.0, REFUSED) for name in WITH_VISITED),
    *((name, "visited", 1.0, TAKEN) for name in WITH_VISITED),
    *((name, "visited", 1.1, REFUSED) for name in WITH_VISITED),
    *((name, "share", 0.0, REFUSED) for name in ("gamma_quantile", "region_share")),
    *((name, "share", 1.0, REFUSED) for name in ("gamma_quantile", "region_share")),
    *((name, "share", 0.999, TAKEN) for name in ("gamma_quantile", "region_share")),
    ("region_share", "deviations", 0.0, TAKEN),
    ("region_share", "deviations", -0.1, REFUSED),
    ("model_invalidation_full", "bound_mm", 0.0, REFUSED),
    ("model_invalidation_full", "bound_mm", 0.001, TAKEN),
]


@pytest.mark.parametrize(("name", "key", "value", "verdict"), LIMITS)
def test_the_limits_of_a_setting(name, key, value, verdict):
    settings = {"measurements": 40} | {key: value}
    if verdict == TAKEN:
        assert getattr(paper.assessor(name, **settings), key) == value
        return
    with pytest.raises(InputError) as caught:
        paper.assessor(name, **settings)
    (problem,) = caught.value.problems
    assert problem.where == key
    assert str(value) in problem.what
    assert problem.allowed
    assert name in str(caught.value)


def candidates_of_an_arm(count):
    q_rad = np.random.default_rng(11).uniform(-0.8, 0.8, (count, 6))
    known = {"q_rad": q_rad, "effects": joint_errors(robot.load("mh180"), q_rad)}
    return Candidates(np.tile(0.01 * np.eye(3), (count, 1, 1)), **known)


@pytest.mark.parametrize("name", ["search_and_confirm", "invalidation_calibrated"])
def test_before_the_first_visit_ends_it_is_said_how_many_points_are_left(name):
    campaign = paper.assessor(name, measurements=30).begin(candidates_of_an_arm(50))
    rng, left = np.random.default_rng(4), []
    while (row := campaign.next()) is not None:
        said = {each.target: each.withheld for each in campaign.statements()}
        if said[MEASURED] is None or said[MEASURED].code != "first_visit":
            break
        assert said.get(CANDIDATES, said[MEASURED]) == said[MEASURED]
        left.append(said[MEASURED].numbers["left"])
        campaign.record(row, rng.normal(size=3))
    assert left == list(range(len(left), 0, -1))
    assert len(left) > 2


@pytest.mark.parametrize(
    ("shape", "said"),
    [((3, 3), r"shape \(3, 3\)"), ((0, 3, 3), r"shape \(0, 3, 3\)"), ((4, 2, 2), r"\(4, 2, 2\)")],
)
def test_covariances_of_another_shape_are_refused_with_their_shape(shape, said):
    with pytest.raises(InputError, match=said):
        Candidates(np.ones(shape))


@pytest.mark.parametrize("name", ["q_rad", "effects"])
def test_what_is_known_of_candidates_has_a_row_for_each_and_numbers_only(name):
    covariance = np.tile(np.eye(3), (4, 1, 1))
    with pytest.raises(InputError, match="3 rows") as caught:
        Candidates(covariance, **{name: np.zeros((3, 6))})
    assert [each.where for each in caught.value.problems] == [name]
    with pytest.raises(InputError, match="not finite"):
        Candidates(covariance, **{name: np.full((4, 6), np.nan)})
    assert getattr(Candidates(covariance, **{name: np.ones((4, 6))}), name).shape == (4, 6)
