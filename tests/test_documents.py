"""README and docs: links lead somewhere, commands and the options shown with them exist."""

from __future__ import annotations

import re
from pathlib import Path

import click
import pytest

from kinacc.cli import main

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINK = re.compile(r"\]\(([^)#\s]+)")
BLOCK = re.compile(r"^```(?:sh|console)?\n(.*?)^```", re.MULTILINE | re.DOTALL)
SHOWN = re.compile(r"^\$? ?kinacc ([a-z][^\n]*)", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files(page):
    inside = [link for link in LINK.findall(page.read_text()) if "://" not in link]
    assert [link for link in inside if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_their_options_exist(page):
    blocks = "\n".join(BLOCK.findall(page.read_text())).replace("\\\n", " ")
    assert [line for line in SHOWN.findall(blocks) if not exists(line.split())] == []


def exists(words: list[str]) -> bool:
    """Whether the command line names commands and options that are there."""
    command: click.Command = main
    for word in words:
        if word.startswith("#") or word in ("|", ">", "&&"):
            break
        if isinstance(command, click.Group):
            command = command.get_command(click.Context(command), word)
            if command is None:
                return False
        elif word.startswith("--"):
            known = {name for each in command.params for name in each.opts}
            if word.split("=")[0] not in known | {"--help"}:
                return False
    return True
