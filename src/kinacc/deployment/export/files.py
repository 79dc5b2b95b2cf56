"""The files of ``kinacc export``, made in memory first and written all or none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from kinacc.calibration import blind_words
from kinacc.calibration.identified import FIXED
from kinacc.calibration.misfit import misfit
from kinacc.config import names
from kinacc.config.error_models import PLAINEST, model_name
from kinacc.deployment import folder as results
from kinacc.deployment.export import description, tables, urdf
from kinacc.errors import InputError, Problem, refuse
from kinacc.kinematics.dh import PARAMETERS
from kinacc.kinematics.robot import Robot
from kinacc.tables import store
from kinacc.tables.atomic import replacing

CARRY_ALL = ("json",)  # formats for models that are no table of DH parameters
_ENDINGS = {
    "yaml": ".yaml",
    "json": ".json",
    "csv": ".csv",
    "urdf": ".urdf",
    "markdown": "_tables.md",
    "latex": "_tables.tex",
}


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
    found = results.read_tables(folder)
    arm = results.calibration(found, robot, model, dataset)
    if arm.model.table is None:
        what, fix = f"cannot carry a {model} model", f"or give --model {PLAINEST}"
        problems = [
            Problem(f"--format {each}", what, ", ".join(CARRY_ALL), fix)
            for each in dict.fromkeys(formats)
            if each not in CARRY_ALL
        ]
        refuse(problems, "Nothing was written")
    fits = misfit(found, robot, model)
    std = _deviations(found[f"{model}_model"], arm.model.joints)
    made = {}
    for each in dict.fromkeys(formats):
        if each == "yaml":
            text = description.robot_yaml(arm)
        elif each == "json":
            known = store.read_metadata(Path(folder) / f"{model}_model.parquet")
            marks = {key: known[key] for key in store.PROVENANCE_KEYS if key in known}
            own = None if arm.model.table is not None else found[f"{model}_model"]
            text = description.robot_json(arm, std, robot.dh, marks, fits, own)
        elif each == "csv":
            text = description.robot_csv(arm, std, robot.dh, fits)
        elif each == "urdf" and urdf_file is not None:
            text = urdf.corrected(arm, urdf_file, *links)
        elif each == "urdf":
            text = urdf.generated(arm, dh_joints)
        else:
            text = _tables(found, robot, dataset, arm.left_open or (), each)
        # A name of its own, so that the DH files may stand beside it.
        own_name = dataset if model == PLAINEST else f"{dataset}_{model}"
        made[f"{own_name if name is None else name}{_ENDINGS[each]}"] = text
    return made


def warning(folder: Path | str) -> str:
    """What the measured poses show too little of, in a line; empty where they show everything."""
    told = results.read_tables(folder).get(f"{PLAINEST}_identified")
    weak = [] if told is None else blind_words.weak(blind_words.listed(told))
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
    formats = "" if other == PLAINEST else f", as {' and '.join(CARRY_ALL).upper()}"
    kind = "plainest" if other == PLAINEST != selected else "selected"
    return (
        f"note: this is the {model_name(model)} model, {rms[model]} rms of {left[model].poses}; "
        f"{option} writes the {kind} one{formats}: {model_name(other)}, {rms[other]}"
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


def _tables(found: Mapping, robot: Robot, dataset: str, unseen: Sequence[str], form: str) -> str:
    if "residuals" not in found:
        raise InputError(Problem(f"{dataset}: residuals.parquet", "no such file", "a finished run"))
    nominal = {"joint": np.arange(1, robot.dh.joints + 1)}
    nominal |= {name: getattr(robot.dh, name) for name in PARAMETERS}
    told = found.get(f"{PLAINEST}_identified", {"parameter": [], "status": []})
    pairs = zip(told["parameter"], told["status"], strict=True)
    fixed = {str(parameter) for parameter, status in pairs if status == FIXED}
    selected = results.recorded_model(found)
    made = tables.paper_tables(
        found["residuals"],
        found["dh_model"],
        nominal,
        dataset,
        unseen,
        fixed,
        selected,
        misfit(found, robot, PLAINEST),
    )
    return (tables.markdown if form == "markdown" else tables.latex)(made)


def _deviations(columns: Mapping[str, np.ndarray], joints: int) -> np.ndarray:
    """Standard deviations (k, 5), by joint, as ``dh.PARAMETERS``; NaN where it has none of them."""
    if f"std_{PARAMETERS[0]}" not in columns:
        return np.full((joints, len(PARAMETERS)), np.nan)
    order = np.argsort(columns["joint"], kind="stable")
    return np.stack(
        [np.asarray(columns[f"std_{name}"], dtype=float)[order] for name in PARAMETERS], axis=1
    )
