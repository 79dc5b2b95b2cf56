"""Folds: what belongs together is held out together, whatever the data looks like."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from kinacc.measurements import folds

DEGREE = np.pi / 180.0


@st.composite
def plans(draw):
    """Joints with revisits a hair apart, full turns apart, and several rows per pose."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    distinct = draw(st.integers(1, 25))
    q = rng.uniform(-np.pi, np.pi, (distinct, 6))
    rows = draw(st.integers(distinct, 60))
    which = np.concatenate([np.arange(distinct), rng.integers(0, distinct, rows - distinct)])
    pose = np.arange(rows)
    jitter = rng.uniform(-0.02, 0.02, (rows, 6)) * DEGREE
    turns = 2 * np.pi * rng.integers(-1, 2, (rows, 6))
    order = rng.permutation(rows)
    return which[order], (q[which] + jitter + turns)[order], pose[order], rng


@settings(max_examples=60, deadline=None)
@given(plans(), st.integers(2, 7), st.integers(0, 1000))
def test_rows_of_one_configuration_share_a_fold(plan, count, seed):
    which, q, pose, _ = plan
    configuration = folds.configurations(pose, q, 0.1 * DEGREE)
    fold = folds.assign(configuration, count, seed)
    for each in np.unique(which):
        assert len(set(configuration[which == each])) == 1
        assert len(set(fold[which == each])) == 1
    assert fold.min() >= 0
    assert fold.max() < count


@settings(max_examples=40, deadline=None)
@given(plans())
def test_configurations_are_a_partition_no_pair_within_tolerance_breaks(plan):
    _, q, pose, _ = plan
    tolerance = 0.1 * DEGREE
    found = folds.configurations(pose, q, tolerance)
    apart = np.abs(q[:, None] - q[None])
    apart = np.abs(apart - 2 * np.pi * np.rint(apart / (2 * np.pi))).max(axis=2)
    close = apart <= tolerance * (1 - 1e-9)
    assert np.all((found[:, None] == found[None]) | ~close)
    # Numbered by first appearance.
    _, first = np.unique(found, return_index=True)
    assert np.all(np.diff(first) > 0)


def test_fewer_configurations_than_folds_leave_folds_empty():
    fold = folds.assign(np.array([0, 0, 1]), 5, 0)
    assert len(set(fold.tolist())) == 2
    assert fold[0] == fold[1]


@settings(max_examples=60, deadline=None)
@given(plans(), st.integers(2, 7))
def test_time_blocks_are_runs_of_first_visits(plan, count):
    _, q, pose, _ = plan
    configuration = folds.configurations(pose, q, 0.1 * DEGREE)
    fold = folds.blocks(configuration, count)
    first = [np.flatnonzero(configuration == label)[0] for label in np.unique(configuration)]
    assert (np.diff(fold[np.sort(first)]) >= 0).all()
    for label in np.unique(configuration):
        assert len(set(fold[configuration == label])) == 1


def test_a_label_of_one_fold_alone_must_train():
    fold = np.array([0, 0, 1, 1, 1, 1, 1, 1, 1])
    label = np.array(["a", "a", "a", "a", "a", "b", "b", "b", "b"])
    same = np.array([0, 1, 2, 3, 4, 5, 6, 7, 4])  # the last is the fifth visited again
    labels = {"session": np.zeros(9), "target": label}
    found = folds.always_trained(fold, labels, same)
    assert [(each.kind, each.value) for each in found] == [("target", "a"), ("target", "b")]
    np.testing.assert_array_equal(found[0].rows, [1, 1, 1, 1, 1, 0, 0, 0, 1])
    np.testing.assert_array_equal(found[1].rows, [0, 0, 0, 0, 1, 1, 1, 1, 1])


def test_neighbours_are_found_across_a_full_turn():
    rng = np.random.default_rng(5)
    near = 2.0 * np.pi * rng.integers(0, 3, (60, 3)) / 3.0 + rng.normal(0.0, 0.02, (60, 3))
    apart = np.abs(np.mod(near[:, None] - near[None] + np.pi, 2.0 * np.pi) - np.pi)
    wanted = np.argwhere(np.triu(np.all(apart <= 0.03, axis=2), 1))
    found = np.sort(folds.neighbours(near, 0.03), axis=1)
    assert len(wanted) > 10
    np.testing.assert_array_equal(np.unique(found, axis=0), wanted)
