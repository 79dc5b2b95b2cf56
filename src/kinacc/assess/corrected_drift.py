"""Limits of a campaign whose readings are corrected for the linear drift its references show."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kinacc.assess.adaptive import Ledger
from kinacc.assess.reference_poses import Correction, correction, planned_readings
from kinacc.assess.sequential_limits import Looks


@dataclass(frozen=True)
class Corrected:
    """Readings without the drift, the looks at them, and the drift itself."""

    ledger: Ledger
    looks: Looks
    drift: Correction


def corrected(campaign, error: float, factor: float, freedom: float) -> Corrected | None:
    """A campaign told again without its drift; None before all planned readings are there.

    ``error``: that the drift may be farther off in any direction than lower limits allow for;
    ``factor`` and ``freedom`` of the noise, over what is planned.
    """
    drift = correction(campaign.plan, planned_readings(campaign.plan, campaign.ledger))
    if drift is None:
        return None
    own, old = campaign.ledger, campaign.looks
    ledger = Ledger(own.candidates)
    kept = (1.0 - campaign.drift_part) * old.lower_error
    looks = Looks(ledger, old.boundary, kept, old.shares, old.factor)
    looks.astray_mm = factor * drift.anywhere_mm(error, freedom)
    sums, latest = np.zeros(own.candidates.points), np.zeros(own.candidates.points)
    times = campaign.plan.time(np.arange(own.taken))
    without_mm = np.array([each[1] for each in own.readings]) - times[:, None] * drift.slope_mm
    for (row, _, covariance), time, reading_mm in zip(
        own.readings, times.tolist(), without_mm, strict=True
    ):
        ledger.record(row, reading_mm, covariance)
        sums[row] += time
        latest[row] = time
        mean = sums[row] / ledger.count[row]
        looks.update(
            row, mean if ledger.as_planned(row) else latest[row] * _skew(ledger.noise(row))
        )
    return Corrected(ledger, looks, drift)


def _skew(noise: float | np.ndarray) -> float:
    """How much farther than its latest reading a mean may be shifted where weights are matrices.

    Such a mean weighs the times of its readings by direction; the norm of that is at most the
    latest time, but for how far the weights are from equal in all directions.
    """
    if isinstance(noise, float):
        return 1.0
    variance = np.linalg.eigvalsh(noise)
    return math.sqrt(float(variance[-1] / variance[0]))
