"""A check report as text, JSON, flat metrics, JUnit XML and Markdown."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from xml.etree import ElementTree

from kinacc.errors import InputError, Problem, as_seen
from kinacc.gate.outcome import FAILED, PASSED, SCHEMA_VERSION, CheckReport, Outcome
from kinacc.tables.atomic import write_whole

_NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def as_text(report: CheckReport) -> str:
    """The verdict first, then a line for each outcome and what to do about it."""
    counts = {
        word: sum(each.verdict == word for each in report.outcomes) for word in _words(report)
    }
    lines = [f"{'PASS' if report.passed else 'FAIL'}: {report.results}, "
             + ", ".join(f"{count} {word}" for word, count in counts.items())]  # fmt: skip
    for each in report.outcomes:
        lines.append(f"{each.verdict:9} {each.dataset}, {each.name}: {each.says}")
        if each.fix and each.verdict != PASSED:
            lines.append(f"{'':9} {each.fix}")
    return "\n".join(map(as_seen, lines))


def _words(report: CheckReport) -> list[str]:
    return list(dict.fromkeys(each.verdict for each in report.outcomes))


def as_json(report: CheckReport) -> str:
    """The report with a ``schema_version``; numbers that are not finite are null."""
    found = {"schema_version": SCHEMA_VERSION, "passed": report.passed, **asdict(report)}
    for each in found["outcomes"]:
        each["figures"] = _finite(each["figures"])
    return json.dumps(found, indent=1, allow_nan=False) + "\n"


def as_metrics(report: CheckReport) -> str:
    """All figures flat by ``<data set>/<check>/<figure>``, numbers alone."""
    found = {
        f"{each.dataset}/{each.name}/{name}": value
        for each in report.outcomes
        for name, value in _finite(each.figures).items()
        if isinstance(value, (int, float))
    }
    return json.dumps(found, indent=1) + "\n"


def _finite(figures: Mapping[str, object]) -> dict[str, object]:
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in figures.items()
    }


def as_junit(report: CheckReport) -> str:
    """JUnit XML: a suite for each data set, a case for each check; warnings are skipped cases."""
    root = ElementTree.Element("testsuites", {"name": "kinacc check-results"})
    for dataset in dict.fromkeys(each.dataset for each in report.outcomes):
        own = [each for each in report.outcomes if each.dataset == dataset]
        failed = sum(each.verdict == FAILED for each in own)
        skipped = sum(each.verdict not in (FAILED, PASSED) for each in own)
        numbers = {"tests": len(own), "failures": failed, "errors": 0, "skipped": skipped}
        about = {"name": _xml(dataset), **{name: str(each) for name, each in numbers.items()}}
        suite = ElementTree.SubElement(root, "testsuite", about)
        for each in own:
            _case(suite, each)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, "unicode")}\n'


def _case(suite: ElementTree.Element, outcome: Outcome) -> None:
    about = {"classname": _xml(f"kinacc.{outcome.dataset}"), "name": _xml(outcome.name)}
    case = ElementTree.SubElement(suite, "testcase", about)
    text = _xml(". ".join(filter(None, [outcome.says, outcome.fix])))
    if outcome.verdict == FAILED:
        ElementTree.SubElement(case, "failure", {"message": text}).text = text
    elif outcome.verdict == PASSED:
        ElementTree.SubElement(case, "system-out").text = text
    else:
        ElementTree.SubElement(case, "skipped", {"message": f"{outcome.verdict}: {text}"})


def _xml(text: str) -> str:
    return _NOT_XML.sub("?", text)


def as_markdown(report: CheckReport) -> str:
    """A heading with the verdict and a table of all outcomes."""
    head = f"## {'PASS' if report.passed else 'FAIL'}: {_cell(report.results)}"
    rows = [f"| {each.verdict} | {_cell(each.dataset)} | {_cell(each.name)} | "
            f"{_cell('. '.join(filter(None, [each.says, each.fix])))} |"
            for each in report.outcomes]  # fmt: skip
    return "\n".join(
        [head, "", "| verdict | data set | check | found |", "|---|---|---|---|", *rows, ""]
    )


def _cell(text: str) -> str:
    kept = as_seen(text).replace("\n", " ").replace("\\", "\\\\")
    return re.sub(r"([|`<>*_\[\]#])", r"\\\1", kept)


_ENDINGS: dict[str, Callable[[CheckReport], str]] = {
    "metrics.json": as_metrics,
    ".json": as_json,
    ".xml": as_junit,
    ".md": as_markdown,
    ".txt": lambda report: as_text(report) + "\n",
}


def write(report: CheckReport, path: Path) -> None:
    """Write a report by the ending of the file; InputError for an ending that is none of these."""
    for ending, text in _ENDINGS.items():
        if path.name.endswith(ending):
            write_whole(path, text(report).encode())
            return
    raise InputError(Problem(str(path), f"ends in {path.suffix!r}", ", ".join(_ENDINGS)))
