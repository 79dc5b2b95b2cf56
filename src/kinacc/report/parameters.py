"""What the calibration changed: DH parameters against nominal, the errors of every joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from bokeh.models import ColumnDataSource

from kinacc.artifacts.allowed import ERRORS
from kinacc.artifacts.columns import Columns
from kinacc.artifacts.error_models import model_name
from kinacc.calibration import summary
from kinacc.calibration.blind_words import parameter_name, short_name
from kinacc.calibration.identified import FIXED, IDENTIFIED, PRIOR, UNDETERMINED
from kinacc.calibration.misfit import Misfit, in_words, misfit, misfits
from kinacc.calibration.summary_words import counted
from kinacc.calibration.uncertainty import Uncertainty, is_angle
from kinacc.deployment.folder import uncertainty
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.vec import VECModel
from kinacc.report import pictures
from kinacc.report.page import Block, Control, Option, Picture, Section, Table
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, VERMILION

_NONE = "–"
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


def section(tables: Mapping[str, Columns], robot: Robot) -> Section:
    """The section of a page on ``dh_model``, ``vec_model`` and how sure they are."""
    found = parameters(tables["dh_model"], tables["dh_identified"], robot)
    measurements = tables["measurements"]
    fitted = int(np.sum(np.asarray(measurements["subset"]) == "train"))
    chosen = model_name(summary.selected(tables["model_selection"]))
    curves = _Curves(tables, robot)
    return Section(
        "parameters",
        "Parameters and how sure they are",
        f"DH and VEC model fitted to {counted(fitted, 'reading')} (selected: {chosen}); bars and "
        f"bands reach {_WIDE:g} standard deviations either way",
        "How far the calibrated arm differs from the maker's, parameter by parameter, and how far "
        "each value may be off; then what the VEC model adds that no DH table can say.",
        "Good: bars shorter than their distance from zero; tenths of a mm, a few mrad, as making "
        "explains. Bad: many mm or degrees (a wrong robot file, unit or zero); curves "
        "that rise at an end, where few poses hold them. Standard deviations, bars and bands are "
        f"{in_words(misfits(tables, robot))}. Where a model leaves errors that neighbouring poses "
        "share, they are too short.",
        "Check large differences against the robot file first. More poses, spread further, "
        "shorten the bars. Load values only as a set (kinacc export): single ones make up for "
        "each other.",
        (
            *(_differences(found, unit) for unit in ("mm", "mrad")),
            _table(found, misfit(tables, robot, "dh")),
            *_bending(tables.get("compliance_model")),
            *(curves.picture(kind) for kind in _KINDS),
            curves.largest(),
            *_directions(tables["vec_model"]),
        ),
    )


@dataclass(frozen=True)
class Parameter:
    """One DH parameter, ``nominal`` and ``calibrated`` in mm or rad with its ``std``, NaN if none.

    ``status`` is that of ``dh_identified``.
    """

    name: str
    nominal: float
    calibrated: float
    std: float
    status: str

    @property
    def unit(self) -> str:
        """Unit of difference and standard deviation."""
        return "mrad" if is_angle(self.name) else "mm"

    @property
    def scale(self) -> float:
        """Number of ``unit`` in the parameter's own unit."""
        return 1e3 if is_angle(self.name) else 1.0

    @property
    def difference(self) -> float:
        """Calibrated minus nominal in ``unit``."""
        return self.scale * (self.calibrated - self.nominal)

    @property
    def spread(self) -> float:
        """Standard deviation in ``unit``."""
        return self.scale * self.std


def parameters(model: Columns, told: Columns, robot: Robot) -> list[Parameter]:
    """Every DH parameter that is there: not the angle beta of a joint that has none."""
    status = dict(zip(told["parameter"], told["status"], strict=True))
    fitted = DHModel.from_columns(model, robot.dh.prismatic)
    order = np.argsort(model["joint"], kind="stable")
    found = []
    for joint in range(fitted.joints):
        for column in PARAMETERS:
            name = f"j{joint + 1}.{column}"
            nominal, calibrated = (float(getattr(of, column)[joint]) for of in (robot.dh, fitted))
            std = float(np.asarray(model[f"std_{column}"], dtype=float)[order][joint])
            each = Parameter(name, nominal, calibrated, std, str(status.get(name, FIXED)))
            if column != "beta_rad" or each.status != FIXED or nominal or calibrated:
                found.append(each)
    return found


