"""How each reader is called by the fuzzer: in this process, as the commands and stages call it."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from kinacc.errors import KinaccError


class CrashError(Exception):
    """A command that ended in something other than an answer or a message."""


class RefusedError(KinaccError):
    """A command that ended with a message."""


def called(*words: object) -> None:
    """Run a command as a person would; an exception that is no message comes out of it."""
    from command_line import call

    done = call(*words)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    if done.exit_code not in (0, 1, 2) or "Traceback" in done.output:
        raise CrashError(f"exit code {done.exit_code}: {done.output[-500:]}")
    if "nested too deeply" in done.output or "not enough memory" in done.output:
        raise CrashError(done.output[-500:])
    if done.exit_code == 2:
        raise RefusedError(done.output[-500:])


def guessed(folder: Path, options: dict) -> None:
    """What ``init`` makes of a file before it asks, its text, and the file read by it."""
    from kinacc.cli.first_poses import poses_without_robot
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.intake import guess as guesses
    from kinacc.measurements.intake import write
    from kinacc.measurements.reader import read

    given = [Path(name) for name in options["given"]]
    found = guesses.look(
        given if len(given) > 1 else given[0],
        options["take"],
        options["turned"],
        options["answers"],
    )
    if found.found.questions:
        return
    guesses.sigma_choice(found)
    found.unused()
    write.dataset_text("own", "own.robot.yaml", found, 30, "note")
    poses_without_robot(found)
    read(found.section, robots.load(options["robot"]), strict=options["strict"])


def init(folder: Path, options: dict) -> None:
    """The command, and the data set it wrote."""
    words = ["--robot", options["robot"], "--json", "--out", "out", "--name", "own", "--force"]
    for name, value in options["answers"].items():
        words += [f"--{name.replace('_', '-')}", value]
    called("init", *options["given"], *words)
    called("check-data", "out/own.yaml", "--json")


def described(folder: Path, options: dict) -> None:
    """The stage ``measurements``: a file by its description, dealt into folds."""
    from kinacc.config.schema import defaults
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.reader import read, read_excluded
    from kinacc.workflow.stages.measurements import split

    usual = defaults()["measurements"]
    given = options["section"]
    section = {
        **usual["file"],
        **given,
        "orientation": usual["file"]["orientation"] | given["orientation"],
    }
    arm = robots.load(options["robot"])
    found = read(section, arm, strict=options["strict"])
    found.left_out()
    if section["exclude"]:
        read_excluded(section, arm)
    settings = {"measurements": {**usual, "folds": 3, "validation_fold": 0}, "seed": 1}
    settings["measurements"]["fold_by"] = options["fold_by"]
    split(found.columns, settings)


def examined(folder: Path, options: dict) -> None:
    """``check-data`` of a described file."""
    from kinacc.checks import check
    from kinacc.config.schema import defaults
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.layout import Layout
    from kinacc.measurements.reader import read

    usual = defaults()["measurements"]["file"]
    given = options["section"]
    section = {**usual, **given, "orientation": usual["orientation"] | given["orientation"]}
    arm = robots.load(options["robot"])
    reading = read(section, arm, strict=False)
    found = check.check(
        reading, Layout.of(section), arm, "own", section["path"], lambda items, words: items
    )
    found.as_text()
    found.as_dict()


def robot_file(folder: Path, options: dict) -> None:
    """A robot file, written again and read back."""
    from kinacc.kinematics import robot as robots

    name = options["file"]
    robots.files(name)
    arm = robots.load(name)
    robots.of_text(robots.as_yaml(arm), "again")
    robots.forward(arm, 0.5 * (arm.q_min_rad + arm.q_max_rad)[None])


def configuration(folder: Path, options: dict) -> None:
    """A configuration, alone or over the paper's."""
    from kinacc.workflow.contradictions import load

    load(["own.yaml"], options.get("overrides") or None)


def campaign(folder: Path, options: dict) -> None:
    """A campaign's folder, where it stands, and what is said of it."""
    from kinacc.campaign import marks, words
    from kinacc.campaign.folder import open_
    from kinacc.cli import campaigns_answers as answers

    opened = open_(".")
    state = opened.state()
    marks.doubts(opened)
    words.standing(state)
    words.statements(state)
    answers.as_facts(state, 1.0)
    if state.asked is not None:
        answers.next_in_words(state)


@cache
def _calibration() -> Any:
    from kinacc.deployment.record import nominal
    from kinacc.kinematics import robot as robots

    return nominal(robots.load("mh180"))


def joints_given(folder: Path, options: dict) -> None:
    """``predict``: joints of a file, and poses there."""
    from kinacc.cli import tables
    from kinacc.deployment.predict import predict

    held = _calibration()
    given = tables.given_joints(held.robot, options["given"], (), (), options["answers"])
    predict(
        held,
        given.joints,
        given.directions,
        "base",
        None,
        lambda items, words: items,
        given.payload,
    )


def poses_given(folder: Path, options: dict) -> None:
    """``compensate``: poses of a file, and the joints for them."""
    from kinacc.cli import target_poses
    from kinacc.deployment.compensate import compensate

    held = _calibration()
    path, program = (None, options["given"]) if options["program"] else (options["given"], None)
    given = target_poses.poses(held, path, (), options["near"], program, "base", None)
    found = compensate(
        held, given.pose, given.joints, given.directions, "base", None, given.payload
    )
    unlike = target_poses.unlike_measured(held, found, None)
    target_poses.compensated(held, given, found, "base", None, unlike, program is not None)


def words_given(folder: Path, options: dict) -> None:
    """Numbers given as arguments: joints, a pose, joints to be near to."""
    from kinacc.cli import rows, target_poses

    held = _calibration()
    kind, words = options["kind"], options["words"]
    if kind == "pose":
        target_poses.poses(held, None, (words,), options.get("near"), None, "base", None)
    else:
        found = rows.of_arguments((words,), kind, held.robot, "--joints")
        given = rows.Rows(1, found[:, 0], found, None, None, ())
        rows.require_within_limits(held.robot, given, "joints")


def compared(folder: Path, options: dict) -> None:
    """``compare``: two robot files, at the joints of a file."""
    joints = ["--joints", options["joints"]] if options["joints"] else []
    called("compare", "a.yaml", "b.yaml", "--poses", 10, "--json", *joints)


def table_read(folder: Path, options: dict) -> None:
    """A table alone: read, its metadata, shown."""
    from kinacc.artifacts import store

    name = options["file"]
    store.read_metadata(Path(name))
    store.read(Path(name))


def table_shown(folder: Path, options: dict) -> None:
    """``show`` of a table, in one of its forms."""
    called("show", options["file"], *options["form"])


def results_used(folder: Path, options: dict) -> None:
    """The results of a data set as predictions take them."""
    import numpy as np

    from kinacc.cli import choice
    from kinacc.deployment.predict import predict

    held = choice.calibration_of("mh180", options["model"], None, ())
    predict(
        held,
        np.zeros((1, held.robot.dh.joints)),
        None,
        "base",
        None,
        lambda items, words: items,
        None,
    )


def results_checked(folder: Path, options: dict) -> None:
    """``check-results``, ``fitted`` and ``summary`` of a results folder."""
    if options["command"] == "check-results":
        from kinacc.workflow.verification.check import check_results

        str(check_results("."))
    else:
        called(options["command"], *(("mh180",) if options["command"] == "fitted" else (".",)))
