"""Candidates where the calibration was not measured, or too unsure for a reading to be judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from kinacc.campaign.begin import needs_instrument_frame
from kinacc.campaign.instrument import Instrument
from kinacc.campaign.plan import Points
from kinacc.deployment.applicability import LIKE_FITTED, is_measured_there
from kinacc.deployment.predict import predict
from kinacc.deployment.record import Calibration
from kinacc.errors import Problem
from kinacc.kinematics.model import JointState

_SIGMAS = 3.0  # a correct reading this far off is nothing unusual
_MANY = 0.1  # of the candidates


@dataclass(frozen=True)
class Unsure:
    """How many of ``candidates`` the calibration knows too little of, and how little, mm.

    ``not_measured``: where the calibration was not measured (see ``deployment.applicability``);
    ``largest_std_mm`` is the largest predicted standard deviation. ``refusable``: three of them are
    beyond ``refused_beyond_mm``, so that a correct reading may be refused. ``undetermined``: others
    that directions the poses did not determine move by more than ``residual_mm``, what the
    calibration left unexplained, per mm or mrad; ``largest_undetermined_mm`` is the most.
    """

    candidates: int
    residual_mm: float
    refused_beyond_mm: float
    not_measured: int
    largest_std_mm: float
    refusable: int
    undetermined: int
    largest_undetermined_mm: float

    def __bool__(self) -> bool:
        return bool(self.not_measured or self.refusable or self.undetermined)

    def as_facts(self) -> dict[str, float | int]:
        """The numbers by name."""
        return asdict(self)

    def asked(self) -> list[Problem]:
        """Whether so many candidates are meant where the calibration was not measured."""
        if self.not_measured <= _MANY * self.candidates:
            return []
        return [
            Problem(
                "candidates",
                self._not_measured(),
                f"at most {_MANY:.0%} of them",
                "--region measured draws them between measured poses; or give --candidates near "
                "these, or calibrate with poses there; --sure takes them as they are",
            )
        ]

    def in_words(self) -> list[str]:
        """What is unsure and what to do about it; nothing where nothing is."""
        lines = []
        if self.not_measured:
            lines.append(f"warning: {self._not_measured()}")
        if self.refusable:
            lines.append(
                f"warning: correct readings may be refused at {self.refusable} of "
                f"{self.candidates} candidates, where {_SIGMAS:g} standard deviations of the "
                f"prediction exceed {self.refused_beyond_mm:g} mm"
            )
        if self.undetermined:
            lines.append(
                f"warning: what the calibration's poses did not determine moves "
                f"{self.undetermined} of {self.candidates} candidates by more than the "
                f"{self.residual_mm:.3g} mm left unexplained, up to "
                f"{self.largest_undetermined_mm:.3g} mm per mm or mrad: calibrate with further "
                "poses, or settle it by a prior, e.g. on the tool's length (docs/fitting.md)"
            )
        return lines

    def _not_measured(self) -> str:
        return (
            f"{self.not_measured} of {self.candidates} candidates lie where the calibration was "
            "not measured, and its errors may be larger: they are outside its joint ranges, or "
            f"known less well than {LIKE_FITTED:.0%} of the poses of the fit (standard deviations "
            f"up to {self.largest_std_mm:.3g} mm)"
        )


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
    at = JointState(arm.robot.dh_joints(points.joints), points.directions)
    measured = is_measured_there(arm, at, point)
    frame = "instrument" if needs_instrument_frame(instruments) else "base"
    found = predict(arm, points.joints, points.directions, frame, point)
    std, blind = found.std_position_mm, found.blind_mm
    left = float(arm.residual.position_mm)
    return Unsure(
        len(points),
        left,
        refused_beyond_mm,
        int(np.sum(~measured)),
        float(np.max(std)),
        int(np.sum(_SIGMAS * std > refused_beyond_mm)),
        int(np.sum(measured & (blind > left))),
        float(np.max(blind)),
    )
