"""A measuring campaign: a section of a data set's report, and a page of its own."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from kinacc.assess.conformity import ACCEPT, REJECT, decide
from kinacc.assess.statement import Statement
from kinacc.campaign import consistency, folder, instrument, nearness, words
from kinacc.campaign.folder import Opened
from kinacc.campaign.reasons import ADVICE
from kinacc.campaign.report import facts, grounds, made_of
from kinacc.campaign.state import State
from kinacc.config.error_models import model_name
from kinacc.figures import campaign as drawing
from kinacc.report.campaign_answers import against, answers, leading, sentence
from kinacc.report.page import FirstScreen, Page, Part, Table, environment
from kinacc.tables.columns import Columns

_MODEL_ERROR = "This is the error of the model at these poses; the robot itself is not changed."
_VERDICTS = {ACCEPT: "MODEL WITHIN", REJECT: "MODEL BEYOND"}
_LARGEST, _MOST_ROWS = 10, 300


def section(opened: Opened, state: State, tables: Mapping[str, Columns]) -> Part:
    """A campaign as a section of a page, by the tables of ``campaign.report.tables``."""
    points = pd.DataFrame(dict(tables["campaign_points"]))
    readings = pd.DataFrame(dict(tables["campaign_readings"]))
    measured = points.dropna(subset="error_mm").sort_values(
        "error_mm", ascending=False, kind="stable"
    )
    bounds, limits = tables["campaign_bounds"], state.plan.limits
    label = state.plan.about["calibration"]
    figures = {}
    if len(readings):
        figures["bounds"] = drawing.draw(
            tables["campaign_points"], bounds, len(state.plan.route), limits.tolerance_mm, label
        )
        figures["readings"] = drawing.readings(tables["campaign_readings"], limits.tolerance_mm)
    struck = readings["struck"].notna()
    values = {
        "whom": _population(state),
        "point": state.plan.about["point"],
        "pledges": [words.pledge(each, state) for each in words.distinct(state)],
        "near": [line for head, told in nearness.told(state) for line in (f"{head}:", *told)],
        "largest": measured[:_LARGEST].to_dict("records"),
        "every": measured[:_MOST_ROWS].to_dict("records"),
        "measured": len(measured),
        "left_out": points[points["left_out"].notna()].to_dict("records"),
        "struck": readings[struck].to_dict("records"),
        "instruments": _instruments(state, readings, struck),
        "scatter": consistency.remarks(state),
        "grounds": list(map(sentence, grounds(state))),
        "facts": [{"fact": sentence(each)} for each in facts(opened, state)],
        "made_of": made_of(opened, state)[:2],
    }  # fmt: skip
    return Part("campaign", values, figures=figures)


def markdown(opened: Opened, state: State, tables: Mapping[str, Columns], picture: str) -> str:
    """The report as text, by the same values as the page."""
    tolerance = state.plan.limits.tolerance_mm
    verdicts = (
        []
        if tolerance is None
        else [(words.target(each), decide(each, tolerance)) for each in state.statements()]
    )
    more = {
        "about": state.plan.about,
        "statements": words.statements(state),
        "begun_against": words.begun_against(state.plan),
        "tolerance_mm": tolerance,
        "verdicts": [(target, each, words.reason(each.reason)) for target, each in verdicts],
        "picture": picture,
        "made_of_all": made_of(opened, state),
    }
    values = section(opened, state, tables).values | more
    return environment().get_template("campaign.md").render(values)


def _instruments(state: State, readings: pd.DataFrame, struck: pd.Series) -> list[dict]:
    """Readings by instrument, and the scatter of repeats over the noise stated."""
    apart = consistency.deviations(state)
    known = {each.number: each.reading.instrument for each in (*state.told, *state.in_hand)}
    rows = []
    for each in state.plan.instruments:
        mine = readings["instrument"] == each.name
        used = readings["error_mm"][mine & ~struck & readings["used"].notna()]
        own = [n for n, name in known.items() if name == each.name and n in apart]
        repeats = np.array([apart[n] for n in own])
        rows.append(
            {
                "name": each.name,
                "noise": instrument.noise(each),
                "used": len(used),
                "waiting": int((mine & ~struck & readings["used"].isna()).sum()),
                "struck": int((mine & struck).sum()),
                "mean": used.mean(),
                "largest": used.max(),
                "repeats": len(repeats),
                "scatter": np.sqrt(np.mean(repeats**2)) if len(repeats) else np.nan,
            }
        )
    return rows


def _population(state: State) -> str:
    """The candidates a campaign is about, in words."""
    count = len(state.plan.points) - len(state.left_out)
    return f"these {count} candidates ({state.plan.about['candidates']})"


def campaign_page(opened: Opened, state: State, tables: Mapping[str, Columns]) -> Page:
    """The page of a campaign, by the state and the tables of ``campaign.report.tables``."""
    about, plan = state.plan.about, state.plan
    said = words.distinct(state)
    lead, told = leading(state, said), answers(state)
    estimates = (words.of_the_estimate(each, state) for each in said)
    low = [each for each in estimates if each not in " ".join(told)]  # none is in every text
    visited = len({each.reading.point for each in state.told})
    candidates = len(plan.points) - len(state.left_out)
    first = FirstScreen(
        f"Largest error of the {model_name(about['model'])} model of {about['robot']}",
        f"calibration {about['calibration']}, {about['point']}; "
        f"{len(state.told)} of {plan.assessor.measurements} readings, at {visited} of {candidates} "
        "candidates",
        _badge(state, said, lead),
        [*told, *low, _MODEL_ERROR],
        [_statements(state, said)],
        _notes(opened, state, tables, said, lead),
    )
    made = {name: str(value) for name, value in folder.marks_of(opened).items()}
    return Page(first, [section(opened, state, tables)], made)


def _badge(state: State, said: Sequence[Statement], lead: Statement) -> tuple[str, bool]:
    tolerance = state.plan.limits.tolerance_mm
    if against(state, said):
        return "NO BOUND" if np.isnan(lead.upper_mm) else "BOUND IN DOUBT", True
    if tolerance is not None and (verdict := decide(lead, tolerance).verdict) in _VERDICTS:
        return f"{_VERDICTS[verdict]} {tolerance:g} mm", verdict != ACCEPT
    if np.isnan(lead.upper_mm):
        return "NO BOUND YET", True
    return ("tolerance: none set", False) if tolerance is None else ("UNDECIDED", True)


def _statements(state: State, said: Sequence[Statement]) -> Table:
    tolerance = state.plan.limits.tolerance_mm
    doubtful = against(state, said)
    rows = []
    for each in said:
        sure = np.isfinite(each.confidence) and not doubtful
        row = {
            "of": words.target(each),
            "upper": each.upper_mm,
            "value": each.value_mm,
            "lower": each.lower_mm,
            "right": words.how_often(each.confidence) if sure else None,
        }
        rows.append(
            row if tolerance is None else row | {"verdict": decide(each, tolerance).verdict}
        )
    columns = [["of", "of"], ["at most", "upper", ".3f"], ["estimate", "value", ".3f"],
               ["at least", "lower", ".3f"], ["each bound is right in", "right"]]  # fmt: skip
    if tolerance is not None:
        columns.append([f"tolerance {tolerance:g} mm", "verdict"])
    return Table("The largest error, mm", rows, columns)


def _notes(
    opened: Opened,
    state: State,
    tables: Mapping[str, Columns],
    said: Sequence[Statement],
    lead: Statement,
) -> dict[str, list[str]]:
    about, plan = state.plan.about, state.plan
    check = [
        *folder.doubts(opened),
        *words.begun_against(plan),
    ]
    if state.in_hand:
        check.append(f"{len(state.in_hand)} readings were not asked for yet and are not used")
    noise = "no point was read twice in a row: nothing holds the noise stated to readings"
    seen = consistency.remarks(state) or ([] if words.of_the_noise(state) else [noise])
    noise = "; ".join([*seen, *words.of_the_noise(state)])
    valid = [
        f"only for {_population(state)}; nothing is said of other poses",
        f"off by: distance from measured to modelled position of the {about['point']}",
    ]
    unsaid = [
        words.statement(each, state)
        for each in said
        if each is not lead and np.isnan(each.upper_mm)
    ]
    unsaid += words.not_counted(state)
    notes = {
        "CHECK": _lines(check),
        "NOISE": [] if consistency.contradicted(state) else _lines([noise]),
        "VALID": _lines(valid),
        "OPEN": _lines(unsaid),
        "NEXT": _next(opened, state, said, lead),
    }
    return notes


def _next(opened: Opened, state: State, said: Sequence[Statement], lead: Statement) -> list[str]:
    """What to do now."""
    folder, limits = shlex.quote(str(opened.folder)), state.plan.limits
    if alarms := words.alarmed(said):
        return _lines(list(dict.fromkeys(ADVICE[each.code] for each in alarms)))
    if against(state, said):
        return _lines(
            [
                "find out whether something moved or the noise was stated too small; then begin a "
                "new campaign with the noise as it is"
            ]
        )
    if state.asked is not None:
        left = state.plan.assessor.measurements - len(state.told)
        label = state.plan.points.label[state.asked]
        why = f"measure point {label}; {left} readings are left"
        if (
            limits.tolerance_mm is not None
            and decide(lead, limits.tolerance_mm).verdict in _VERDICTS
        ):
            why = f"the tolerance is decided: you may end here, or narrow the bounds: {why}"
        return [*_lines([why]), f"kinacc campaign next {folder}"]
    if limits.tolerance_mm is None:
        said_now = "nothing more is asked for; to hold it to a tolerance:"
        command = f"kinacc campaign status {folder} --tolerance-mm MM"
        return [*_lines([said_now]), command]
    done = {
        ACCEPT: "nothing: what was asked is kept at these candidates",
        REJECT: "the tolerance is not kept: calibrate with more poses, or with another model, and "
        "begin a new campaign",
    }
    if (verdict := decide(lead, limits.tolerance_mm).verdict) in done:
        return _lines([done[verdict]])
    more = (
        "no decision: a new campaign with a larger budget, on candidates drawn anew; how large, "
        "kinacc campaign plan says"
    )
    return _lines([more])


def _lines(lines: Sequence[str]) -> list[str]:
    return list(map(sentence, lines))
