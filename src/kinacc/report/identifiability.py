"""What the poses leave open: which parameters they do not determine, and which go together."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool
from bokeh.transform import linear_cmap

from kinacc.artifacts.columns import Columns
from kinacc.calibration import blind_words, summary
from kinacc.calibration.blind_groups import of_arm
from kinacc.calibration.blind_words import parameter_name, short_name
from kinacc.calibration.identified import FIXED, IDENTIFIED, PRIOR, UNDETERMINED
from kinacc.calibration.misfit import Misfit, in_words, misfit
from kinacc.calibration.summary_words import counted
from kinacc.calibration.uncertainty import is_angle
from kinacc.kinematics.robot import Robot
from kinacc.report import pictures
from kinacc.report.page import Block, Picture, Section, Table, Text

_MOST = 50  # parameters of the picture; of more, those of base and targets are left out
_CLOSE = 0.95  # |correlation| at which two parameters are hardly told apart
_PAIRS = 10
_NONE = "–"
_STATUSES = {
    IDENTIFIED: "determined by the poses",
    PRIOR: "known beforehand (prior)",
    UNDETERMINED: "undetermined",
    FIXED: "fixed",
}


def section(tables: Mapping[str, Columns], robot: Robot) -> Section:
    """The section of a page on ``dh_identified`` and ``dh_covariance``."""
    told = tables["dh_identified"]
    pairs = _Pairs(tables["dh_covariance"])
    return Section(
        "identifiability",
        "What the poses leave open",
        f"{counted(len(told['parameter']), 'parameter')} of the DH fit{_frames(told)}: "
        f"{_counts(told)}",
        "Which parameters the measured poses determine, which they cannot tell apart, and which "
        "are only known together.",
        "Good: all that is open is open for any poses of such an arm; it changes no pose, and is "
        "no fault. Bad: what other poses would show; two parameters whose correlation is near 1 "
        "or -1, of which one stands in for the other.",
        "Measure poses that show it (kinacc plan-poses proposes them), or state what is known "
        "(calibration.frames, calibration.dh.parameters). Do not read a meaning into the value of "
        "an undetermined parameter, or of one of a close pair.",
        (
            *_open(told, tables["measurements"], robot),
            *_rank(tables.get("dh_fit")),
            *((_heat_map(pairs), pairs.closest()) if len(pairs.names) > 1 else ()),
            _every(told, misfit(tables, robot, "dh")),
        ),
    )


def _frames(told: Columns) -> str:
    return "" if of_arm([str(each) for each in told["parameter"]]).all() else ", base and tool too"


def _counts(told: Columns) -> str:
    status = list(told["status"])
    return ", ".join(
        f"{status.count(each)} {words}" for each, words in _STATUSES.items() if each in status
    )


def _open(told: Columns, measurements: Columns, robot: Robot) -> list[Block]:
    """What cannot be told apart, in sentences; first what further poses would settle."""
    said = blind_words.listed(told)
    weak = blind_words.weak(said)
    always = [text for text in said if not text.endswith(blind_words.WEAK)]
    if not said:
        return [Text("Nothing is left open: the poses determine every parameter.")]
    settled = "others may: measure such (kinacc plan-poses) or state it (calibration.frames)"
    rows = [(text, settled) for text in weak]
    rows += [(text, "no pose of such an arm does: no fault") for text in always]
    heads = ("these poses do not show", "do others?")
    blocks: list[Block] = [Table("What cannot be told apart", heads, tuple(rows))]
    for each in summary.of_pointing(measurements, robot) if weak else ():
        blocks.append(
            Text(f"The flange points one way in all poses (within {each.value:.2g} {each.unit}).")
        )
    return blocks


def _rank(fit: Columns | None) -> list[Block]:
    """How well the directions of parameters are seen that were fitted, and that were not."""
    if fit is None:
        return []
    quantity, value = np.asarray(fit["quantity"]), np.asarray(fit["value"], dtype=float)
    single = {name: float(value[quantity == name][0]) for name in ("rank", "rank_threshold")}
    seen, rank = value[quantity == "singular_value"], int(single["rank"])
    if not rank or not len(seen):
        return []
    share = seen / seen[0]
    text = (
        f"Directions of parameters, base and tool projected out: {rank} of {len(seen)} are fitted. "
        f"The poses show the weakest of them {share[rank - 1]:.2g} times as much as the strongest"
    )
    if rank < len(seen):
        text += f", the strongest of those not fitted {share[rank]:.1g} times"
    return [Text(f"{text}; the limit is {single['rank_threshold']:g} (calibration.dh.truncation).")]


class _Pairs:
    """Correlations of the parameters that have any: ``names`` (P,), ``matrix`` (P, P)."""

    def __init__(self, covariance: Columns) -> None:
        every = list(dict.fromkeys(map(str, covariance["parameter"])))
        place = {name: i for i, name in enumerate(every)}
        row = [place[str(each)] for each in covariance["parameter"]]
        column = [place[str(each)] for each in covariance["other"]]
        matrix = np.full((len(every), len(every)), np.nan)
        matrix[row, column] = matrix[column, row] = covariance["correlation"]
        known = np.isfinite(np.diag(matrix))
        if known.sum() > _MOST:
            known &= of_arm(every)
        self.names = [name for name, yes in zip(every, known, strict=True) if yes]
        self.left_out = len(every) - len(self.names)
        self.matrix = matrix[np.ix_(known, known)]

    def closest(self) -> Table:
        """The pairs of the largest |correlation|, each with its place in the picture."""
        first, second = np.tril_indices(len(self.names), -1)
        order = np.argsort(-np.abs(self.matrix[first, second]), kind="stable")[:_PAIRS]
        first, second = first[order], second[order]
        rows = tuple(
            (
                parameter_name(self.names[i]),
                parameter_name(self.names[j]),
                f"{self.matrix[i, j]:+.3f}",
            )
            for i, j in zip(first, second, strict=True)
        )
        return Table(
            f"The {counted(len(rows), 'pair')} that go together most",
            ("parameter", "and", "correlation"),
            rows,
            numeric=frozenset({2}),
            picked_in="correlations",
            picks=tuple(int(i * len(self.names) + j) for i, j in zip(first, second, strict=True)),
        )


def _heat_map(pairs: _Pairs) -> Picture:
    short = [short_name(name) for name in pairs.names]
    plot = pictures.figure(
        "",
        "",
        height_px=150 + 15 * len(short),
        tools="tap,reset,save",
        x_range=short,
        y_range=short[::-1],
    )
    data = _cells(pairs, short)
    drawn = plot.rect(
        "across",
        "down",
        width=1.0,
        height=1.0,
        source=data,
        line_color=None,
        fill_color=linear_cmap("size", pictures.COLOURMAP, 0.0, 1.0),
        nonselection_fill_alpha=0.45,
        selection_line_color=pictures.VERMILION,
    )
    plot.scatter("across", "down", size="mark", source=data, color="black", line_color="white")
    told = [("", "@first and @second"), ("correlation", "@correlation{0.000}")]
    plot.add_tools(HoverTool(tooltips=told, renderers=[drawn]))
    plot.add_layout(drawn.construct_color_bar(title="|correlation|", width=10), "right")
    plot.grid.grid_line_color = None
    plot.xaxis.major_label_orientation = "vertical"
    plot.axis.major_label_text_font_size = "8pt"
    close = int(np.sum(np.abs(pairs.matrix[np.tril_indices(len(short), -1)]) >= _CLOSE))
    caption = (
        f"Colour: how far two parameters go together, sign left aside; a dot marks {_CLOSE:g} and "
        f"more ({counted(close, 'pair')}). Undetermined parameters have no correlation"
        + (f"; {pairs.left_out} are left out." if pairs.left_out else ".")
    )
    words = f"Correlations of {len(short)} parameters of the DH fit. {caption}"
    details = {"first": "{}", "second": "{}", "correlation": "correlation {}"}
    invitation = "Select a cell to read its two parameters."
    return Picture("correlations", plot, words, caption, details=details, invitation=invitation)


def _cells(pairs: _Pairs, short: list[str]) -> ColumnDataSource:
    """One cell for every pair, row by row."""
    down, across = (each.ravel() for each in np.indices(pairs.matrix.shape))
    names = np.array([parameter_name(each) for each in pairs.names], dtype=object)
    size = np.abs(pairs.matrix).ravel()
    columns = {
        "down": np.array(short, dtype=object)[down],
        "across": np.array(short, dtype=object)[across],
        "first": names[down],
        "second": names[across],
        "correlation": pairs.matrix.ravel(),
        "size": size,
        "mark": np.where((size >= _CLOSE) & (down != across), 6.0, 0.0),
    }
    return pictures.source("correlations", columns)


def _every(told: Columns, fits: Misfit) -> Table:
    rows = []
    for name, status, std, why in zip(
        *(told[each] for each in ("parameter", "status", "std", "statement")), strict=True
    ):
        scale, unit = (1e3, "mrad") if is_angle(str(name)) else (1.0, "mm")
        known = f"{scale * std:.3g} {unit}" if np.isfinite(std) else _NONE
        rows.append((parameter_name(str(name)), str(status), known, str(why or _NONE)))
    heads = ("parameter", "status", "standard deviation", "why it is not identified")
    caption = f"Status of every parameter; standard deviations are {in_words([fits])}"
    return Table(caption, heads, tuple(rows), frozenset({2}), folded=True)
