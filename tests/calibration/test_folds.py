"""Folds: what belongs together is held out together, whatever the data looks like."""

from __future__ import annotations

import numpy as np
import pytest
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


@settings(max_examples=60, deadline=None)
@given(plans(), st.integers(2, 7))
def test_sizes_differ_by_no_more_than_the_largest_configuration(plan, count):
    _, q, pose, _ = plan
    configuration = folds.configurations(pose, q, 0.1 * DEGREE)
    sizes = np.bincount(folds.assign(configuration, count, 1), minlength=count)
    assert sizes.sum() == len(q)
    assert sizes.max() - sizes.min() <= np.bincount(configuration).max()


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


def test_targets_of_a_pose_stay_together_even_if_its_joints_were_read_apart():
    q = np.array([[0.0] * 6, [0.5] * 6, [0.0] * 6, [0.9] * 6])
    assert folds.configurations(np.array([3, 3, 7, 8]), q, 1e-3).tolist() == [0, 0, 0, 1]


def test_seed_decides_and_nothing_else():
    configuration = np.arange(100)
    first = folds.assign(configuration, 5, 1)
    np.testing.assert_array_equal(first, folds.assign(configuration, 5, 1))
    assert np.any(first != folds.assign(configuration, 5, 2))
    np.testing.assert_array_equal(np.bincount(first), [20] * 5)


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


def test_time_blocks_are_even_and_contiguous_without_revisits():
    fold = folds.blocks(np.repeat(np.arange(40), 3), 5)
    np.testing.assert_array_equal(fold, np.repeat(np.arange(5), 24))


def test_a_label_of_one_fold_alone_must_train():
    fold = np.array([0, 0, 1, 1, 1, 1, 1, 1, 1])
    label = np.array(["a", "a", "a", "a", "a", "b", "b", "b", "b"])
    same = np.array([0, 1, 2, 3, 4, 5, 6, 7, 4])  # the last is the fifth visited again
    labels = {"session": np.zeros(9), "target": label}
    found = folds.always_trained(fold, labels, same)
    assert [(each.kind, each.value) for each in found] == [("target", "a"), ("target", "b")]
    np.testing.assert_array_equal(found[0].rows, [1, 1, 1, 1, 1, 0, 0, 0, 1])
    np.testing.assert_array_equal(found[1].rows, [0, 0, 0, 0, 1, 1, 1, 1, 1])


def test_a_label_with_enough_rows_outside_each_fold_is_held_out():
    fold, label = np.array([0, 0, 0, 1, 1, 1, 1, 0]), np.array([*"aaaaaa", "b", "b"])
    found = folds.always_trained(fold, {"target": label}, np.arange(8))
    assert [each.value for each in found] == ["b"]


def test_neighbours_are_found_across_a_full_turn():
    rng = np.random.default_rng(5)
    near = 2.0 * np.pi * rng.integers(0, 3, (60, 3)) / 3.0 + rng.normal(0.0, 0.02, (60, 3))
    apart = np.abs(np.mod(near[:, None] - near[None] + np.pi, 2.0 * np.pi) - np.pi)
    wanted = np.argwhere(np.triu(np.all(apart <= 0.03, axis=2), 1))
    found = np.sort(folds.neighbours(near, 0.03), axis=1)
    assert len(wanted) > 10
    np.testing.assert_array_equal(np.unique(found, axis=0), wanted)


def test_rows_chosen_are_told_apart_as_if_there_were_no_others():
    rng = np.random.default_rng(6)
    q = rng.integers(0, 4, (80, 2)) * 0.1 + rng.normal(0.0, 0.01, (80, 2))
    pose = rng.integers(0, 60, 80)
    pairs = folds.neighbours(q, 0.02)
    for rows in (np.arange(80), np.arange(0, 80, 2), np.flatnonzero(rng.random(80) < 0.3)):
        wanted = folds.configurations(pose[rows], q[rows], 0.02)
        np.testing.assert_array_equal(folds.configurations_among(rows, pose, pairs), wanted)


@pytest.mark.parametrize("seed", range(5))
def test_poses_joined_by_a_long_chain_of_revisits_are_one_configuration(seed):
    order = np.random.default_rng(seed).permutation(3000)
    chain = np.stack([order[:-1], order[1:]], axis=1)
    apart = np.delete(chain, 1500, axis=0)
    pose = np.arange(3000)
    assert not folds.configurations_among(pose, pose, chain).any()
    found = folds.configurations_among(pose, pose, apart)
    assert np.array_equal(found == found[order[0]], np.isin(pose, order[:1501]))
    assert found.max() == 1
