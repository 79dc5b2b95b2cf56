"""What ``kinacc init`` asks where the names of a file leave open what was measured."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import click

from kinacc.cli.file_options import ANSWERS
from kinacc.errors import InputError, Problem
from kinacc.measurements.intake import guess as guesses
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.columns import Question
from kinacc.measurements.intake.guess import Guess

# Options that answer a choice, by its key.
_FREE = ("join", "clock_offset", "pulses_per_deg")  # answers that no list holds


def looked(paths: Sequence[str], options: dict, ask: bool) -> Guess:
    """The guess at a file without open questions: answered by options, or by a person.

    Two files are joints and points of the same poses.
    """
    if len(paths) > 2:
        what, allowed = f"{len(paths)} files", "one file, or one of joints and one of points"
        raise InputError(Problem(" ".join(paths), what, allowed))
    files, path = (paths[0] if len(paths) == 1 else paths), " ".join(paths)
    take, turned = list(options["take"]), options["orientation"] != "none"
    names = (*ANSWERS, *_FREE)
    answers = {name: options[name] for name in names if options.get(name) is not None}
    while True:
        try:
            guess = guesses.look(files, take, turned, answers)
        except Undecided as error:
            if not ask:
                raise
            answers |= {each.key: _answered(each, error) for each in error.choices}
            continue
        questions = guess.found.questions
        if not questions:
            choice = guesses.sigma_choice(guess) if "sigma" not in answers else None
            if choice is None:
                return guess
            error = Undecided(path, [choice])
            if not ask:
                raise error
            answers[choice.key] = _answered(choice, error)
            continue
        if not ask:
            raise InputError(
                [_open(path, each) for each in questions], f"{path} leaves open what is to be read"
            )
        answer = _which(path, questions[0])
        take += answer
        turned = turned and bool(answer)


def _answered(choice: Choice, error: Undecided) -> str:
    """The answer to a choice. Raises ``error`` where nobody is there to answer."""
    click.echo(f"{choice.about[0].upper()}{choice.about[1:]}.")
    for value, words in choice.answers.items():
        click.echo(f"  {value}: {words}")
    wanted = str if choice.key in _FREE else click.Choice(list(choice.answers))
    try:
        return click.prompt("Answer", type=wanted, show_choices=False)
    except click.Abort:
        raise error from None


def _which(path: str, question: Question) -> list[str]:
    """Columns to take, as answered; none only where that is an answer too."""
    click.echo(f"The names do not tell {question.about}: {question.why}.")
    for number, reading in enumerate(question.readings, 1):
        click.echo(f"  {number}: {reading.in_words()}")
    several = question.about == "the measured point" and len(question.readings) > 1
    hint = ", as 1,2 if several were measured" if several else ""
    count = len(question.readings)
    while True:
        try:
            answer = click.prompt(f"Number (0 for none of them{hint})", type=str)
        except click.Abort:
            raise InputError(_open(path, question)) from None
        numbers = [int(word) for word in answer.replace(",", " ").split() if word.isdecimal()]
        if numbers == [0] and question.without:
            return []
        if numbers == [0]:
            what = f"does not hold {question.about}, by the answer given"
            raise InputError(Problem(path, what, fix="add the columns to the file"))
        if numbers and all(1 <= n <= count for n in numbers) and (several or len(numbers) == 1):
            return [question.readings[number - 1].names[0] for number in numbers]
        click.echo(f"a number from 0 to {count}")


def _open(path: str, question: Question) -> Problem:
    """What the file leaves open, with the options that decide it."""
    readings = "; or ".join(each.in_words() for each in question.readings)
    options = [f"--take {shlex.quote(each.names[0])}" for each in question.readings]
    options += ["--orientation none"] if question.without else []
    return Problem(
        path,
        f"the names do not tell {question.about}: {question.why}: {readings}",
        fix=f"give {' or '.join(options)}",
    )
