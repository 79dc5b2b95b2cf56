"""Write what pages say of commands from the commands: ``python tools/document_commands.py``.

docs/command-line.md from their help, and the tables of exit codes in docs/commands.md.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from copy import copy
from pathlib import Path

import click

from kinacc.cli.exit_codes import EXIT_CODES, OF_COMMANDS
from kinacc.cli.group import main

DOCS = Path(__file__).parents[1] / "docs"
_TABLES = re.compile("(?<=<!-- exit codes -->\n).*(?=<!-- end of exit codes -->)", re.DOTALL)
_HEAD = """\
# Commands and their options

What `kinacc COMMAND --help` says, of every command. [What options and exit codes
mean](commands.md) that all commands share is on a page of its own; the tables that commands
leave are on that of [artefacts](artifacts.md).

Written from the commands by `python tools/document_commands.py`.
"""


def command_line_markdown() -> str:
    """The text of docs/command-line.md: commands in the sections and the order of the help."""
    parts = [_HEAD]
    for title, names in main.sections.items():
        parts.append(f"## {title}\n")
        for name in names:
            parts += [_entry(words, command) for words, command in _below(name)]
    return "\n".join(parts)


def _below(name: str) -> Iterator[tuple[str, click.Command]]:
    command = main.commands[name]
    yield name, command
    if isinstance(command, click.Group) and name != "run":  # its commands are the stages
        for below in command.commands:
            yield f"{name} {below}", command.commands[below]


def _entry(words: str, command: click.Command) -> str:
    plain = copy(command)
    plain.add_help_option = False  # every command has it
    context = click.Context(
        plain, info_name=f"kinacc {words}", max_content_width=80, terminal_width=80
    )
    return f"### kinacc {words}\n\n```text\n{plain.get_help(context)}\n```\n"


def commands_markdown() -> str:
    """The text of docs/commands.md, with the tables of exit codes as the commands have them."""
    every = [
        _row("exit code", "meaning", "a build server shows"),
        _row(*["---"] * 3),
        *(_row(str(code), *words) for code, words in EXIT_CODES.items()),
    ]
    by_command = [
        _row("command", "0", "1", "2"),
        _row(*["---"] * 4),
        *(_row(f"`kinacc {name}`", *words) for name, words in OF_COMMANDS.items()),
    ]
    tables = "\n".join(["", *every, "", *by_command, "", ""])
    return _TABLES.sub(lambda _: tables, (DOCS / "commands.md").read_text(encoding="utf-8"))


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |".replace("|  |", "| |")


if __name__ == "__main__":
    (DOCS / "command-line.md").write_text(command_line_markdown(), encoding="utf-8")
    (DOCS / "commands.md").write_text(commands_markdown(), encoding="utf-8")