def _differences(found: Sequence[Parameter], unit: str) -> Picture:
    mine = [each for each in found if each.unit == unit]
    what = "lengths" if unit == "mm" else "angles"
    named = [short_name(each.name) for each in mine]
    difference = np.array([each.difference for each in mine])
    reach = _WIDE * np.array([each.spread for each in mine])
    columns = {
        "short": np.array(named, dtype=object),
        "called": np.array([parameter_name(each.name) for each in mine], dtype=object),
        "status": np.array([each.status for each in mine], dtype=object),
        "difference": difference,
        "std": np.array([each.spread for each in mine]),
        "low": difference - reach,
        "high": difference + reach,
    }
    data = pictures.source(f"differences-{what}", columns)
    plot = pictures.figure(
        "",
        f"calibrated - nominal, {unit}",
        hover=[
            ("", "@called, @status"),
            (f"difference, {unit}", "@difference{0.0000}"),
            ("standard deviation", "@std{0.0000}"),
        ],
        x_range=named,
    )
    plot.hspan(y=0.0, line_color="grey", line_dash="dotted")
    plot.segment("short", "low", "short", "high", source=data, line_color=BLUE, line_width=2)
    for status in dict.fromkeys(each.status for each in mine):
        marker, colour = _LOOK[status]
        size = np.array([9.0 if each.status == status else 0.0 for each in mine])
        data.data[f"size_{status}"] = size.astype(np.float32)
        plot.scatter(
            "short",
            "difference",
            source=data,
            marker=marker,
            size=f"size_{status}",
            color=colour,
            line_width=2,
            legend_label=status,
        )
    plot.xaxis.major_label_orientation = "vertical"
    plot.legend.update(orientation="horizontal", spacing=14)
    plot.add_layout(plot.legend[0], "above")
    caption = (
        f"Difference of the {what} of the DH model, with {_WIDE:g} standard deviations either way."
    )
    if any(each.status == UNDETERMINED for each in mine):
        caption += (
            " Undetermined ones have no bar: where they stand is a convention, the least change of "
            "all that fit, and no measurement."
        )
    far = max(mine, key=lambda each: abs(each.difference))
    words = f"{caption} The largest: {parameter_name(far.name)}, {far.difference:+.3f} {unit}."
    details = {
        "called": "{}",
        "status": "{}",
        "difference": f"difference {{}} {unit}",
        "std": f"standard deviation {{}} {unit}",
    }
    return Picture(f"differences-{what}", plot, words, caption, details=details)


def _table(found: Sequence[Parameter], fits: Misfit) -> Table:
    rows = tuple(
        (
            parameter_name(each.name),
            *(_value(each, value) for value in (each.nominal, each.calibrated)),
            f"{_number(each.difference, '+')} {each.unit}",
            f"{each.spread:.4f} {each.unit}" if np.isfinite(each.spread) else _NONE,
            each.status,
        )
        for each in found
    )
    heads = ("parameter", "nominal", "calibrated", "difference", "standard deviation", "status")
    caption = f"DH parameters, nominal and calibrated; standard deviations are {in_words([fits])}"
    return Table(caption, heads, rows, frozenset({1, 2, 3, 4}), folded=True)


def _value(each: Parameter, value: float) -> str:
    if is_angle(each.name):
        return f"{_number(np.rad2deg(value))} deg"
    return f"{_number(value)} mm"


def _number(value: float, sign: str = "") -> str:
    """Four decimals, and no minus zero."""
    return f"{round(value, 4) + 0.0:{sign}.4f}"


