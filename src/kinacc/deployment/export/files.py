"""The files of ``kinacc export``, made in memory first and written all or none."""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType

from kinacc.calibration import identifiability
from kinacc.config import names
from kinacc.config.error_models import PLAINEST, model_name
from kinacc.deployment import folder as results
from kinacc.deployment.export import formats as _formats
from kinacc.deployment.export.source import Source
from kinacc.errors import Problem, refuse
from kinacc.kinematics.robot import Robot
from kinacc.tables.atomic import replacing

FORMATS = tuple(each.name for each in pkgutil.iter_modules(_formats.__path__))


def format_named(name: str) -> ModuleType:
    """The module of a format."""
    return import_module(f"{_formats.__name__}.{name}")


def formats_of(model: str) -> tuple[str, ...]:
    """Formats that carry a model."""
    return tuple(each for each in FORMATS if model == PLAINEST or format_named(each).ANY_MODEL)


def contents(
    folder: Path | str,
    robot: Robot,
    formats: Sequence[str],
    name: str | None = None,
    urdf_file: Path | str | None = None,
    links: tuple[str | None, str | None] = (None, None),
    dh_joints: bool = False,
    model: str = PLAINEST,
) -> dict[str, str]:
    """File names and their text for a calibrated model of a results folder.

    Raises InputError for what cannot be exported.
    """
    dataset = Path(folder).resolve().name
    if name is None:
        problems = names.not_in_a_line("the results folder", dataset)
    else:
        problems = names.not_of_a_file("--name", name)
    refuse(problems, "Nothing was written")
    tables = results.read_tables(folder)
    arm = results.calibration(tables, robot, model, dataset)
    if arm.model.table is None:
        able, fix = formats_of(model), f"or give --model {PLAINEST}"
        what = f"cannot carry a {model} model"
        wrong = [each for each in dict.fromkeys(formats) if each not in able]
        refuse(
            [Problem(f"--format {each}", what, ", ".join(able), fix) for each in wrong],
            "Nothing was written",
        )
    source = Source(arm, tables, Path(folder), urdf_file, links, dh_joints)
    # A name of its own, so that the DH files may stand beside it.
    stem = name or (dataset if model == PLAINEST else f"{dataset}_{model}")
    modules = [format_named(each) for each in dict.fromkeys(formats)]
    return {f"{stem}{each.ENDING}": each.text(source) for each in modules}


def warning(folder: Path | str) -> str:
    """What the measured poses show too little of, in a line; empty where they show everything."""
    told = results.read_tables(folder).get(f"{PLAINEST}_identified")
    weak = [] if told is None else identifiability.weak(identifiability.listed(told))
    if not weak:
        return ""
    more = f" and {len(weak) - 1} more" if len(weak) > 1 else ""
    return (
        f"warning: the arm is calibrated for poses like the measured ones only: {weak[0]}{more}; "
        "the files say so"
    )


def note(folder: Path | str, model: str = PLAINEST) -> str:
    """What the ``model`` written leaves beside the selected one, and how to get the other."""
    found = results.read_tables(folder)
    selected = results.selected_model(found)
    other = PLAINEST if model == selected else selected
    left = {each: results.residual(found, each) for each in (model, other)}
    if model == other or None in left.values():
        return ""
    rms = {each: f"{known.position_mm:.3f} mm" for each, known in left.items()}
    option = "without --model" if other == PLAINEST else f"--model {other}"
    carried = "" if other == PLAINEST else f", as {' and '.join(formats_of(other)).upper()}"
    kind = "plainest" if other == PLAINEST != selected else "selected"
    return (
        f"note: this is the {model_name(model)} model, {rms[model]} rms of {left[model].poses}; "
        f"{option} writes the {kind} one{carried}: {model_name(other)}, {rms[other]}"
    )


def write(made: Mapping[str, str], target: Path | str, force: bool = False) -> list[str]:
    """Write files into a folder, all or none; InputError for those already there."""
    paths = [Path(target) / name for name in made]
    there = [
        Problem(str(path), "is there already", fix="give --force to replace it")
        for path in paths
        if path.exists() and not force
    ]
    refuse(there, "Nothing was written")
    with replacing(paths) as temporary:
        for part, text in zip(temporary, made.values(), strict=True):
            part.write_text(text, encoding="utf-8")
    return [str(path) for path in paths]
