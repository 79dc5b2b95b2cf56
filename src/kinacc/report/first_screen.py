"""The first screen of a data set's page: how good, how sure, what next."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from kinacc.calibration.summary import LARGE_SHARE, Fact, of
from kinacc.calibration.summary_words import counted, model_called, texts_of
from kinacc.config.error_models import NOMINAL, model_name
from kinacc.report.page import FirstScreen, Part, Text, printed
from kinacc.tables.allowed import FINDING_LEVELS, LEFT_OUT
from kinacc.tables.columns import Columns

_OF_THE_PAPER = {"claims": "CLAIMS", "differ": "DIFFER"}
_ACCEPTED = "; accepted: "  # in front of the reason, where a finding was accepted
_FOR = {  # commands that follow, and what they are for
    "export": "files of the model for controllers and simulators:",
    "compensate": "joints that put the tool at a pose:",
    "campaign": "to go on with the campaign:",
}
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
    ``outdated`` tables are not shown, ``reason`` is why all results are outdated, empty where they
    are not; ``tolerance`` says whether that of the configuration is kept, where the campaign does
    not; ``history`` is what a series says of the one in force.
    """

    claims: Mapping[str, Sequence[str]]
    other: Sequence[str]
    largest: Sequence[str]
    campaign: Sequence[str]
    following: Sequence[str]
    outdated: Sequence[str]
    more: str
    tolerance: str = ""
    history: str = ""
    reason: str = ""


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
        "kind": "full pose" if full else "positions only",
        "of": "of a synthetic arm: no measurement" if synthetic else "measured",
    }
    if data["poses"].value == data["readings"].value:
        del about["readings"]
    errors = of(facts, "held_out_error") or of(facts, "training_error")
    rows = [_model(facts, model, known) for model, known in errors.items()]
    best = next(each for each in rows if "remark" in each)
    values = {
        "rows": rows,
        "best": best,
        "nominal": next(each for each in rows if each["model"] == NOMINAL),
        "held_out": bool(of(facts, "held_out_error")),
        "fitted": bool(of(facts, "robot")["base and tool"]["fitted"].value),
        "answers": answers,
        "share": LARGE_SHARE,
        "digits": _decimals([each["mean"] for each in rows]),
        "digits_best": _decimals([best["mean"]]),
        "digits_turned": _decimals([each["turned_mean"] for each in rows if "turned_mean" in each]),
    }
    return FirstScreen(
        name if name == robot else f"{robot} “{name}”",
        ", ".join(about.values()),
        _badge(facts, synthetic),
        notes=tuple(_notes(facts, remedies, answers)),
        answer=Part("first", values),
    )


def _model(facts: Sequence[Fact], model: str, errors: Mapping[str, Fact]) -> dict:
    """Errors of a model, held out where poses were; ``turned_`` those of orientation, mrad."""
    row = {"model": model, "called": model_called(facts, model), "name": model_name(model)}
    row |= {name: each.value for name, each in errors.items()}
    if of(facts, "held_out_error"):
        turned = of(facts, "held_out_orientation_error").get(model, {})
        row |= {f"turned_{name}": each.value for name, each in turned.items()}
    known = of(facts, "selection").get(model, {})
    return row | ({"remark": "selected"} if known and known["selected"].value else {})


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
    left = [each for each in doubts if _ACCEPTED not in each.text]
    if not left:
        return f"DATA: {counted(len(doubts), 'problem')}, accepted", False
    return f"DATA: {counted(len(left), 'problem')}", True


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
    data = [_of_delivered(each) for each in told["data"][1:]]  # the first stands in the title
    notes.append(("DATA", data))
    notes.append(("CHECK", [*_sized_by(told["check"]), *map(_without_code, told["check"])]))
    if answers.reason:
        notes.insert(0, ("OUTDATED", [answers.reason, "run kinacc calibrate again"]))
    if answers.outdated:
        names = ", ".join(answers.outdated)
        words = f"{names}: made from other tables than those here, so not shown"
        notes.append(("LEFT OUT", [words, "kinacc check-results says what to run"]))
    largest = list(answers.largest)
    if answers.campaign:
        notes.append(("CAMPAIGN", largest[1:]))  # what may be said stands above
        largest = []
    largest = [
        re.sub("^not assessed", "the largest error is not assessed", each) for each in largest
    ]
    first = [f"{'then' if i else 'first'}, {each}" for i, each in enumerate(remedies)]
    notes.append(("NEXT", [*first, *largest, *_captioned(answers.following)]))
    notes += [(word, told[key]) for key, word in _NOTES.items()]
    notes.append(("OTHER ERRORS", answers.other))
    return [(name, tuple(_text(each) for each in texts)) for name, texts in notes if texts]


def _without_code(finding: str) -> str:
    """A finding whose name is written as words."""
    name, colon, rest = finding.partition(":")
    return f"{name.replace('_', ' ')}{colon}{rest}" if name.isidentifier() else finding


def _sized_by(findings: Sequence[str]) -> list[str]:
    """Whose errors the check speaks of, where it does: they are not those of the table."""
    if not any(" mm" in each for each in findings):
        return []
    return ["by a quick fit of its own, whose errors are not those of the models above:"]


def _of_delivered(words: str) -> str:
    """What is said of the models, told from the fits that judge them in turn."""
    return words.replace("models fitted to", "the models delivered are fitted to", 1)


def _captioned(commands: Sequence[str]) -> Iterator[str]:
    """Commands, each below what it is for."""
    for each in commands:
        words = each.split()
        if len(words) > 1 and words[1] in _FOR:
            yield _FOR[words[1]]
        yield each


def _text(words: str) -> Text:
    return Text(
        printed(words), code=words.startswith("kinacc ") and not words.startswith("kinacc check-r")
    )


def remedies(found: Columns | None) -> list[str]:
    """What to do about findings of the data check that nobody accepted."""
    if found is None:
        return []
    columns = (found[name] for name in ("level", "lines", "fix", "accepted"))
    return [
        ": ".join(str(each) for each in (lines, fix) if each)
        for level, lines, fix, accepted in zip(*columns, strict=True)
        if level not in (FINDING_LEVELS[-1], LEFT_OUT) and fix and not accepted
    ]
