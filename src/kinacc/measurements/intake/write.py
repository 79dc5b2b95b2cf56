"""The two files ``kinacc init`` writes: a data set and, where it needs one, a robot."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from kinacc.config.measured import JointsFile, MeasuredFile
from kinacc.config.names import LONGEST
from kinacc.config.schema import defaults
from kinacc.kinematics import robot as robots
from kinacc.measurements.intake.guess import Guess

_FEW_POSES = 60  # below, every configuration is held out once


def dataset_content(robot: str, guess: Guess, poses: int) -> dict[str, Any]:
    """The settings of a data set as in the configuration; ``poses``: how many were measured."""
    section, usual = guess.section, MeasuredFile().model_dump()
    units = ("joint_unit", "length_unit")
    file = {k: v for k, v in section.items() if k in units or v != usual[k]}
    turn = section["orientation"]
    keys = {"euler": ("kind", "convention", "unit"), "rotation_vector": ("kind", "unit")}
    in_order = any(ours.endswith("quat1") for ours in section["columns"])
    shown = ("kind", "order") if in_order else keys.get(turn["kind"], ("kind",))
    file["orientation"] = {key: turn[key] for key in shown}
    if joints := section.get("joints"):
        usual = JointsFile().model_dump()
        file["joints"] = {k: v for k, v in joints.items() if k == "by" or v != usual[k]}
    few = poses < _FEW_POSES  # one configuration held out at a time
    return {
        "robot": robot,
        "measurements": {
            "source": "file",
            "file": file,
            "folds": poses if few else defaults()["measurements"]["folds"],
            "validation_fold": None,  # every row fits the delivered models; folds judge them
        },
        "calibration": {
            "base_and_tool": "estimated",
            "vec": {"order": "auto", "prior": "chosen"},
            "dh": {"fit_to": "measurements", "hayati_joints": "auto"},
        },
        "evaluation": {"space": "measured"},
    }


def dataset_text(name: str, robot: str, guess: Guess, poses: int, note: str) -> str:
    """The data set as a configuration file."""
    head = "".join(f"# {line}".rstrip() + "\n" for line in note.splitlines())
    return f"{head}\n{_yaml({'datasets': {name: dataset_content(robot, guess, poses)}})}"


class _Dumper(yaml.SafeDumper):
    """Lists and short mappings on one line."""


_Dumper.add_representer(
    list, lambda dumper, row: dumper.represent_sequence("tag:yaml.org,2002:seq", row, True)
)


def _yaml(content: Any) -> str:
    return yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=1000)


def shipped_text(name: str) -> str:
    """The description of a shipped robot, to be kept beside the data and changed at will."""
    text = (Path(robots.__file__).parents[1] / "robots" / f"{name}.yaml").read_text("utf-8")
    head = f"# Copy of the shipped robot {name}; change what differs on yours (docs/robots.md)."
    return f"{head}\n{text}"


def urdf_text(name: str, urdf: Path, folder: Path) -> str:
    """A robot file that reads a URDF file, named from where the robot file stands."""
    return (
        f"# The arm of {urdf.name}; docs/robots.md says what else may stand here.\n"
        f"{_yaml({'name': name, 'urdf': seen_from(folder, urdf)})}"
        "# base_link: base       # where the chain starts, if not at the root\n"
        "# tip_link: tool0       # where it ends, if there is a choice\n"
    )


def coupled_text(text: str, joint_map: Sequence[Sequence[float]], why: str) -> str:
    """The text of a robot file with another ``joint_map``, which holds the rows' signs too."""
    text = re.sub(r",?\s*\bsign:\s*[+-]?1\b", "", text)
    text = re.sub(r"^joint_map:.*\n(?:[ \t-].*\n)*", "", text, flags=re.MULTILINE)
    rows = ", ".join(f"[{', '.join(f'{factor:g}' for factor in row)}]" for row in joint_map)
    return f"{text.rstrip()}\n# {why}\njoint_map: [{rows}]\n"


# theta offset, d, a, alpha of six axes with a spherical wrist, and the lengths of the drawing.
_SIX = (
    (0, 100, 100, -90, "d: A, a: B"),
    (-90, 0, 100, 0, "a: C"),
    (0, 0, 100, -90, "a: D; d: axis 4 sideways, to the left"),
    (0, 100, 0, 90, "d: E"),
    (0, 0, 0, -90, "no length"),
    (180, 100, 0, 0, "d: F"),
)


def template_text(name: str, joints: int) -> str:
    """A robot file to be filled in: an arm of ``joints`` rows that is no arm yet."""
    form = _SIX if joints == len(_SIX) else ((0, 0, 100, 90, "joint"),) * joints
    rows = "".join(
        f"  - {{theta_offset_deg: {theta}, d_mm: {d}, a_mm: {a}, alpha_deg: {alpha}, sign: 1, "
        f"limits_deg: [-360, 360]}} # {number}, {lengths}\n"
        for number, (theta, d, a, alpha, lengths) in enumerate(form, 1)
    )
    return (
        "# FILL IN lengths and limits of the data sheet, named by the drawing in docs/robots.md.\n"
        "# sign: -1 where the controller counts against the drawing. theta_offset_deg: less sign\n"
        "# times the angle that the controller shows in the drawn pose. check-data then tries it.\n"
        f"{_yaml({'name': name})}source: FILL IN where the figures come from\ndh:\n{rows}"
    )


def seen_from(folder: Path, path: str | Path) -> str:
    """A path as a file in ``folder`` names it; an absolute one stays."""
    path = Path(path)
    return str(path) if path.is_absolute() else Path(os.path.relpath(path, folder)).as_posix()


def plain_name(path: str | Path) -> str:
    """Name of a data set after a file: letters, digits, _ and -, not too many."""
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", Path(path).stem).strip("_-")
    return stem[:LONGEST].rstrip("_-") or "measured"
