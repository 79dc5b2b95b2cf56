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
from kinacc.tables import store
from kinacc.tables.atomic import replacing

FORMATS = tuple(module.name for module in pkgutil.iter_modules(_formats.__path__))


def format_named(name: str) -> ModuleType:
    """The module of a format."""
    return import_module(f"{_formats.__name__}.{name}")


def formats_of(model: str) -> tuple[str, ...]:
    """Formats that carry a model."""
    return tuple(item for item in FORMATS if model == PLAINEST or format_named(item).ANY_MODEL)


def contents(
    source: Source, formats: Sequence[str] = (), name: str | None = None
) -> dict[str, str]:
    """File names and their text for a calibrated model; all formats that carry it by default.

    Raises InputError for what cannot be exported.
    """
    arm, able = source.calibration, formats_of(source.calibration.choice)
    # A name of its own, so that the DH files may stand beside it.
    stem = name or (arm.name if arm.choice == PLAINEST else f"{arm.name}_{arm.choice}")
    message, fix = f"cannot carry a {arm.choice} model", f"or give --model {PLAINEST}"
    problems = names.not_of_a_file("--name", stem if name is None else name)
    problems += [
        Problem(f"--format {item}", message, ", ".join(able), fix)
        for item in formats
        if item not in able
    ]
    refuse(problems, "Nothing was written")
    modules = [format_named(item) for item in dict.fromkeys(formats or able)]
    return {f"{stem}{item.ENDING}": item.text(source) for item in modules}


def read_source(
    folder: Path | str,
    robot: Robot,
    model: str = PLAINEST,
    urdf_file: Path | str | None = None,
    links: tuple[str | None, str | None] = (None, None),
    dh_joints: bool = False,
) -> Source:
    """What formats are made of, from a results folder; InputError where it cannot be used."""
    tables = results.read_tables(folder)
    arm = results.calibration(tables, robot, model, Path(folder).resolve().name)
    path = Path(folder) / f"{model}_model.parquet"
    known = store.read_metadata(path) if path.is_file() else {}
    marks = {key: known[key] for key in store.PROVENANCE_KEYS if key in known}
    return Source(arm, tables, marks, urdf_file, links, dh_joints)


def notes(source: Source) -> list[str]:
    """What the poses leave open, and the model that was selected instead of the one written."""
    lines, identified = [], source.tables.get(f"{PLAINEST}_identified")
    weak = identifiability.weak(identifiability.listed(identified)) if identified else []
    if weak:
        lines = [f"warning: valid for poses like the measured ones: {'; '.join(weak)}"]
    selected = results.selected_model(source.tables)
    if selected != source.calibration.choice:
        lines.append(f"note: {model_name(selected)} was selected (--model {selected})")
    return lines


def write(files: Mapping[str, str], target: Path | str, force: bool = False) -> list[str]:
    """Write files into a folder, all or none; InputError for those already there."""
    paths = [Path(target) / name for name in files]
    refuse(
        [
            Problem(str(path), "is there already", fix="give --force to replace it")
            for path in paths
            if path.exists() and not force
        ],
        "Nothing was written",
    )
    with replacing(paths) as temporary:
        for part, text in zip(temporary, files.values(), strict=True):
            part.write_text(text, encoding="utf-8")
    return [str(path) for path in paths]
