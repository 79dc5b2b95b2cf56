"""The two files ``kinacc init`` writes: a data set and, where it needs one, a robot."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from kinacc.config.names import LONGEST
from kinacc.config.schema import defaults
from kinacc.kinematics import robot as robots
from kinacc.measurements.intake.guess import Guess
from kinacc.measurements.layout import Layout

_AS_USUAL = {**Layout().written(), "no_reading": [], "sigma": 1}
_FEW_POSES = 60  # below, every configuration is held out once
_PLAIN = re.compile(r"[A-Za-z_./][A-Za-z0-9_./ -]*")
_WORDS_OF_YAML = ("yes", "no", "on", "off", "true", "false", "null", "y", "n")


def dataset_text(name: str, robot: str, guess: Guess, configurations: int, note: str) -> str:
    """The data set as a configuration file."""
    section = guess.section
    turn = section["orientation"]
    lines = [
        *(f"# {line}" for line in note.splitlines()),
        "",
        "datasets:",
        f"  {name}:",
        f"    robot: {scalar(robot)}",
        "    measurements:",
        "      source: file",
        "      file:",
        f"        path: {scalar(section['path'])}",
    ]
    for key, default in _AS_USUAL.items():
        if section[key] != default:
            lines.append(f"        {key}: {_listed(section[key])}")
    if section.get("pulses_per_deg"):
        lines.append(f"        pulses_per_deg: {scalar(section['pulses_per_deg'])}")
    if section.get("repeats_in_names"):
        lines.append("        repeats_in_names: true # P12_1 and P12-2 are readings of one pose")
    if "joints" in section:
        lines.append("        joints: # in a file of their own")
        spare = () if section["joints"]["by"] == "time" else ("clock_offset_s", "within_s")
        for key, value in section["joints"].items():
            if value is not None and key not in spare and value != _AS_USUAL.get(key):
                lines.append(f"          {key}: {_listed(value)}")
    lines.append(f"        joint_unit: {section['joint_unit']}")
    lines.append(f"        length_unit: {section['length_unit']}")
    words = {"kind": turn["kind"]}
    if turn["kind"] == "euler":
        words["convention"] = turn["convention"]
    if turn["kind"] in ("euler", "rotation_vector"):
        words["unit"] = turn["unit"]
    if turn["kind"] == "quaternion" and any(k.endswith("quat1") for k in section["columns"]):
        words["order"] = turn["order"]
    listed = ", ".join(f"{key}: {scalar(value)}" for key, value in words.items())
    lines.append(f"        orientation: {{{listed}}}")
    lines.append(f"        targets: [{', '.join(scalar(name) for name in section['targets'])}]")
    if section["columns"]:
        lines.append("        columns: # our name: the file's name")
        for ours, own in section["columns"].items():
            key = ours if _PLAIN.fullmatch(ours) else scalar(ours)
            lines.append(f"          {key}: {scalar(own)}")
    folds = configurations if configurations < _FEW_POSES else defaults()["measurements"]["folds"]
    held = " # one configuration held out at a time" if configurations < _FEW_POSES else ""
    lines += [
        f"      folds: {folds}{held}",
        "      validation_fold: null # every row fits the delivered models; folds judge them",
        "    calibration:",
        "      base_and_tool: estimated",
        "      vec: {order: auto, prior: chosen} # chosen by held-out errors",
        "      dh: {fit_to: measurements, hayati_joints: auto}",
        "    evaluation:",
        "      space: measured # the region the measured poses fill",
    ]
    return "\n".join(lines) + "\n"


def _listed(value: Any) -> str:
    """A value, a list or a mapping as YAML on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_listed(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(_listed(each) for each in value)}]"
    return scalar(value)


def shipped_text(name: str) -> str:
    """The description of a shipped robot, to be kept beside the data and changed at will."""
    text = (Path(robots.__file__).parents[1] / "robots" / f"{name}.yaml").read_text("utf-8")
    head = f"# Copy of the shipped robot {name}; change what differs on yours (docs/robots.md)."
    return f"{head}\n{text}"


def urdf_text(name: str, urdf: Path, folder: Path) -> str:
    """A robot file that reads a URDF file, named from where the robot file stands."""
    return (
        f"# The arm of {urdf.name}; docs/robots.md says what else may stand here.\n"
        f"name: {scalar(name)}\n"
        f"urdf: {scalar(seen_from(folder, urdf))}\n"
        "# base_link: base       # where the chain starts, if not at the root\n"
        "# tip_link: tool0       # where it ends, if there is a choice\n"
    )


def coupled_text(text: str, joint_map: Sequence[Sequence[float]], why: str) -> str:
    """The text of a robot file with another ``joint_map``, which holds the rows' signs too."""
    text = re.sub(r",?\s*\bsign:\s*[+-]?1\b", "", text)
    text = re.sub(r"^joint_map:.*\n(?:[ \t-].*\n)*", "", text, flags=re.MULTILINE)
    rows = ", ".join(f"[{', '.join(f'{each:g}' for each in row)}]" for row in joint_map)
    return f"{text.rstrip()}\n# {why}\njoint_map: [{rows}]\n"


def template_text(name: str, joints: int) -> str:
    """A robot file to be filled in: an arm of ``joints`` rows that is no arm yet."""
    row = (
        "  - {theta_offset_deg: 0, d_mm: 0, a_mm: 100, alpha_deg: 90, sign: 1, "
        "limits_deg: [-360, 360]} # joint "
    )
    return "\n".join(
        [
            "# FILL IN: lengths and angles of the arm's data sheet, row by row (docs/robots.md).",
            "# sign: -1 where the controller counts against the row's axis. Until then check-data",
            "# says that the robot does not fit.",
            f"name: {scalar(name)}",
            "source: FILL IN where the figures come from",
            "convention: standard # or modified (Craig)",
            "dh:",
            *(f"{row}{number}" for number in range(1, joints + 1)),
            "",
        ]
    )


def seen_from(folder: Path, path: str | Path) -> str:
    """A path as a file in ``folder`` names it; an absolute one stays."""
    path = Path(path)
    return str(path) if path.is_absolute() else Path(os.path.relpath(path, folder)).as_posix()


def scalar(value: Any) -> str:
    """A value as YAML on one line."""
    if isinstance(value, str) and _PLAIN.fullmatch(value) and value.strip() == value:
        return value if value.lower() not in _WORDS_OF_YAML else json.dumps(value)
    return json.dumps(value, ensure_ascii=False)


def plain_name(path: str | Path) -> str:
    """Name of a data set after a file: letters, digits, _ and -, not too many."""
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", Path(path).stem).strip("_-")
    return stem[:LONGEST].rstrip("_-") or "measured"
