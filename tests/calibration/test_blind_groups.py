"""Directions in groups: the same whatever the basis they are given in."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.calibration.blind_groups import groups

# Motions of the base along and about z, then parameters of joints 1, 2 and 3.
OF_ARM = np.array([False, False, True, True, True, True, True])
WITH_BASE = np.array([[1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0]])
ARM_ALONE = np.array([[0.0, 0.0, 0.0, 0.0, 1.0, -1.0, 0.0]])
WEAK = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])


def rotated(rows: np.ndarray, seed: int) -> np.ndarray:
    mixed, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(len(rows), len(rows))))
    return mixed @ rows


@pytest.mark.parametrize("seed", range(5))
def test_groups_do_not_depend_on_how_the_space_is_mixed(seed):
    hidden = rotated(np.concatenate([WITH_BASE, ARM_ALONE]), seed)
    lost = rotated(np.concatenate([WITH_BASE, ARM_ALONE, WEAK]) / np.sqrt(2.0), seed + 100)
    found = groups(hidden, lost, OF_ARM)
    said = {
        (tuple(np.flatnonzero(np.abs(each.directions).max(axis=0) > 1e-9)), each.structural)
        for each in found
    }
    assert said == {((0, 2), True), ((1, 3), True), ((4, 5), True), ((6,), False)}
    for each in found:
        assert np.abs(each.directions).max() == pytest.approx(1.0)


def test_directions_of_frames_alone_are_found_in_a_mixture():
    alone = np.array([[1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    found = groups(rotated(np.concatenate([alone, ARM_ALONE]), 3), np.zeros((0, 7)), OF_ARM)
    assert [each.structural for each in found] == [True, True]
    np.testing.assert_allclose(np.abs(found[0].directions), np.abs(alone), atol=1e-12)
    np.testing.assert_allclose(np.abs(found[1].directions), np.abs(ARM_ALONE), atol=1e-12)


def test_nothing_undetermined_makes_no_group():
    assert groups(np.zeros((0, 7)), np.zeros((0, 7)), OF_ARM) == ()
