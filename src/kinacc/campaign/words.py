"""Statements of assessors and the standing of a campaign, in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from kinacc.assess.limits import VISITS as FUTURE
from kinacc.assess.noise import KNOWN, noise_plan
from kinacc.assess.registry import RECOMMENDED
from kinacc.assess.statement import CANDIDATES, MEAN, MEASURED, REGION, Reason, Statement
from kinacc.campaign import consistency, instrument
from kinacc.campaign.plan import Plan
from kinacc.campaign.reasons import ADVICE, reason
from kinacc.campaign.state import State

_CLEAR_OF_NOISE = 3.0  # standard deviations: larger bounds stay right where the noise is less
TARGETS = {MEASURED: "measured points", CANDIDATES: "all candidates", REGION: "share of the region"}


def one_of(point: str, targets: Sequence[str]) -> list[str]:
    """Which of several targets a campaign is about, why, and how to mean another."""
    if len(targets) < 2:
        return []
    why = (
        f"the first of {', '.join(targets)}" if point == targets[0] else f"of {', '.join(targets)}"
    )
    return [f"a campaign is about one point: {point}, {why}; --point names another"]


def distances_m(plan: Plan) -> tuple[float, float]:
    """The nearest and the farthest candidate from the origin of the instrument's frame, m."""
    apart = np.linalg.norm(plan.points.modelled_mm - plan.to_base.position_mm, axis=1)
    return 1e-3 * float(apart.min()), 1e-3 * float(apart.max())


def trackers(plan: Plan) -> list[str]:
    """Where laser trackers stand, whose noise hangs on that."""
    named = ", ".join(each.name for each in plan.instruments if each.laser is not None)
    least, most = distances_m(plan)
    said = f"{least:.2f} m to {most:.2f} m from the candidates, by the calibration: its head is "
    return [f"{named}: {said}taken to be the origin of its frame"] if named else []


def arrangements(plan: Plan) -> list[str]:
    """What a campaign does about noise, wrong readings and drift, a line each."""
    if plan.assessor.name != RECOMMENDED:
        return []
    of: Any = plan.assessor
    lines = []
    if of.noise != KNOWN and of.noise_freedom:
        lines.append(f"the noise is as stated{told_factor(plan)}")
    elif of.noise != KNOWN:
        lines.append(
            "the noise is estimated in this campaign, by readings repeated at once: what is stated "
            "is what readings are planned by"
        )
    elif (margin := noise_plan(of, len(plan.route)).margin) > 1.0:
        told = reason(Reason("noise_margin", {"margin": margin}))
        lines.append(f"{told}; --set noise_margin=1 takes it as stated")
    if of.wrong_rate:
        lines.append(
            f"up to {of.wrong_rate:.1%} of the readings may be wrong: bounds hold all the same, "
            f"with {of.confidence - of.wrong_rate:.1%} confidence"
        )
    if of.references:
        lines.append(
            f"{of.references} readings return to reference poses: a drift found is said, and no "
            "bound is stated"
        )
        lines.append(
            "a drift of one standard deviation over the campaign is found in under 10 % of "
            "campaigns, and bounds then hold less often (docs/alarms.md)"
        )
    if of.error_of != MEAN:
        lines.append(f"the error meant is what {FUTURE:.0%} of visits to the worst pose keep")
    if of.allowance_mm:
        lines.append(f"{of.allowance_mm:g} mm are allowed for what no repeat sees, in both bounds")
    return lines


def begun_against(plan: Plan) -> list[str]:
    """What spoke against the campaign as it was begun, which whoever reads a bound has to know."""
    return [f"begun against: {each}" for each in plan.overruled]


def statements(state: State) -> list[str]:
    """What may be said, a sentence each."""
    return [statement(each, state) for each in distinct(state)]


def distinct(state: State) -> list[Statement]:
    """The statements to tell: where all candidates are measured and the same holds of them, one."""
    said = {each.target: each for each in state.statements()}
    points = len(state.plan.points) - len(state.left_out)
    texts = {target: statement(each, state) for target, each in said.items()}
    measured, whole = texts.get(MEASURED, ""), texts.get(CANDIDATES, "")
    same = measured.partition(" is ")[2] == whole.partition(" is ")[2]
    if whole and same and _visited(state) == points:
        del said[MEASURED]
    return list(said.values())


def pledge(said: Statement, state: State) -> str:
    """The upper bound as a promise: how often such a bound is right, of what, on which conditions.

    Where none is stated, why.
    """
    if math.isnan(said.upper_mm):
        return statement(said, state)
    points = len(state.plan.points) - len(state.left_out)
    verb = "are" if said.excepted > 1 else "is"
    limit = f"{verb} off by more than {said.upper_mm:.3f} mm"
    if said.error_of != MEAN:
        limit += f" in more than {1.0 - FUTURE:.0%} of its future visits"
    of_all = {
        MEASURED: f"none of the {_visited(state)} measured points {limit}",
        CANDIDATES: f"{_no_more(said.excepted)} of these {points} candidates {limit}",
        REGION: f"no more than {1.0 - said.share:.1%} of the region {limit}",
    }
    return (
        f"By a procedure whose bound is right in {how_often(said.confidence)}, "
        f"{of_all[said.target]}, if {conditions(said, state)}."
    )


