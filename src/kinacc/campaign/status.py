"""The status of a campaign: bounds, verdict, assumptions, remarks, and the next point."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.assess.attainable import NONE, WidthLimits, limits_of
from kinacc.assess.conformity import ACCEPT, REJECT, Decision, decide
from kinacc.assess.limits import VISITS
from kinacc.assess.noise import ESTIMATED, KNOWN
from kinacc.assess.statement import CANDIDATES, MEAN, MEASURED, REGION, Reason, Statement
from kinacc.campaign import consistency, instrument
from kinacc.campaign.consistency import Scatter
from kinacc.campaign.folder import Opened
from kinacc.campaign.plan import Plan
from kinacc.campaign.reasons import ADVICE, reason
from kinacc.campaign.state import State

_CLEAR_OF_NOISE = 3.0  # standard deviations: larger bounds hold where the noise is smaller
_VISIT = f"{VISITS:.0%}".replace("%", " %")


@dataclass(frozen=True)
class Bound:
    """Bounds on the largest error of a target, mm; NaN where none is stated.

    ``lower_mm`` and ``upper_mm`` each hold with ``confidence``. ``target``: ``measured`` points,
    all ``candidates``, or a ``share`` of the ``region``. The upper bound leaves ``excepted`` of
    the ``points`` out; ``unmeasured`` of them have no reading. ``error_of``: the ``mean`` error of
    a pose, or a future ``visit``. ``withheld``: why there is no bound; ``noise``: how large the
    bounds take it where not as stated; ``doubt``: that bounds and estimate contradict each other.
    ``verdict``, by guard band (JCGM 106:2012), on ``tolerance_mm``, with ``reason``. ``risk``: of a
    wrong verdict. ``attainable_mm``, ``proven_mm``, ``attainable_lower_mm``: mean excess of the
    best design that knows all errors, excess below which no reliable bound stays, and the same for
    the lower bound, by the estimated errors (:mod:`kinacc.assess.attainable`).
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
    acceptance_limit_mm: float
    risk: float
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

    @property
    def text(self) -> str:
        """The bounds in a sentence or two."""
        value = f"estimate {self.value_mm:.3f} mm" if np.isfinite(self.value_mm) else ""
        if value and self.unmeasured:
            value += f", likely too low: {self.unmeasured} of {self.points} are not measured"
        lower = f"at least {self.lower_mm:.3f} mm" if np.isfinite(self.lower_mm) else ""
        sure = f"one-sided, {percent(self.confidence)} confidence"
        visits = f" in {_VISIT} of future visits to the worst pose" if self.error_of != MEAN else ""
        error = f"argest error at {self.about}{visits}"
        if not np.isfinite(self.upper_mm):
            more = "; ".join(filter(None, [self.withheld, lower and f"{lower} ({sure})", value]))
            return f"No upper bound on the l{error}: {more or 'none is stated'}."
        text, every = f"L{error}: at most {self.upper_mm:.3f} mm", " each" if lower else ""
        if lower and not self.excepted:
            text += f", {lower}"
        text += f" ({sure}{every})"
        text += f". Largest error of all {self.points}: {lower}" if lower and self.excepted else ""
        return f"{text}; {value}." if value else f"{text}."


