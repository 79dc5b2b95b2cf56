"""From the mean error of poses to the error that 95 % of future visits to the worst pose keep."""

from __future__ import annotations

import math
from dataclasses import replace

from scipy.optimize import brentq

from kinacc.assess.limits import reading_below
from kinacc.assess.statement import VISIT, Statement

SHARE = 0.95  # of future visits
_WIDEST = 4.0  # standard deviations beyond the mean error that more than 95 % of visits keep


def visit_mm(size_mm: float, arm_mm: float, share: float = SHARE) -> float:
    """Size that a ``share`` of visits to a pose of mean error ``size_mm`` does not exceed.

    arm_mm: standard deviation of a visit per axis, equal in all. Noncentral chi with three degrees
    of freedom. Grows with the size and with the noise (of both any point between the pose's mean
    and a visit inside the sphere stays inside), so limits on these bring limits on it. NaN for a
    size that is not known.
    """
    if math.isnan(size_mm) or arm_mm <= 0.0:
        return size_mm
    a = size_mm / arm_mm
    beyond = (a, a + _WIDEST)
    return arm_mm * brentq(lambda x: reading_below(x, a) - share, *beyond, xtol=1e-14, rtol=1e-14)


def of_future_visits(said: Statement, arms_mm: tuple[float, float, float]) -> Statement:
    """A statement on mean errors as one on future visits; ``arms_mm``: for lower, value, upper."""
    least, likely, most = arms_mm
    return replace(
        said,
        lower_mm=visit_mm(said.lower_mm, least),
        value_mm=visit_mm(said.value_mm, likely),
        upper_mm=visit_mm(said.upper_mm, most),
        error_of=VISIT,
    )
