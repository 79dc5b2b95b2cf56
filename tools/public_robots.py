"""Calibrate the measured arms of examples/data blind, and write the page and picture about them.

    python tools/public_robots.py [CORES]   # works in public-robots/, by the commands of a user
    python tools/public_robots.py page      # the page anew from docs/public-robots.csv

A row of the table is a model held to a set of readings, position errors in mm. ``fitted`` and
``judged``: data sets, the same where shares of it were held out; ``where``: all readings, or those
at which every model says something; ``order`` of a VEC model; ``like``: readings that lie where
the calibration was measured, empty where shares were held out.
"""

from __future__ import annotations

import json
import math
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from jinja2 import Environment, FileSystemLoader
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from kinacc.figures import save, style

ROOT = Path(__file__).parents[1]
FOLDER, DOCS = ROOT / "public-robots", ROOT / "docs"
TABLE = DOCS / "public-robots.csv"
UR5, UR10 = (ROOT / "examples" / "data" / name for name in ("ur5_gts", "ur10_tmac"))
COPIED = {
    "ur5.robot.yaml": ROOT / "examples" / "ur5.robot.yaml",
    "ur10_b.csv": UR10 / "series_B.csv",
    "ur10_d.csv": UR10 / "published_series_D.csv",
}
ADDED = {"ur5_grid.csv": "published_grid.csv", "ur5_random.csv": "published_random.csv"}
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
# Means of 20 poses in P. Jacobi's thesis (Tsinghua University, 2025), mm, as its abstract has them.
BEFORE_MM, AFTER_MM = 2.5664, 0.1549
SERIES = {"ur5_grid": "UR5", "ur10_b": "UR10, series B", "ur10_d": "UR10, series D"}
LOOKS = {
    "nominal": (style.MUTED, "s", "nominal arm, best base and tool"),
    "dh": (style.BLUE, "o", "DH"),
    "vec": (style.VERMILION, "D", "VEC"),
}
LOW_MM = 0.04  # where the picture's axis begins


def commands() -> list[list[str]]:
    """The commands in their order, as a user would type them."""
    found = []
    for name in dict.fromkeys([*FITTED, *(judged for _, judged, _ in VERIFIED)]):
        robot = "ur5.robot.yaml" if name.startswith("ur5") else "ur10"
        found.append(f"kinacc init {name}.csv --robot {robot}")
    found += [f"kinacc calibrate {name}.yaml" for name in FITTED]
    found += [
        f"kinacc verify {judged}.yaml --calibration results/{fitted} --base {setup} --tool {setup}"
        for fitted, judged, setup in VERIFIED
    ]
    return [each.split() for each in found]


def prepare(folder: Path) -> None:
    """Put the measured files into ``folder``; those that are there already stay as they are.

    The UR5's ``x_dif`` is actual minus target: ``x_t + x_dif`` has six decimals in every row, as
    instruments write them, and ``x_t - x_dif`` has not.
    """
    folder.mkdir(exist_ok=True)
    contents = {name: source.read_bytes() for name, source in COPIED.items()}
    for name, published in ADDED.items():
        table = pd.read_csv(UR5 / published, dtype=str)
        found = table[[f"joint_{i}" for i in range(1, 7)]].copy()
        for axis in "xyz":
            point = table[f"{axis}_t"].astype(float) + table[f"{axis}_dif"].astype(float)
            found[f"{axis}_mm"] = point.map("{:.6f}".format)
        contents[name] = found.to_csv(index=False, lineterminator="\n").encode()
    for name, content in contents.items():
        path = folder / name
        if not path.is_file() or path.read_bytes() != content:
            path.write_bytes(content)


