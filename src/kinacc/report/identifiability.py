"""What the poses leave open: which parameters they do not determine, and which go together."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool
from bokeh.transform import linear_cmap

from kinacc.calibration import blind_words, summary
from kinacc.calibration.blind_groups import of_arm
from kinacc.calibration.blind_words import parameter_name, short_name
from kinacc.calibration.identified import FIXED, IDENTIFIED, PRIOR, UNDETERMINED
from kinacc.calibration.misfit import in_words, misfit
from kinacc.calibration.uncertainty import is_angle
from kinacc.kinematics.robot import Robot
from kinacc.report import pictures
from kinacc.report.page import Part, Picture, records
from kinacc.tables.columns import Columns

_MOST = 50  # parameters of the picture; of more, those of base and targets are left out
_CLOSE = 0.95  # |correlation| at which two parameters are hardly told apart
_PAIRS = 10
_STATUSES = {
    IDENTIFIED: "determined by the poses",
    PRIOR: "known beforehand (prior)",
    UNDETERMINED: "undetermined",
    FIXED: "fixed",
}


def section(tables: Mapping[str, Columns], robot: Robot) -> Part:
    """The section of a page on ``dh_identified`` and ``dh_covariance``."""
    told, pairs = tables["dh_identified"], _Pairs(tables["dh_covariance"])
    open_ = blind_words.listed(told)
    weak = blind_words.weak(open_)
    status = list(told["status"])
    values = {
        "parameters": len(status),
        "frames": not of_arm([str(each) for each in told["parameter"]]).all(),
        "counts": {words: status.count(each) for each, words in _STATUSES.items()},
        "weak": weak,
        "always": [text for text in open_ if not text.endswith(blind_words.WEAK)],
        "spread_deg": summary.flange_spread_deg(tables["measurements"], robot) if weak else None,
        "rank": _rank(tables.get("dh_fit")),
        "pairs": pairs.closest(),
        "close": pairs.close,
        "limit": _CLOSE,
        "drawn": len(pairs.names),
        "left_out": pairs.left_out,
        "every": [_known(each) for each in records(told)],
        "deviations": in_words([misfit(tables, robot, "dh")]),
    }
    return Part("identifiability", values, (_heat_map(pairs),) if len(pairs.names) > 1 else ())


def _rank(fit: Columns | None) -> dict | None:
    """How well the directions of parameters are determined that were fitted, and that were not."""
    if fit is None:
        return None
    quantity, value = np.asarray(fit["quantity"]), np.asarray(fit["value"], dtype=float)
    rank, threshold = (value[quantity == name][0] for name in ("rank", "rank_threshold"))
    share = value[quantity == "singular_value"]
    if not rank or not len(share):
        return None
    share = share / share[0]
    return {"rank": int(rank), "threshold": threshold, "share": share}


def _known(row: dict) -> dict:
    """A parameter as a person calls it, with its standard deviation in mm or mrad."""
    scale, unit = (1e3, "mrad") if is_angle(str(row["parameter"])) else (1.0, "mm")
    known = f"{scale * row['std']:.3g} {unit}" if np.isfinite(row["std"]) else None
    return row | {"called": parameter_name(str(row["parameter"])), "known": known}


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

    @property
    def close(self) -> int:
        """Number of pairs that are hardly told apart."""
        below = np.tril_indices(len(self.names), -1)
        return int(np.sum(np.abs(self.matrix[below]) >= _CLOSE))

    def closest(self) -> list[dict]:
        """The pairs of the largest |correlation|, each with its place in the picture."""
        first, second = np.tril_indices(len(self.names), -1)
        order = np.argsort(-np.abs(self.matrix[first, second]), kind="stable")[:_PAIRS]
        called = [parameter_name(each) for each in self.names]
        return [
            {
                "first": called[i],
                "second": called[j],
                "correlation": self.matrix[i, j],
                "pick": int(i * len(called) + j),
            }
            for i, j in zip(first[order], second[order], strict=True)
        ]


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
    details = {"first": "{}", "second": "{}", "correlation": "correlation {}"}
    invitation = "Select a cell to read its two parameters."
    return Picture("correlations", plot, details=details, invitation=invitation)


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
