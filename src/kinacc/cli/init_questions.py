"""The questions of ``kinacc init``: the open readings of a file, and what was assumed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

import click

from kinacc.errors import InputError, Problem
from kinacc.measurements.intake import guess as guesses
from kinacc.measurements.intake.choices import TAKE, Choice, Undecided
from kinacc.measurements.intake.guess import OPTIONS, Guess

_FREE = ("join", "clock_offset", "pulses_per_deg", "no_reading")  # answers that no list holds


def guessed(paths: Sequence[str], answers: dict[str, Any], ask: bool) -> Guess:
    """The guess without open questions: answered by options, or by a person into ``answers``.

    Two files are joints and points of the same poses.
    """
    if len(paths) > 2:
        message, allowed = f"{len(paths)} files", "one file, or one of joints and one of points"
        raise InputError(Problem(" ".join(paths), message, allowed))
    while True:
        try:
            return guesses.look(paths, answers)
        except Undecided as error:
            if not ask:
                raise
            _answer(error.choices[0], answers, error)


def _answer(choice: Choice, answers: dict[str, Any], error: Undecided) -> None:
    """Ask one question. Raises ``error`` where nobody is there to answer."""
    click.echo(f"{choice.about[0].upper()}{choice.about[1:]}.")
    is_take, values = choice.option == TAKE, [*choice.answers]
    for number, (value, text) in enumerate(choice.answers.items(), 1):
        click.echo(f"  {number if is_take else value}: {text}")
    while True:
        hint = "Number, 0 for none" + (", as 1,2 for several" if choice.several else "")
        is_free = is_take or choice.key in _FREE
        try:
            answer = click.prompt(
                hint if is_take else "Answer", type=str if is_free else click.Choice(values),
                show_choices=False,
            )  # fmt: skip
        except click.Abort:
            raise error from None
        if not is_take:
            answers[choice.key] = answer
            return
        numbers = [int(word) for word in answer.replace(",", " ").split() if word.isdecimal()]
        if numbers == [0] and choice.without:
            answers["orientation"] = "none"
            return
        if numbers == [0]:
            raise error
        if (
            numbers
            and all(1 <= n <= len(values) for n in numbers)
            and (choice.several or len(numbers) == 1)
        ):
            answers["take"] = [*answers.get("take", ()), *(values[n - 1] for n in numbers)]
            return


def asked(guess: Guess, robot: str | None) -> dict[str, str]:
    """A person's answers to what was assumed, where they differ from the guess.

    ``robot``: the one given, which needs no question. Raises InputError where nobody answers.
    """
    section, turn = guess.section, guess.section["orientation"]
    guessed_ = section | {
        "angle_unit": turn["unit"],
        "orientation": turn["convention"],
        "order": "quaternion",
        "horizontal": section["directions"]["horizontal"],
    }
    answers = {}
    for setting, text in guess.assumed.items():
        option, allowed = OPTIONS[setting]
        click.echo(f"Not stated in the file: {text}.")
        try:
            answer = click.prompt(
                f"{option[2:].replace('-', ' ').capitalize()}", type=click.Choice(allowed),
                default=guessed_[setting], show_choices=len(allowed) < 5,
            )  # fmt: skip
        except click.Abort:
            refuse_unanswered(guess, guess.assumed, robot)
        if answer != guessed_[setting]:
            answers[option[2:].replace("-", "_")] = answer
    return answers


def refuse_unanswered(guess: Guess, assumed: Mapping[str, str], robot: str | None) -> NoReturn:
    """Raise InputError naming the options that answer what nobody answered."""
    path = str(guess.section["path"])
    problems = [
        Problem(path, f"not stated; the guess: {text}",
                fix=f"give {OPTIONS[setting][0]}, or --yes to take the guess")
        for setting, text in assumed.items()
    ]  # fmt: skip
    if robot is None:
        fix = "give --robot, or --yes to take the one that fits"
        problems.append(Problem(path, "does not state which robot was measured", fix=fix))
    raise InputError(problems, "The questions were not answered, and nothing was written")
