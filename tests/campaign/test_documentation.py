"""The pages on campaigns name only commands and options that are there."""

from __future__ import annotations

import re
from pathlib import Path

from kinacc.cli.group import main

PAGE = Path(__file__).resolve().parents[2] / "docs" / "campaigns.md"
REFERENCE = PAGE.with_name("campaigns-reference.md")


def test_every_command_and_option_on_the_page_exists():
    text = PAGE.read_text(encoding="utf-8")
    calls = re.findall(r"^\$ kinacc (.*(?:\\\n.*)*)", text, re.MULTILINE)
    assert len(calls) >= 8
    for line in calls:
        words = line.replace("\\\n", " ").split()
        command = main.get_command(None, words[0])
        if words[0] == "campaign":
            command = command.commands[words[1]]
        known = {option for each in command.params for option in each.opts}
        assert {word for word in words if re.match(r"--?[a-z]", word)} <= known
    text += REFERENCE.read_text(encoding="utf-8")
    commands = [*main.get_command(None, "campaign").commands.values()]
    known = {option for each in commands for given in each.params for option in given.opts}
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z0-9-]+", text)) <= known


def test_the_pictures_are_there():
    for name in re.findall(r"\]\(([\w-]+\.png)\)", PAGE.read_text(encoding="utf-8")):
        assert (PAGE.parent / name).stat().st_size > 1000
