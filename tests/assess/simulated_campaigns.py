"""Campaigns of search_and_confirm on errors that are known."""

from __future__ import annotations

import numpy as np

from kinacc.assess.adaptive import Candidates
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.world import carry_on


def away(rng, sizes):
    """Errors (m, 3) of these sizes in directions drawn at random."""
    way = rng.normal(size=(len(sizes), 3))
    return way * (sizes / np.linalg.norm(way, axis=1))[:, None]


def equal(points, noise_mm=0.1):
    """So many candidates with one noise."""
    return Candidates.with_equal_noise(np.full(points, noise_mm))


def conducted(rng, errors_mm, measurements, shift=None, noise_mm=1.0, stated=1.0, **settings):
    """A campaign to its end; ``shift(number, error)`` is added to the reading of that number.

    ``stated``: the noise stated over the true one.
    """
    candidates = equal(len(errors_mm), stated * noise_mm)
    campaign = SearchAndConfirm(measurements, **settings).begin(candidates)

    def reading_mm(row, _):
        off = shift(campaign.ledger.taken + 1, errors_mm[row]) if shift else 0.0
        return errors_mm[row] + noise_mm * rng.normal(size=3) + off

    carry_on(campaign, reading_mm)
    return campaign
