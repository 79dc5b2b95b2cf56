"""The house style: one place for sizes, colours and words that every figure shares.

Everything is set for the size at which a figure is printed: a single column is 3.5 in wide, a
double column 7.16 in, and no text is smaller than 7 pt. Colours are those of Okabe and Ito, which
stay apart for colour-blind readers; every meaning carried by a colour is carried by a marker or
line style as well.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

SINGLE_COLUMN_IN = 3.5
DOUBLE_COLUMN_IN = 7.16
SMALL_PT = 7.0
TEXT_PT = 8.0

INK = "#222222"
MUTED = "#5f5f5f"
FAINT = "#d9d9d9"
BLUE = "#0072B2"
ORANGE = "#E69F00"
VERMILION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#7F3C8D"
SKY = "#56B4E9"

# Colour and marker of each assessor; names not listed take the spare ones in order.
ASSESSORS = {
    "maximum": ("Maximum measurement", VERMILION, "^"),
    "outlier_rejection": ("Outlier rejection", BLUE, "s"),
    "model_invalidation": ("Model invalidation", GREEN, "o"),
}
SPARE = ((PURPLE, "D"), ("#A6761D", "v"), (SKY, "P"), (INK, "X"), ("#CC79A7", "*"))

# Settings a reader's own matplotlibrc must not change are all given, on top of the defaults.
HOUSE: dict[Any, Any] = {
    "font.family": ["DejaVu Sans"],
    "mathtext.fontset": "dejavusans",
    "font.size": TEXT_PT,
    "axes.titlesize": TEXT_PT,
    "axes.labelsize": TEXT_PT,
    "xtick.labelsize": SMALL_PT,
    "ytick.labelsize": SMALL_PT,
    "legend.fontsize": SMALL_PT,
    "figure.titlesize": TEXT_PT,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e8e8e8",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.handlelength": 1.4,
    "legend.handletextpad": 0.5,
    "legend.columnspacing": 1.2,
    "legend.borderaxespad": 0.2,
    "hatch.linewidth": 0.4,
    "figure.dpi": 200,
    "figure.constrained_layout.h_pad": 0.03,
    "figure.constrained_layout.w_pad": 0.03,
    # Text keeps the same width on screen and on paper, so one layout serves every format.
    "text.hinting": "none",
    "svg.fonttype": "path",
    "svg.hashsalt": "kinacc",
    "pdf.fonttype": 42,
    "pdf.compression": 6,
}


@contextmanager
def house() -> Iterator[None]:
    """Apply the house style, whatever the surrounding matplotlib settings are."""
    keep = {"backend", "backend_fallback", "interactive", "toolbar"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", matplotlib.MatplotlibDeprecationWarning)
        defaults = {k: v for k, v in matplotlib.rcParamsDefault.items() if k not in keep}
        context = matplotlib.rc_context({**defaults, **HOUSE})
        context.__enter__()
    try:
        yield
    finally:
        context.__exit__(None, None, None)


def new_figure(width_in: float, height_in: float, *, arranged: bool = True) -> Figure:
    """Return an empty figure of the printed size, in inches.

    ``arranged`` leaves the places of axes and labels to the layout engine.
    """
    return Figure(figsize=(width_in, height_in), layout="constrained" if arranged else None)


def assessor_style(names: list[str]) -> dict[str, tuple[str, str, str]]:
    """Return label, colour and marker for each assessor, known ones first and fixed."""
    known = [name for name in ASSESSORS if name in names]
    others = sorted(set(names) - set(known))
    chosen = {name: ASSESSORS[name] for name in known}
    for index, name in enumerate(others):
        colour, marker = SPARE[index % len(SPARE)]
        chosen[name] = (name.replace("_", " ").capitalize(), colour, marker)
    return chosen


def darker(colour: str, factor: float = 0.75) -> str:
    """Return the colour darkened for text, which needs more contrast than a line."""
    channels = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(f"{round(c * factor):02x}" for c in channels)


def shortened(name: str, limit: int) -> str:
    """Return a name of at most ``limit`` characters, cut in the middle so both ends stay."""
    if len(name) <= limit:
        return name
    head = (limit - 1) // 2
    return f"{name[:head]}…{name[-(limit - 1 - head) :]}"


def literal(text: str) -> str:
    """A text that stands in a legend as it is: neither a formula nor, as _text, left out."""
    return f"{' ' * text.startswith('_')}{text.replace('$', chr(92) + '$')}"


def name_dataset(figure: Figure, dataset: str | None) -> None:
    """Write the data set's name small above the figure, where one is given."""
    if dataset:
        limit = int(figure.get_figwidth() * 15)
        figure.suptitle(
            shortened(dataset, limit),
            x=0.01,
            ha="left",
            fontsize=SMALL_PT,
            color=MUTED,
            parse_math=False,
        )


def spread(values: list[float], gap: float, low: float, high: float) -> list[float]:
    """Return positions near ``values`` at least ``gap`` apart and inside [low, high].

    Pools of neighbours that would overlap are centred on their mean. If everything cannot fit,
    the gap shrinks to what fits.
    """
    count = len(values)
    if not count:
        return []
    gap = min(gap, (high - low) / max(count - 1, 1))
    order = sorted(range(count), key=lambda i: values[i])
    pools: list[list] = []  # [mean of (value - index * gap), members]
    for rank, i in enumerate(order):
        pools.append([values[i] - rank * gap, 1])
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            mean, size = pools.pop()
            before, n = pools[-1]
            pools[-1] = [(before * n + mean * size) / (n + size), n + size]
    flat = [mean for mean, size in pools for _ in range(size)]
    placed = [0.0] * count
    for rank, i in enumerate(order):
        base = min(max(flat[rank], low), high - (count - 1) * gap)
        placed[i] = base + rank * gap
    return placed


def outside_label(axes: Axes, y: float, text: str, colour: str) -> None:
    """Write a label just right of the axes, at height ``y`` in axes fractions."""
    axes.text(
        1.02,
        y,
        text,
        transform=axes.transAxes,
        color=darker(colour),
        fontsize=SMALL_PT,
        va="center",
        ha="left",
        linespacing=1.0,
    )
