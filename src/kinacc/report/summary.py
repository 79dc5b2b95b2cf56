"""Summary of a calibration: one record for terminal, JSON, table and page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from kinacc.assess.conformity import UNDECIDED
from kinacc.assess.statement import CANDIDATES, Statement
from kinacc.calibration import summary as figures
from kinacc.calibration.summary import Tolerance
from kinacc.campaign import tolerance
from kinacc.campaign.status import CampaignStatus
from kinacc.config.error_models import MEASURED, NOMINAL, model_name
from kinacc.tables.allowed import FINDING_LEVELS

BOUND, HELD_OUT = "bound", "held-out"  # statistics that a verdict is by
STATISTICS = {"mean": "mean", f"{figures.LARGE_SHARE:.0%}": "quantile_99", "largest": "largest"}
_TOLERANCE_OF = {BOUND: "bound", HELD_OUT: "quantile_99"}
_NOTE = FINDING_LEVELS[-1]


@dataclass(frozen=True)
class ModelErrors:
    """Errors of a model over ``n`` rows that every model was tried on.

    ``reference`` is ``measured`` or the model it is compared with; ``estimate`` is ``held_out`` or
    ``training``; ``quantity`` is position (mm) or orientation (mrad).
    """

    model: str
    reference: str
    estimate: str
    quantity: str
    unit: str
    n: int
    mean: float
    quantile_99: float
    largest: float


@dataclass(frozen=True)
class Selection:
    """How a model did in the selection: see ``model_selection``; ``order`` of a VEC model."""

    model: str
    selected: bool
    held_out_rms_mm: float
    gain_mm2: float
    gain_std_error_mm2: float
    order: int | None = None
    held_out_orders: tuple[int, int] | None = None
    highest_order_tried: int | None = None

    @property
    def label(self) -> str:
        """The model's name with its order."""
        if self.order is None:
            return model_name(self.model)
        low, high = self.held_out_orders or (self.order, self.order)
        folds = f" (held out: {low} to {high})" if low < high else ""
        most = ", the highest tried" if self.order == self.highest_order_tried else ""
        return f"{model_name(self.model)}, order {self.order}{folds}{most}"


@dataclass(frozen=True)
class JointRange:
    """Measured range of a joint (deg or mm) and its share of the joint's travel."""

    joint: int
    low: float
    high: float
    unit: str
    share: float


@dataclass(frozen=True)
class Finding:
    """A finding of the data check; ``accepted`` is the reason given in the configuration."""

    finding: str
    level: str
    rows: int
    text: str
    lines: str
    fix: str
    accepted: str

    @property
    def is_open(self) -> bool:
        """Whether it is a suspicion that nobody accepted."""
        return self.level != _NOTE and not self.accepted


@dataclass(frozen=True)
class ExcludedRow:
    """A row that the configuration excludes, and its error by the selected model."""

    line: int
    where: str
    reason: str
    error_mm: float


@dataclass(frozen=True)
class JointCompliance:
    """How a joint bends; a value that was not fitted is NaN."""

    joint: int
    compliance_rad_per_nm: float
    std_compliance_rad_per_nm: float
    lever_coefficient_rad_per_mm: float
    std_lever_coefficient_rad_per_mm: float


@dataclass(frozen=True)
class Verdict:
    """Whether an error is within a tolerance: accept, reject or undecided, and why.

    ``source`` of the tolerance is empty where a command was given it.
    """

    verdict: str
    reason: str
    tolerance_mm: float
    source: str = ""


@dataclass(frozen=True)
class NextStep:
    """A command to go on with, and its purpose."""

    purpose: str
    command: str


@dataclass(frozen=True)
class Claims:
    """Number of the paper's claims by verdict, without those that chose a reading of the paper."""

    agree: int
    differ: int
    not_comparable: int
    differing: tuple[str, ...]