def carry_out(folder: Path, cores: str) -> pd.DataFrame:
    """The table, by the commands."""
    verified = []
    for words in commands():
        more = {"init": ["--force"], "calibrate": ["--cores", cores], "verify": ["--json"]}
        print(shlex.join(words), flush=True)
        printed = _answer(folder, [*words[1:], *more[words[1]]])
        if words[1] == "verify":
            verified += _elsewhere(json.loads(printed))
        elif words[1] == "init" and (name := Path(words[2]).stem) in FITTED:
            text = (folder / f"{name}.yaml").read_text(encoding="utf-8")
            (section,) = yaml.safe_load(text)["datasets"].values()
            for key in ("source", "file"):
                section["measurements"].pop(key)
            if {key: section[key] for key in SETTINGS} != SETTINGS:
                raise SystemExit(f"{name}: init writes other settings than this file says")
    held_out = [row for name in FITTED for row in _held_out(name, folder)]
    return pd.DataFrame(held_out + verified).round(5)  # of mm: what no machine or library changes


def _answer(folder: Path, words: list[str]) -> str:
    one_thread = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, "-m", "kinacc", *words]
    return subprocess.run(
        command, cwd=folder, env=os.environ | one_thread, check=True, stdout=subprocess.PIPE,
        text=True,
    ).stdout  # fmt: skip


def _held_out(name: str, folder: Path) -> Iterator[dict]:
    answer = json.loads(_answer(folder, ["fitted", f"results/{name}", "--json"]))
    for model, found in answer["held_out_error"].items():
        yield {
            "fitted": name, "judged": name, "where": "all", "model": model,
            "selected": "yes" if model == answer["selected"] else "no",
            "order": answer["vec_order"] if model == "vec" else None,
            "readings": int(found["n"]), "mean_mm": found["mean"],
            "quantile_99_mm": found["quantile_99"], "largest_mm": found["largest"],
            "rms_mm": answer["position_error_mm"][model]["validation"]["rms"], "like": None,
        }  # fmt: skip


def _elsewhere(answer: Mapping) -> Iterator[dict]:
    for row in answer["rows"]:
        model, errors = row["model"].lower(), ("mean_mm", "quantile_99_mm", "largest_mm", "rms_mm")
        yield {
            "fitted": Path(answer["calibration"]).name, "judged": answer["readings_of"],
            "where": "all" if row["readings"] == answer["readings"] else "common", "model": model,
            "selected": "yes" if model == answer["selected"] else "no", "order": None,
            "readings": row["readings"], **{name: row[name] for name in errors},
            "like": answer["like_measured"],
        }  # fmt: skip


def read() -> pd.DataFrame:
    """The table; ``order`` and ``like`` are whole numbers or null."""
    return pd.read_csv(TABLE).astype({"order": "Int64", "like": "Int64"})


def lines(table: pd.DataFrame) -> Iterator[tuple[dict, str, str, str]]:
    """Rows by model of every line of the page, its two labels, and what VEC covers of it."""
    places = table[["fitted", "judged", "where"]].drop_duplicates()
    order = 2 * places["judged"].ne("ur5_random") + places["fitted"].ne(places["judged"])
    for fitted, judged, where in places.loc[order.sort_values(kind="stable").index].to_numpy():
        if judged == "ur5_grid":
            continue
        own = table[(table["fitted"] == fitted) & (table["judged"] == judged)]
        of = {row.model: row for row in own[own["where"] == where].itertuples()}
        common = own.loc[own["where"] == "common", "readings"]
        covers = f"covers {common.iloc[0] if len(common) else 'none'} of these"
        poses = table.loc[(table["fitted"] == fitted) & (table["judged"] == fitted), "readings"]
        first = f"{SERIES[fitted]}, {poses.iloc[0]:,} poses"
        count, series = of["nominal"].readings, SERIES.get(judged, "").partition(", ")[2]
        second = f"all {count:,} poses of {series}"
        if judged == "ur5_random":
            first, second = f"{first} of a grid", f"the authors' {count} random poses"
        elif judged == fitted:
            second = "each fifth, left out in turn"
        elif where == "common":
            second = f"{count:,} poses of {series}, those VEC covers"
        yield of, first, second, covers


