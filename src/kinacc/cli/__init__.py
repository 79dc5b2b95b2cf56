"""The command line: one module a command, loaded only when it is called."""

from kinacc.cli.process import main

__all__ = ["main"]