def _no_more(count: int) -> str:
    return f"no more than {count}" if count else "none"


def conditions(said: Statement, state: State) -> str:
    """On what an upper bound hangs."""
    of: Any = state.plan.assessor
    needed = [reason(said.assumption) or "", _noise_assumed(said, state)]
    if getattr(of, "wrong_rate", 0.0):
        needed.append(f"at most {of.wrong_rate:.1%} of the readings are wrong")
    if getattr(of, "allowance_mm", 0.0):
        needed.append(f"what no repeat sees is at most {of.allowance_mm:g} mm")
    needed.append("nothing moved (base, tool, instrument)")
    named = [each for each in needed if each]
    return f"{', '.join(named[:-1])} and {named[-1]}"


def how_often(confidence: float) -> str:
    """The confidence of a bound as a count: 95 of 100 campaigns."""
    of = 100 if math.isclose(100.0 * confidence, round(100.0 * confidence)) else 1000
    return f"{of * confidence:g} of {of} campaigns"


def _noise_assumed(said: Statement, state: State) -> str:
    """What the noise has to be: no more than stated, or as stated where a bound is that small."""
    used = state.plan.instruments
    largest = max(float(np.linalg.eigvalsh(each.covariance_mm2)[-1]) for each in used)
    clear = said.upper_mm > _CLEAR_OF_NOISE * math.sqrt(largest)
    factor = told_factor(state.plan)
    if len(used) == 1:
        most = "" if factor else "at most " if clear else "exactly "
        return f"the noise is {most}{instrument.noise(used[0])}{factor}"
    each = "; ".join(f"{one.name}: {instrument.noise(one)}" for one in used)
    most = "at most " if clear and not factor else ""
    return f"the noise is {most}as stated{factor} ({each})"


def told_factor(plan: Plan) -> str:
    """What may be wrong with the noise as stated; empty where it is taken as known."""
    if getattr(plan.assessor, "noise", KNOWN) == KNOWN:
        return ""
    freedom = getattr(plan.assessor, "noise_freedom", 0)
    told = f"{freedom} degrees of freedom of a test" if freedom else "the campaign's own readings"
    return f", but for one factor that {told} tell"


def statement(said: Statement, state: State) -> str:
    """One sentence a person may quote, and what is to be known of its estimate."""
    return " ".join(filter(None, [_statement(said, state), of_the_estimate(said, state)]))


def of_the_estimate(said: Statement, state: State) -> str:
    """That the estimate for all candidates tends to be low while some are not measured."""
    points = len(state.plan.points) - len(state.left_out)
    left = points - _visited(state)
    if said.target != CANDIDATES or math.isnan(said.value_mm) or not left:
        return ""
    unread = f"{left} of {points} {'is' if left == 1 else 'are'} not measured"
    return f"The estimate for all candidates tends to be too low: {unread}."


def _statement(said: Statement, state: State) -> str:
    whose = about(said, state)
    if said.withheld and math.isnan(said.upper_mm):
        seen = ""
        if not math.isnan(said.value_mm):
            seen = f"; it is estimated at {said.value_mm:.3f} mm"
        if not math.isnan(said.lower_mm):
            seen += f", and at least {said.lower_mm:.3f} mm ({_sure(said)})"
        return f"No upper bound for {whose}: {reason(said.withheld)}{seen}."
    if said.excepted and not math.isnan(said.lower_mm):
        return _all_but(said, state)
    parts = [f"at most {said.upper_mm:.3f} mm"] if not math.isnan(said.upper_mm) else []
    if not math.isnan(said.lower_mm):
        parts.append(f"at least {said.lower_mm:.3f} mm")
    value = f"estimated at {said.value_mm:.3f} mm" if not math.isnan(said.value_mm) else ""
    if not parts:
        return f"{whose[0].upper()}{whose[1:]} is {value}; no bound is stated."
    each = "each " if len(parts) > 1 else ""
    text = f"{whose[0].upper()}{whose[1:]} is {' and '.join(parts)}, {each}with {_sure(said)}"
    text += f" ({value})" if value else ""
    text += _meant(said)
    text += f", if {reason(said.assumption)}" if said.assumption else ""
    against = doubt(said, state).replace("The bounds contradict", "They contradict")
    return f"{text}. {against}." if against else f"{text}."


def _all_but(said: Statement, state: State) -> str:
    """The sentence on all candidates but a few that may all have been missed."""
    points = len(state.plan.points) - len(state.left_out)
    return (
        f"All but {said.excepted} of the {points} candidates are off by at most "
        f"{said.upper_mm:.3f} mm, and the largest error of all is at least {said.lower_mm:.3f} mm, "
        f"each with {_sure(said)} (largest estimated at {said.value_mm:.3f} mm){_meant(said)}. "
        f"Which {said.excepted} is not known: with {_visited(state)} of {points} measured, so many "
        "could all have been missed."
    )