def _bending(table: Columns | None) -> list[Block]:
    """How far joints turn under gravity, where they do."""
    columns = {
        "compliance_rad_per_nm": "urad per N m",
        "lever_coefficient_rad_per_mm": "urad per mm of lever",
    }
    rows = []
    for joint in summary.bending(table):
        for name, unit in columns.items():
            if joint[name] is not None:
                std = joint[f"std_{name}"]
                sure = "not determined" if std is None else f"{1e6 * std:.3g}"
                rows.append((f"joint {joint['joint']}", f"{1e6 * joint[name]:.4g}", sure, unit))
    heads = ("joint", "coefficient", "standard deviation", "unit")
    caption = "Joints that bend under gravity (compliance model)"
    return [Table(caption, heads, tuple(rows), frozenset({1, 2}))] if rows else []


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
            scale = _scale(ERRORS[error])
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
            if banded:
                band = plot.varea(
                    "q1",
                    f"j1_{name}_low",
                    f"j1_{name}_high",
                    source=self.data,
                    fill_color=colour,
                    fill_alpha=0.18,
                    legend_label=name,
                )
                band.glyph.name = f"{name}-band"
            line = plot.line(
                "q1",
                f"j1_{name}",
                source=self.data,
                color=colour,
                line_dash=dash,
                line_width=2,
                legend_label=name,
            )
            line.glyph.name = f"{name}-line"
        plot.xaxis[0].name = f"{kind}-axis"
        plot.legend.click_policy = "hide"
        plot.legend.update(orientation="horizontal", spacing=14)
        plot.add_layout(plot.legend[0], "above")
        options = tuple(
            Option(f"{n + 1}", tuple(self._sets(kind, mine, n, banded)))
            for n in range(self.model.joints)
        )
        bands = (
            f"Bands: {_WIDE:g} standard deviations either way."
            if banded
            else "How sure the curves are is not known: these results hold no covariance."
        )
        caption = (
            f"The {what}s that the VEC model (order {self.model.order}) puts in front of a joint, "
            "less what neighbouring joints or a DH table can take over (constants, and across the "
            f"axis one wave a turn: no pose tells whose they are). {bands} A click in the legend "
            "hides a curve."
        )
        control = Control("Joint", options)
        return Picture(f"curves-{kind}", plot, caption, caption, (control,))

    def _sets(self, kind: str, mine: Sequence[str], joint: int, banded: bool):
        at = f"j{joint + 1}"
        for name in mine:
            yield f"{name}-line", "x", pictures.field(f"q{joint + 1}")
            yield f"{name}-line", "y", pictures.field(f"{at}_{name}")
            if banded:
                yield f"{name}-band", "x", pictures.field(f"q{joint + 1}")
                yield f"{name}-band", "y1", pictures.field(f"{at}_{name}_low")
                yield f"{name}-band", "y2", pictures.field(f"{at}_{name}_high")
        yield f"{kind}-axis", "axis_label", self._label(joint)

    def largest(self) -> Table:
        """The largest of each error over the joint's range, with its standard deviation there."""
        rows = []
        for joint in range(self.model.joints):
            cells = [f"joint {joint + 1}"]
            for error in range(len(ERRORS)):
                at = int(np.argmax(np.abs(self.values[joint, error])))
                std = self.std[joint, error, at]
                sure = f" ± {std:.3f}" if np.isfinite(std) else ""
                cells.append(f"{self.values[joint, error, at]:+.3f}{sure}")
            rows.append(tuple(cells))
        units = [_KINDS[name.partition("_")[0]][1] for name in ERRORS]
        heads = tuple(f"{name}, {unit}" for name, unit in zip(ERRORS, units, strict=True))
        sure = ", with one standard deviation" if np.isfinite(self.std).any() else ""
        return Table(
            f"The largest of every error of a joint that no DH table can say{sure}",
            ("DH joint", *heads),
            tuple(rows),
            frozenset(range(1, len(heads) + 1)),
            folded=True,
        )


def _scale(error: str) -> float:
    """Number of mm or mrad in the unit of an error."""
    return _KINDS[error.partition("_")[0]][2]


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


def _directions(table: Columns) -> list[Block]:
    """What a joint turns further by the direction it comes from, where that was fitted."""
    direction = np.asarray(table["direction"]).astype(int)
    rows = []
    for i in np.flatnonzero(direction):
        std = 1e3 * float(table["std"][i])
        value = f"{1e3 * float(table['coefficient'][i]):+.4f}"
        sure = f"{std:.4f}" if np.isfinite(std) else _NONE
        sign = "falling" if direction[i] < 0 else "rising"
        rows.append((f"joint {int(table['joint'][i])}", sign, value, sure))
    heads = ("DH joint", "its angle was", "eps_z, mrad", "standard deviation")
    caption = "Offsets by the direction of travel (backlash) of the VEC model"
    return [Table(caption, heads, tuple(rows), frozenset({2, 3}))] if rows else []
