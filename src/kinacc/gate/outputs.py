"""The report of a check as text, JSON, JUnit and Markdown."""

from __future__ import annotations

import json
import re
from pathlib import Path

from pydantic_core import to_jsonable_python

from kinacc.errors import input_error
from kinacc.gate.outcome import CheckReport
from kinacc.report.rendering import environment
from kinacc.tables.atomic import write_whole

_NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def as_json(report: CheckReport) -> str:
    """The report as it is; numbers that are not finite are null."""
    values = {"schema_version": 1, "passed": report.passed, **vars(report)}
    return json.dumps(to_jsonable_python(values, inf_nan_mode="null"), indent=1) + "\n"


def as_text(report: CheckReport, ending: str = ".txt") -> str:
    """The report by the template of an ending: a line for each outcome, a table, or JUnit XML."""
    template = environment(ending == ".xml").get_template(f"check{ending}")
    return _NOT_XML.sub("?", template.render(vars(report), passed=report.passed))


def write(report: CheckReport, path: Path) -> None:
    """Write a report by the ending of the file; InputError for an ending that is none of these."""
    if path.suffix == ".json":
        text = as_json(report)
    elif path.suffix in (".xml", ".md"):
        text = as_text(report, path.suffix)
    else:
        raise input_error(str(path), f"ends in {path.suffix!r}", ".json, .xml, .md")
    write_whole(path, text.encode())
