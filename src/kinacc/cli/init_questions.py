"""What ``kinacc init`` asks where a file leaves open what was measured, and how."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import NoReturn

import click

from kinacc.cli.file_options import ANSWERS
from kinacc.cli.first_poses import poses_without_robot
from kinacc.errors import InputError, Problem
from kinacc.measurements.intake import guess as guesses
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.columns import Question
from kinacc.measurements.intake.guess import Guess

_CONVENTIONS = ("none", "quaternion", "rotation_vector", "XYZ", "ZYX", "xyz", "zyx", "ZYZ")
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


# By what is assumed: what is asked, and the option that answers it.
_QUESTIONS = {
    "horizontal": ("which way horizontal angles count", "--horizontal"),
    "orientation": ("how its orientations are written", "--orientation"),
    "order": ("the order of the parts of its quaternions", "--orientation"),
    "joint_unit": ("the unit of its joints", "--joint-unit"),
    "length_unit": ("the unit of its positions", "--length-unit"),
    "angle_unit": ("the unit of its orientations", "--angle-unit"),
}


def poses_to_ask_about(guess: Guess) -> list[dict[str, object]]:
    """The first poses as assumed, to look at before anything is asked; none where nothing is."""
    with suppress(InputError):  # joints that slide are not to be read without their robot
        return poses_without_robot(guess) if guess.assumed else []
    return []


def asked(guess: Guess, robot: str | None) -> Guess:
    """The guess after a person was asked about what it assumes.

    ``robot``: the one given, which needs no question. Raises InputError where nobody answers.
    """
    try:
        return _by_person(guess)
    except click.Abort:
        refuse_unanswered(guess, guess.assumed, robot)


def refuse_unanswered(guess: Guess, assumed: Mapping[str, str], robot: str | None) -> NoReturn:
    """Raise InputError naming the options that answer what nobody answered."""
    path = str(guess.section["path"])
    problems = [
        Problem(
            path,
            f"does not say {_QUESTIONS[each][0]}; the guess: {words}",
            fix=f"give {_QUESTIONS[each][1]}, or --yes to take the guess",
        )
        for each, words in assumed.items()
    ]
    if robot is None:
        fix = "give --robot, or --yes to take the one that fits"
        problems.append(Problem(path, "does not say which robot was measured", fix=fix))
    raise InputError(problems, "The questions were not answered, and nothing was written")


def _by_person(guess: Guess) -> Guess:
    for setting, words in guess.assumed.items():
        click.echo(f"Not stated in the file: {_QUESTIONS[setting][0]}. Guess: {words}.")
        if setting == "horizontal":
            ways = guess.section["directions"]
            answer = click.prompt(
                "Horizontal angles, seen from above",
                type=click.Choice(["clockwise", "counterclockwise"]),
                default=ways["horizontal"],
            )
            guess = guess.but({"directions": ways | {"horizontal": answer}})
        elif setting == "orientation":
            answer = click.prompt(
                "Orientation (Euler capitals: about moving axes, small: about fixed axes)",
                type=click.Choice(_CONVENTIONS),
                default=guess.section["orientation"]["convention"],
            )
            guess = guess.but({"orientation": orientation_of(answer)})
        elif setting == "order":
            order = click.prompt("Order", type=click.Choice(["wxyz", "xyzw"]), default="wxyz")
            guess = guess.but({"orientation": {"order": order}})
        else:
            units = ["mm", "m"] if setting == "length_unit" else ["deg", "rad"]
            now = guess.section["orientation"]["unit"]
            now = now if setting == "angle_unit" else guess.section[setting]
            unit = click.prompt("Unit", type=click.Choice(units), default=now)
            changed = (
                {"orientation": {"unit": unit}} if setting == "angle_unit" else {setting: unit}
            )
            guess = guess.but(changed)
    return guess


def orientation_of(word: str) -> dict:
    """The settings that an answer or ``--orientation`` stands for; InputError for no such word."""
    from kinacc.checks.orientations import CONVENTIONS

    if word in ("none", "quaternion", "rotation_vector"):
        return {"kind": word}
    if word == "quaternion_xyzw":
        return {"kind": "quaternion", "order": "xyzw"}
    if word in CONVENTIONS:
        return {"kind": "euler", "convention": word}
    allowed = f"none, quaternion, quaternion_xyzw, rotation_vector, {', '.join(CONVENTIONS)}"
    raise InputError(Problem("--orientation", repr(word), allowed))
