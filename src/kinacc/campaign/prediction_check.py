"""Candidates at which the calibration is too unsure for a reading to be judged against it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from kinacc.campaign.begin import needs_instrument_frame
from kinacc.campaign.instrument import Instrument
from kinacc.campaign.plan import Points
from kinacc.deployment.predict import predict
from kinacc.deployment.record import Calibration

_FAR = 3.0  # times what the calibration left unexplained: no longer explained by it
_SIGMAS = 3.0  # a correct reading this far off is nothing unusual


@dataclass(frozen=True)
class Unsure:
    """How many of ``candidates`` are predicted badly, and how badly, mm.

    ``uncertain``: of a predicted standard deviation above three times ``residual_mm``, what the
    calibration left unexplained; ``largest_std_mm`` is the largest. ``refusable``: three standard
    deviations are beyond ``refused_beyond_mm``, so that a correct reading may be refused.
    ``undetermined``: those that directions the poses did not determine move by more than
    ``residual_mm`` per mm or mrad; ``largest_undetermined_mm`` is the most.
    """

    candidates: int
    residual_mm: float
    refused_beyond_mm: float
    uncertain: int
    largest_std_mm: float
    refusable: int
    undetermined: int
    largest_undetermined_mm: float

    def __bool__(self) -> bool:
        return bool(self.uncertain or self.refusable or self.undetermined)

    def as_facts(self) -> dict[str, float | int]:
        """The numbers by name."""
        return asdict(self)

    def in_words(self) -> list[str]:
        """What is unsure and what to do about it; nothing where nothing is."""
        if not self:
            return []
        lines, all_of = [], f"of {self.candidates} candidates"
        if self.uncertain or self.refusable:
            line = (
                f"warning: the calibration predicts {self.uncertain} {all_of} with a standard "
                f"deviation above {_FAR:g} times the {self.residual_mm:.3g} mm it left unexplained "
                f"(up to {self.largest_std_mm:.3g} mm)"
            )
            if self.refusable:
                line += (
                    f"; correct readings may be refused at {self.refusable} of them, where "
                    f"{_SIGMAS:g} standard deviations exceed {self.refused_beyond_mm:g} mm"
                )
            lines.append(line)
        if self.undetermined:
            lines.append(
                f"warning: what the calibration's poses did not determine moves "
                f"{self.undetermined} {all_of} by more than the {self.residual_mm:.3g} mm left "
                f"unexplained, up to {self.largest_undetermined_mm:.3g} mm per mm or mrad"
            )
        lines.append(
            "  take candidates nearer to the poses of the fit (--joints-deg, --inside-mm, "
            "--candidates), calibrate with further poses, or settle it by a prior, e.g. on the "
            "tool's length (docs/fitting.md); begin the campaign anew then"
        )
        return lines


def unsure(
    arm: Calibration,
    points: Points,
    instruments: Sequence[Instrument],
    point: str | None,
    refused_beyond_mm: float,
) -> Unsure | None:
    """How unsure the calibration is of the candidates, in the frame of the readings.

    None where it knows no covariance or nothing of what it left unexplained.
    """
    if arm.known is None or arm.residual is None or not np.isfinite(arm.residual.position_mm):
        return None
    frame = "instrument" if needs_instrument_frame(instruments) else "base"
    found = predict(arm, points.joints, points.directions, frame, point)
    std, blind = found.std_position_mm, found.blind_mm
    left = float(arm.residual.position_mm)
    return Unsure(
        len(points),
        left,
        refused_beyond_mm,
        int(np.sum(std > _FAR * left)),
        float(np.max(std)),
        int(np.sum(_SIGMAS * std > refused_beyond_mm)),
        int(np.sum(blind > left)),
        float(np.max(blind)),
    )
