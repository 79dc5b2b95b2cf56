"""Tables I to III as a paper prints them, in Markdown and LaTeX."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd

from kinacc.calibration.identifiability import FIXED
from kinacc.calibration.misfit import in_words
from kinacc.config.error_models import ERROR_MODELS, MEASURED, PLAINEST, Comparison, model_name
from kinacc.config.names import in_markdown
from kinacc.deployment.export.source import Source
from kinacc.deployment.folder import selected_model
from kinacc.deployment.record import POSES
from kinacc.errors import input_error
from kinacc.kinematics.dh import PARAMETERS

_STATISTICS = {"mean": "mean", "max": "max", "rms": "rms", "gamma99": "99 % gamma"}
_HEADS = dict(zip(PARAMETERS, ("theta - q [rad]", "d [mm]", "a [mm]", "alpha [rad]", "beta [rad]"),
                  strict=True))  # fmt: skip
_MOST_DECIMALS = 6
_TEX = {"\\": r"\textbackslash ", "^": r"\^{}", "~": r"\~{}", "±": r"$\pm$", "†": r"$^\dagger$"}
_TEX |= {sign: f"\\{sign}" for sign in "&%_#${}"}


@dataclass(frozen=True)
class PaperTable:
    """Cells as text, and what stands above and under them."""

    name: str
    caption: str
    cells: pd.DataFrame
    notes: list[str]


def paper_tables(source: Source) -> list[PaperTable]:
    """Residuals of the models and DH parameters; the selected model comes first."""
    if "residuals" not in source.tables:
        place = f"{source.calibration.name}: residuals.parquet"
        raise input_error(place, "no such file", "a finished run")
    name, selected = source.calibration.name, selected_model(source.tables)
    measured = {
        model: _residuals(
            source,
            Comparison(MEASURED, model).name,
            model,
            f"{model_name(model)} model{' (selected)' * (model == selected)} against "
            f"measurements, {name}",
        )
        for model in dict.fromkeys(("vec", "dh", *({selected} & set(ERROR_MODELS))))
    }
    between = _residuals(source, "dh_vs_vec", "dh_vec", f"DH model against VEC model, {name}")
    created = [measured.pop("vec"), _parameters(source), between, *measured.values()]
    return sorted(created, key=lambda table: table.name != selected)


def with_deviation(value: float, std: float) -> str:
    """``value ± std`` with two digits of the deviation; the value alone where there is none."""
    if not np.isfinite(std):
        return f"{round(value, 4) + 0.0:.4f}†"
    if std <= 0.0:
        return f"{value:g}"
    decimals = min(max(1 - int(np.floor(np.log10(std))), 0), _MOST_DECIMALS)
    return f"{value:.{decimals}f} ± {std:.{decimals}f}"


def _residuals(source: Source, comparison: str, name: str, caption: str) -> PaperTable:
    table = pd.DataFrame(dict(source.tables["residuals"]))
    table = table[table["fold"].astype(float).isna() & (table["comparison"] == comparison)]
    table = table.sort_values(
        "subset", key=lambda subset: subset.map([*POSES].index), kind="stable"
    )
    cells = pd.DataFrame({
        "": table["quantity"] + " [" + table["unit"] + "], " + table["subset"].map(POSES),
        "points": table["n"].astype(int).astype(str),
    })  # fmt: skip
    for key, head in _STATISTICS.items():
        cells[head] = [f"{value:.3f}" if np.isfinite(value) else "-" for value in table[key]]
    note = "99 % gamma: quantile of a gamma distribution fitted to the magnitudes."
    return PaperTable(name, caption, cells, [note])


def _parameters(source: Source) -> PaperTable:
    fitted = source.joints
    reported = pd.DataFrame(
        source.tables.get(f"{PLAINEST}_identified", {}), columns=["parameter", "status"]
    )
    fixed = {*reported.loc[reported["status"] == FIXED, "parameter"]}
    shown = PARAMETERS if fitted["beta_rad"].any() else PARAMETERS[:-1]
    cells = pd.DataFrame({"joint": fitted["joint"].astype(str)})
    for name in shown:
        names = "j" + cells["joint"] + f".{name}"
        cells[_HEADS[name]] = np.select(
            [
                (name == "beta_rad")
                & fitted[f"std_{name}"].isna()
                & (fitted[name] == fitted[f"nominal_{name}"]),
                names.isin(fixed),
            ],
            ["-", fitted[name].map("{:g} (fixed)".format)],
            list(map(with_deviation, fitted[name], fitted[f"std_{name}"])),
        )
    notes = [f"One standard deviation behind ±, {in_words([source.calibration.misfit])}."]
    marks = "".join(cells.to_numpy().ravel())
    if "†" in marks:
        notes.append("† only determined together with others: one of many values that fit as well.")
    if "(fixed)" in marks:
        notes.append("Fixed: not fitted, the value is nominal.")
    if source.calibration.left_open:
        notes.append(f"Left open by the poses: {'; '.join(source.calibration.left_open)}.")
    caption = f"DH parameters, {source.calibration.name}"
    return PaperTable("dh_parameters", caption, cells, notes)


def markdown(source: Source) -> str:
    """The tables one after the other, as Markdown."""
    parts = []
    for table in paper_tables(source):
        rule = ["---", *["---:"] * (table.cells.shape[1] - 1)]
        rows = [[*table.cells], rule, *table.cells.to_numpy().tolist()]
        lines = [
            f"**{in_markdown(table.caption)}**",
            "",
            *(f"| {' | '.join(row)} |" for row in rows),
        ]
        parts.append("\n".join([*lines, "", *map(in_markdown, table.notes)]))
    return "\n\n".join(parts) + "\n"


def latex(source: Source) -> str:
    """The tables one after the other, as LaTeX (package booktabs)."""
    parts = []
    for table in paper_tables(source):
        cells = table.cells.map(_tex).rename(columns=_tex)
        body = cells.to_latex(
            index=False,
            column_format=f"l{'r' * (cells.shape[1] - 1)}",
            caption=_tex(table.caption),
            label=f"tab:{table.name}",
        )
        notes = "".join(f"\\par\\smallskip\\footnotesize {_tex(note)}\n" for note in table.notes)
        parts.append(body.replace(r"\end{table}", notes + r"\end{table}"))
    return "\n".join(parts)


def _tex(text: str) -> str:
    return re.sub(r"[\\^~±†&%_#${}]", lambda sign: _TEX[sign[0]], text)
