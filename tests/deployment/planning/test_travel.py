"""The order of driving: every pose once, never longer than nearest neighbour, near the shortest."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinacc.deployment.planning import travel


def to_the_nearest(distance):
    """The path from point 0 that always goes on to the nearest point not yet visited."""
    path, left = [0], set(range(1, len(distance)))
    while left:
        path.append(min(left, key=lambda point: distance[path[-1], point]))
        left.remove(path[-1])
    return np.array(path)


@given(st.integers(0, 10_000), st.integers(2, 30), st.sampled_from(sorted(travel.METRICS)))
def test_every_pose_once_and_no_longer_than_nearest_neighbour(seed, count, metric):
    joints = np.random.default_rng(seed).uniform(-2, 2, (count, 6))
    distance = travel.distances(joints, metric)
    path = travel.order(distance)
    assert sorted(path.tolist()) == list(range(count))
    assert path[0] == 0
    plain = travel.length(distance, to_the_nearest(distance))
    assert travel.length(distance, path) <= plain + 1e-9
    # No stretch is better driven backwards.
    for first in range(1, count):
        for last in range(first + 1, count):
            turned = path.copy()
            turned[first : last + 1] = turned[first : last + 1][::-1]
            assert travel.length(distance, turned) >= travel.length(distance, path) - 1e-8


def test_near_the_shortest_path_of_all():
    shares = []
    for seed in range(15):
        joints = np.random.default_rng(seed).uniform(-2, 2, (7, 6))
        distance = travel.distances(joints)
        best = min(
            travel.length(distance, np.array([0, *rest])) for rest in permutations(range(1, 7))
        )
        shares.append(travel.length(distance, travel.order(distance)) / best)
    assert min(shares) >= 1.0 - 1e-12
    assert np.mean(shares) < 1.05


def test_metrics_are_what_they_say():
    joints = np.array([[0.0, 0.0], [3.0, -4.0]])
    assert travel.distances(joints, "largest")[0, 1] == 4.0
    assert travel.distances(joints, "sum")[0, 1] == 7.0
    speed = np.array([1.0, 2.0])
    assert travel.distances(joints, "largest", speed)[0, 1] == pytest.approx(3.0)
