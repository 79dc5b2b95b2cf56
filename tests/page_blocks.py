"""What pages tell a reader to type, and what they say is then printed.

A comment above a block, which no reader sees, says what is special about it, and why:

    <!-- not run: REASON -->       typed nowhere
    <!-- other output: REASON -->  what is printed is not held to it
    <!-- only in full: REASON -->  typed with KINACC_PAGES_IN_FULL=1
    <!-- dry run: REASON -->       its snakemake lines only plan
    <!-- exit code 1: REASON -->   the last command does not end with 0
    <!-- in a clone: REASON -->    typed in a clone of the repository, whatever the page's folder
    <!-- file NAME: REASON -->     not typed but kept under that name
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

TYPED = ("sh", "console", "python")
_KINDS = r"not run|other output|only in full|dry run|exit code \d+|in a clone|file [\w.-]+"
_NOTE = rf"<!-- ({_KINDS}): ((?:(?!-->).)+) -->\n"
_BLOCK = re.compile(rf"^((?:{_NOTE})*)^```([\w-]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.]*\d)")


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


def exchanges(block: Block) -> Iterator[tuple[str, str]]:
    """Commands of a console block with what each is said to print, in order."""
    for part in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
        lines = part.splitlines()
        typed = 1 + next(i for i, line in enumerate(lines) if not line.endswith("\\"))
        yield "\n".join(lines[:typed]), "\n".join(lines[typed:])


def not_printed(expected: str, printed: str) -> list[str]:
    """Lines of a page that were not printed, in this order; ``..`` stands for any.

    Blanks count once. Numbers may differ by one in the last digit and, where they have decimals, by
    2 %, as they do between processors.
    """
    rest = iter(printed.splitlines())
    missing = []
    for line in expected.splitlines():
        if line.strip() in ("", ".."):
            continue
        kept = list(rest)
        at = next((i for i, other in enumerate(kept) if _alike(line, other)), None)
        rest = iter(kept if at is None else kept[at + 1 :])
        if at is None:
            missing.append(line)
    return missing


def _alike(line: str, other: str) -> bool:
    words, others = (" ".join(_NUMBER.sub("#", each).split()) for each in (line, other))
    numbers, those = _NUMBER.findall(line), _NUMBER.findall(other)
    return words == others and all(map(_close, numbers, those))


def _close(number: str, other: str) -> bool:
    base, _, exponent = number.partition("e")
    decimals = len(base.partition(".")[2])
    last = 10.0 ** (int(exponent or 0) - decimals)
    share = 0.02 if decimals or exponent else 0.0
    return abs(float(number) - float(other)) <= 1.01 * last + share * abs(float(number))
