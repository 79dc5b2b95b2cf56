"""What the calibration changed: DH parameters against nominal, the errors of every joint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from bokeh.models import ColumnDataSource

from kinacc.calibration import summary
from kinacc.calibration.blind_words import parameter_name, short_name
from kinacc.calibration.identified import FIXED, IDENTIFIED, PRIOR, UNDETERMINED
from kinacc.calibration.misfit import in_words, misfit, misfits
from kinacc.calibration.uncertainty import Uncertainty, is_angle
from kinacc.config.error_models import model_name
from kinacc.deployment.folder import uncertainty
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.vec import VECModel
from kinacc.report import pictures
from kinacc.report.page import Control, Option, Part, Picture, records
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, VERMILION
from kinacc.report.summary import compliance
from kinacc.tables.allowed import ERRORS
from kinacc.tables.columns import Columns

_WIDE = 2.0  # standard deviations either way that bars and bands reach
_LOOK = {
    IDENTIFIED: ("circle", BLUE),
    PRIOR: ("square", GREEN),
    UNDETERMINED: ("x", VERMILION),
    FIXED: ("diamond", GREY),
}
_LINES = (("solid", BLUE), ("dashed", ORANGE), ("dotdash", GREEN))  # of x, y, z
_KINDS = {"delta": ("shift", "mm", 1.0), "eps": ("turn", "mrad", 1e3)}
_LEAST_POINTS, _POINTS_EACH = 80, 4  # of a curve, and of every order in it


def section(tables: Mapping[str, Columns], robot: Robot) -> Part:
    """The section of a page on ``dh_model``, ``vec_model`` and how sure they are."""
    found = parameters(tables["dh_model"], tables["dh_identified"], robot)
    curves = _Curves(tables, robot)
    offsets = [each for each in records(tables["vec_model"]) if each["direction"]]
    values = {
        "fitted": np.sum(np.asarray(tables["measurements"]["subset"]) == "train"),
        "selected": model_name(summary.selected(tables["model_selection"])),
        "wide": _WIDE,
        "deviations": in_words(misfits(tables, robot)),
        "deviations_dh": in_words([misfit(tables, robot, "dh")]),
        "parameters": found,
        "bending": list(compliance(tables.get("compliance_model"))),
        "order": curves.model.order,
        "banded": bool(np.isfinite(curves.std).any()),
        "errors": {name: _KINDS[name.partition("_")[0]][1] for name in ERRORS},
        "largest": curves.largest(),
        "offsets": offsets,
    }
    drawn = [_differences(found, unit) for unit in ("mm", "mrad")]
    return Part("parameters", values, (*drawn, *(curves.picture(kind) for kind in _KINDS)))


def parameters(model: Columns, told: Columns, robot: Robot) -> list[dict]:
    """Every DH parameter that is there: not the angle beta of a joint that has none.

    ``nominal`` and ``calibrated`` are in deg or mm; ``difference`` and ``std`` in ``unit``.
    """
    status = dict(zip(told["parameter"], told["status"], strict=True))
    fitted = DHModel.from_columns(model, robot.dh.prismatic)
    order = np.argsort(model["joint"], kind="stable")
    found = []
    for joint, column in np.ndindex(fitted.joints, len(PARAMETERS)):
        name = f"j{joint + 1}.{PARAMETERS[column]}"
        known = status.get(name, FIXED)
        values = [float(getattr(of, PARAMETERS[column])[joint]) for of in (robot.dh, fitted)]
        if PARAMETERS[column] == "beta_rad" and known == FIXED and not any(values):
            continue
        angle = is_angle(name)
        scale = 1e3 if angle else 1.0
        nominal, calibrated = np.rad2deg(values) if angle else values
        std = np.asarray(model[f"std_{PARAMETERS[column]}"], dtype=float)[order][joint]
        found.append(
            {
                "short": short_name(name),
                "called": parameter_name(name),
                "status": str(known),
                "nominal": nominal,
                "calibrated": calibrated,
                "of": "deg" if angle else "mm",
                "difference": scale * (values[1] - values[0]),
                "std": scale * std,
                "unit": "mrad" if angle else "mm",
            }
        )
    return found


def _differences(found: Sequence[Mapping], unit: str) -> Picture:
    mine = [each for each in found if each["unit"] == unit]
    texts = ("short", "called", "status")
    columns = {name: np.array([each[name] for each in mine], dtype=object) for name in texts}
    difference, std = (np.array([each[name] for each in mine]) for name in ("difference", "std"))
    columns |= {
        "difference": difference,
        "std": std,
        "low": difference - _WIDE * std,
        "high": difference + _WIDE * std,
    }
    statuses = dict.fromkeys(columns["status"])
    for status in statuses:
        columns[f"size_{status}"] = np.where(columns["status"] == status, 9.0, 0.0)
    key = f"differences-{'lengths' if unit == 'mm' else 'angles'}"
    data = pictures.source(key, columns)
    plot = pictures.figure(
        "",
        f"calibrated - nominal, {unit}",
        hover=[
            ("", "@called, @status"),
            (f"difference, {unit}", "@difference{0.0000}"),
            ("standard deviation", "@std{0.0000}"),
        ],
        x_range=list(columns["short"]),
    )
    plot.hspan(y=0.0, line_color="grey", line_dash="dotted")
    plot.segment("short", "low", "short", "high", source=data, line_color=BLUE, line_width=2)
    for status in statuses:
        marker, colour = _LOOK[status]
        plot.scatter(
            "short", "difference", source=data, marker=marker, size=f"size_{status}",
            color=colour, line_width=2, legend_label=status,
        )  # fmt: skip
    plot.xaxis.major_label_orientation = "vertical"
    pictures.legend_above(plot, len(statuses))
    details = {
        "called": "{}",
        "status": "{}",
        "difference": f"difference {{}} {unit}",
        "std": f"standard deviation {{}} {unit}",
    }
    return Picture(key, plot, details=details)


class _Curves:
    """What the VEC model says of every joint over its range that no DH table can say.

    ``joints`` (k, m) in deg, mm where one slides; ``values`` and ``std`` (k, 6, m) in mm and mrad,
    ``std`` NaN where the covariance is not known.
    """

    def __init__(self, tables: Mapping[str, Columns], robot: Robot) -> None:
        self.model = VECModel.from_columns(tables["vec_model"], robot.dh.prismatic)
        self.prismatic = robot.dh.prismatic
        count = max(_LEAST_POINTS, _POINTS_EACH * self.model.order) + 1
        at = np.linspace(-1.0, 1.0, count)
        low, high = self.model.domain
        joints = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * at
        self.joints = np.where(self.prismatic[:, None], joints, np.rad2deg(joints))
        basis = np.polynomial.chebyshev.chebvander(at, self.model.order)
        known = uncertainty(tables, "vec")
        self.values = np.empty((self.model.joints, len(ERRORS), count))
        self.std = np.full(self.values.shape, np.nan)
        for joint, error in np.ndindex(self.values.shape[:2]):
            scale = _KINDS[ERRORS[error].partition("_")[0]][2]
            shared = _shared(ERRORS[error], joints[joint], bool(self.prismatic[joint]))
            own = scale * (basis - shared @ np.linalg.lstsq(shared, basis, rcond=None)[0])
            self.values[joint, error] = own @ self.model.coefficients[joint, error]
            self.std[joint, error] = _spread(known, joint, error, own)
        self.data = self._source()

    def _source(self) -> ColumnDataSource:
        columns = {}
        for joint in range(self.model.joints):
            columns[f"q{joint + 1}"] = self.joints[joint]
            for error, name in enumerate(ERRORS):
                value, reach = self.values[joint, error], _WIDE * self.std[joint, error]
                columns[f"j{joint + 1}_{name}"] = value
                columns[f"j{joint + 1}_{name}_low"] = value - reach
                columns[f"j{joint + 1}_{name}_high"] = value + reach
        return pictures.source("curves", columns)

    def _label(self, joint: int) -> str:
        return f"joint {joint + 1} of the DH table, {'mm' if self.prismatic[joint] else 'deg'}"

    def picture(self, kind: str) -> Picture:
        """The three errors of one kind, delta or eps, over the angle of the joint chosen."""
        what, unit, _ = _KINDS[kind]
        mine = [f"{kind}_{axis}" for axis in "xyz"]
        plot = pictures.figure(self._label(0), f"{what}, {unit}", tools="pan,box_zoom,reset,save")
        plot.hspan(y=0.0, line_color="grey", line_dash="dotted")
        banded = bool(np.isfinite(self.std).any())
        for name, (dash, colour) in zip(mine, _LINES, strict=True):
            shared = {"source": self.data, "color": colour, "legend_label": name}
            at = f"j1_{name}"
            if banded:
                band = plot.varea("q1", f"{at}_low", f"{at}_high", **shared, alpha=0.18)
                band.glyph.name = f"{name}-band"
            line = plot.line("q1", at, **shared, line_dash=dash, line_width=2)
            line.glyph.name = f"{name}-line"
        plot.xaxis[0].name = f"{kind}-axis"
        pictures.legend_above(plot, 3)
        options = tuple(
            Option(f"{n + 1}", tuple(self._sets(kind, mine, n, banded)))
            for n in range(self.model.joints)
        )
        return Picture(f"curves-{kind}", plot, controls=(Control("Joint", options),))

    def _sets(self, kind: str, mine: Sequence[str], joint: int, banded: bool) -> Iterator[tuple]:
        for name in mine:
            at = f"j{joint + 1}_{name}"
            parts = {"line": {"y": at}}
            if banded:
                parts["band"] = {"y1": f"{at}_low", "y2": f"{at}_high"}
            for part, columns in parts.items():
                for prop, column in {"x": f"q{joint + 1}", **columns}.items():
                    yield f"{name}-{part}", prop, pictures.field(column)
        yield f"{kind}-axis", "axis_label", self._label(joint)

    def largest(self) -> list[dict]:
        """The largest of each error over the joint's range, with its standard deviation there."""
        rows: list[dict] = [{"joint": joint + 1} for joint in range(self.model.joints)]
        for joint, error in np.ndindex(self.values.shape[:2]):
            at = int(np.argmax(np.abs(self.values[joint, error])))
            std = self.std[joint, error, at]
            sure = f" ± {std:.3f}" if np.isfinite(std) else ""
            rows[joint][ERRORS[error]] = f"{self.values[joint, error, at]:+.3f}{sure}"
        return rows


def _shared(error: str, joint: np.ndarray, slides: bool) -> np.ndarray:
    """Functions (m, f) of a joint (m,) that neighbouring frames can take over from its error.

    A constant change of the frame before the joint is a constant error; one of the frame behind it
    is, seen from before, constant along and about the axis and turns with the joint across it.
    """
    constant = np.ones_like(joint)
    if error.endswith("z") or (slides and error.startswith("eps")):
        return constant[:, None]
    turning = (joint,) if slides else (np.cos(joint), np.sin(joint))
    return np.stack([constant, *turning], axis=1)


def _spread(known: Uncertainty | None, joint: int, error: int, basis: np.ndarray) -> np.ndarray:
    """Standard deviations (m,) of a curve ``basis`` (m, order + 1) times its coefficients."""
    names = [f"j{joint + 1}.{ERRORS[error]}.{n}" for n in range(basis.shape[1])]
    place = {} if known is None else {name: i for i, name in enumerate(known.names)}
    if not all(name in place for name in names):
        return np.full(len(basis), np.nan)
    mine = [place[name] for name in names]
    block = known.covariance[np.ix_(mine, mine)]
    return np.sqrt(np.maximum(np.einsum("mi,ij,mj->m", basis, block, basis), 0.0))
