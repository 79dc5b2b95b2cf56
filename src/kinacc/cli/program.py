"""``kinacc compensate --program``: a robot program corrected for a calibrated arm."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import click
import numpy as np
import pandas as pd

from kinacc.cli import rows
from kinacc.cli.output import PICTURES, TABLES, Output, require_writable
from kinacc.deployment import programs
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem, as_seen, first_few
from kinacc.measurements.table import numbers_of


def correct(
    calibration: Calibration,
    program: str,
    near_deg: str | None,
    tools: tuple[str, ...],
    bases: tuple[str, ...],
    frames: tuple[str, ...],
    pulses_per_degree: str | None,
    base_is_fixed: bool,
    at_most_mm: float,
    leave: bool,
    dry_run: bool,
    table: str | None,
    picture: str | None,
    frame: str,
    point: str | None,
    out: str | None,
    as_json: bool,
    force: bool,
) -> None:
    """Correct a program, write it, and print its corrections; exit code 1 where one is refused."""
    if frame != "base":
        raise InputError(Problem("--frame", "programs are in the robot's own base", "base"))
    require_writable([table], force, TABLES)
    require_writable([picture], force, PICTURES)
    near = None
    if near_deg is not None:
        near = rows.of_arguments((near_deg,), "deg", calibration.robot, "--near-deg")[0]
    pulses = None if pulses_per_degree is None else _pulses(pulses_per_degree)
    given = {"tool": _frames("--tool", tools), "base": _frames("--base", bases)}
    if sys.stdin.isatty():
        found = programs.read_program(program, frames, pulses)
        for kind, name in programs.frames_missing(found):
            if name not in given[kind] and "" not in given[kind]:
                text = click.prompt(f"{kind} {name} (six numbers, mm and deg)")
                given[kind][name] = _numbers(f"--{kind}", text)
    answer = programs.compensate_program(
        calibration,
        program,
        given["tool"],
        given["base"],
        frames,
        near,
        pulses,
        point,
        at_most_mm,
        base_is_fixed,
    )
    if picture:
        from kinacc.figures.program import draw

        Output(picture=picture).draw(draw(answer.table))
    facts = {
        "language": answer.language,
        "corrected": int((answer.table["status"] == "corrected").sum()),
        "refused": [str(problem) for problem in answer.refused],
        "left": answer.left,
        "remarks": answer.remarks,
        "positions": answer.table,
    }
    Output(as_json, table).show(facts, answer.table, _lines(answer))
    if not as_json:
        for line in _warnings(answer):
            click.echo(as_seen(line), err=True)
    if not dry_run and out is not None:
        (replace(answer, refused=()) if leave else answer).write(out, force)
        click.echo(f"Written: {out}", err=as_json)
    if answer.refused and not leave:
        raise SystemExit(1)


def _lines(answer: programs.CorrectedProgram) -> Iterator[str]:
    moved = answer.table["status"] == "corrected"
    yield f"{answer.language}: {moved.sum()} of {len(answer.table)} positions corrected"
    if moved.any():
        changes = answer.table.loc[moved, "change_mm"]
        yield f"Change of a position: mean {changes.mean():.3g} mm, largest {changes.max():.3g} mm"


def _warnings(answer: programs.CorrectedProgram) -> Iterator[str]:
    for column, bad, text in (
        ("is_measured_there", False, "outside the measured region; errors may be larger"),
        ("is_near_singular", True, "near a singular posture"),
    ):
        named = answer.table.loc[answer.table.get(column, pd.Series()).eq(bad), "position"]
        if len(named):
            yield f"{len(named)} positions {text}: {first_few(list(named))}"
    yield from answer.remarks
    yield from (f"Computed by the program, not corrected: {line}" for line in answer.left)
    yield from (f"Refused: {problem}" for problem in answer.refused)


def _frames(option: str, texts: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Frames by name; the name is empty where a frame is for all."""
    given = {}
    for text in texts:
        name, _, numbers = text.rpartition("=")
        given[name.strip()] = _numbers(option, numbers)
    return given


def _numbers(option: str, text: str) -> np.ndarray:
    values = numbers_of(text)
    if len(values) not in (6, 7):
        raise InputError(Problem(option, repr(text), "six numbers, mm and deg"))
    return np.array(values)


def _pulses(text: str) -> np.ndarray:
    values = np.array(numbers_of(text))
    if len(values) == 0 or not np.all(values != 0.0):
        raise InputError(Problem("--pulses-per-degree", repr(text), "one number an axis"))
    return values
