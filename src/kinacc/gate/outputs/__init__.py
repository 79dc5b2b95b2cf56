"""What people and build servers read of the gate, all of it written from ``Verdicts``."""

from kinacc.gate.outputs.files import ENDINGS, json_text, writer, written
from kinacc.gate.outputs.junit import as_junit
from kinacc.gate.outputs.machine import as_json, schema_text
from kinacc.gate.outputs.markdown import as_markdown
from kinacc.gate.outputs.screen import as_text
from kinacc.gate.outputs.servers import DIALECTS
from kinacc.gate.outputs.servers import annotated as annotations

__all__ = [
    "DIALECTS",
    "ENDINGS",
    "annotations",
    "as_json",
    "as_junit",
    "as_markdown",
    "as_text",
    "json_text",
    "schema_text",
    "writer",
    "written",
]