@dataclass(frozen=True)
class CalibrationSummary:
    """What the calibration of one data set is worth.

    Positions in mm, orientations in mrad. ``errors`` holds every population; ``share_measured`` is
    the share of the box of the joint ranges that lies near measured poses (None where the table
    ``summary`` does not state it); ``flange_spread_deg`` is None unless the flange points in one
    direction; ``held_out_over_noise`` is NaN where the noise is unknown.
    """

    name: str
    folder: str
    written: str
    robot: str
    synthetic: bool
    readings: int
    poses: int
    targets: int
    fitted: int
    frames_fitted: bool
    full_pose: bool
    selected: str
    errors: tuple[ModelErrors, ...]
    selection: tuple[Selection, ...]
    joint_ranges: tuple[JointRange, ...]
    share_measured: float | None
    flange_spread_deg: float | None
    unidentifiable: tuple[str, ...]
    poorly_determined: tuple[str, ...]
    checked: bool
    findings: tuple[Finding, ...]
    left_out: tuple[str, ...]
    excluded: tuple[ExcludedRow, ...]
    compliance: tuple[JointCompliance, ...]
    noise_mm: float
    held_out_over_noise: Mapping[str, float]
    campaign: CampaignStatus | None
    remarks: tuple[str, ...]
    tolerance: Tolerance | None
    claims: Claims | None
    other_errors: Mapping[str, float]
    history: str
    outdated: str
    next_steps: tuple[NextStep, ...]

    @property
    def is_held_out(self) -> bool:
        """Whether poses were held out."""
        return any(each.estimate == "held_out" for each in self.errors)

    def position_errors(self) -> dict[str, ModelErrors]:
        """Position errors against measurements by model, held out where poses were."""
        estimate = "held_out" if self.is_held_out else "training"
        return {
            each.model: each
            for each in self.errors
            if (each.reference, each.estimate, each.quantity) == (MEASURED, estimate, "position")
        }

    def orientation_errors(self) -> dict[str, ModelErrors]:
        """Held-out orientation errors by model, empty for positions only."""
        return {
            each.model: each
            for each in self.errors
            if (each.reference, each.estimate, each.quantity)
            == (MEASURED, "held_out", "orientation")
        }

    @property
    def best(self) -> ModelErrors:
        """Position errors of the selected model."""
        return self.position_errors()[self.selected]

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the bounds of the campaign are withheld or unreliable."""
        return () if self.campaign is None else (*self.campaign.against, *self.campaign.overruled)

    def error_table(self) -> pd.DataFrame:
        """Errors of every model at the rows of ``best``: model, then statistics by name and unit.

        The index holds the models; numbers are texts of three significant digits.
        """
        turned, rows = self.orientation_errors(), {}
        for model, errors in self.position_errors().items():
            row = {"model": self.label(model)}
            for part in filter(None, (errors, turned.get(model))):
                for name, key in STATISTICS.items():
                    row[f"{name}, {part.unit}"] = size(getattr(part, key))
            rows[model] = row
        return pd.DataFrame.from_dict(rows, orient="index").fillna("")

    def label(self, model: str) -> str:
        """A model's name with its order, or with the frames that were fitted."""
        if model == NOMINAL:
            return "nominal, base and tool fitted" if self.frames_fitted else NOMINAL
        return next(each.label for each in self.selection if each.model == model)

    def verdict(self, by: str, tolerance_mm: float | None = None) -> Verdict | None:
        """The verdict ``by`` the bound of the campaign or by held-out errors.

        Without ``tolerance_mm`` the campaign's tolerance counts, then that of the configuration
        where it is about the same statistic; None where there is none.
        """
        bound = self.campaign.of_all if self.campaign else None
        source = ""
        if tolerance_mm is None and bound is not None and by == BOUND:
            tolerance_mm, source = bound.tolerance_mm, tolerance.OF_CAMPAIGN
        if tolerance_mm is None and self.tolerance and self.tolerance.of == _TOLERANCE_OF[by]:
            tolerance_mm, source = self.tolerance.mm, tolerance.OF_CONFIGURATION
        if tolerance_mm is None:
            return None
        if by == HELD_OUT:
            judged = tolerance.by_held_out(
                Tolerance(tolerance_mm, _TOLERANCE_OF[by]), self._held_out()
            )
        elif bound is None:
            judged = UNDECIDED, "no campaign bounds the largest error"
        else:
            limits = (bound.value_mm, bound.lower_mm, bound.upper_mm, bound.confidence)
            statement = Statement(CANDIDATES, *limits, excepted=bound.excepted)
            judged = tolerance.by_bound(tolerance_mm, statement, bool(self.doubts))
        return Verdict(*judged, tolerance_mm, source)

    def of_configuration(self) -> Verdict | None:
        """The verdict on the tolerance of the configuration, by the statistic it names."""
        if self.tolerance is None:
            return None
        if self.tolerance.of == "bound":
            return self.verdict(BOUND, self.tolerance.mm)
        judged = tolerance.by_held_out(self.tolerance, self._held_out())
        return Verdict(*judged, self.tolerance.mm, tolerance.OF_CONFIGURATION)

    def _held_out(self) -> dict[str, float]:
        best = self.best
        if not self.is_held_out:
            return {}
        return {"n": best.n, "mean": best.mean, "quantile_99": best.quantile_99}


def size(value: float) -> str:
    """A number with three significant digits, without an exponent."""
    if not math.isfinite(value) or value == 0.0:
        return f"{value:.3g}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"