def text(table: pd.DataFrame) -> str:
    """The page."""
    rows = ["| arm, fitted to | judged at | nominal | DH | VEC | the authors |", "|---" * 6 + "|"]
    for of, first, second, covers in lines(table):
        cells = [first, second]
        for model in LOOKS:
            row = of.get(model)
            cell = f"{row.mean_mm:.3f} / {row.largest_mm:.3f}" if row else covers
            cells.append(f"**{cell}**" if row and row.selected == "yes" else cell)
        published = f"mean {BEFORE_MM:.3f} before, {AFTER_MM:.3f} after"
        cells.append(published if "random" in second else "none at hand")
        rows.append(f"| {' | '.join(cells)} |")

    def row(fitted: str, judged: str, model: str, where: str = "all"):
        keys = {"fitted": fitted, "judged": judged, "model": model, "where": where}
        (found,) = table[
            np.all([table[key] == value for key, value in keys.items()], axis=0)
        ].itertuples()
        return found

    best = row("ur5_grid", "ur5_random", "vec")
    error = math.sqrt(max(best.rms_mm**2 - best.mean_mm**2, 0.0) / (best.readings - 1))
    pages = Environment(loader=FileSystemLoader(Path(__file__).parent), keep_trailing_newline=True)
    return pages.get_template("public-robots.md.jinja").render(
        table="\n".join(rows), row=row, mm=lambda each: f"{each.mean_mm:.3f}", best=best,
        standard_error=error, after=AFTER_MM, before=BEFORE_MM,
        settings=yaml.safe_dump(SETTINGS, sort_keys=False).strip(),
        commands="\n".join(map(shlex.join, commands())),
    )  # fmt: skip


def picture(table: pd.DataFrame) -> Figure:
    """Mean to largest error of every model in every line of the table."""
    shown = list(lines(table))
    with style.new_figure(style.DOUBLE_COLUMN_IN, 0.62 * len(shown) + 0.75) as figure:
        axes = figure.subplots()

        def note(x: float, y: float, label: str, colour: str, side: str = "left") -> None:
            axes.annotate(
                label, (x, y), (6 if side == "left" else -6, 0), textcoords="offset points",
                ha=side, va="center", fontsize=style.SMALL_PT, color=colour,
            )  # fmt: skip

        for place, (of, _, _, covers) in enumerate(shown):
            for number, (model, (colour, marker, label)) in enumerate(LOOKS.items()):
                height = place + 0.22 * (number - 1)
                if (row := of.get(model)) is None:
                    note(LOW_MM, height, f"VEC {covers}", style.VERMILION)
                    continue
                axes.plot([row.mean_mm, row.largest_mm], [height] * 2, color=colour, lw=1.6)
                axes.plot([row.quantile_99_mm], [height], "|", color=colour, ms=6)
                axes.plot([row.mean_mm], [height], marker, color=colour, ms=4.5,
                          label=None if place else label)  # fmt: skip
        axes.plot([AFTER_MM, BEFORE_MM], [0.46, 0.46], "*", color=style.GREEN, ms=7)
        note(AFTER_MM, 0.46, "thesis, mean after", style.GREEN)
        note(BEFORE_MM, 0.46, "thesis, mean before", style.GREEN, "right")
        labels = [f"fitted: {first}\njudged: {second}" for _, first, second, _ in shown]
        axes.set_yticks(np.arange(len(shown)), labels)
        axes.set(ylim=(len(shown) - 0.55, -0.45), xscale="log", xlim=(LOW_MM, 3.6))
        axes.set_xticks([0.05, 0.1, 0.2, 0.5, 1.0, 2.0])
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.xaxis.minorticks_off()
        axes.set_xlabel("position error at readings no fit has seen, mm (logarithmic)")
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", ncols=3)
    return figure


if __name__ == "__main__":
    if sys.argv[1:] != ["page"]:
        prepare(FOLDER)
        carry_out(FOLDER, *sys.argv[1:] or ["1"]).to_csv(TABLE, index=False, lineterminator="\n")
    (DOCS / "public-robots.md").write_text(text(read()), encoding="utf-8")
    save.write(picture(read()), {"png": DOCS / "public-robots.png"})
