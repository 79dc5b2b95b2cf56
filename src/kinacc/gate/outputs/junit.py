"""What the gate says as JUnit XML, in what GitLab, Jenkins and Azure Pipelines all read.

A suite is a data set, a test case a gate; GitLab tells suites apart by ``classname``. A gate that
warns or cannot tell is a case that was skipped, with the verdict before its message: all three
count skipped cases apart and fail no build for them, while a case that passed shows nothing of its
words unless one opens it. What a gate says stands in the attribute and in the text: GitLab shows
the text, the others lead with the attribute.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from kinacc.gate.outcome import FAILED, PASSED, Outcome, Verdicts
from kinacc.gate.outputs import told

_WHOLE = "results"  # the suite of what is said of no single data set


def as_junit(verdicts: Verdicts) -> str:
    """An XML document: ``testsuites``, a suite for each data set, a case for each gate."""
    root = ElementTree.Element("testsuites", {"name": "kinacc gate", **_counts(verdicts.outcomes)})
    by_dataset: dict[str, list[Outcome]] = {}
    for each in verdicts.outcomes:
        by_dataset.setdefault(each.dataset or _WHOLE, []).append(each)
    for dataset, outcomes in by_dataset.items():
        suite = ElementTree.SubElement(
            root, "testsuite", {"name": told.line(dataset), **_counts(outcomes)}
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
    about = {
        "classname": told.line(f"kinacc.{dataset}"),
        "name": told.line(outcome.name),
        "time": "0",
    }
    if outcome.file:
        about["file"] = told.line(outcome.file)
    case = ElementTree.SubElement(suite, "testcase", about)
    if outcome.verdict == PASSED:
        ElementTree.SubElement(case, "system-out").text = told.line(outcome.says)
    elif outcome.verdict == FAILED:
        failure = {"message": told.line(outcome.says), "type": told.line(outcome.kind)}
        ElementTree.SubElement(case, "failure", failure).text = _body(outcome)
    else:
        message = told.line(f"{outcome.verdict}: {told.said(outcome)}")
        ElementTree.SubElement(case, "skipped", {"message": message}).text = _body(outcome)


def _body(outcome: Outcome) -> str:
    """What stands below the message: differences by cause, and what to do."""
    lines = [outcome.says]
    for cause, differences in told.by_cause(outcome.differences):
        lines += [cause, *(f"- {each}" for each in differences)]
    lines += [f"What to do: {outcome.fix}"] if outcome.fix else []
    return "\n".join(map(told.line, lines))
