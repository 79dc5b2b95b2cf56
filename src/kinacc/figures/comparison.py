"""Two calibrations side by side: parameters in standard deviations, and how far poses moved."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.calibrated.compare import Comparison, Parameters, Shift
from kinacc.calibration.uncertainty import is_angle
from kinacc.figures import style

_FAR = 3.0  # standard deviations
_SYMBOLS = {
    "theta_offset_rad": "θ", "d_mm": "d", "a_mm": "a", "alpha_rad": "α", "beta_rad": "β",
}  # fmt: skip


def draw(found: Comparison, first: str, second: str) -> Figure:
    """Draw a comparison; ``first`` and ``second`` name the calibrations."""
    rows = len(found.parameters.names) if found.parameters else 0
    with style.house():
        height = max(2.6, 0.13 * rows + 0.9)
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, height)
        if found.parameters:
            left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
            _parameters(left, found.parameters)
        else:
            right = figure.subplots()
        _shifts(right, found)
        style.name_dataset(figure, f"{second} against {first}")
    return figure


def _parameters(ax: Axes, parameters: Parameters) -> None:
    """Bars of standard deviations; of mm and mrad where no standard deviation is known."""
    places = np.arange(len(parameters.names))
    angle = np.array([is_angle(name) for name in parameters.names], dtype=bool)
    moved = parameters.difference * np.where(angle, 1e3, 1.0)
    undetermined = np.array([bool(where) for where in parameters.undetermined_in], dtype=bool)
    in_sigmas = bool(np.isfinite(parameters.sigmas).any())
    values = parameters.sigmas if in_sigmas else np.where(undetermined, np.nan, moved)
    known = np.isfinite(values)
    largest = float(np.max(np.abs(values[known]), initial=0.0)) * 1.1
    far = known & in_sigmas & (np.abs(values) > _FAR)
    near = known & ~far
    if in_sigmas:
        largest = max(_FAR * 1.5, largest)
        ax.axvspan(-_FAR, _FAR, color=style.FAINT, alpha=0.5, lw=0)
    ax.barh(places[near], values[near], 0.62, color=style.BLUE)
    ax.barh(places[far], values[far], 0.62, color=style.VERMILION, hatch="////", ec="white", lw=0)
    if undetermined.any():
        at = places[undetermined]
        ax.plot(np.zeros(len(at)), at, "x", color=style.MUTED, ms=4)
    # Held by both fits and yet another value: there is no deviation to draw it by.
    for place in places[~known & ~undetermined & (moved != 0.0)]:
        words = f" {moved[place]:+.3g} {'mrad' if angle[place] else 'mm'}"
        ax.text(0.0, place, words, va="center", fontsize=style.SMALL_PT, color=style.VERMILION)
    ax.axvline(0.0, color=style.MUTED, lw=0.6)
    ax.set_yticks(places, [_label(name) for name in parameters.names])
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")
    ax.set(xlim=(-(largest or 1.0), largest or 1.0), ylim=(len(places) - 0.4, -0.6))
    units = "standard deviations" if in_sigmas else "lengths in mm, angles in mrad"
    crosses = "; ×: undetermined" if undetermined.any() else ""
    ax.set_xlabel(f"Change ({units}{crosses})")


def _shifts(ax: Axes, found: Comparison) -> None:
    _curve(ax, found.as_they_stand, "as they stand", style.ORANGE, "-")
    _curve(ax, found.apart_from_frames, "after best base and tool", style.GREEN, (0, (4, 1.5)))
    ax.set(xlabel="Change of flange position (mm)", ylabel="Share of poses", ylim=(0.0, 1.02))
    ax.set_xlim(left=0.0)
    ax.legend(
        loc="lower right", title="dotted: rms expected by chance", title_fontsize=style.SMALL_PT
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
