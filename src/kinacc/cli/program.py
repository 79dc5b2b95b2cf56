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
        _frames(tools),
        _frames(bases),
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
    changes = answer.table.query("status == 'corrected'").get("change_mm", pd.Series([0.0]))
    missed = f", {len(answer.not_corrected)} statements not" if answer.not_corrected else ""
    lines = [
        f"{answer.language}: {len(answer.table) - len(answer.refused)} of {len(answer.table)} "
        f"positions corrected{missed}; change: mean {changes.mean():.3g} mm, "
        f"largest {changes.max():.3g} mm"
    ]
    facts = {name: value for name, value in vars(answer).items() if name != "files"}
    Output(as_json, table).show(facts, answer.table, lines)
    for line in () if as_json else _warnings(answer):
        click.echo(as_seen(line), err=True)
    if answer.refused:
        raise SystemExit(1)
    if not dry_run and out is not None:
        answer.write(out, force)
        click.echo(f"Written: {out}", err=as_json)


def _warnings(answer: programs.CorrectedProgram) -> Iterator[str]:
    table = answer.table.reindex(columns=["position", "is_measured_there", "is_near_singular"])
    for named, text in (
        (table[table["is_measured_there"].eq(False)], "outside the measured region"),
        (table[table["is_near_singular"].eq(True)], "near a singular posture"),
    ):
        if len(named):
            yield f"{len(named)} positions {text}: {first_few(list(named['position']))}"
    yield from answer.remarks
    reason = "computed by the program, incomplete or defined elsewhere"
    yield from (f"Not corrected, {reason}: {line}" for line in answer.not_corrected)
    yield from (f"Refused: {problem}" for problem in answer.refused)


def _frames(texts: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Frames by name; the name is empty where a frame is for all."""
    parts = (text.rpartition("=") for text in texts)
    return {name.strip(): np.array(numbers_of(numbers)) for name, _, numbers in parts}


def _asked(kind: str, name: str) -> np.ndarray:
    return np.array(numbers_of(click.prompt(f"{kind} {name} (six numbers, mm and deg)")))
