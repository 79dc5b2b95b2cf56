"""``kinacc fitted``: what the calibration in a results folder is worth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.cli import choice
from kinacc.cli.output import Output, answers, plain
from kinacc.config.error_models import ALWAYS, ERROR_MODELS, NOMINAL, PLAINEST

if TYPE_CHECKING:
    from kinacc.measurements.row_names import RowNames

_FURTHER = (*(f"{kind}_model" for kind in ALWAYS), "residuals", "worst_rows")
_MODELS = (NOMINAL, *ERROR_MODELS)
_FIGURES = ("n", "rms", "mean", "max")
_SUBSETS = ("train", "validation")
_WORST = 5


@click.command("fitted")
@click.argument("folder", type=click.Path())
@click.option("--all", "whole", is_flag=True, help="Leave nothing out.")
@answers("Print JSON instead of text.")
def fitted(folder: str, whole: bool, out: Output) -> None:
    """Say what the calibration in FOLDER, the results of a data set, is worth.

    Half a page: the data and what is wrong with them, errors at held-out poses before and after,
    the model these select, where it is valid, what the poses could not tell apart, and the bound on
    the largest error if there is a campaign. With --all training errors, every statement and the
    rows with the largest errors too.

    \b
    Example:
      kinacc fitted results/ur10_b
      kinacc fitted results/ur10_b --all
      kinacc fitted results/ur10_b --json
    """
    from kinacc.report.answer import answer

    reason = choice.say_outdated(folder)
    if out.as_json:
        out.say({**summary(folder), **({"outdated": reason} if reason else {})}, "")
        return
    tables = read(folder, whole)
    lines = answer(folder, tables, whole)
    click.echo("\n".join([*lines, *(_further(tables) if whole else [])]))


def read(folder: Path | str, whole: bool = True) -> dict[str, dict]:
    """The tables needed, for all there is to tell or for half a page.

    Raises InputError naming all that are missing.
    """
    from kinacc.calibration.summary import TABLES
    from kinacc.report import answer

    return answer.read(folder, (*TABLES, *(_FURTHER if whole else ())))


def summary(folder: Path | str) -> dict:
    """The answer as plain values: errors in mm by model and subset, selection, statements, rows."""
    from kinacc.calibration import blind_words
    from kinacc.calibration.misfit import misfits
    from kinacc.calibration.summary import bending, findings, left_out, of, selected
    from kinacc.deployment.folder import recorded_robot
    from kinacc.measurements.row_names import RowNames
    from kinacc.report.answer import campaign_of, facts_of

    tables = read(folder)
    facts, bound = facts_of(tables), campaign_of(folder, tables).assessed
    excluded, names = tables.get("excluded_rows"), RowNames.of_columns(tables["measurements"])
    choice, told = tables["model_selection"], tables["dh_identified"]
    best = selected(choice)
    gain = choice["gain_mm2"][list(choice["model"]).index("vec")]
    error = choice["gain_std_error_mm2"][list(choice["model"]).index("vec")]
    return {
        "selected": best,
        "gain_of_vec_mm2": plain(gain),
        "gain_std_error_mm2": plain(error),
        "vec_order": int(max(tables["vec_model"]["order"])),
        "position_error_mm": {
            model: {subset: _errors(tables["residuals"], model, subset) for subset in _SUBSETS}
            for model in _MODELS
            if model in (NOMINAL, *choice["model"])
        },
        **{
            topic: {
                item: {name: plain(each.value) for name, each in known.items()}
                for item, known in of(facts, topic).items()
            }
            for topic in ("held_out_error", "held_out_orientation_error", "range")
        },
        "parameters": _statuses(told),
        "undetermined": blind_words.listed(told),
        "worst_rows": _worst(tables["worst_rows"], best, names),
        "left_out": left_out(tables.get("data_check")),
        "data": findings(tables["data_check"]) if "data_check" in tables else [],
        "excluded": None if excluded is None else _excluded(excluded, best),
        "position_error_with_excluded_mm": None
        if excluded is None
        else {
            model: _with_excluded(tables["residuals"], excluded, model)
            for model in _MODELS
            if model in (NOMINAL, *choice["model"])
        },
        "gains_mm2": _gains(choice),
        "bending": bending(tables.get("compliance_model")),
        "standard_deviations": {
            each.model: each.as_facts() for each in misfits(tables, recorded_robot(folder))
        },
        "largest_error": None if bound is None else bound.as_facts(),
    }


def _gains(choice: Mapping) -> dict[str, dict]:
    """Squared error that each model takes off that of the plainest one, and its standard error."""
    columns = (choice[name] for name in ("model", "gain_mm2", "gain_std_error_mm2"))
    return {
        str(model): {"gain": plain(gain), "std_error": plain(error)}
        for model, gain, error in zip(*columns, strict=True)
        if model != PLAINEST
    }


def _statuses(told: Mapping) -> dict[str, list[str]]:
    """Parameters of the DH fit by what the poses say of them."""
    pairs = [(str(p), str(s)) for p, s in zip(told["parameter"], told["status"], strict=True)]
    return {
        status: [parameter for parameter, each in pairs if each == status]
        for status in dict.fromkeys(each for _, each in pairs)
    }


def _errors(table: Mapping, model: str, subset: str) -> dict | None:
    for i, comparison in enumerate(table["comparison"]):
        wanted = comparison == f"{model}_vs_measured" and table["subset"][i] == subset
        if wanted and table["quantity"][i] == "position" and table["fold"][i] != table["fold"][i]:
            return {name: plain(table[name][i]) for name in _FIGURES}
    return None


def _excluded(table: Mapping, model: str) -> list[dict]:
    """The rows of one model, each with its error: null where it could not be read."""
    from kinacc.calibration.summary import excluded_errors
    from kinacc.measurements.row_names import RowNames

    names = RowNames.of_columns({**table, "row": table["line"]})
    return [
        {"line": line, "where": names.one(line), "reason": reason, "error_mm": plain(error)}
        for line, reason, error in excluded_errors(table, model)
    ]


def _with_excluded(residuals: Mapping, excluded: Mapping, model: str) -> dict | None:
    """Held-out figures with the rows that the configuration leaves out of all fits."""
    import numpy as np

    held_out = _errors(residuals, model, "validation")
    rows = excluded["comparison"] == f"{model}_vs_measured"
    size = np.linalg.norm([excluded[f"e{axis}_mm"][rows] for axis in "xyz"], axis=0)
    size = size[np.isfinite(size)]
    if held_out is None:
        return None
    n, more = held_out["n"], len(size)
    return {
        "n": n + more,
        "rms": float(np.sqrt((n * held_out["rms"] ** 2 + np.sum(size**2)) / (n + more))),
        "mean": float((n * held_out["mean"] + np.sum(size)) / (n + more)),
        "max": float(max(held_out["max"], *size, 0.0)),
    }


def _worst(table: Mapping, model: str, names: RowNames) -> list[dict]:
    rows = [
        i
        for i, comparison in enumerate(table["comparison"])
        if comparison == f"{model}_vs_measured"
    ]
    held_out = [i for i in rows if table["estimate"][i] == "cross_validated"] or rows
    held_out.sort(key=lambda i: table["rank"][i])
    return [
        {
            "line": plain(table["line"][i]),
            "row": int(table["row"][i]),
            "where": _called(table, i, names),
            "pose": int(table["pose"][i]),
            "target": str(table["target"][i]),
            "error_mm": plain(table["error_mm"][i]),
        }
        for i in held_out[:_WORST]
    ]


def _called(table: Mapping, i: int, names: RowNames) -> str:
    """What a person calls a row: by its line, or by its number where the arm is synthetic."""
    line, pose = table["line"][i], int(table["pose"][i])
    if line != line:
        return f"row {int(table['row'][i])}, pose {pose}"
    return names.one(line) if int(line) in names.pose else f"{names.one(line)}, pose {pose}"


def _further(tables: Mapping[str, Mapping]) -> list[str]:
    """What does not stand on the half page."""
    from kinacc.calibration.summary import selected
    from kinacc.calibration.summary_words import counted, paragraph
    from kinacc.config.error_models import model_name
    from kinacc.measurements.row_names import RowNames

    best = selected(tables["model_selection"])
    statuses = [f"{len(each)} {name}" for name, each in _statuses(tables["dh_identified"]).items()]
    names = RowNames.of_columns(tables["measurements"])
    worst = [
        f"{row['where']}, {row['target']}: {row['error_mm']:.3f} mm"
        for row in _worst(tables["worst_rows"], best, names)
    ]
    held_out = "cross_validated" in tables["worst_rows"]["estimate"]
    how = " where it was fitted without them" if held_out else ""
    return [
        *paragraph("parameters", [f"of the DH fit: {', '.join(statuses)}"]),
        *paragraph(
            "worst rows",
            [
                f"the {counted(len(worst), 'row')} that {model_name(best)} is farthest from{how}:",
                *worst,
            ],
        ),
    ]
