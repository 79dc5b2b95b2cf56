"""Pictures of a calibration: the checked file, joint errors, a comparison, a corrected program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.deployment.compare import ROUNDING, Difference
from kinacc.figures import style

_DOTS = 20000  # more readings than this are not drawn one by one


def draw_check(
    joints: pd.DataFrame,
    line: np.ndarray,
    left_mm: np.ndarray,
    limit_mm: float,
    suspects: Mapping[str, Sequence[int]],
) -> Figure:
    """Joint coverage against limits above, residuals against the line of the file below.

    ``joints`` has joint, low, high, least, most and unit per joint; ``line`` (n,) and ``left_mm``
    (n,) of the readings, empty where nothing was fitted; ``suspects`` lines by kind.
    """
    with style.new_figure(style.DOUBLE_COLUMN_IN, 4.2) as figure:
        above, below = figure.subplots(2, 1, height_ratios=(1, 2))
        _joints(above, joints)
        if left_mm.size:
            _residuals(below, line, left_mm, limit_mm, suspects)
        else:
            below.text(0.5, 0.5, "the robot does not fit the file", ha="center", va="center")
            below.set_axis_off()
    return figure


def _joints(axes: Axes, joints: pd.DataFrame) -> None:
    for row in joints.itertuples():
        low, high = np.interp([row.low, row.high], [row.least, row.most], [0.0, 1.0])
        axes.barh(row.joint, 1.0, height=0.62, color=style.FAINT)
        axes.barh(row.joint, high - low, left=low, height=0.62, color=style.SKY)
        label = f"{row.low:.0f} to {row.high:.0f} {row.unit}"
        axes.text(1.01, row.joint, label, va="center", fontsize=style.SMALL_PT)
    axes.set_yticks(joints["joint"])
    axes.invert_yaxis()
    axes.set(xlim=(0.0, 1.18), ylabel="joint")
    axes.set_xticks([0.0, 0.5, 1.0], ["lower limit", "middle", "upper limit"])
    axes.grid(visible=False)


def _residuals(
    axes: Axes,
    line: np.ndarray,
    left_mm: np.ndarray,
    limit_mm: float,
    suspects: Mapping[str, Sequence[int]],
) -> None:
    step = max(len(line) // _DOTS, 1)
    shown = np.maximum(left_mm, max(0.1 * float(np.quantile(left_mm, 0.01)), 1e-7))
    axes.plot(line[::step], shown[::step], ".", ms=2.5, color=style.MUTED, label="readings")
    for (kind, lines), (colour, marker) in zip(suspects.items(), cycle(style.SERIES), strict=False):
        rows = np.isin(line, [*lines])
        axes.plot(line[rows], shown[rows], marker, mfc="none", mec=colour,
                  label=kind.replace("_", " "))  # fmt: skip
    if np.isfinite(limit_mm):
        axes.axhline(limit_mm, color=style.INK, lw=0.8, ls="--", label="most to be expected")
    axes.set(yscale="log", xlabel="line of the file", ylabel="left by a quick fit (mm)")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))


_LINES = ((style.BLUE, "-"), (style.ORANGE, "--"), (style.GREEN, "-."))  # of x, y, z
_DEVIATIONS = 2.0


def draw_joint_errors(
    joints: np.ndarray, values: np.ndarray, std: np.ndarray, units: Sequence[str]
) -> Figure:
    """Draw shifts and turns of every joint, with bands of two standard deviations.

    Parameters
    ----------
    joints
        Positions (k, m) of the joints, in ``units`` (k,).
    values, std
        Shifts along x, y, z in mm, then turns in mrad, (k, 6, m); ``std`` NaN where unknown.
    """
    with style.new_figure(style.DOUBLE_COLUMN_IN, 1.15 * len(joints) + 0.5) as figure:
        panels = figure.subplots(len(joints), 2, sharey="col", squeeze=False)
        for (joint, kind), ax in np.ndenumerate(panels):
            for axis, (colour, dash) in enumerate(_LINES):
                value = values[joint, 3 * kind + axis]
                reach = _DEVIATIONS * std[joint, 3 * kind + axis]
                ends = value - reach, value + reach
                ax.fill_between(joints[joint], *ends, color=colour, alpha=0.15, lw=0)
                ax.plot(joints[joint], value, color=colour, ls=dash, label="xyz"[axis])
            ylabel = ("shift, mm", "turn, mrad")[kind]
            ax.set(xlabel=f"joint {joint + 1}, {units[joint]}", ylabel=ylabel)
        panels[0, 1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    return figure


_FAR = 3.0  # standard deviations
_SYMBOLS = {"theta_offset": "θ", "d": "d", "a": "a", "alpha": "α", "beta": "β"}


def draw_comparison(difference: Difference) -> Figure:
    """Draw changes of the parameters, and the share of poses that moved no more than a distance.

    Parameters
    ----------
    difference
        Comparison of two calibrations; lengths in mm.
    """
    parameters = difference.parameters
    rows = 0 if parameters is None else len(parameters)
    name, height_in = "{1} against {0}".format(*difference.names), max(2.6, 0.13 * rows + 0.9)
    with style.new_figure(style.DOUBLE_COLUMN_IN, height_in, name) as figure:
        axes = figure.subplots(1, 2 if rows else 1, squeeze=False)[0]
        if parameters is not None and rows:
            _parameters(axes[0], parameters)
        _shifts(axes[-1], difference)
    return figure


def _parameters(ax: Axes, parameters: pd.DataFrame) -> None:
    """Changes in standard deviations; a change without one stands in words on the middle line."""
    names = [name.partition(".") for name in parameters["name"]]
    labels = [f"{_SYMBOLS[name]}$_{{{joint[1:]}}}$" for joint, _, name in names]
    table = parameters.assign(place=range(len(parameters)))
    known, unknown = table[table["sigmas"].notna()], table[table["sigmas"].isna()]
    far = known["sigmas"].abs() > _FAR
    ax.axvspan(-_FAR, _FAR, color=style.FAINT, alpha=0.5, lw=0)
    colours = np.where(far, style.VERMILION, style.BLUE)
    ax.barh(known["place"], known["sigmas"], 0.62, color=colours)
    ax.plot(np.zeros(len(unknown)), unknown["place"], "x", color=style.MUTED)
    for row in unknown[unknown["difference"].abs() > ROUNDING].itertuples():
        ax.annotate(
            f"{row.difference:+.3g} {row.unit}", (0.0, row.place), xytext=(4, 0),
            textcoords="offset points", va="center", fontsize=style.SMALL_PT, color=style.MUTED,
        )  # fmt: skip
    limit = max(_FAR * 1.5, 1.1 * known["sigmas"].abs().max()) if len(known) else _FAR * 1.5
    ax.set(xlim=(-limit, limit), ylim=(len(table) - 0.4, -0.6))
    ax.set_xlabel("Change (standard deviations)\n×: without one; the change, if any, beside it")
    ax.set_yticks(table["place"], labels)
    ax.grid(visible=False, axis="y")


def _shifts(ax: Axes, difference: Difference) -> None:
    looks = ("moved_mm", style.ORANGE, "-"), ("arm_moved_mm", style.GREEN, (0, (4, 1.5)))
    for (name, colour, line), row in zip(looks, difference.shifts.itertuples(), strict=True):
        label = f"{row.frames}: rms {row.rms_mm:.3g} mm"
        ax.ecdf(difference.poses[name], color=colour, ls=line, label=label)
        ax.axvline(row.chance_mm, color=colour, lw=0.9, ls=":")
    ax.set(xlabel="Change of flange position (mm)", ylabel="Share of poses", ylim=(0.0, 1.02))
    ax.set_xlim(left=0.0)
    dotted = difference.shifts["chance_mm"].notna().any()
    ax.legend(title="dotted: rms expected by chance" if dotted else None)


def draw_program(table: pd.DataFrame) -> Figure:
    """Draw the correction of every position of a program.

    Parameters
    ----------
    table
        ``position``, ``status``, ``change_mm`` and ``change_mrad``; positions that are not
        ``corrected`` have no bar.
    """
    moved = table.where(table["status"] == "corrected")
    with style.new_figure(7.0, 5.0) as figure:
        axes = figure.subplots(2, 1, sharex=True)
        for axis, unit in zip(axes, ("mm", "mrad"), strict=True):
            axis.bar(moved.index, moved.get(f"change_{unit}", 0.0), color="0.5")
            axis.set_ylabel(f"change ({unit})")
        if len(table) <= 40:
            axes[1].set_xticks(table.index, table["position"], rotation=90)
        axes[1].set_xlabel("position")
        return figure
