"""``kinacc compensate --program``: a robot program corrected for a calibrated arm."""

from __future__ import annotations

import sys
from collections.abc import Iterator

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
    near = near_deg and rows.of_arguments((near_deg,), "deg", calibration.robot, "--near-deg")[0]
    answer = programs.compensate_program(
        calibration,
        program,
        _frames("--tool", tools),
        _frames("--base", bases),
        frames,
        near,
        pulses_per_degree and np.array(numbers_of(pulses_per_degree)),
        point,
        at_most_mm,
        base_is_fixed,
        _asked if sys.stdin.isatty() else None,
    )
    if picture:
        from kinacc.figures.program import draw

        Output(picture=picture).draw(draw(answer.table))
    moved = answer.table["status"] == "corrected"
    changes = answer.table.get("change_mm", pd.Series(0.0, moved.index))[moved]
    lines = [
        f"{answer.language}: {moved.sum()} of {len(moved)} positions corrected",
        f"Change of a position: mean {changes.mean():.3g} mm, largest {changes.max():.3g} mm",
    ]
    facts = {
        "language": answer.language,
        "corrected": int(moved.sum()),
        "refused": [str(problem) for problem in answer.refused],
        "left": answer.left,
        "remarks": answer.remarks,
        "positions": answer.table,
    }
    Output(as_json, table).show(facts, answer.table, lines if moved.any() else lines[:1])
    for line in () if as_json else _warnings(answer):
        click.echo(as_seen(line), err=True)
    if answer.refused:
        raise SystemExit(1)
    if not dry_run and out is not None:
        answer.write(out, force)
        click.echo(f"Written: {out}", err=as_json)


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


def _asked(kind: str, name: str) -> np.ndarray:
    return _numbers(f"--{kind}", click.prompt(f"{kind} {name} (six numbers, mm and deg)"))


def _numbers(option: str, text: str) -> np.ndarray:
    values = numbers_of(text)
    if len(values) not in (6, 7):
        raise InputError(Problem(option, repr(text), "six numbers, mm and deg"))
    return np.array(values)
