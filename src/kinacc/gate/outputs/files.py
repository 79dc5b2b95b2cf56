"""Files that the gate writes, each by the ending of its name."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from kinacc.artifacts.atomic import write_whole
from kinacc.errors import InputError, Problem
from kinacc.gate.outcome import Verdicts
from kinacc.gate.outputs.junit import as_junit
from kinacc.gate.outputs.machine import as_json
from kinacc.gate.outputs.markdown import as_markdown
from kinacc.gate.outputs.screen import as_text
from kinacc.gate.outputs.servers import annotated

_WIDTH = 100


def json_text(verdicts: Verdicts) -> str:
    """:func:`as_json` as text; ``##``, which servers take for a command, is written in codes."""
    text = json.dumps(as_json(verdicts), indent=1, allow_nan=False)
    return text.replace("##", "\\u0023\\u0023") + "\n"


def _quality(verdicts: Verdicts) -> str:
    return "\n".join(annotated(verdicts, "gitlab")) + "\n"


# By the ending, the longer one first.
ENDINGS: dict[str, Callable[[Verdicts], str]] = {
    ".codequality.json": _quality,
    ".json": json_text,
    ".xml": as_junit,
    ".md": as_markdown,
    ".txt": lambda verdicts: f"{as_text(verdicts, _WIDTH)}\n",
}


def writer(path: Path | str) -> Callable[[Verdicts], str]:
    """What a file of this name holds. Raises InputError for an ending that is none of ENDINGS."""
    for ending, text in ENDINGS.items():
        if Path(path).name.endswith(ending):
            return text
    problem = Problem(str(path), f"ends in {Path(path).suffix!r}", ", ".join(ENDINGS))
    raise InputError(problem, "Nothing was written")


def written(verdicts: Verdicts, path: Path | str) -> None:
    """Write what a file of this name holds, whole or not at all, over one that is there."""
    write_whole(Path(path), writer(path)(verdicts).encode("utf-8"))
