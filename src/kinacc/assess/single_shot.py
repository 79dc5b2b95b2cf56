"""Exact single-shot bound: measure points once; the largest reading bounds the largest error."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from pydantic import PositiveInt
from pydantic.dataclasses import dataclass

from kinacc.assess.adaptive import STRICT, AdaptiveAssessor, Confidence, Ledger
from kinacc.assess.statement import CANDIDATES, CONFIDENCE, MEASURED, Reason, Statement


@dataclass(frozen=True, config=STRICT)
class SingleShot(AdaptiveAssessor):
    """Measure each point once, up to ``measurements`` points.

    Upper bound: the smallest size such that one reading at a point of that size exceeds what was
    read there with the wanted confidence, largest over the points. It holds with that confidence
    without correction for the number of points, for it is wrong only if the reading at the one
    point that is truly largest is too small. Lower bound: the same turned round, corrected for
    the number of points. Assumes normal readings of known covariance (eq. 9), nothing else. It
    speaks of the points measured; where these are all candidates, of all candidates.
    """

    measurements: PositiveInt
    confidence: Confidence = CONFIDENCE
    name: ClassVar[str] = "single_shot"

    def state(self, ledger: Ledger) -> tuple[Statement, ...]:
        """The bound, with the largest reading as the value."""
        if not ledger.visited:
            return (Statement(MEASURED, withheld=Reason("nothing_measured")),)
        error, points = 1.0 - self.confidence, ledger.candidates.points
        first = min(self.measurements, points)
        lower, upper = zip(*ledger.limits_mm(error / first, error).values(), strict=True)
        statement = Statement(
            MEASURED,
            value_mm=float(ledger.sizes_mm().max()),
            lower_mm=max(lower),
            upper_mm=max(upper),
            confidence=self.confidence,
        )
        everywhere = replace(statement, target=CANDIDATES)
        if left := points - len(ledger.visited):
            withheld = Reason("unmeasured", {"left": left, "points": points})
            everywhere = Statement(CANDIDATES, value_mm=statement.value_mm, withheld=withheld)
        return statement, everywhere
