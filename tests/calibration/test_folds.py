"""Folds: what belongs together is held out together, whatever the data looks like."""

from __future__ import annotations

import numpy as np
import pandas as pd
from hypothesis import given, settings
from hypothesis import strategies as st

from kinacc.measurements import folds

TOLERANCE = np.deg2rad(0.1)


@st.composite
def plans(draw):
    """Joints with revisits a hair apart, full turns apart, and which rows they belong to."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    distinct = draw(st.integers(1, 25))
    rows = draw(st.integers(distinct, 60))
    more = rng.integers(0, distinct, rows - distinct)
    place = rng.permutation(np.concatenate([np.arange(distinct), more]))
    q = rng.uniform(-np.pi, np.pi, (distinct, 6))[place]
    q = q + np.deg2rad(rng.uniform(-0.02, 0.02, (rows, 6)))
    return place, q + 2 * np.pi * rng.integers(-1, 2, (rows, 6))


@settings(max_examples=60, deadline=None)
@given(plans(), st.integers(2, 7), st.integers(0, 1000))
def test_rows_of_one_configuration_share_a_fold_or_a_block_of_time(plan, count, seed):
    place, q = plan
    found = folds.configurations(np.arange(len(q)), q, TOLERANCE)
    apart = np.abs(q[:, None] - q[None])
    apart = np.abs(apart - 2 * np.pi * np.rint(apart / (2 * np.pi))).max(axis=2)
    assert np.all((found[:, None] == found[None]) | (apart > TOLERANCE * (1 - 1e-9)))
    first = np.unique(found, return_index=True)[1]
    assert np.all(np.diff(first) > 0)  # numbered by first appearance
    fold, block = folds.assign(found, count, seed), folds.blocks(found, count)
    table = pd.DataFrame({"configuration": found, "fold": fold, "block": block})
    assert (table.groupby(place).nunique() == 1).all(axis=None)
    assert fold.min() >= 0
    assert fold.max() < count
    assert (np.diff(block[first]) >= 0).all()


def test_a_label_of_one_fold_alone_must_train():
    fold = np.array([0, 0, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 1, 1, 1])
    label = np.array(["a"] * 5 + ["b"] * 4 + ["c"] * 6)  # of c three are left without either fold
    same = np.array([0, 1, 2, 3, 4, 5, 6, 7, 4, 8, 9, 10, 11, 12, 13])  # the ninth is the fifth
    found = [*folds.always_trained(fold, {"session": np.zeros(15), "target": label}, same)]
    assert [names for *names, _ in found] == [["target", "a"], ["target", "b"]]
    np.testing.assert_array_equal(np.flatnonzero(found[0][2]), [0, 1, 2, 3, 4, 8])
    np.testing.assert_array_equal(np.flatnonzero(found[1][2]), [4, 5, 6, 7, 8])
