"""README and docs: links lead somewhere, commands and the options shown with them exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import click
import pytest

from kinacc.cli.group import main

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINK = re.compile(r"\]\(([^)#\s]+)")
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
SHOWN = re.compile(r"^(?:\$ )?kinacc ([a-z][^\n]*)", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page):
    inside = [link for link in LINK.findall(page.read_text()) if "://" not in link]
    assert [link for link in inside if not (page.parent / link).exists()] == []


def shown_commands(page: Path) -> list[list[str]]:
    """Words of the command lines in a page's blocks, continued lines joined."""
    found = BLOCK.findall(page.read_text())
    blocks = "\n".join(text for kind, text in found if kind in ("", "sh")).replace("\\\n", " ")
    return [shlex.split(line, comments=True) for line in SHOWN.findall(blocks)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_are_there_and_take_what_is_shown(page):
    for words in shown_commands(page):
        command, above = main, click.Context(main)
        while isinstance(command, click.Group):
            command = command.get_command(above, words[0])
            assert command is not None, words
            words = words[1:]
        if "--help" in words:
            continue
        with above:
            command.make_context(command.name, list(words), parent=above)


def test_pages_that_walk_a_reader_through_show_commands():
    assert len(shown_commands(ROOT / "docs" / "from-tracker-file-to-compensated-robot.md")) > 5