@dataclass(frozen=True)
class CampaignStatus:
    """Status of a campaign, as ``kinacc campaign status`` prints it and writes it as JSON.

    ``readings`` were taken, ``readings_used`` of them requested by the assessor so far; ``scatter``
    compares repeated readings with the stated noise. ``against``: reasons why the bounds are
    withheld or unreliable, with ``advice``; ``assumes``: conditions of the bounds; ``notes``:
    findings on noise, frame, left-out points and struck readings; ``overruled``: doubts at the
    start that were overruled. ``bounds``: the main target first.
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
    last_reading: int
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
        order = (CANDIDATES, REGION, MEASURED)
        return min(self.bounds, key=lambda each: order.index(each.target))

    @property
    def next_command(self) -> str:
        """The command that continues the campaign, or ends it."""
        going = self.next_point is not None
        return shlex.join(["kinacc", "campaign", "next" if going else "report", self.folder])

    @property
    def headline(self) -> str:
        """The verdict, or the main bound without a tolerance."""
        main = self.bound
        if self.against:
            stated = "BOUND IN DOUBT" if np.isfinite(main.upper_mm) else "NO BOUND"
            return f"{stated}: {self.against[0]}."
        if main.tolerance_mm is None or not (main.verdict and np.isfinite(main.upper_mm)):
            return main.text
        sure = f"{percent(main.confidence)} confidence"
        size, at = f"{main.tolerance_mm:g} mm", f"largest error at {main.about}"
        if main.verdict == ACCEPT:
            return f"ACCEPT: {at} within {size} (upper bound {main.upper_mm:.3f} mm, {sure})."
        if main.verdict == REJECT:
            return f"REJECT: {at} beyond {size} (lower bound {main.lower_mm:.3f} mm, {sure})."
        return f"UNDECIDED on {size}: {main.reason}."

    @property
    def progress(self) -> str:
        """Readings taken, and the next point."""
        waiting = self.readings - self.readings_used
        ahead = f", {waiting} more taken ahead" if waiting else ""
        text = (
            f"{self.readings_used} of {self.budget} readings{ahead}, at {self.points_measured} of "
            f"{self.candidates} candidates."
        )
        if self.next_point is not None:
            return f"{text} Next point: {self.next_point}."
        spent = self.readings_used >= self.budget
        return f"{text} {'The budget is spent' if spent else 'No further reading is needed'}."


def status(opened: Opened, state: State, tolerance_mm: float | None = None) -> CampaignStatus:
    """Return the status of a campaign; ``tolerance_mm`` in place of its own."""
    plan, about = state.plan, state.plan.about
    said, label = state.statements(), plan.points.label
    tolerance_mm = plan.limits.tolerance_mm if tolerance_mm is None else tolerance_mm
    candidates = len(plan.points) - len(state.left_out)
    visited = len(state.campaign.ledger.visited)
    near, scattered = consistency.nearness(state), consistency.scatter(state)
    held = None if getattr(plan.assessor, "noise", KNOWN) == ESTIMATED else scattered
    overstated = near is not None and near.too_small
    bounds = [_bound(each, state, candidates, tolerance_mm, overstated) for each in said]
    bounds.sort(key=lambda each: (math.isnan(each.upper_mm), each.target != plan.limits.target))
    if visited == candidates and len({(b.lower_mm, b.value_mm, b.upper_mm) for b in bounds}) == 1:
        bounds = [each for each in bounds if each.target != MEASURED] or bounds
    alarms = {
        each.withheld.code: reason(each.withheld)
        for each in said
        if each.withheld and each.withheld.code in ADVICE
    }
    against = [*alarms.values()]
    if not alarms:
        against = [_near(near)] if overstated and near else []
        against += [_scattered(held)] if held and held.too_large else []
        against += [each.doubt for each in bounds if each.doubt]
    noise = [_scattered(held)] if held and not held.too_large and not overstated else []
    noise += [each.noise for each in bounds if each.noise]
    return CampaignStatus(
        folder=str(opened.folder),
        robot=about["robot"],
        calibration=about["calibration"],
        model=about["model"],
        point=about["point"],
        assessor=plan.assessor.name,
        budget=plan.assessor.measurements,
        readings=state.taken,
        readings_used=len(state.told),
        last_reading=state.numbered,
        candidates=candidates,
        points_measured=visited,
        left_out={label[point]: why for point, why in state.left_out.items()},
        struck={each.number: why for each, why in state.struck},
        next_point=None if state.asked is None else label[state.asked],
        recorded=max(opened.recorded, default=""),
        noise={each.name: instrument.noise(each) for each in plan.instruments},
        scatter=scattered,
        against=tuple(dict.fromkeys([*against, *_suspicious(state)] if alarms else against)),
        advice=tuple(ADVICE[each] for each in alarms),
        assumes=_assumes(plan, bounds[0]),
        notes=tuple(dict.fromkeys([*noise, *_frame(state), *_not_counted(state)])),
        overruled=plan.overruled,
        bounds=tuple(bounds),
    )


def percent(share: float) -> str:
    """Return a share as ``95 %``."""
    return f"{100.0 * share:.4g} %"


def _bound(
    said: Statement, state: State, candidates: int, tolerance_mm: float | None, overstated: bool
) -> Bound:
    visited, nan = len(state.campaign.ledger.visited), math.nan
    limits = limits_now(said, state)
    judged = Decision("", nan, nan, nan, nan, Reason("between"))
    if tolerance_mm is not None:
        judged = decide(said, tolerance_mm)
    doubt = ""
    if said.upper_mm < said.lower_mm:
        doubt = "the bounds contradict each other"
    elif said.value_mm > said.upper_mm:
        doubt = "the estimate lies above the upper bound, which cannot be relied on"
    if doubt:
        kind = "overstated" if overstated else "understated"
        doubt += f": noise {kind}, or one of the few campaigns that the confidence leaves out"
    copied = (
        "target", "share", "value_mm", "lower_mm", "upper_mm", "confidence", "excepted", "error_of",
    )  # fmt: skip
    return Bound(
        points=visited if said.target == MEASURED else candidates,
        unmeasured=candidates - visited if said.target == CANDIDATES else 0,
        withheld=reason(said.withheld),
        assumption=reason(said.assumption),
        noise=reason(said.noise),
        doubt=doubt,
        tolerance_mm=tolerance_mm,
        reason=reason(judged.reason) if judged.verdict else "",
        attainable_mm=limits.attainable_mm,
        proven_mm=limits.proven_mm,
        attainable_lower_mm=limits.lower_mm,
        **{name: getattr(said, name) for name in copied},
        **{
            name: getattr(judged, name)
            for name in ("verdict", "guard_band_mm", "acceptance_limit_mm", "risk")
        },
    )


def limits_now(said: Statement, state: State) -> WidthLimits:
    """Return how near a statement could come to the largest error; NaN where it has no bound.

    By the sizes of the mean readings, corrected for their noise; unread points have the median.
    """
    ledger = state.campaign.ledger
    if math.isnan(said.upper_mm):
        return NONE
    read = np.isfinite(ledger.noise_mm)
    square = np.sum(ledger.mean_mm[read] ** 2, axis=1) - 3.0 * ledger.noise_mm[read] ** 2
    sizes = np.sqrt(np.maximum(square, 0.0))
    sizes_mm = np.full(len(read), np.median(sizes))
    sizes_mm[read] = sizes
    return limits_of(said, ledger.visited, sizes_mm, ledger.candidates.sigma_mm, ledger.taken)


def _assumes(plan: Plan, bound: Bound) -> str:
    """The conditions of the main bound; empty where none is stated."""
    if not np.isfinite(bound.upper_mm):
        return ""
    used, settings = plan.instruments, plan.assessor
    stated = "; ".join(f"{each.name}: {instrument.noise(each)}" for each in used)
    if len(used) == 1:
        stated = instrument.noise(used[0])
    if getattr(settings, "noise", KNOWN) != KNOWN:
        freedom = getattr(settings, "noise_freedom", 0)
        source = f"a test with {freedom} degrees of freedom" if freedom else "repeated readings"
        noise = f"a noise of {stated} up to one factor, determined by {source}"
    else:
        largest = max(float(np.linalg.eigvalsh(each.covariance_mm2)[-1]) for each in used)
        clear = bound.upper_mm > _CLEAR_OF_NOISE * math.sqrt(largest)
        noise = f"a standard deviation of {'at most' if clear else 'exactly'} {stated}"
    wrong, allowance = (getattr(settings, name, 0.0) for name in ("wrong_rate", "allowance_mm"))
    more = [
        f"{bound.assumption}, " if bound.assumption else "",
        f"at most {percent(wrong)} wrong readings, " if wrong else "",
        f"at most {allowance:g} mm of what no repeat shows, " if allowance else "",
    ]
    fixed = "a fixed base, tool and instrument"
    return f"Assumes independent normal readings with {noise}, {''.join(more)}and {fixed}."


def assumptions(status: CampaignStatus, plan: Plan) -> list[str]:
    """Return everything that the bounds rest on, a sentence each."""
    settings = vars(plan.assessor)
    meant = "The error is the mean of measured minus modelled position at a pose."
    if status.bound.error_of != MEAN:
        arm_mm = settings["arm_mm"]
        arm = "all of the noise" if arm_mm is None else f"{arm_mm:g} mm per axis"
        meant = f"The error is the one that {_VISIT} of future visits keep; the arm scatters {arm}."
    rate, allowance_mm = settings.get("wrong_rate", 0.0), settings.get("allowance_mm", 0.0)
    lines = [
        status.assumes,
        meant,
        "The noise includes the instrument, its target, and how well the arm repeats a pose. What "
        "the instrument gets wrong every time at a pose counts as an error of the arm.",
        "Candidates were drawn without regard to their errors; none was left out for its error.",
        f"At most {percent(rate)} of the readings are wrong, each at random."
        if rate
        else "No reading is wrong without differing from others of its pose.",
        f"Frame, tool offset and scale of the instrument are wrong by at most {allowance_mm:g} mm."
        if allowance_mm
        else "Frame, tool offset and scale of the instrument are right: no repeat checks them.",
        "No drift or step is too small for the reference poses to show."
        if settings.get("references")
        else "Nothing drifted or moved: no reference poses check it.",
    ]
    if any(each.frame == instrument.INSTRUMENT for each in plan.instruments):
        lines.append("The instrument stands where the calibration placed it.")
    if "confidence" in settings:
        sure = settings["confidence"] - rate
        both = percent(max(2.0 * sure - 1.0, 0.0))
        lines.append(f"Each bound holds with {percent(sure)} confidence, both with {both}.")
    return [each for each in lines if each]


def _near(near: Scatter) -> str:
    return (
        f"readings lie {near.ratio:.2f} times as far from the predictions as the stated noise "
        f"takes them ({near.freedom} degrees of freedom): noise overstated, or no readings"
    )


def _scattered(found: Scatter) -> str:
    text = (
        f"repeated readings scatter {found.ratio:.2f} times the stated noise ({found.freedom} "
        "degrees of freedom)"
    )
    if found.too_large:
        return f"{text}, more than chance allows: noise understated, or something moved"
    return f"{text}: noise overstated, bounds wider than needed" if found.too_small else text


def _frame(state: State) -> Iterable[str]:
    """What the reference poses show, and how large a drift may stay unseen."""
    change = state.campaign.change()
    if change is not None and change.is_found:
        yield reason(change.reason)
    elif change is not None:
        yield (
            "the reference poses show no drift and no step (a drift of "
            f"{change.unseen_mm:.3f} mm would be found in half of the cases)"
        )


def _suspicious(state: State) -> Sequence[str]:
    """Readings that do not fit the others of their pose, by number in the journal."""
    return [
        f"reading {state.told[each.number - 1].number} at point "
        f"{state.plan.points.label[state.rows[each.row]]} lies {each.deviations:.1f} standard "
        "deviations from the others there"
        for each in state.campaign.suspicious()
    ]


def _not_counted(state: State) -> Iterable[str]:
    label = state.plan.points.label
    for point, why in state.left_out.items():
        yield f"point {label[point]} was left out: {why}"
    for each, why in state.struck:
        at = f"{np.linalg.norm(each.error_mm):.3f} mm at {label[each.reading.point]}"
        yield f"reading {each.number} ({at}) was struck: {why}"
