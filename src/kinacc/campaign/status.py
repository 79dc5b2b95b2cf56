"""The status of a campaign: bounds, verdict, assumptions, remarks, and the next point."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinacc.assess.attainable import NONE, WidthLimits, limits_of
from kinacc.assess.noise import ESTIMATED, KNOWN
from kinacc.assess.statement import (
    CANDIDATES,
    MEASURED,
    REGION,
    Decision,
    Reason,
    Statement,
    decide,
)
from kinacc.campaign.folder import Opened
from kinacc.campaign.plan import TARGETS, Plan
from kinacc.campaign.state import Scatter, State, scatter, size_scatter

_CLEAR_OF_NOISE = 3.0  # standard deviations: larger bounds hold where the noise is smaller
_UNJUDGED = Decision("", None, math.nan)


@dataclass(frozen=True)
class Bound:
    """Bounds on the largest error of a target, mm; NaN where none is stated.

    ``lower_mm`` and ``upper_mm`` each hold with ``confidence``. ``target``: ``measured`` points,
    all ``candidates``, or a ``share`` of the ``region``. The upper bound leaves ``excepted`` of
    the ``points`` out; ``unmeasured`` of them have no reading. ``error_of``: the ``mean`` error of
    a pose, or a future ``visit``. ``withheld``: why there is no bound; ``noise``: how large the
    bounds take it where not as stated; ``doubt``: that bounds and estimate contradict each other.
    ``verdict``, by guard band (JCGM 106:2012), on ``tolerance_mm``, with ``reason``; it is wrong
    with a probability of one less ``confidence`` at most. ``attainable_mm``, ``proven_mm``,
    ``attainable_lower_mm``: mean excess of the best design that knows all errors, excess below
    which no reliable bound stays, and the same for the lower bound, by the estimated errors
    (:mod:`kinacc.assess.attainable`).
    """

    target: str
    points: int
    share: float
    value_mm: float
    lower_mm: float
    upper_mm: float
    confidence: float
    excepted: int
    unmeasured: int
    error_of: str
    withheld: str
    assumption: str
    noise: str
    doubt: str
    tolerance_mm: float | None
    verdict: str
    reason: str
    guard_band_mm: float
    attainable_mm: float
    proven_mm: float
    attainable_lower_mm: float

    @property
    def about(self) -> str:
        """The points: ``these 200 candidates``."""
        if self.target == REGION:
            return f"{100.0 * self.share:.1f} % of the region"
        named = "measured points" if self.target == MEASURED else "candidates"
        few = f"all but {self.excepted} of " if self.excepted else ""
        return f"{few}these {self.points} {named}" if self.points != 1 else "one measured point"


@dataclass(frozen=True)
class CampaignStatus:
    """Status of a campaign, as ``kinacc campaign status`` prints it and writes it as JSON.

    ``readings`` were taken, ``readings_used`` of them requested by the assessor so far; ``scatter``
    compares repeated readings with the stated noise. ``against``: reasons why the bounds are
    withheld or unreliable, with ``advice``; ``assumes``: conditions of the bounds; ``notes``:
    findings on noise and frame; ``left_out``, ``struck``: points and readings with the reason;
    ``overruled``: doubts at the start that were overruled. ``bounds``: the main target first.
    """

    folder: str
    robot: str
    calibration: str
    model: str
    point: str
    assessor: str
    budget: int
    readings: int
    readings_used: int
    candidates: int
    points_measured: int
    left_out: Mapping[str, str]
    struck: Mapping[int, str]
    next_point: str | None
    recorded: str
    noise: Mapping[str, str]
    scatter: Scatter | None
    against: tuple[str, ...]
    advice: tuple[str, ...]
    assumes: str
    notes: tuple[str, ...]
    overruled: tuple[str, ...]
    bounds: tuple[Bound, ...]

    @property
    def bound(self) -> Bound:
        """The main bound."""
        return self.bounds[0]

    @property
    def of_all(self) -> Bound:
        """The bound on all candidates, else on a share of the region, else on measured points."""
        return min(self.bounds, key=lambda bound: TARGETS.index(bound.target))

    @property
    def next_command(self) -> str:
        """The command that continues the campaign, or ends it."""
        going = self.next_point is not None
        return shlex.join(["kinacc", "campaign", "next" if going else "report", self.folder])


def status(opened: Opened, tolerance_mm: float | None = None) -> CampaignStatus:
    """Return the status of a campaign: bounds, verdict, conditions, remarks and the next point.

    Parameters
    ----------
    opened : Opened
        The campaign as read (:func:`kinacc.campaign.folder.open_`).
    tolerance_mm : float, optional
        Largest error allowed, in place of the campaign's own.

    Returns
    -------
    CampaignStatus
        Bounds in mm, the main target first.
    """
    plan, state, label = opened.plan, opened.state, opened.plan.points.label
    stated, visited = state.statements(), len(state.campaign.ledger.visited)
    tolerance_mm = plan.limits.tolerance_mm if tolerance_mm is None else tolerance_mm
    candidates = len(state.rows)
    near, repeats = size_scatter(state), scatter(state)
    bounds = [_bound(item, state, tolerance_mm) for item in stated]
    bounds.sort(key=lambda item: (math.isnan(item.upper_mm), TARGETS.index(item.target)))
    if visited == candidates and len({(b.lower_mm, b.value_mm, b.upper_mm) for b in bounds}) == 1:
        bounds = [item for item in bounds if item.target != MEASURED] or bounds
    reasons = [item.withheld for item in stated if item.withheld]
    alarms = {item.code: reason(item) for item in reasons if item.code in ADVICE}
    against, notes = list(alarms.values()), []
    if alarms:
        against += [
            f"reading {state.used[item.number - 1].number} at point "
            f"{label[state.rows[item.row]]} lies {item.deviations:.1f} standard deviations from "
            "the others there"
            for item in state.campaign.suspicious()
        ]
    elif near is not None and near.too_small:
        against.append(
            f"readings lie {near.ratio:.2f} times as far from the predictions as the stated noise "
            f"takes them ({near.freedom} degrees of freedom): noise overstated, or no readings"
        )
    elif repeats and getattr(plan.assessor, "noise", KNOWN) != ESTIMATED:
        consequence = ": noise overstated, bounds wider than needed" if repeats.too_small else ""
        notes.append(
            f"repeated readings scatter {repeats.ratio:.2f} times the stated noise "
            f"({repeats.freedom} degrees of freedom){consequence}"
        )
    if not alarms:
        against += [item.doubt for item in bounds if item.doubt]
    notes += [item.noise for item in bounds if item.noise]
    change = state.campaign.change()
    if change is not None and change.is_found:
        notes.append(reason(change.reason))
    elif change is not None:
        notes.append(
            "the reference poses show no drift and no step (a drift of "
            f"{change.unseen_mm:.3f} mm would be found in half of the cases)"
        )
    return CampaignStatus(
        folder=str(opened.folder),
        **{name: plan.about[name] for name in ("robot", "calibration", "model", "point")},
        assessor=plan.assessor.name,
        budget=plan.assessor.measurements,
        readings=len(state.readings),
        readings_used=len(state.used),
        candidates=candidates,
        points_measured=visited,
        left_out={label[point]: why for point, why in state.left_out.items()},
        struck={item.number: item.struck or "" for item in state.struck},
        next_point=None if state.requested is None else label[state.requested],
        recorded=max(opened.recorded, default=""),
        noise={device.name: device.noise for device in plan.instruments},
        scatter=repeats,
        against=tuple(dict.fromkeys(against)),
        advice=tuple(ADVICE[code] for code in alarms),
        assumes=_assumes(plan, bounds[0]),
        notes=tuple(dict.fromkeys(notes)),
        overruled=plan.overruled,
        bounds=tuple(bounds),
    )


def percent(share: float) -> str:
    """Return a share as ``95 %``."""
    return f"{100.0 * share:.4g} %"


def _bound(stated: Statement, state: State, tolerance_mm: float | None) -> Bound:
    visited, candidates = len(state.campaign.ledger.visited), len(state.rows)
    judged = _UNJUDGED if tolerance_mm is None else decide(stated, tolerance_mm)
    doubt = ""
    if stated.upper_mm < stated.lower_mm or stated.upper_mm < stated.value_mm:
        doubt = (
            "the bounds and the estimate contradict each other: noise misstated, or one of the few "
            "campaigns that the confidence leaves out"
        )
    fields: dict[str, Any] = {**vars(stated), **_limits(stated, state)._asdict()}
    texts = {name: reason(fields[name]) for name in ("withheld", "assumption", "noise")}
    return Bound(
        **(fields | texts),
        points=visited if stated.target == MEASURED else candidates,
        unmeasured=candidates - visited if stated.target == CANDIDATES else 0,
        doubt=doubt,
        tolerance_mm=tolerance_mm,
        verdict=judged.verdict,
        reason=reason(judged.reason),
        guard_band_mm=judged.guard_band_mm,
    )


def _limits(stated: Statement, state: State) -> WidthLimits:
    """How near the statement could come to the largest error; NaN where it has no bound.

    By the sizes of the mean readings, corrected for their noise; unread points have the median.
    """
    ledger = state.campaign.ledger
    if math.isnan(stated.upper_mm):
        return NONE
    read = np.isfinite(ledger.noise_mm)
    square = np.sum(ledger.mean_mm[read] ** 2, axis=1) - 3.0 * ledger.noise_mm[read] ** 2
    sizes = np.sqrt(np.maximum(square, 0.0))
    sizes_mm = np.full(len(read), np.median(sizes))
    sizes_mm[read] = sizes
    return limits_of(stated, ledger.visited, sizes_mm, ledger.candidates.sigma_mm, ledger.taken)


def _assumes(plan: Plan, bound: Bound) -> str:
    """The conditions of the main bound; empty where none is stated."""
    if math.isnan(bound.upper_mm):
        return ""
    used, settings = plan.instruments, vars(plan.assessor)
    stated = "; ".join(f"{device.name}: {device.noise}" for device in used)
    stated = used[0].noise if len(used) == 1 else stated
    if settings.get("noise", KNOWN) != KNOWN:
        freedom = settings["noise_freedom"]
        source = f"a test with {freedom} degrees of freedom" if freedom else "repeated readings"
        noise = f"a noise of {stated} up to one factor, determined by {source}"
    else:
        largest = max(float(np.linalg.eigvalsh(device.covariance_mm2)[-1]) for device in used)
        clear = bound.upper_mm > _CLEAR_OF_NOISE * math.sqrt(largest)
        noise = f"a standard deviation of {'at most' if clear else 'exactly'} {stated}"
    wrong, allowance = settings.get("wrong_rate", 0.0), settings.get("allowance_mm", 0.0)
    parts = [
        noise,
        bound.assumption,
        f"at most {percent(wrong)} wrong readings" if wrong else "",
        f"at most {allowance:g} mm of what no repeat shows" if allowance else "",
        "and a fixed base, tool and instrument",
    ]
    return f"Assumes independent normal readings with {', '.join(filter(None, parts))}."


# Texts of the codes of assessors.
REASONS = {
    # assumptions
    "drawn_at_random": "points drawn at random from the region",
    # no bound
    "nothing_measured": "no reading yet",
    "first_visit": "{left} more points of the first visit are needed",
    "first_visit_by_travel": "{left} points of the first visit, made in order of travel, are open",
    "predicted": "all {read} readings equal the predicted positions to the last digit: were "
    "predictions recorded?",
    "unmeasured": "{left} of {points} candidates are not measured",
    "few_points": "{read} points read; {share:.0%} of the region needs {needed}",
    "drift": "the reference poses show a drift of {size:.3f} mm over the campaign "
    "({x:+.3f}, {y:+.3f}, {z:+.3f} in the robot's base; standard deviation {deviation:.3f} mm)",
    "step": "the reference poses show a step of {size:.3f} mm between readings {after} and "
    "{before} ({x:+.3f}, {y:+.3f}, {z:+.3f} in the robot's base; standard deviation "
    "{deviation:.3f} mm)",
    "scatter": "readings of one pose in a row scatter {ratio:.2f} times the stated noise "
    "({freedom:.0f} degrees of freedom): noise understated, or something moves",
    "tails": "readings of one pose lie {farthest:.1f} standard deviations apart: some are wrong, "
    "or the noise is not normal",
    "wrong_readings": "readings that do not fit the others of their pose: {readings:.0f}",
    "noise_unknown": "the noise is not estimated yet: {freedom:.0f} of {needed:.0f} degrees of "
    "freedom",
    # noise of the bounds
    "noise_margin": "too few repeated readings planned to check the stated noise ({sure} of "
    "{needed} degrees of freedom): bounds use {margin:g} times the stated value (--set "
    "noise_margin=1 takes it as stated)",
    "noise_shown": "bounds use {factor:.2f} times the stated noise, as repeated readings show "
    "({freedom:.0f} degrees of freedom)",
    "noise_estimated": "noise estimated in this campaign: {factor:.2f} times the planned value "
    "({freedom:.0f} degrees of freedom)",
    "noise_tested": "noise of a repeatability test ({freedom:.0f} degrees of freedom)",
    "noise_limited": "bounds use {factor:.2f} times the noise of the repeatability test, its upper "
    "limit ({freedom:.0f} degrees of freedom), as readings may be wrong",
    "noise_bounded": "no repeated readings: noise at most {factor:.2f} times the planned value, by "
    "the size of all readings",
    # small budgets
    "excepted_ahead": "the bound will leave {excepted:.0f} candidates out; {enough:.0f} readings "
    "bound all of them",
    # decisions
    "between": "the tolerance lies between lower and upper bound",
    "contradict": "bounds and estimate contradict each other: is the noise understated?",
    "within": "the upper bound is within the tolerance",
    "beyond": "the lower bound exceeds the tolerance",
    "some_excepted": "the upper bound is within the tolerance but leaves {excepted:.0f} candidates "
    "out",
    "no_upper": "no upper bound is stated",
}


# What to do where readings contradict an assumption of the bounds.
ADVICE = {
    "predicted": "Begin a new campaign, and record readings of an instrument.",
    "scatter": "Check whether something moves; begin a new campaign with the noise tested (kinacc "
    "repeatability) or estimated (--noise estimate).",
    "tails": "Check the readings; begin a new campaign, with --wrong-readings where some may go "
    "wrong.",
    "wrong_readings": "Check each reading named: strike it where something went wrong (kinacc "
    "campaign strike FOLDER NUMBER --reason ..), else begin a new campaign with --wrong-readings.",
    "drift": "Find what moved or warmed up, and begin a new campaign.",
    "step": "Find what moved, and begin a new campaign.",
}


def reason(why: Reason | None) -> str:
    """Return the text of a reason; empty for None."""
    return "" if why is None else REASONS[why.code].format(**why.numbers)
