"""The command line: its commands by name, each imported when it is called."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from importlib import import_module
from typing import NoReturn

import click

from kinacc import __version__
from kinacc.cli.process import AGAINST, NOBODY_READS, STOPPED, TERMINATED, UNUSABLE
from kinacc.errors import InputError, KinaccError, MachineError, Problem, refused
from kinacc.workflow.start import ONE_THREAD

_AS_JSON = f"{__name__}.as_json"
# The commands by purpose, each with the module of its code and what it does.
SECTIONS = {
    "Measured data": {
        "init": ("init", "describe a file of measurements, and its robot"),
        "check-data": ("data", "look for mistakes before anything is fitted"),
        "exclude": ("data", "rows that no fit shall use"),
        "plan-poses": ("plan_poses", "choose poses for a calibration, in a short order"),
        "calibrate": ("run", "fit the models and show their held-out errors"),
        "add": ("data", "new readings of the same arm, to its series"),
    },
    "The study": {
        "study": ("run", "maps, assessors under noise, figures and claims"),
        "show": ("results", "any table of results in the terminal, or as CSV"),
        "check-results": ("results", "digests, thresholds and the accepted run"),
    },
    "A calibrated arm": {
        "summary": ("results", "errors of one calibration, or a table of many"),
        "report": ("results", "one page to read, mail and keep"),
        "predict": ("poses", "joints to the pose of the tool, with uncertainty"),
        "compensate": ("poses", "poses or a program to the joints that reach them"),
        "export": ("export", "the model for other programs and controllers"),
        "verify": ("verify", "does the calibration still hold at new readings?"),
        "compare": ("compare", "differences of two calibrations"),
    },
    "Its largest error": {
        "repeatability": ("repeatability", "noise of a reading, from repeated readings"),
        "campaign": ("campaign", "bounds: plan, start, next, record, status, report"),
    },
}
_MODULES = {name: item[0] for names in SECTIONS.values() for name, item in names.items()}


class InOrder(click.Group):
    """A group that lists its commands in the order of the work."""

    def list_commands(self, context: click.Context) -> list[str]:
        """Names in the order of the work."""
        return list(self.commands)


class Commands(InOrder):
    """All commands, loaded when they are called; bad input ends in a list of problems."""

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        """The command ``a-name``: ``a_name`` of its module."""
        if name not in _MODULES:
            return None
        module = import_module(f"kinacc.cli.{_MODULES[name]}")
        command: click.Command = getattr(module, name.replace("-", "_"))
        return command

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """The commands by purpose."""
        for title, names in SECTIONS.items():
            with formatter.section(title):
                formatter.write_dl([(name, purpose) for name, (_, purpose) in names.items()])

    def parse_args(self, context: click.Context, args: list[str]) -> list[str]:
        """Note whether problems are asked for as JSON; more threads of BLAS are not."""
        context.meta[_AS_JSON] = "--json" in args
        os.environ.update(ONE_THREAD)
        return super().parse_args(context, args)

    def invoke(self, context: click.Context) -> object:
        """Run the command; docs/commands.md has the exit codes of errors and signals."""
        signals: list[int] = []
        try:
            with _listening(signals):
                result = super().invoke(context)
                print(end="", flush=True)  # a full disk is noticed here
                return result
        except (Exception, KeyboardInterrupt) as error:
            usage = isinstance(error, click.UsageError) and not context.meta[_AS_JSON]
            if usage or isinstance(error, (click.exceptions.Exit, click.Abort)):
                raise
            code, text, problems = _ending(error, signals)
        if problems and context.meta[_AS_JSON]:
            click.echo(json.dumps({"problems": [asdict(item) for item in problems]}, indent=1))
        if text:
            click.echo(text, err=True)
        context.exit(code)


def _ending(error: BaseException, signals: Sequence[int]) -> tuple[int, str, Sequence[Problem]]:
    """Exit code, text and problems of an error; a fault of kinacc itself is raised again.

    ``signals`` to stop that came. A library that a signal meets may raise an error of its own.
    """
    if signal.SIGTERM in signals:
        return TERMINATED, "stopped by the system; what was finished is kept", ()
    if signals or isinstance(error, KeyboardInterrupt):
        return STOPPED, "stopped", ()
    if isinstance(error, BrokenPipeError):
        return NOBODY_READS, "", ()
    if isinstance(error, MemoryError):
        return AGAINST, f"not enough memory: {error or 'ask for less'}", ()
    if isinstance(error, RecursionError):
        return AGAINST, "the input is nested too deeply to be read", ()
    if isinstance(error, click.UsageError):
        place = error.ctx.command_path if error.ctx else ""
        return UNUSABLE, "", (Problem(place, error.format_message()),)
    if isinstance(error, OSError):
        error = refused(error)
    if not isinstance(error, KinaccError):
        raise error
    unusable = isinstance(error, InputError) and not isinstance(error, MachineError)
    return UNUSABLE if unusable else AGAINST, str(error), getattr(error, "problems", ())


@contextmanager
def _listening(signals: list[int]) -> Iterator[None]:
    """Ctrl-C and SIGTERM end the block as an exception, so that files in the making are removed."""

    def end(number: int, _: object) -> NoReturn:
        signals.append(number)
        raise KeyboardInterrupt

    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        for number, handler in before.items():
            if handler != signal.SIG_IGN:  # as of SIGINT for a command in the background
                signal.signal(number, end)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@click.group(
    cls=Commands,
    commands={name: click.Command(name) for name in _MODULES},  # their names, before any is loaded
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, prog_name="kinacc")
def main() -> None:
    """Calibrate a robot's kinematic model, state its error, and bound the largest one.

    Three commands lead from a file of measurements to an answer, in any folder. Every command has
    --help with an example.

    \b
    Example:
      kinacc init tracker.csv --robot ur10
      kinacc check-data tracker.yaml
      kinacc calibrate tracker.yaml
    """


if __name__ == "__main__":
    main(prog_name="kinacc")
