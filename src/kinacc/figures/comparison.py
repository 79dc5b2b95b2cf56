"""Two calibrations side by side: parameters in standard deviations, and how far poses moved."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.deployment.compare import Comparison, Parameters, Shift
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
    places = np.arange(len(parameters.names))
    sigmas = parameters.sigmas
    known = np.isfinite(sigmas)
    far = known & (np.abs(sigmas) > _FAR)
    near = known & ~far
    limit = max(_FAR * 1.5, float(np.max(np.abs(sigmas[known]), initial=0.0)) * 1.1)
    ax.axvspan(-_FAR, _FAR, color=style.FAINT, alpha=0.5, lw=0)
    ax.barh(places[near], sigmas[near], 0.62, color=style.BLUE)
    ax.barh(places[far], sigmas[far], 0.62, color=style.VERMILION, hatch="////", ec="white", lw=0)
    ax.plot(np.zeros(int((~known).sum())), places[~known], "x", color=style.MUTED, ms=4)
    ax.axvline(0.0, color=style.MUTED, lw=0.6)
    ax.set_yticks(places, [_label(name) for name in parameters.names])
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")
    ax.set(xlim=(-limit, limit), ylim=(len(places) - 0.4, -0.6))
    ax.set_xlabel("Change (standard deviations; ×: undetermined)")


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
