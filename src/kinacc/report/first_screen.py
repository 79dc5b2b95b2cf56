"""The first screen of a data set's page: how good, how sure, what next."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from kinacc.artifacts.allowed import FINDING_LEVELS
from kinacc.artifacts.error_models import model_name
from kinacc.calibration.summary import LARGE_SHARE, Fact, of
from kinacc.calibration.summary_words import counted, model_called, texts_of
from kinacc.report.page import FirstScreen, Table, Text

_FIGURES = {"mean": "mean", "quantile_99": f"{LARGE_SHARE:.0%}", "largest": "largest"}
_OF_THE_PAPER = {"claims": "CLAIMS", "differ": "DIFFER"}
_NO_CAMPAIGN = ("Largest error: not assessed (no campaign).", "Tolerance: none set.")
_NOTES = {
    "excluded": "EXCLUDED",
    "selected": "SELECTED",
    "bending": "BENDING",
    "valid where": "VALID",
    "undetermined": "OPEN",
}


@dataclass(frozen=True)
class Answers:
    """What is to be told beside the facts: texts, and commands that follow.

    ``claims`` on the paper by name, ``other`` errors of other populations, ``largest`` what there
    is to say of the largest error, ``campaign`` the sentences of a campaign, none without one;
    ``outdated`` tables are not shown.
    """

    claims: Mapping[str, Sequence[str]]
    other: Sequence[str]
    largest: Sequence[str]
    campaign: Sequence[str]
    following: Sequence[str]
    outdated: Sequence[str]
    more: str


def screen(
    name: str, robot: str, facts: Sequence[Fact], remedies: Sequence[str], answers: Answers
) -> FirstScreen:
    """The first screen on the facts of a calibration; ``remedies`` are for what the data lack."""
    data = of(facts, "data")["measurements"]
    synthetic = data["source"].text == "synthetic"
    full = bool(of(facts, "held_out_orientation_error"))
    about = {
        "poses": counted(data["poses"].value, "pose"),
        "readings": counted(data["readings"].value, "reading"),
        "kind": "full pose" if full else "position",
        "of": "of a synthetic arm: no measurement" if synthetic else "measured",
    }
    if data["poses"].value == data["readings"].value:
        del about["readings"]
    return FirstScreen(
        name if name == robot else f"{robot} “{name}”",
        ", ".join(about.values()),
        _badge(facts, synthetic),
        tuple(_sentences(facts, answers)),
        _errors(facts),
        tuple(_notes(facts, remedies, answers)),
    )


def _badge(facts: Sequence[Fact], synthetic: bool) -> tuple[str, bool]:
    """What the check of the data found, in two or three words."""
    if synthetic:
        return "SYNTHETIC ARM", False
    found = [each for each in facts if each.topic == "check"]
    if not found:
        return "DATA: not checked", True
    doubts = [each for each in found if each.text and each.statistic != FINDING_LEVELS[-1]]
    if not doubts:
        return "DATA: nothing suspicious", False
    return f"DATA: {counted(len(doubts), 'problem')}", True


def _sentences(facts: Sequence[Fact], answers: Answers) -> list[str]:
    chosen = of(facts, "selection")
    best = next(model for model, known in chosen.items() if known["selected"].value)
    held_out, trained = of(facts, "held_out_error"), of(facts, "training_error")
    figures = (held_out or trained)[best]
    whom = "poses no fit has seen" if held_out else "the poses it was fitted to"
    size = {key: figures[key].value for key in _FIGURES}
    digits = _decimals([size["mean"]])
    rows = counted(figures["n"].value, "held-out row")
    lines = [
        f"The calibrated model ({model_name(best)}) misses {whom} by {size['mean']:.{digits}f} "
        f"mm on average, {LARGE_SHARE:.0%} of them by less than {size['quantile_99']:.{digits}f} "
        "mm.",
    ]
    if held_out:
        lines.append(
            f"Observed on {rows}; it says nothing of poses elsewhere. This is the error of the "
            "model: the robot improves only once the calibration is loaded or used to compensate."
        )
    else:
        lines.append("No pose was held out: errors at other poses are larger, and unknown.")
    return lines + (list(answers.campaign) or list(_NO_CAMPAIGN))


def _errors(facts: Sequence[Fact]) -> tuple[Table, ...]:
    """Errors of every model at the same rows, position and, where measured, orientation."""
    held_out = of(facts, "held_out_error")
    errors = held_out or of(facts, "training_error")
    turned = of(facts, "held_out_orientation_error") if held_out else {}
    chosen = of(facts, "selection")
    count = next(iter(errors.values()))["n"].value
    where = "poses left out of the fit" if held_out else "poses that were fitted"
    heads = ["model", *(f"{words}, mm" for words in _FIGURES.values())]
    heads += [f"{words}, mrad" for words in _FIGURES.values()] if turned else []
    digits = _decimals([figures["mean"].value for figures in errors.values()])
    turned_digits = _decimals([figures["mean"].value for figures in turned.values()])
    rows, marked = [], {}
    for number, (model, figures) in enumerate(errors.items()):
        cells = [model_called(facts, model)]
        cells += [f"{figures[key].value:.{digits}f}" for key in _FIGURES]
        if turned:
            known = turned.get(model, {})
            cells += [
                f"{known[key].value:.{turned_digits}f}" if key in known else "" for key in _FIGURES
            ]
        rows.append(tuple(cells))
        if model in chosen and chosen[model]["selected"].value:
            marked[number] = "selected"
    caption = f"Error at {where}, the same {counted(count, 'row')} for every model"
    if turned:
        caption += "; position in mm, orientation in mrad"
    return (Table(caption, tuple(heads), tuple(rows), frozenset(range(1, len(heads))), marked),)


def _decimals(means: Sequence[float]) -> int:
    """Decimals that leave the smallest mean two digits, two at least."""
    smallest = min((each for each in means if each > 0.0), default=1.0)
    return max(2, 1 - math.floor(math.log10(smallest)))


def _notes(
    facts: Sequence[Fact], remedies: Sequence[str], answers: Answers
) -> list[tuple[str, tuple[Text, ...]]]:
    """Lines under names in capitals; commands stand as code."""
    told = texts_of(facts, answers.more)
    notes = [(_OF_THE_PAPER[key], answers.claims[key]) for key in _OF_THE_PAPER if answers.claims]
    notes.append(("CHECK", told["check"]))
    if answers.outdated:
        names = ", ".join(answers.outdated)
        words = f"{names}: made from other tables than those here, so not shown"
        notes.append(("LEFT OUT", [words, "kinacc check-results says what to run"]))
    largest = list(answers.largest)
    if answers.campaign:
        notes.append(("LARGEST ERROR", largest))
        largest = []
    largest = [
        re.sub("^not assessed", "the largest error is not assessed", each) for each in largest
    ]
    notes.append(("NEXT", [*remedies, *largest, *answers.following]))
    notes += [(word, told[key]) for key, word in _NOTES.items()]
    notes.append(("OTHER ERRORS", answers.other))
    return [(name, tuple(_text(each) for each in texts)) for name, texts in notes if texts]


def _text(words: str) -> Text:
    words = re.sub("\u00a0{2,}", "; ", words)  # columns of a terminal
    return Text(words, code=words.startswith("kinacc ") and not words.startswith("kinacc check-r"))
