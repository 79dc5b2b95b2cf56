"""``kinacc compensate --program``: a robot program corrected for a calibrated arm."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Any

import click
import numpy as np

from kinacc.cli import rows
from kinacc.cli.exit_codes import AGAINST
from kinacc.cli.output import PICTURES, TABLES, Output, require_writable
from kinacc.deployment import programs
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem, as_seen, first_few
from kinacc.measurements.table import numbers_of


def correct(
    calibration: Calibration, program: str, near_deg: str | None, options: Mapping[str, Any]
) -> None:
    """Correct a program, write it, and print its corrections; exit code 1 where one is refused.

    ``options``: those of ``kinacc compensate``, by their names.
    """
    if options["frame"] != "base":
        raise InputError(Problem("--frame", "programs are in the robot's own base", "base"))
    require_writable([options["table"]], options["force"], TABLES)
    require_writable([options["picture"]], options["force"], PICTURES)
    near, pulses = near_deg, options["pulses_per_degree"]
    answer = programs.compensate_program(
        calibration,
        program,
        _frames(options["tools"]),
        _frames(options["bases"]),
        options["frames"],
        near and rows.of_arguments((near,), "deg", calibration.robot, "--near-deg")[0],
        pulses and np.array(numbers_of(pulses)),
        options["point"],
        options["at_most_mm"],
        options["base_is_fixed"],
        _asked if sys.stdin.isatty() else None,
    )
    out = Output(options["as_json"], options["table"], options["picture"])
    if out.picture:
        from kinacc.figures.program import draw

        out.draw(draw(answer.table))
    change = answer.table.get("change_mm", answer.table["status"] == "")
    change = change[answer.table["status"] == "corrected"]
    missed = f", {len(answer.not_corrected)} statements not" if answer.not_corrected else ""
    line = f"{answer.language}: {len(change)} of {len(answer.table)} positions corrected{missed}"
    if len(change):
        line += f"; change: mean {change.mean():.3g} mm, largest {change.max():.3g} mm"
    facts = {name: value for name, value in vars(answer).items() if name != "files"}
    out.show(facts, answer.table, [line])
    for text in () if out.as_json else _warnings(answer):
        click.echo(as_seen(text), err=True)
    if answer.refused:
        raise SystemExit(AGAINST)
    if not options["dry_run"] and options["out"] is not None:
        answer.write(options["out"], options["force"])
        click.echo(f"Written: {options['out']}", err=out.as_json)


def _warnings(answer: programs.CorrectedProgram) -> Iterator[str]:
    table = answer.table.reindex(columns=["position", "is_measured_there", "is_near_singular"])
    for warned, text in (
        (table["is_measured_there"].eq(False), "outside the measured region"),
        (table["is_near_singular"].eq(True), "near a singular posture"),
    ):
        if warned.any():
            yield f"{warned.sum()} positions {text}: {first_few(list(table['position'][warned]))}"
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
