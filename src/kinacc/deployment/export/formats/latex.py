"""Tables I to III as LaTeX (package booktabs), one ``table`` environment each."""

from __future__ import annotations

import re

from kinacc.deployment.export.paper_tables import paper_tables
from kinacc.deployment.export.source import Source

ENDING, ANY_MODEL = "_tables.tex", False
_MARKS = {"\\": r"\textbackslash ", "^": r"\^{}", "~": r"\~{}", "±": r"$\pm$", "†": r"$^\dagger$"}
_MARKS |= {sign: f"\\{sign}" for sign in "&%_#${}"}


def text(source: Source) -> str:
    """The tables one after the other."""
    parts = []
    for table in paper_tables(source):
        cells = table.cells.map(_tex).rename(columns=_tex)
        body = cells.to_latex(
            index=False,
            column_format=f"l{'r' * (cells.shape[1] - 1)}",
            caption=_tex(table.caption),
            label=f"tab:{table.name}",
        )
        notes = "".join(f"\\par\\smallskip\\footnotesize {_tex(note)}\n" for note in table.notes)
        parts.append(body.replace(r"\end{table}", notes + r"\end{table}"))
    return "\n".join(parts)


def _tex(text: str) -> str:
    return re.sub(r"[\\^~±†&%_#${}]", lambda sign: _MARKS[sign[0]], text)
