"""The command line: one module a command, loaded only when it is called."""

from kinacc.cli.group import main

__all__ = ["main"]