def of_the_noise(state: State) -> list[str]:
    """How large the bounds take the noise, where it is not as stated."""
    said = (reason(each.noise) for each in state.statements())
    return list(dict.fromkeys(each for each in said if each is not None))


def suspicious(state: State) -> list[str]:
    """Readings that do not fit the others of their pose, by their number in the journal."""
    found = getattr(state.campaign, "suspicious", tuple)()
    label = state.plan.points.label
    return [
        f"reading {state.told[each.number - 1].number} at point {label[state.rows[each.row]]} lies "
        f"{each.deviations:.1f} standard deviations from the others there: look what happened; "
        "where something went wrong, kinacc campaign strike leaves it out, with the reason"
        for each in found
    ]


def standing(state: State) -> list[str]:
    """How far the campaign is, line by line."""
    budget = state.plan.assessor.measurements
    visited = _visited(state)
    points = len(state.plan.points) - len(state.left_out)
    lines = [
        f"{state.taken} of {budget} readings taken, at {visited} of {points} points"
        if not state.in_hand
        else f"{state.taken} readings taken, {len(state.told)} of {budget} used, at {visited} of "
        f"{points} points; {len(state.in_hand)} in hand, not asked for yet"
    ]
    lines += not_counted(state)
    lines += consistency.remarks(state)
    lines += of_frame(state)
    lines += [*of_the_noise(state), *suspicious(state)]
    if state.asked is not None:
        lines.append(f"measure next: point {state.plan.points.label[state.asked]}")
    elif len(state.told) >= budget:
        lines.append("the budget is spent")
    else:
        lines.append("no further measurement is wanted")
    return lines


def of_frame(state: State) -> list[str]:
    """What reference poses say of the frame, and how large a drift may go unseen."""
    change = state.campaign.change()
    if change is None:
        return []
    unseen = f"a drift of {change.unseen_mm:.3f} mm would be found in half of the cases"
    if not change.is_found:
        return [f"the reference poses show no drift and no step; {unseen}"]
    return [str(reason(change.reason))]


def not_counted(state: State) -> list[str]:
    """Points left out and readings struck, each with the reason given."""
    label = state.plan.points.label
    lines = [f"point {label[p]} was left out: {reason}" for p, reason in state.left_out.items()]
    return lines + [
        f"reading {each.number}, {np.linalg.norm(each.error_mm):.3f} mm at point "
        f"{label[each.reading.point]}, was struck: {reason}"
        for each, reason in state.struck
    ]


def _visited(state: State) -> int:
    return len({each.reading.point for each in state.told})


def target(said: Statement) -> str:
    """What a statement is about, in a table."""
    return target_of(said.target, said.share, said.excepted)


def target_of(named: str, share: float, excepted: int) -> str:
    """The same by what ``campaign_bounds`` holds of a statement."""
    if named == REGION:
        return f"{share:.1%} of the region"
    if excepted:
        return f"all but {excepted} candidate{'s' if excepted > 1 else ''}"
    return TARGETS[named]


def about(said: Statement, state: State) -> str:
    """Whose largest error a statement is on."""
    if said.target == MEASURED:
        visited = _visited(state)
        points = "one measured point" if visited == 1 else f"{visited} measured points"
        return f"the largest error of the {points}"
    if said.target == CANDIDATES:
        points = len(state.plan.points) - len(state.left_out)
        return f"the largest error of all {points} candidates"
    return f"the largest error of {said.share:.1%} of the region"


def _meant(said: Statement) -> str:
    """Which error of a pose is meant, where it is not its mean."""
    if said.error_of == MEAN:
        return ""
    return f", as {FUTURE:.0%} of future visits to the worst pose keep it"


def doubt(said: Statement, state: State) -> str:
    """What the figures of a statement say against it.

    Bounds are the narrowest of several looks, the estimate is of all readings: where it lies above
    the upper bound, that bound is nearly always wrong. Empty where nothing speaks against it.
    """
    if said.upper_mm < said.lower_mm:
        found = "The bounds contradict each other"
    elif said.value_mm > said.upper_mm:
        found = "The estimate lies above the upper bound, which cannot be relied on"
    else:
        return ""
    if consistency.too_near(state):
        return f"{found}: the noise is stated too large, or these are no readings"
    return (
        f"{found}: the noise is stated too small, or this is one of the few campaigns the "
        "confidence allows to be wrong"
    )


def against(said: Sequence[Statement], state: State) -> list[str]:
    """Why the bounds of a campaign are withheld or cannot be relied on, without a full stop."""
    alarms = dict.fromkeys(reason(each) for each in alarmed(said))
    if alarms:
        return [*filter(None, alarms), *suspicious(state)]
    doubts = (doubt(each, state) for each in said)
    return [each for each in (*consistency.contradicted(state), *doubts) if each]


def alarmed(said: Iterable[Statement]) -> list[Reason]:
    """What withholds bounds because readings speak against what these rest on."""
    return [each.withheld for each in said if each.withheld and each.withheld.code in ADVICE]


def _sure(said: Statement) -> str:
    return f"{said.confidence:.0%} confidence"
