"""What did not pass, in the forms in which build servers show it beside a file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import replace

from kinacc.gate.outcome import FAILED, PASSED, Outcome, Verdicts
from kinacc.gate.outputs import told

_LONGEST = 2_000  # characters of a message that is told beside a file
_MOST = 50  # GitHub shows so many of a job


def annotated(verdicts: Verdicts, dialect: str) -> list[str]:
    """Lines to print: one for each gate that did not pass, failed first.

    ``dialect``: one of DIALECTS. That of GitLab is a file (Code Quality), in one line.
    """
    found = [
        replace(each, file=told.line(told.file_of(each, verdicts)))
        for each in told.ordered(verdicts.outcomes)
        if each.verdict != PASSED
    ]
    return DIALECTS[dialect](found)


def _message(outcome: Outcome) -> str:
    causes = [cause for cause, _ in told.by_cause(outcome.differences)]
    parts = [outcome.says, *causes, outcome.fix]
    return told.line(" -- ".join(filter(None, parts)))[:_LONGEST]


def _level(outcome: Outcome) -> str:
    return "error" if outcome.verdict == FAILED else "warning"


def _escaped(text: str, signs: str) -> str:
    """Text whose signs are written as their codes, the percent sign too."""
    for sign in f"%\r\n{signs}":
        text = text.replace(sign, f"%{ord(sign):02X}")
    return text


def _github(outcomes: Sequence[Outcome]) -> list[str]:
    """Workflow commands of GitHub Actions."""
    lines = []
    for each in outcomes[:_MOST]:
        about = {"file": each.file, "title": told.line(told.title(each))}
        told_of = ",".join(f"{name}={_escaped(value, ':,')}" for name, value in about.items())
        lines.append(f"::{_level(each)} {told_of}::{_escaped(_message(each), '')}")
    return lines


def _azure(outcomes: Sequence[Outcome]) -> list[str]:
    """Logging commands of Azure Pipelines."""
    lines = []
    for each in outcomes[:_MOST]:
        words = told.line(f"{told.title(each)}: {_message(each)}")
        about = f"type={_level(each)};sourcepath={_of_azure(each.file)}"
        lines.append(f"##vso[task.logissue {about}]{_of_azure(words)}")
    return lines


def _of_azure(text: str) -> str:
    codes = {"%": "%AZP25", ";": "%3B", "\r": "%0D", "\n": "%0A", "]": "%5D"}
    return "".join(codes.get(each, each) for each in text)


def _gitlab(outcomes: Sequence[Outcome]) -> list[str]:
    """A report of GitLab's Code Quality, which shows it beside a file of a merge request."""
    entries = [
        {
            "description": f"{told.line(told.title(each))}: {_message(each)}",
            "check_name": f"kinacc-gate-{each.kind}",
            "fingerprint": hashlib.sha256(
                "\0".join((each.dataset, each.name, each.kind)).encode("utf-8", "backslashreplace")
            ).hexdigest(),
            "severity": "major" if each.verdict == FAILED else "minor",
            "location": {"path": each.file, "lines": {"begin": 1}},
        }
        for each in outcomes
    ]
    return [json.dumps(entries)]


def _plain(outcomes: Sequence[Outcome]) -> list[str]:
    """``file:1: error: words``, as compilers write it: Jenkins (Warnings) and editors read it."""
    return [
        f"{each.file}:1: {_level(each)}: {told.line(told.title(each))}: {_message(each)}"
        for each in outcomes
    ]


DIALECTS: dict[str, Callable[[Sequence[Outcome]], list[str]]] = {
    "github": _github,
    "gitlab": _gitlab,
    "azure": _azure,
    "plain": _plain,
}
