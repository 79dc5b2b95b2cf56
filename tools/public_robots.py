"""Calibrate the measured arms of examples/data blind: ``python tools/public_robots.py``.

Works in public-robots/, by the commands a user would type and nothing else; what is up to date is
not made again. Leaves docs/public-robots.csv, from which document_public_robots.py writes the page.
"""

from __future__ import annotations

import csv
import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import yaml

ROOT = Path(__file__).parents[1]
DATA = ROOT / "examples" / "data"
FOLDER = ROOT / "public-robots"
TABLE = ROOT / "docs" / "public-robots.csv"
UR5, UR10 = DATA / "ur5_gts", DATA / "ur10_tmac"
COPIED = {
    "ur5.robot.yaml": ROOT / "examples" / "ur5.robot.yaml",
    "ur10_b.csv": UR10 / "series_B.csv",
    "ur10_d.csv": UR10 / "published_series_D.csv",
}
ADDED = {"ur5_grid.csv": "published_grid.csv", "ur5_random.csv": "published_random.csv"}
ROBOT = {"ur5_grid": "ur5.robot.yaml", "ur5_random": "ur5.robot.yaml"}  # ur10 is shipped
FITTED = ("ur5_grid", "ur10_b", "ur10_d")
VERIFIED = (
    ("ur5_grid", "ur5_random", "same"),
    ("ur10_b", "ur10_d", "moved"),
    ("ur10_d", "ur10_b", "moved"),
)
# What init writes of every file that is fitted, beside the description of its columns.
SETTINGS = {
    "measurements": {"folds": 5, "validation_fold": None},
    "calibration": {
        "base_and_tool": "estimated",
        "vec": {"order": "auto", "prior": "chosen"},
        "dh": {"fit_to": "measurements", "hayati_joints": "auto"},
    },
}

_DIGITS = 5  # of mm: what no machine or library changes


class Row(NamedTuple):
    """One model held to one set of readings; errors of position in mm.

    ``fitted`` and ``judged``: data sets, the same where shares of it were held out. ``where``: all
    readings, or those at which every model says something. ``order`` of a VEC model. ``like``:
    readings that lie where the calibration was measured, empty where shares were held out.
    """

    fitted: str
    judged: str
    where: str
    model: str
    selected: bool
    order: int | None
    readings: int
    mean_mm: float
    quantile_99_mm: float
    largest_mm: float
    rms_mm: float
    like: int | None


def commands() -> list[list[str]]:
    """The commands in their order, as a user would type them."""
    names = dict.fromkeys([*FITTED, *(judged for _, judged, _ in VERIFIED)])
    described = [
        ["kinacc", "init", f"{each}.csv", "--robot", ROBOT.get(each, "ur10"), "--yes"]
        for each in names
    ]
    fits = [["kinacc", "calibrate", f"{each}.yaml"] for each in FITTED]
    held = [
        [
            "kinacc",
            "verify",
            f"{judged}.yaml",
            "--calibration",
            f"results/{fitted}",
            "--base",
            setup,
            "--tool",
            setup,
        ]
        for fitted, judged, setup in VERIFIED
    ]
    return [*described, *fits, *held]


def with_points(published: str) -> str:
    """A published table of the UR5 as joints and the point that was measured, in mm.

    ``x_dif`` is actual minus target: ``x_t + x_dif`` has six decimals in every row, as instruments
    write them, and ``x_t - x_dif`` has not.
    """
    lines = ["joint_1,joint_2,joint_3,joint_4,joint_5,joint_6,x_mm,y_mm,z_mm"]
    for row in csv.DictReader(published.splitlines()):
        joints = [row[f"joint_{i}"] for i in range(1, 7)]
        points = [float(row[f"{axis}_t"]) + float(row[f"{axis}_dif"]) for axis in "xyz"]
        lines.append(",".join([*joints, *(f"{each:.6f}" for each in points)]))
    return "\n".join(lines) + "\n"


