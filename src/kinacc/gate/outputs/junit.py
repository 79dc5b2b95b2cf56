"""What the gate says as JUnit XML, in what GitLab, Jenkins and Azure Pipelines all read.

A suite is a data set, a test case a gate. A gate that warns or cannot tell is a case that was
skipped: of these servers all count skipped cases apart, show their message and let the build pass,
and none shows what a case that passed has printed. The message begins with the verdict itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from xml.etree import ElementTree

from kinacc.gate.outcome import FAILED, PASSED, Outcome, Verdicts
from kinacc.gate.outputs import told

_NO_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_WHOLE = "results"  # the suite of what is said of no single data set


def as_junit(verdicts: Verdicts) -> str:
    """An XML document: ``testsuites``, a suite for each data set, a case for each gate."""
    root = ElementTree.Element("testsuites", {"name": "kinacc gate", **_counts(verdicts.outcomes)})
    by_dataset: dict[str, list[Outcome]] = {}
    for each in verdicts.outcomes:
        by_dataset.setdefault(each.dataset or _WHOLE, []).append(each)
    for dataset, outcomes in by_dataset.items():
        suite = ElementTree.SubElement(
            root, "testsuite", {"name": _text(dataset), **_counts(outcomes)}
        )
        for each in outcomes:
            _case(suite, dataset, each)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, "unicode")}\n'


def _counts(outcomes: Iterable[Outcome]) -> dict[str, str]:
    verdicts = [each.verdict for each in outcomes]
    failed, passed = verdicts.count(FAILED), verdicts.count(PASSED)
    numbers = {"tests": len(verdicts), "failures": failed, "errors": 0}
    numbers["skipped"] = len(verdicts) - failed - passed
    return {**{name: str(number) for name, number in numbers.items()}, "time": "0"}


def _case(suite: ElementTree.Element, dataset: str, outcome: Outcome) -> None:
    about = {"classname": _text(f"kinacc.{dataset}"), "name": _text(outcome.name), "time": "0"}
    if outcome.file:
        about["file"] = _text(outcome.file)
    case = ElementTree.SubElement(suite, "testcase", about)
    if outcome.verdict == PASSED:
        ElementTree.SubElement(case, "system-out").text = _text(outcome.says)
    elif outcome.verdict == FAILED:
        failure = {"message": _text(outcome.says), "type": _text(outcome.kind)}
        ElementTree.SubElement(case, "failure", failure).text = _body(outcome)
    else:
        message = _text(f"{outcome.verdict}: {outcome.says}")
        ElementTree.SubElement(case, "skipped", {"message": message}).text = _body(outcome)


def _body(outcome: Outcome) -> str:
    """What stands below the message: differences by cause, and what to do."""
    lines = [outcome.says]
    for cause, differences in told.by_cause(outcome.differences):
        lines += [cause, *(f"- {each}" for each in differences)]
    lines += [f"What to do: {outcome.fix}"] if outcome.fix else []
    return "\n".join(map(_text, lines))


def _text(text: str) -> str:
    """Characters that XML knows, on one line."""
    return _NO_XML.sub("\ufffd", told.line(text))
