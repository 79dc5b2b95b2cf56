"""Tables I to III as a paper would print them, in Markdown and LaTeX."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.calibration.misfit import GIVEN, Misfit, in_words
from kinacc.config.error_models import ERROR_MODELS, MEASURED, Comparison, model_name
from kinacc.config.names import in_markdown
from kinacc.deployment.record import POSES
from kinacc.kinematics.dh import PARAMETERS
from kinacc.tables.columns import Columns

_FIGURES = (("mean", "mean"), ("max", "max"), ("rms", "rms"), ("gamma99", "99 % gamma"))
_DIGITS_OF_STD = 2
_MOST_DECIMALS = 6
_FIXED = "(fixed)"


@dataclass(frozen=True)
class PrintedTable:
    """A caption, headers with their units, rows of text, and notes under the table."""

    name: str
    caption: str
    headers: Sequence[tuple[str, str]]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()


def paper_tables(
    residuals: Columns,
    fitted: Columns,
    nominal: Columns,
    name: str,
    unseen: Sequence[str] = (),
    fixed: Collection[str] = (),
    selected: str = "",
    fits: Misfit | None = None,
) -> list[PrintedTable]:
    """Tables of a data set from its ``residuals`` and ``dh_model``; ``nominal`` as ``dh_model``.

    ``unseen``: what the poses leave open, in sentences, as a note to the DH parameters; ``fixed``:
    those that were not fitted, as ``dh_identified`` names them. The model ``selected`` comes first.
    ``fits``: what standard deviations of the DH parameters are worth.
    """

    def measured(model: str) -> PrintedTable:
        chosen = " (selected)" if model == selected else ""
        caption = f"{model_name(model)} model{chosen} against measurements, {name}"
        return _residual_table(residuals, Comparison(MEASURED, model).name, model, caption)

    made = [
        measured("vec"),
        _dh_table(fitted, nominal, name, unseen, fixed, fits),
        _residual_table(residuals, "dh_vs_vec", "dh_vec", f"DH model against VEC model, {name}"),
        measured("dh"),
    ]
    if selected in ERROR_MODELS and all(table.name != selected for table in made):
        made.append(measured(selected))
    return sorted(made, key=lambda table: table.name != selected)


def markdown(tables: Sequence[PrintedTable]) -> str:
    """The tables as Markdown."""
    parts = []
    for table in tables:
        heads = [f"{text} [{unit}]" if unit else text for text, unit in table.headers]
        lines = [f"**{in_markdown(table.caption)}**", "", _markdown_row(heads)]
        lines.append(_markdown_row(["---", *["---:"] * (len(heads) - 1)]))
        lines += [_markdown_row(row) for row in table.rows]
        lines += ["", *map(in_markdown, table.notes)] if table.notes else []
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def latex(tables: Sequence[PrintedTable]) -> str:
    """The tables as LaTeX (packages booktabs and amsmath), one ``table`` environment each."""
    parts = []
    for table in tables:
        heads = [
            rf"\multicolumn{{1}}{{c}}{{{_tex(text)}{f' [{_tex(unit)}]' if unit else ''}}}"
            for text, unit in table.headers
        ]
        lines = [
            r"\begin{table}",
            r"  \centering",
            rf"  \caption{{{_tex(table.caption)}}}",
            rf"  \label{{tab:{table.name}}}",
            rf"  \begin{{tabular}}{{l{'r' * (len(heads) - 1)}}}",
            r"    \toprule",
            f"    {' & '.join(heads)} " + r"\\",
            r"    \midrule",
            *(f"    {' & '.join(_tex_cell(cell) for cell in row)} " + r"\\" for row in table.rows),
            r"    \bottomrule",
            r"  \end{tabular}",
        ]
        lines += [rf"  \par\smallskip\footnotesize {_tex(note)}" for note in table.notes]
        parts.append("\n".join([*lines, r"\end{table}"]))
    return "\n\n".join(parts) + "\n"


def with_deviation(value: float, std: float) -> str:
    """``value ± std`` with two digits of the deviation; the value alone where there is none."""
    if not np.isfinite(std):
        return f"{round(value, 4) + 0.0:.4f}†"
    if std <= 0.0:
        return f"{value:g}"
    decimals = _DIGITS_OF_STD - 1 - int(np.floor(np.log10(std)))
    decimals = min(max(decimals, 0), _MOST_DECIMALS)
    return f"{value:.{decimals}f} ± {std:.{decimals}f}"


def _residual_table(columns: Columns, comparison: str, name: str, caption: str) -> PrintedTable:
    pooled = np.isnan(np.asarray(columns["fold"], dtype=float))
    ours = pooled & (np.asarray(columns["comparison"]) == comparison)
    rows = []
    for subset, words in POSES.items():
        for row in np.flatnonzero(ours & (np.asarray(columns["subset"]) == subset)):
            figures = [_figure(columns[key][row]) for key, _ in _FIGURES]
            quantity = f"{columns['quantity'][row]} [{columns['unit'][row]}]"
            rows.append([f"{quantity}, {words}", str(int(columns["n"][row])), *figures])
    heads = [("", ""), ("points", ""), *((head, "") for _, head in _FIGURES)]
    note = "99 % gamma: quantile of a gamma distribution fitted to the magnitudes."
    return PrintedTable(name, caption, heads, rows, [note])


def _dh_table(
    fitted: Columns,
    nominal: Columns,
    name: str,
    unseen: Sequence[str],
    unfitted: Collection[str],
    fits: Misfit | None,
) -> PrintedTable:
    order = np.argsort(fitted["joint"], kind="stable")
    shown = [each for each in PARAMETERS if each != "beta_rad" or np.any(fitted[each] != 0.0)]
    heads = {
        "theta_offset_rad": ("theta - q", "rad"),
        "d_mm": ("d", "mm"),
        "a_mm": ("a", "mm"),
        "alpha_rad": ("alpha", "rad"),
        "beta_rad": ("beta", "rad"),
    }
    rows, blind, held = [], False, False
    for row in order:
        joint = int(fitted["joint"][row])
        cells = [str(joint)]
        for each in shown:
            value, std = float(fitted[each][row]), float(fitted[f"std_{each}"][row])
            fixed = not np.isfinite(std) and value == float(nominal[each][row])
            if each == "beta_rad" and fixed:
                cells.append("-")
                continue
            if f"j{joint}.{each}" in unfitted:
                held = True
                cells.append(f"{value:g} {_FIXED}")
                continue
            blind |= not np.isfinite(std)
            cells.append(with_deviation(value, std))
        rows.append(cells)
    worth = GIVEN if fits is None else in_words([fits])
    notes = [f"One standard deviation behind ±, {worth}."]
    if blind:
        notes.append(
            "† the poses show it only together with others: this value is one of many that fit as "
            "well."
        )
    notes += ["Fixed: not fitted, the value is nominal."] if held else []
    notes += [f"Left open by the poses: {'; '.join(unseen)}."] if unseen else []
    return PrintedTable(
        "dh_parameters",
        f"DH parameters, {name}",
        [("joint", ""), *(heads[each] for each in shown)],
        rows,
        notes,
    )


def _figure(value: float) -> str:
    return "-" if not np.isfinite(value) else f"{value:.3f}"


def _markdown_row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _tex_cell(text: str) -> str:
    number = text.replace("†", "").replace(" ± ", "").removesuffix(f" {_FIXED}")
    if number.lstrip("-").replace(".", "").replace("e-", "").isdigit():
        mark = r"^\dagger" if text.endswith("†") else ""
        held = f" {_FIXED}" if text.endswith(_FIXED) else ""
        shown = text.removesuffix(held).rstrip("†").replace("±", r"\pm")
        return f"${shown}{mark}${held}"
    return _tex(text)


def _tex(text: str) -> str:
    for plain, tex in (
        ("\\", r"\textbackslash "), ("&", r"\&"), ("%", r"\%"), ("_", r"\_"), ("#", r"\#"),
        ("$", r"\$"), ("{", r"\{"), ("}", r"\}"), ("^", r"\^{}"), ("~", r"\~{}"),
        ("±", r"$\pm$"), ("†", r"$^\dagger$"), ("theta", r"$\theta$"), ("alpha", r"$\alpha$"),
        ("beta", r"$\beta$"),
    ):  # fmt: skip
        text = text.replace(plain, tex)
    return text
