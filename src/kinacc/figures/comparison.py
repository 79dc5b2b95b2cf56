"""Two calibrations side by side: parameters in standard deviations, and how far poses moved."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.deployment.compare import ROUNDING, Difference, Shift
from kinacc.figures import style

_FAR = 3.0  # standard deviations
_SYMBOLS = {
    "theta_offset": "θ", "d": "d", "a": "a", "alpha": "α", "beta": "β",
}  # fmt: skip


def draw(found: Difference) -> Figure:
    """Draw a comparison."""
    parameters = found.parameters
    rows = 0 if parameters is None else len(parameters)
    with style.house():
        height = max(2.6, 0.13 * rows + 0.9)
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, height)
        if parameters is not None and rows:
            left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
            _parameters(left, parameters)
        else:
            right = figure.subplots()
        _shifts(right, found)
        style.name_dataset(figure, "{1} against {0}".format(*found.names))
    return figure


def _parameters(ax: Axes, parameters: pd.DataFrame) -> None:
    """Changes in standard deviations; in mm and mrad where none has a standard deviation."""
    places = np.arange(len(parameters))
    known = np.isfinite(parameters["sigmas"].to_numpy())
    if known.any():
        _in_deviations(ax, parameters, places, known)
    else:
        _in_units(ax, parameters, places)
    ax.axvline(0.0, color=style.MUTED, lw=0.6)
    ax.set_yticks(places, [_label(name) for name in parameters["name"]])
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")
    ax.set(ylim=(len(places) - 0.4, -0.6))


def _in_deviations(
    ax: Axes, parameters: pd.DataFrame, places: np.ndarray, known: np.ndarray
) -> None:
    sigmas = parameters["sigmas"].to_numpy()
    far = known & (np.abs(sigmas) > _FAR)
    near = known & ~far
    limit = max(_FAR * 1.5, float(np.max(np.abs(sigmas[known]), initial=0.0)) * 1.1)
    ax.axvspan(-_FAR, _FAR, color=style.FAINT, alpha=0.5, lw=0)
    ax.barh(places[near], sigmas[near], 0.62, color=style.BLUE)
    ax.barh(places[far], sigmas[far], 0.62, color=style.VERMILION, hatch="////", ec="white", lw=0)
    ax.plot(np.zeros(int((~known).sum())), places[~known], "x", color=style.MUTED, ms=4)
    # What has no standard deviation has no place on this axis: its change is written beside it.
    for place in places[~known & (_change(parameters) != 0.0)]:
        words = f"{_change(parameters)[place]:+.3g} {parameters['unit'][place]}"
        ax.annotate(
            words,
            (0.0, place),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=style.SMALL_PT,
            color=style.MUTED,
        )
    ax.set_xlim(-limit, limit)
    ax.set_xlabel("Change (standard deviations)\n×: without one; the change, if any, beside it")


def _in_units(ax: Axes, parameters: pd.DataFrame, places: np.ndarray) -> None:
    change = _change(parameters)
    turns = (parameters["unit"] == "mrad").to_numpy()
    angles = {"color": style.ORANGE, "hatch": "////", "ec": "white", "lw": 0}
    kinds = ((~turns, "mm", {"color": style.BLUE}), (turns, "mrad", angles))
    for which, unit, look in kinds:
        if which.any():
            ax.barh(places[which], change[which], 0.62, label=unit, **look)
    blind = (parameters["undetermined"] != "").to_numpy()
    ax.plot(change[blind], places[blind], "x", color=style.MUTED, ms=4)
    limit = 1.1 * float(np.max(np.abs(change), initial=0.0)) or 1.0
    units = ", ".join(unit for which, unit, _ in kinds if which.any())
    ax.set_xlim(-limit, limit)
    ax.set_xlabel(f"Change ({units}{'; ×: undetermined' if blind.any() else ''})")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)


def _change(parameters: pd.DataFrame) -> np.ndarray:
    """Differences (P,) in mm and mrad; what is no more than rounding is 0."""
    change = parameters["difference"].to_numpy()
    return np.where(np.abs(change) > ROUNDING, change, 0.0)


def _shifts(ax: Axes, found: Difference) -> None:
    _curve(ax, found.as_they_stand, "as they stand", style.ORANGE, "-")
    _curve(ax, found.apart_from_frames, "after best base and tool", style.GREEN, (0, (4, 1.5)))
    ax.set(xlabel="Change of flange position (mm)", ylabel="Share of poses", ylim=(0.0, 1.02))
    ax.set_xlim(left=0.0)
    shifts = (found.as_they_stand, found.apart_from_frames)
    dotted = any(np.isfinite(shift.chance_mm) for shift in shifts)
    ax.legend(
        loc="best",
        title="dotted: rms expected by chance" if dotted else None,
        title_fontsize=style.SMALL_PT,
    )


def _curve(ax: Axes, shift: Shift, words: str, colour: str, line) -> None:
    ordered = np.sort(shift.position_mm)
    share = np.arange(1, len(ordered) + 1) / len(ordered)
    label = f"{words}: rms {shift.rms_mm:.3g} mm"
    ax.plot(ordered, share, color=colour, ls=line, label=label)
    if np.isfinite(shift.chance_mm):
        ax.axvline(shift.chance_mm, color=colour, lw=0.9, ls=(0, (1, 1.5)))


def _label(name: str) -> str:
    joint, _, parameter = name.partition(".")
    return f"{_SYMBOLS[parameter]}$_{{{joint[1:]}}}$"
