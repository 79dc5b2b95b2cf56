"""Statements of assessors and the standing of a campaign, in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from kinacc.assess.statement import CANDIDATES, MEASURED, REGION, Reason, Statement
from kinacc.campaign import consistency, instrument
from kinacc.campaign.plan import Plan
from kinacc.campaign.state import State

_CLEAR_OF_NOISE = 3.0  # standard deviations: larger bounds stay right where the noise is less
TARGETS = {MEASURED: "measured points", CANDIDATES: "all candidates", REGION: "share of the region"}

REASONS = {
    # assumptions
    "drawn_at_random": "the points were drawn at random from the region",
    "crowd": "at least {crowd} of the {points} candidates have an error above the largest divided "
    "by {isolation:g}",
    "smooth": "smooth errors of single joints cause the errors, but for local ones",
    "smooth_and_crowd": "smooth errors of single joints cause the errors, but for local ones; at "
    "least {crowd} candidates have an error above the largest divided by {isolation:g}",
    # of statements withheld
    "nothing_measured": "nothing measured yet",
    "first_visit": "{left} more points of the first visit have to be read before anything is said",
    "first_visit_by_travel": "{left} points of the first visit, made in order of travel, are left",
    "predicted": "every reading ({read}) equals the predicted position to the last digit, which "
    "none of an instrument does: were predictions recorded?",
    "suspects": "the suspects are not all measured again yet",
    "unmeasured": "{left} of {points} candidates are not measured",
    "missed": "{seen} of {points} candidates measured: {crowd} could have been missed",
    "all_missed": "{seen} of {points} candidates measured: fewer than {crowd} large errors could "
    "all have been missed",
    "stands_alone": "one measured error is more than {isolation:g} times all others",
    "few_points": "{read} points read; {share:.0%} of the region needs {needed}",
    "few_sizes": "{read} points read; a distribution needs at least {needed}, of different size",
    "few_for_model": "{first} points in the first visit; the model needs {needed}",
    "much_noise": "noise makes up {part:.0%} of the mean square of the readings",
    "not_gamma": "the largest reading does not belong to a gamma distribution",
    "unexplained_reading": "a reading is farther from what joints explain than local errors are",
    "unexplained_half": "smooth errors of single joints explain less than half of the errors",
    # of budgets that are small
    "no_bound_ahead": "no bound will be stated: that takes {needed} points in the first visit",
    "no_bound_on_all": "no bound on all candidates would ever be stated: that takes {needed} "
    "readings at least",
    "assumption_ahead": "with {enough} readings, the bound on all candidates would need no "
    "assumption",
    # of forecasts that are not made
    "few_read": "{read} points were read, {needed} are needed",
    "not_exchangeable": "simulated errors know nothing of each other, and this assessor rests on "
    "how errors of different poses belong together: see kinacc plan-campaign",
    # of decisions on a tolerance
    "between": "the tolerance lies between lower and upper bound: measure more",
    "contradict": "the bounds contradict each other or the value: is the noise stated too small?",
    "within": "the upper bound is within the tolerance",
    "beyond": "the lower bound exceeds the tolerance",
    "no_upper": "no upper bound is stated",
}


def reason(why: Reason | None) -> str | None:
    """A reason in words; None where there is none."""
    return None if why is None else REASONS[why.code].format(**why.numbers)


def one_of(point: str, targets: Sequence[str]) -> list[str]:
    """Which of several targets a campaign is about, why, and how to mean another."""
    if len(targets) < 2:
        return []
    why = (
        f"the first of {', '.join(targets)}" if point == targets[0] else f"of {', '.join(targets)}"
    )
    return [f"a campaign is about one point: {point}, {why}; --point names another"]


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
    limit = f"is off by more than {said.upper_mm:.3f} mm"
    of_all = {
        MEASURED: f"none of the {_visited(state)} measured points {limit}",
        CANDIDATES: f"none of these {points} candidates {limit}",
        REGION: f"no more than {1.0 - said.share:.1%} of the region {limit}",
    }
    return (
        f"By a procedure whose bound is right in {how_often(said.confidence)}, "
        f"{of_all[said.target]}, if {conditions(said, state)}."
    )


def conditions(said: Statement, state: State) -> str:
    """On what an upper bound hangs."""
    moved = "nothing moved (base, tool, instrument)"
    needed = [reason(said.assumption) or "", _noise_assumed(said, state), moved]
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
    if len(used) == 1:
        return f"the noise is {'at most' if clear else 'exactly'} {instrument.noise(used[0])}"
    each = "; ".join(f"{one.name}: {instrument.noise(one)}" for one in used)
    return f"the noise is {'at most ' if clear else ''}as stated ({each})"


def statement(said: Statement, state: State) -> str:
    """One sentence a person may quote."""
    whose = about(said, state)
    if said.withheld and math.isnan(said.upper_mm):
        seen = ""
        if not math.isnan(said.value_mm):
            seen = f"; it is estimated at {said.value_mm:.3f} mm"
        if not math.isnan(said.lower_mm):
            seen += f", and at least {said.lower_mm:.3f} mm ({_sure(said)})"
        return f"No upper bound for {whose}: {reason(said.withheld)}{seen}."
    parts = [f"at most {said.upper_mm:.3f} mm"] if not math.isnan(said.upper_mm) else []
    if not math.isnan(said.lower_mm):
        parts.append(f"at least {said.lower_mm:.3f} mm")
    value = f"estimated at {said.value_mm:.3f} mm" if not math.isnan(said.value_mm) else ""
    if not parts:
        return f"{whose[0].upper()}{whose[1:]} is {value}; no bound is stated."
    each = "each " if len(parts) > 1 else ""
    text = f"{whose[0].upper()}{whose[1:]} is {' and '.join(parts)}, {each}with {_sure(said)}"
    text += f" ({value})" if value else ""
    text += f", if {reason(said.assumption)}" if said.assumption else ""
    against = doubt(said, state).replace("The bounds contradict", "They contradict")
    return f"{text}. {against}." if against else f"{text}."


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
    if state.asked is not None:
        lines.append(f"measure next: point {state.plan.points.label[state.asked]}")
    elif len(state.told) >= budget:
        lines.append("the budget is spent")
    else:
        lines.append("no further measurement is wanted")
    return lines


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


def against(said: Iterable[Statement], state: State) -> list[str]:
    """Why the bounds of a campaign cannot be relied on, without a full stop."""
    doubts = (doubt(each, state) for each in said)
    return [each for each in (*consistency.contradicted(state), *doubts) if each]


def _sure(said: Statement) -> str:
    return f"{said.confidence:.0%} confidence"
