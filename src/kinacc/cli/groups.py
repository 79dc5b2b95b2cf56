"""Groups of commands that are listed in the order in which they are used."""

from __future__ import annotations

import click


class InOrder(click.Group):
    """A group whose commands are listed in the order in which they were added."""

    def list_commands(self, context: click.Context) -> list[str]:
        """The commands as they were added."""
        return list(self.commands)
