"""A measuring campaign: a section of a data set's report, and a page of its own."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence

import numpy as np

from kinacc.assess.conformity import ACCEPT, REJECT, decide
from kinacc.assess.statement import Statement
from kinacc.campaign import consistency, folder, nearness, words
from kinacc.campaign.folder import Opened
from kinacc.campaign.reasons import ADVICE
from kinacc.campaign.report import facts, grounds, made_of, read_above
from kinacc.campaign.state import State
from kinacc.config.error_models import model_name
from kinacc.report.campaign_answers import against, answers, leading, sentence
from kinacc.report.campaign_course import course, mm, scatter
from kinacc.report.campaign_points import points, readings
from kinacc.report.page import ROBOT_ITSELF, FirstScreen, Page, Section, Table, Text
from kinacc.tables.columns import Columns

_MODEL_ERROR = f"This is the error of the model at these poses: {ROBOT_ITSELF}."
_VERDICTS = {ACCEPT: "MODEL WITHIN", REJECT: "MODEL BEYOND"}


def section(state: State, tables: Mapping[str, Columns], key: str) -> Section:
    """A campaign as one section of another page, by the tables of ``campaign.report.tables``.

    ``key`` tells several campaigns on one page apart.
    """
    about = state.plan.about
    return Section(
        key,
        "Campaign",
        f"the {about['point']} at {_population(state)}; no other poses, and none of the held-out "
        "rows",
        "What readings at poses drawn beforehand allow to say of the largest error there.",
        "Good: bounds that close in as readings come, with the estimate between them. Bad: bounds "
        "that cross, or readings within a block that scatter more than the noise stated.",
        "Go on while points are asked for; where the bounds cannot be relied on, look at the noise "
        "and at what may have moved before you believe them.",
        (
            *(Text(words.pledge(each, state)) for each in words.distinct(state)),
            *course(state, tables, key),
            *points(state, tables, key),
            *readings(state, tables, key),
            *scatter(state, key),
        ),
    )


def _sections(state: State, tables: Mapping[str, Columns]) -> tuple[Section, ...]:
    """A campaign as sections of a page of its own."""
    whom = _population(state)
    return (
        Section(
            "course",
            "The bounds as they grew",
            f"the largest error of {whom}",
            "What could be said after each number of readings: at most, at least, the estimate.",
            "Good: the bounds close in and the estimate stays between them. Bad: a jump late (a "
            "large error was found late), bounds that cross (the noise is not as stated, or "
            "something moved).",
            "Bounds that are too far apart at the end take more readings: kinacc plan-campaign "
            "says how many a new campaign needs.",
            (*_nearness(state), *course(state, tables, "course")),
        ),
        Section(
            "points",
            "Errors by point",
            f"{int((np.asarray(tables['campaign_points']['readings']) > 0).sum())} measured points "
            f"of {whom}",
            "The distance between where the model says the point is and the mean of what was read "
            "there, with the limits on what stays when the pose is measured again.",
            "Good: the largest differ little from the next ones. Bad: one point far above all, or "
            "large errors together in one place or at one end of a joint.",
            "Look at the largest: how was the target seen there, did the arm come from another "
            "side? Large errors in one region: calibrate with more poses there.",
            points(state, tables, "points"),
        ),
        Section(
            "readings",
            "Readings",
            f"{len(tables['campaign_readings']['reading'])} readings, those struck and not used "
            "included",
            "Every reading in the order in which it was taken, by instrument.",
            "Good: the same picture from the first to the last, whatever the instrument. Bad: a "
            "step or a slope (something moved, warmed up), one instrument above the others. Points "
            "that come again towards the end are large because the largest are read again.",
            "Where there is a step, find out what happened between the two readings. Strike a "
            "reading that went wrong (kinacc campaign strike), with the reason, never for its "
            "size.",
            readings(state, tables, "readings"),
        ),
        Section(
            "noise",
            "Noise as stated, and as seen",
            "readings within a block (those that one decision had taken at one point), but the "
            "first of each",
            "How far readings lie from the mean of those before in their block, over what the "
            "noise stated brings: 1 on average where it is as stated.",
            "Good: around 1, few above the dotted line, no trend. Bad: most above 1 (the noise is "
            "stated too small), a rise over the readings (something moves).",
            "Noise stated too small makes the bounds wrong: begin a new campaign with the noise as "
            "it is. Stated too large, it makes them wider than they need be.",
            scatter(state, "noise"),
        ),
    )


def _nearness(state: State) -> tuple[Text, ...]:
    """How near the bounds are, and how near they could be, a sentence each."""
    return _lines([line for head, told in nearness.told(state) for line in (f"{head}:", *told)])


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
        (*told, *low, _MODEL_ERROR),
        (_statements(state, said),),
        _notes(opened, state, tables, said, lead),
    )
    made = {name: str(value) for name, value in folder.marks_of(opened).items()}
    return Page(first, (*_sections(state, tables), _grounds(opened, state)), made)


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
    heads = ("of", "at most", "estimate", "at least", "each bound is right in")
    rows = []
    for each in said:
        about = words.target(each)
        sure = np.isfinite(each.confidence) and not doubtful
        right = words.how_often(each.confidence) if sure else "-"
        sizes = (mm(size) for size in (each.upper_mm, each.value_mm, each.lower_mm))
        verdict = () if tolerance is None else (decide(each, tolerance).verdict,)
        rows.append((about, *sizes, right, *verdict))
    if tolerance is not None:
        heads = (*heads, f"tolerance {tolerance:g} mm")
    return Table("The largest error, mm", heads, tuple(rows), numeric=frozenset({1, 2, 3}))


def _notes(
    opened: Opened,
    state: State,
    tables: Mapping[str, Columns],
    said: Sequence[Statement],
    lead: Statement,
) -> tuple[tuple[str, tuple[Text, ...]], ...]:
    about, plan = state.plan.about, state.plan
    check = [
        *folder.doubts(opened),
        *words.begun_against(plan),
        *read_above(state, tables["campaign_points"]),
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
        "NOISE": () if consistency.contradicted(state) else _lines([noise]),
        "VALID": _lines(valid),
        "OPEN": _lines(unsaid),
        "NEXT": _next(opened, state, said, lead),
    }
    return tuple((name, texts) for name, texts in notes.items() if texts)


def _next(
    opened: Opened, state: State, said: Sequence[Statement], lead: Statement
) -> tuple[Text, ...]:
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
        return (
            *_lines([why]),
            Text(f"kinacc campaign next {folder}", code=True),
        )
    if limits.tolerance_mm is None:
        said_now = "nothing more is asked for; to hold it to a tolerance:"
        command = f"kinacc campaign status {folder} --tolerance-mm MM"
        return *_lines([said_now]), Text(command, code=True)
    done = {
        ACCEPT: "nothing: what was asked is kept at these candidates",
        REJECT: "the tolerance is not kept: calibrate with more poses, or with another model, and "
        "begin a new campaign",
    }
    if (verdict := decide(lead, limits.tolerance_mm).verdict) in done:
        return _lines([done[verdict]])
    more = (
        "no decision: a new campaign with a larger budget, on candidates drawn anew; how large, "
        "kinacc plan-campaign says"
    )
    return _lines([more])


def _lines(lines: Sequence[str]) -> tuple[Text, ...]:
    return tuple(Text(sentence(each)) for each in lines)


def _grounds(opened: Opened, state: State) -> Section:
    """What the bounds rest on, and what was measured with what."""
    return Section(
        "grounds",
        "What the bounds rest on",
        "; ".join(made_of(opened, state)[:2]),
        "The conditions of every statement on this page, and how the campaign was fixed before its "
        "first reading.",
        "Good: each of them holds in your cell. Bad: one that does not; the bounds then say "
        "nothing.",
        "Read them against how you measured; the tables beside this page (kinacc campaign report) "
        "hold every number.",
        (
            *_lines(grounds(state)),
            Table(
                "How it was measured",
                ("what was fixed, and what was taken",),
                tuple((sentence(each),) for each in facts(opened, state, str)),
            ),
        ),
    )
