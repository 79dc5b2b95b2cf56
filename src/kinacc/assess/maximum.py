"""Maximum Measurement (eqs. 11-12): the largest measured error is the accuracy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinacc.assess.world import Assessment, Assessor, World


@dataclass(frozen=True)
class Maximum(Assessor):
    """Measure each point once, up to ``measurements`` points, and take the largest magnitude."""

    measurements: int
    name: ClassVar[str] = "maximum"

    def assess(self, world: World) -> Assessment:
        """Eq. 11 over the first readings."""
        magnitudes = world.magnitudes_mm(self.measurements)
        return Assessment(float(magnitudes.max()), magnitudes.size, magnitudes.size)
