"""Summary of a calibration: one record for terminal, JSON, table and page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from kinacc.assess.statement import ACCEPT, CANDIDATES, REJECT, UNDECIDED, Statement, decide
from kinacc.calibration.summary import LARGE_SHARE, Tolerance
from kinacc.campaign.status import Bound, CampaignStatus
from kinacc.campaign.status import reason as reason_text
from kinacc.config.error_models import MEASURED, NOMINAL, model_name
from kinacc.report.rendering import size

BOUND, HELD_OUT = "bound", "held-out"  # statistics that a verdict is by
STATISTICS = {"mean": "mean", f"{LARGE_SHARE:.0%}": "quantile_99", "largest": "largest"}
_FEWEST = round(1.0 / (1.0 - LARGE_SHARE))  # rows of which that share is less than all
_TOLERANCE_OF = {BOUND: "bound", HELD_OUT: "quantile_99"}


@dataclass(frozen=True)
class Verdict:
    """Whether an error is within a tolerance: accept, reject or undecided, and why.

    ``source`` of the tolerance is empty where a command was given it.
    """

    verdict: str
    reason: str
    tolerance_mm: float
    source: str = ""


@dataclass(frozen=True, eq=False)
class CalibrationSummary:
    """What the calibration of one data set is worth. Positions in mm, orientations in mrad.

    Attributes
    ----------
    measured
        Day of the measurement, of a line of a series or of its newest line; else empty.
    errors
        A row for each model, reference (``measured`` or another model), estimate (``held_out`` or
        ``training``) and quantity (position, orientation): ``unit``, ``n`` rows that every model
        was tried on, ``mean``, ``quantile_99``, ``largest``, ``rms``, and ``std_error`` of the mean
        over ``configurations``.
    selection
        ``model_selection`` with the ``order`` of a VEC model and the highest that was tried; None
        where there is none.
    joint_ranges
        Measured ``low`` and ``high`` of each joint and its limits ``least`` and ``most``, in deg or
        mm, and the ``share`` of the travel that is measured.
    share_measured
        Share of the box of the joint ranges that lies near measured poses, None where unknown.
    flange_spread_deg
        Largest angle of the flange axis to its mean, None unless it points in one direction.
    findings
        Findings of the data check, the gravest first; ``is_open`` where nobody accepted a
        suspicion, ``accepted`` is the reason stated.
    excluded
        Rows that the configuration excludes, each with its error by the selected model.
    compliance
        Joints that bend; NaN where a coefficient was not fitted.
    noise_mm, stated_noise_mm
        Noise of a reading per axis: of repeated readings, and of standard deviations in the file;
        NaN where unknown.
    held_out_over_noise
        By model, NaN where the noise is unknown.
    claims
        Number of the paper's claims by verdict, without those that chose a reading of the paper,
        and the names of the differing ones.
    next_steps
        Commands by purpose.
    """

    name: str
    folder: str
    written: str
    measured: str
    robot: str
    synthetic: bool
    readings: int
    poses: int
    targets: int
    fitted: int
    frames_fitted: bool
    full_pose: bool
    selected: str
    errors: pd.DataFrame
    selection: pd.DataFrame
    joint_ranges: pd.DataFrame
    share_measured: float | None
    flange_spread_deg: float | None
    unidentifiable: tuple[str, ...]
    poorly_determined: tuple[str, ...]
    checked: bool
    findings: pd.DataFrame
    left_out: tuple[str, ...]
    excluded: pd.DataFrame
    compliance: pd.DataFrame
    noise_mm: float
    stated_noise_mm: float
    held_out_over_noise: Mapping[str, float]
    campaign: CampaignStatus | None
    remarks: tuple[str, ...]
    tolerance: Tolerance | None
    claims: Mapping[str, Any] | None
    history: str
    outdated: str
    next_steps: Mapping[str, str]

    @property
    def is_held_out(self) -> bool:
        """Whether poses were held out."""
        return bool((self.errors["estimate"] == "held_out").any())

    @property
    def position_errors(self) -> pd.DataFrame:
        """Position errors against measurements by model, held out where poses were."""
        return self._against_measured("position")

    def _against_measured(self, quantity: str) -> pd.DataFrame:
        table = self.errors[self.errors["quantity"] == quantity].set_index("model")
        estimate = "held_out" if self.is_held_out else "training"
        return table[(table["reference"] == MEASURED) & (table["estimate"] == estimate)]

    @property
    def best(self) -> Any:
        """Position errors of the selected model: ``n``, ``mean``, ``quantile_99``, ``largest``."""
        return next(self.position_errors.loc[[self.selected]].itertuples())

    @property
    def rms_without_noise_mm(self) -> float:
        """Noise-corrected rms of ``best``: root of rms^2 - 3 sigma^2, sigma as stated; 0 at least.

        NaN where the file states no standard deviations.
        """
        square = self.best.rms**2 - 3.0 * self.stated_noise_mm**2
        return math.sqrt(max(square, 0.0)) if math.isfinite(square) else math.nan

    @property
    def open_findings(self) -> pd.DataFrame:
        """Suspicions of the data check that nobody accepted."""
        return self.findings[self.findings["is_open"].astype(bool)]

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the bounds of the campaign are withheld or unreliable."""
        return () if self.campaign is None else (*self.campaign.against, *self.campaign.overruled)

    def error_table(self) -> pd.DataFrame:
        """Errors of every model at the rows of ``best``: model, then statistics by name and unit.

        The index holds the models; numbers are texts of three significant digits.
        """
        table = pd.DataFrame(index=self.position_errors.index)
        table["model"] = [self.label(model) for model in table.index]
        for errors in (self.position_errors, self._against_measured("orientation")):
            for name, column in STATISTICS.items() if len(errors) else ():
                table[f"{name}, {errors['unit'].iloc[0]}"] = errors[column].map(size)
        return table.fillna("")

    def label(self, model: str) -> str:
        """A model's name with its order, or with the frames that were fitted."""
        if model == NOMINAL:
            return "nominal, base and tool fitted" if self.frames_fitted else NOMINAL
        row = self.selection.set_index("model").loc[model]
        if row["order"] is None:
            return model_name(model)
        most = ", the highest tried" if row["order"] == row["highest_order_tried"] else ""
        return f"{model_name(model)}, order {row['order']}{most}"

    @property
    def bound(self) -> Bound | None:
        """The bound of the campaign on all candidates, None without a campaign."""
        return self.campaign.of_all if self.campaign else None

    def verdict(self, by: str, tolerance_mm: float | None = None) -> Verdict | None:
        """The verdict ``by`` the bound of the campaign or by held-out errors.

        Without ``tolerance_mm`` the campaign's tolerance counts, then that of the configuration
        where it is about the same statistic; None where there is none.
        """
        statistic = _TOLERANCE_OF[by]
        if tolerance_mm is not None:
            return self._judged(Tolerance(tolerance_mm, statistic))
        if by == BOUND and self.bound and self.bound.tolerance_mm is not None:
            return self._judged(Tolerance(self.bound.tolerance_mm, statistic), "the campaign's")
        is_about_it = self.tolerance is not None and self.tolerance.of == statistic
        return self.of_configuration() if is_about_it else None

    def of_configuration(self) -> Verdict | None:
        """The verdict on the tolerance of the configuration, by the statistic it names."""
        return self._judged(self.tolerance, "the configuration's") if self.tolerance else None

    def _judged(self, allowed: Tolerance, source: str = "") -> Verdict:
        """Whether the statistic of a tolerance is within it."""
        best, bound, verdict = self.best, self.bound, UNDECIDED
        if allowed.of == "bound":
            reason = "no campaign bounds the largest error"
            if self.doubts:
                reason = "its bound cannot be relied on"
            elif bound is not None:
                limits = (bound.value_mm, bound.lower_mm, bound.upper_mm, bound.confidence)
                stated = Statement(CANDIDATES, *limits, excepted=bound.excepted)
                decided = decide(stated, allowed.mm)
                verdict, reason = decided.verdict, reason_text(decided.reason)
        elif not self.is_held_out:
            reason = "no error is held out"
        elif allowed.of == "mean":
            verdict = ACCEPT if best.mean <= allowed.mm else REJECT
            reason = f"the mean error held out is {best.mean:.3f} mm"
        elif best.quantile_99 > allowed.mm:
            verdict, reason = (
                REJECT,
                "more than 1 % of the errors held out are beyond the tolerance",
            )
        elif best.n < _FEWEST:
            reason = f"{best.n:.0f} errors are held out, too few to tell of 1 % of them"
        else:
            verdict, reason = ACCEPT, "99 % of the errors held out are within the tolerance"
        return Verdict(verdict, reason, allowed.mm, source)
