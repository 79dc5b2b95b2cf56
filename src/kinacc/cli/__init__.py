"""The command line: a module a topic, loaded only when one of its commands is called."""

from kinacc.cli.process import main

__all__ = ["main"]
