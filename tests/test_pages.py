"""The commands on the pages of the documentation are commands there are, with options they have."""

import re
import shlex
from pathlib import Path

import click
import pytest

from kinacc.cli import main

DOCS = Path(__file__).parents[1] / "docs"
PAGES = ("checking-data.md", "from-tracker-file-to-compensated-robot.md")


def commands(page):
    """Command lines of a page's blocks, continued lines joined."""
    text = (DOCS / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```(?:sh)?\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [line.removeprefix("$ ") for line in lines if re.match(r"(\$ )?kinacc ", line)]


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_a_page_are_accepted(page):
    found = commands(page)
    assert found
    for line in found:
        name, *words = shlex.split(line, comments=True)[1:]
        with click.Context(main) as above:
            main.commands[name].make_context(name, words, parent=above)
