"""The questions of ``kinacc init``: the open readings of a file, and what was assumed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import click

from kinacc.errors import InputError, Problem
from kinacc.measurements.intake import guess as guesses
from kinacc.measurements.intake.choices import TAKE, Choice, Undecided
from kinacc.measurements.intake.guess import OPTIONS, Guess

_FREE = ("join", "clock_offset", "pulses_per_deg", "no_reading")  # answers that no list holds


def guessed(paths: Sequence[str], answers: dict[str, Any], ask: bool) -> Guess:
    """The guess without open questions: answered by options, or by a person into ``answers``."""
    if len(paths) > 2:
        message, allowed = f"{len(paths)} files", "one file, or one of joints and one of points"
        raise InputError(Problem(" ".join(paths), message, allowed))
    while True:
        try:
            return guesses.look(paths, answers)
        except Undecided as error:
            if not ask:
                raise
            try:
                answers |= _answer(error.choices[0], answers.get("take", ()))
            except click.Abort:
                raise error from None


def _answer(choice: Choice, taken: Sequence[str]) -> dict[str, Any]:
    """Ask one question. Raises Abort where nobody is there to answer, or takes none."""
    values, by_number = [*choice.answers], choice.option == TAKE
    click.echo(f"{choice.about[0].upper()}{choice.about[1:]}.")
    for number, (value, text) in enumerate(choice.answers.items(), 1):
        click.echo(f"  {number if by_number else value}: {text}")

    def read(text: str) -> dict[str, Any]:
        if not by_number:
            if choice.key not in _FREE and text not in values:
                raise click.BadParameter(", ".join(values))
            return {choice.key: text}
        numbers = [int(number) for number in re.findall(r"\d+", text)]
        if numbers == [0]:
            if not choice.without:
                raise click.Abort
            return {"orientation": "none"}
        if not numbers or not 1 <= min(numbers) <= max(numbers) <= len(values):
            raise click.BadParameter(f"1 to {len(values)}, or 0 for none")
        if len(numbers) > 1 and not choice.several:
            raise click.BadParameter("one number")
        return {"take": [*taken, *(values[number - 1] for number in numbers)]}

    hint = "Number, 0 for none" + (", as 1,2 for several" if choice.several else "")
    return click.prompt(hint if by_number else "Answer", value_proc=read)


def confirmed(guess: Guess, robot: str | None) -> dict[str, str]:
    """A person's answers to what was assumed, where they differ from the guess.

    Raises InputError where nobody answers.
    """
    section, turn = guess.section, guess.section["orientation"]
    defaults = section | {
        "angle_unit": turn["unit"],
        "orientation": turn["convention"],
        "order": "quaternion",
        "horizontal": section["directions"]["horizontal"],
    }
    answers = {}
    for setting, text in guess.assumed.items():
        option, allowed = OPTIONS[setting]
        click.echo(f"Not stated in the file: {text}.")
        key = option[2:].replace("-", "_")
        try:
            answer = click.prompt(
                key.replace("_", " ").capitalize(), type=click.Choice(allowed),
                default=defaults[setting], show_choices=len(allowed) < 5,
            )  # fmt: skip
        except click.Abort:
            raise unanswered(guess, [OPTIONS[name][0] for name in guess.assumed], robot) from None
        if answer != defaults[setting]:
            answers[key] = answer
    return answers


def unanswered(guess: Guess, options: Sequence[str], robot: str | None) -> InputError:
    """The error naming the options that answer what nobody answered."""
    path = str(guess.section["path"])
    options = [*options, *([] if robot else ["--robot"])]
    return InputError(
        [Problem(path, "not stated", fix=f"give {option}, or --yes") for option in options],
        "The questions were not answered, and nothing was written",
    )
