"""What pages tell a reader to type.

A comment above a block, which no reader sees, says what is special about it, and why:

    <!-- not run: REASON -->       typed nowhere
    <!-- only in full: REASON -->  typed with KINACC_PAGES_IN_FULL=1
    <!-- dry run: REASON -->       its snakemake lines only plan
    <!-- exit code 1: REASON -->   the last command does not end with 0
    <!-- in a clone: REASON -->    typed in a clone of the repository, whatever the page's folder
    <!-- file NAME: REASON -->     not typed but kept under that name
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

TYPED = ("sh", "console", "python")
_KINDS = r"not run|only in full|dry run|exit code \d+|in a clone|file [\w.-]+"
_NOTE = rf"<!-- ({_KINDS}): ((?:(?!-->).)+) -->\n"
_BLOCK = re.compile(rf"^((?:{_NOTE})*)^```([\w-]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page: where it begins, its language, its text, and notes with reasons."""

    page: Path
    line: int
    language: str
    text: str
    notes: dict[str, str]

    @property
    def place(self) -> str:
        """Page and line, as editors read them."""
        return f"{self.page.name}:{self.line}"

    @property
    def exit_code(self) -> int:
        """What its last command ends with."""
        codes = [int(note.split()[-1]) for note in self.notes if note.startswith("exit")]
        return codes[0] if codes else 0

    @property
    def file(self) -> str:
        """The name it is kept under; empty where it is typed."""
        return next((note.split()[1] for note in self.notes if note.startswith("file")), "")


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in _BLOCK.finditer(text):
        line = text.count("\n", 0, match.start(4)) + 1
        notes = dict(re.findall(_NOTE, match[1]))
        found.append(Block(page, line, match[4], match[5], notes))
    return found


def typed(block: Block) -> str:
    """The text of a block that a shell is given; of a console, without what it printed."""
    if block.language == "python":
        return f"python -c {shlex.quote(block.text)}"
    if block.language != "console":
        return block.text
    return "\n".join(re.findall(r"^\$ ((?:.*\\\n)*.*)", block.text, re.MULTILINE))
