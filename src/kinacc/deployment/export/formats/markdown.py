"""Tables I to III as Markdown."""

from __future__ import annotations

from kinacc.config.names import in_markdown
from kinacc.deployment.export.paper_tables import paper_tables
from kinacc.deployment.export.source import Source

ENDING, ANY_MODEL = "_tables.md", False


def text(source: Source) -> str:
    """The tables one after the other."""
    parts = []
    for table in paper_tables(source):
        rule = ["---", *["---:"] * (table.cells.shape[1] - 1)]
        rows = [[*table.cells], rule, *table.cells.to_numpy().tolist()]
        lines = [
            f"**{in_markdown(table.caption)}**",
            "",
            *(f"| {' | '.join(row)} |" for row in rows),
        ]
        parts.append("\n".join([*lines, "", *map(in_markdown, table.notes)]))
    return "\n\n".join(parts) + "\n"
