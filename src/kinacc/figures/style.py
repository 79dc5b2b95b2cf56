"""The house style: sizes, colours and words that every figure shares; house.mplstyle has the rest.

Everything is set for the size at which a figure is printed. Colours are those of Okabe and Ito,
which stay apart for colour-blind readers; a marker or line style carries every meaning as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib.style
from matplotlib.axes import Axes
from matplotlib.figure import Figure

SINGLE_COLUMN_IN = 3.5
DOUBLE_COLUMN_IN = 7.16
SMALL_PT = 7.0

INK = "#222222"
MUTED = "#5f5f5f"
FAINT = "#d9d9d9"
BLUE = "#0072B2"
ORANGE = "#E69F00"
VERMILION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#7F3C8D"
SKY = "#56B4E9"
SERIES = ((BLUE, "o"), (ORANGE, "s"), (GREEN, "^"), (PURPLE, "D"), (VERMILION, "v"), (SKY, "P"))
TRUTH: dict[str, Any] = {"color": INK, "lw": 1, "ls": (0, (4, 2))}
LIMIT: dict[str, Any] = {"color": VERMILION, "lw": 1.0, "ls": (0, (6, 2))}

# Label, colour and marker of each assessor; names not listed take the spare ones in order.
ASSESSORS = {
    "maximum": ("Maximum measurement", VERMILION, "^"),
    "outlier_rejection": ("Outlier rejection", BLUE, "s"),
    "model_invalidation": ("Model invalidation", GREEN, "o"),
}
SPARE = ((PURPLE, "D"), ("#A6761D", "v"), (SKY, "P"), (INK, "X"), ("#CC79A7", "*"))


def house() -> AbstractContextManager[None]:
    """Context of the house style, whatever the surrounding matplotlib settings are."""
    sheet = Path(__file__).with_name("house.mplstyle")
    return matplotlib.style.context(sheet, after_reset=True)


@contextmanager
def new_figure(
    width_in: float, height_in: float, name: str | None = None, *, arranged: bool = True
) -> Iterator[Figure]:
    """An empty figure of the printed size, drawn in the house style, with a name small above it.

    ``arranged`` leaves the places of axes and labels to the layout engine.
    """
    with house():
        figure = Figure(figsize=(width_in, height_in), layout="constrained" if arranged else None)
        if name:
            figure.suptitle(
                shortened(name, int(width_in * 15)),
                x=0.01, ha="left", fontsize=SMALL_PT, color=MUTED, parse_math=False,
            )  # fmt: skip
        yield figure


def assessor_style(names: Iterable[str]) -> dict[str, tuple[str, str, str]]:
    """Return label, colour and marker for each assessor, known ones first and fixed."""
    names = set(names)
    looks = {name: look for name, look in ASSESSORS.items() if name in names}
    for name, look in zip(sorted(names - set(looks)), cycle(SPARE), strict=False):
        looks[name] = (name.replace("_", " ").capitalize(), *look)
    return looks


def shortened(name: str, limit: int) -> str:
    """Return a name of at most ``limit`` characters, cut in the middle so both ends stay."""
    head = (limit - 1) // 2
    return name if len(name) <= limit else f"{name[:head]}…{name[head + 1 - limit :]}"


def literal(text: str) -> str:
    """A text that stands in a legend as it is: neither a formula nor, as _text, left out."""
    return f"{' ' * text.startswith('_')}{text.replace('$', chr(92) + '$')}"


def draw_limit(axes: Axes, value: float | None, label: str | None = None) -> None:
    """Draw a horizontal line at a limit, where there is one."""
    if value is not None:
        axes.axhline(value, label=label, **LIMIT)


def legend_above(axes: Axes, columns: int = 2, title: str | None = None) -> None:
    """Place a legend above the axes, where it covers nothing; none where nothing is labelled."""
    axes.legend(
        *axes.get_legend_handles_labels(), loc="lower left", bbox_to_anchor=(0.0, 1.0),
        ncols=columns, title=title, alignment="left",
    )  # fmt: skip