def prepare(folder: Path) -> None:
    """Put the measured files into ``folder``; those that are there already stay as they are."""
    folder.mkdir(exist_ok=True)
    for name, source in COPIED.items():
        if not (folder / name).is_file() or (folder / name).read_bytes() != source.read_bytes():
            shutil.copyfile(source, folder / name)
    for name, published in ADDED.items():
        text = with_points((UR5 / published).read_text(encoding="utf-8"))
        if not (folder / name).is_file() or (folder / name).read_text(encoding="utf-8") != text:
            (folder / name).write_text(text, encoding="utf-8")


def settings_of(path: Path) -> dict:
    """What a configuration by init says beside the description of a file's columns."""
    (section,) = yaml.safe_load(path.read_text(encoding="utf-8"))["datasets"].values()
    measurements = section["measurements"]
    told = {name: measurements[name] for name in measurements if name not in ("source", "file")}
    return {"measurements": told, "calibration": section["calibration"]}


def carry_out(folder: Path, cores: str) -> Iterator[Row]:
    """Every row of the table, by the commands."""
    answers = {}
    for words in commands():
        more = {"init": ["--force"], "calibrate": ["--cores", cores], "verify": ["--json"]}
        print(shlex.join(words), flush=True)
        answers[tuple(words)] = _answer(folder, [*words[1:], *more[words[1]]])
        if words[1] == "init" and (name := Path(words[2]).stem) in FITTED:
            own = folder / f"{name}.yaml"
            if settings_of(own) != SETTINGS:
                raise SystemExit(f"{own}: init writes other settings than this file says")
    for name in FITTED:
        yield from _held_out(
            name, json.loads(_answer(folder, ["fitted", f"results/{name}", "--json"]))
        )
    for words, text in answers.items():
        if words[1] == "verify":
            yield from _elsewhere(json.loads(text))


def _answer(folder: Path, words: list[str]) -> str:
    one_thread = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, "-m", "kinacc", *words]
    return subprocess.run(
        command,
        cwd=folder,
        env=os.environ | one_thread,
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    ).stdout


def _held_out(name: str, said: Mapping) -> Iterator[Row]:
    for model, found in said["held_out_error"].items():
        rms = said["position_error_mm"][model]["validation"]["rms"]
        figures = [found["mean"], found["quantile_99"], found["largest"], rms]
        order = said["vec_order"] if model == "vec" else None
        chosen = model == said["selected"]
        rounded = [round(each, _DIGITS) for each in figures]
        yield Row(name, name, "all", model, chosen, order, int(found["n"]), *rounded, None)


def _elsewhere(said: Mapping) -> Iterator[Row]:
    fitted, most = Path(said["calibration"]).name, said["readings"]
    for row in said["rows"]:
        model = row["model"].lower()
        figures = [row[name] for name in ("mean_mm", "quantile_99_mm", "largest_mm", "rms_mm")]
        rounded = [round(each, _DIGITS) for each in figures]
        where = "all" if row["readings"] == most else "common"
        chosen = model == said["selected"]
        like = said["like_measured"]
        yield Row(
            fitted, said["readings_of"], where, model, chosen, None, row["readings"], *rounded, like
        )


def write(rows: list[Row], path: Path = TABLE) -> None:
    """The table as CSV; empty cells for what does not apply."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Row._fields)
        for row in rows:
            cells = row._replace(selected="yes" if row.selected else "no")
            writer.writerow(["" if each is None else each for each in cells])


def read(path: Path = TABLE) -> list[Row]:
    """The rows of the table."""
    with path.open(newline="", encoding="utf-8") as file:
        return [
            Row(
                *(each[name] for name in ("fitted", "judged", "where", "model")),
                each["selected"] == "yes",
                int(each["order"]) if each["order"] else None,
                int(each["readings"]),
                *(float(each[name]) for name in Row._fields[7:11]),
                int(each["like"]) if each["like"] else None,
            )
            for each in csv.DictReader(file)
        ]


if __name__ == "__main__":
    prepare(FOLDER)
    write(list(carry_out(FOLDER, sys.argv[1] if len(sys.argv) > 1 else "1")))
