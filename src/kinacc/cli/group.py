"""The command line: its commands by name, each imported when it is called."""

from __future__ import annotations

import json
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from difflib import get_close_matches
from importlib import import_module
from typing import NoReturn

import click

from kinacc import __version__, removed
from kinacc.cli.exit_codes import AGAINST, NOBODY_READS, STOPPED, TERMINATED, UNUSABLE
from kinacc.errors import InputError, KinaccError, MachineError, Problem, refused
from kinacc.workflow.start import ONE_THREAD

_AS_JSON, _ASKS_HELP = f"{__name__}.as_json", f"{__name__}.asks_help"
_HELP = ("-h", "--help")


class Named(Mapping[str, click.Command]):
    """Commands by name, made when they are asked for."""

    def __init__(self, names: Mapping[str, object], make: Callable[[str], click.Command]) -> None:
        self.names, self.make = names, make

    def __getitem__(self, name: str) -> click.Command:
        if name not in self.names:
            raise KeyError(name)
        return self.make(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


# Words that people try, and the command that does it.
_MEANT = {
    "check": "check-data",
    "fit": "calibrate",
    "forward": "predict",
    "identify": "calibrate",
    "ik": "compensate",
    "import": "init",
    "inverse": "compensate",
    "measure": "campaign next",
    "correct": "compensate",
    "remove": "strike",
    "noise": "repeatability",
    "reproduce": "study",
    "results": "summary",
    "cat": "show",
    "head": "show",
    "list": "show",
    "ls": "show",
    "print": "show",
    "table": "show",
    "view": "show",
    "fleet": "summary",
    "overview": "summary",
    "undo": "strike",
    "validate": "check-data",
}


class InOrder(click.Group):
    """A group whose commands are listed in the order in which they were added."""

    def list_commands(self, context: click.Context) -> list[str]:
        """The commands in the order of the work."""
        return list(self.commands)

    def resolve_command(
        self, context: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command of a word; for one that is none, what may be meant."""
        word = args[0]
        if word in self.commands or word.startswith("-"):
            return super().resolve_command(context, args)
        if word in removed.COMMANDS:
            raise click.UsageError(f"{word} is gone: {removed.COMMANDS[word]}", context)
        names = self.list_commands(context)
        meant = _MEANT.get(word.lower(), "")
        if meant.partition(" ")[0] not in names:
            meant = next(iter(get_close_matches(word.lower(), names, 1)), "")
        fix = f" Did you mean {meant}?" if meant else f" There are: {', '.join(names)}."
        raise click.UsageError(f"{word!r} is no command.{fix}", context)


class Lazy(InOrder):
    """A group that lists its commands without importing them.

    ``sections`` are titles with names of commands, each with what it does in few words; ``make``
    gives the command of a name.
    """

    def __init__(
        self,
        *args: object,
        sections: Mapping[str, Mapping[str, str]],
        make: Callable[[str], click.Command],
        **more: object,
    ) -> None:
        names = {name: words for each in sections.values() for name, words in each.items()}
        super().__init__(*args, commands=Named(names, make), **more)
        self.sections = sections

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """The commands by what they are for, in the order of the work."""
        for title, names in self.sections.items():
            with formatter.section(title):
                formatter.write_dl(list(names.items()))


def imported(package: str) -> Callable[[str], click.Command]:
    """How the command ``a-name`` is had: as ``a_name`` of the module ``a_name`` of a package."""

    def command(name: str) -> click.Command:
        name = name.replace("-", "_")
        return getattr(import_module(f"{package}.{name}"), name)

    return command


class Terminated(KeyboardInterrupt):
    """The system asked the command to end (SIGTERM)."""


class Commands(Lazy):
    """A group whose commands report bad input as a list of problems, without a traceback."""

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        """Words of the command line, with options under the names they have now."""
        own = args[: args.index("--")] if "--" in args else args
        context.meta[_AS_JSON] = "--json" in own
        context.meta[_ASKS_HELP] = not {*own}.isdisjoint(_HELP)
        for i, word in enumerate(own):
            name, mark, value = word.partition("=")
            if gone := removed.OPTIONS.get(own[0], {}).get(name):
                raise click.UsageError(f"{name} is gone: {gone}", context)
            if new := removed.RENAMED.get(own[0], {}).get(name):
                args = [*args[:i], f"{new}{mark}{value}", *args[i + 1 :]]
                click.echo(f"{name} is called {new} now, and goes with the next version", err=True)
        return super().parse_args(context, args)

    def invoke(self, context: click.Context) -> object:
        """Run the command; exit code 2 on bad input, 130 and 143 where it was stopped.

        What the machine refuses (memory, a disk that is full) is 1, in one sentence as well, and
        141 where nobody reads the output any more, as of other tools. With --json problems are
        printed as JSON.
        """
        came: list[int] = []
        try:
            with _listening(came):
                if not context.meta[_ASKS_HELP]:
                    os.environ.update(ONE_THREAD)
                return super().invoke(context)
        except (Exception, KeyboardInterrupt) as error:
            usage = isinstance(error, click.UsageError) and not context.meta[_AS_JSON]
            if usage or isinstance(error, (click.exceptions.Exit, click.Abort)):
                raise
            code, said, problems = _ending(error, came)
        if problems and context.meta[_AS_JSON]:
            click.echo(json.dumps({"problems": [asdict(each) for each in problems]}, indent=1))
        if said:
            click.echo(said, err=True)
        context.exit(code)


def _ending(error: BaseException, came: Sequence[int]) -> tuple[int, str, Sequence[Problem]]:
    """Exit code, words and problems of what ended a command; a fault of its own is raised again.

    ``came``: signals to stop. A library that one finds at work may raise an error of its own.
    """
    if signal.SIGTERM in came:
        return TERMINATED, "stopped by the system; what was finished is kept", ()
    if came or isinstance(error, KeyboardInterrupt):
        return STOPPED, "stopped", ()
    if isinstance(error, MemoryError):
        return AGAINST, f"there is not enough memory for this: {error or 'ask for less'}", ()
    if isinstance(error, RecursionError):
        return AGAINST, "something given to this command is nested too deeply to be read", ()
    if isinstance(error, BrokenPipeError):
        return NOBODY_READS, "", ()
    if isinstance(error, OSError):
        error = refused(error)
    if isinstance(error, click.UsageError):
        place = error.ctx.command_path if error.ctx else ""
        return UNUSABLE, "", (Problem(place, error.format_message()),)
    if isinstance(error, InputError):
        code = AGAINST if isinstance(error, MachineError) else UNUSABLE
        return code, str(error), error.problems
    if isinstance(error, KinaccError):
        return AGAINST, str(error), ()
    raise error


@contextmanager
def _listening(came: list[int]) -> Iterator[None]:
    """Ctrl-C, and SIGTERM as it, end the block so that what it began is tidied up."""

    def end(signum: int, _: object) -> NoReturn:
        came.append(signum)
        raise Terminated if signum == signal.SIGTERM else KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield  # only the first thread of a program may say what signals do
        return
    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}
    try:
        for each, how in before.items():
            if how != signal.SIG_IGN:  # as of SIGINT for a command in the background
                signal.signal(each, end)
        yield
    finally:
        for each, how in before.items():
            signal.signal(each, how)


SECTIONS = {
    "Measured data": {
        "init": "describe a file of measurements, and its robot",
        "check-data": "look for mistakes before anything is fitted",
        "exclude": "rows that no fit shall use",
        "plan-poses": "choose poses for a calibration, in a short order",
        "calibrate": "fit the models, and say what they are worth",
        "add": "new readings of the same arm, to its series",
    },
    "The study": {
        "study": "everything beside: maps, the assessors under noise, claims",
        "show": "any table of results in the terminal, or as CSV",
        "check-results": "hold a results folder to its contract",
    },
    "A calibrated arm": {
        "summary": "what a calibration is worth, or a table of many",
        "report": "one page of it all, to read, mail and keep",
        "predict": "joints to the pose of the tool, with uncertainty",
        "compensate": "poses to the joints that put the tool there",
        "export": "write the model for other programs",
        "verify": "how far it is off at readings it was not fitted to",
        "compare": "what differs between two calibrations",
    },
    "Its largest error": {
        "repeatability": "poses read again and again: what noise a reading has",
        "campaign": "bounds on it: plan, start, next, record, status, report",
    },
}


@click.group(
    cls=Commands,
    sections=SECTIONS,
    make=imported("kinacc.cli"),
    context_settings={"help_option_names": list(_HELP)},
)
@click.version_option(__version__, prog_name="kinacc")
def main() -> None:
    """How accurate is a robot's kinematic model, and how large can its error be?

    Three commands lead from a file of measurements to an answer, in any folder. What they leave
    serves the others. Every command has --help with an example.

    \b
    Example:
      kinacc init tracker.csv --robot ur10
      kinacc check-data tracker.yaml
      kinacc calibrate tracker.yaml
    """


if __name__ == "__main__":
    main(prog_name="kinacc")
