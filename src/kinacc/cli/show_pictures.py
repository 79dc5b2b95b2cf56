"""Pictures for ``kinacc show --plot``: curves by plotext; maps and histograms of characters.

A character of a map or histogram is a cell or a bin; plotext's bars spread over their neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rich.color import Color
from rich.style import Style
from rich.text import Text

from kinacc.artifacts.error_models import MEASURED, NOMINAL, model_name
from kinacc.cli.screen import Screen, decimals_of, number
from kinacc.cli.show_table import Shown
from kinacc.errors import InputError, Problem

_LEVELS = ".:-=+*#%@"
# Viridis, from dark to bright: also told apart without seeing red or green.
_COLOURS = (
    *("#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58"),
    *("#b5de2b", "#fde725"),
)
# Of lines: colours that are told apart without seeing red or green, on dark and on light; where
# there are none, characters.
_INKS = ("#008ed7", "#e68c00", "#009e73", "#cc6ea0", "#969696")
_MARKS = "oxz+*"
_HEIGHT, _LOW, _WIDEST = 18, 6, 100
_EIGHTHS = " ▁▂▃▄▅▆▇█"
_MARGIN = 8  # characters at the left of a histogram
_TICKS = 6
Columns = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class _Line:
    """Points x (n,), y (n,), joined where there are more than one, and what they are."""

    label: str
    x: np.ndarray
    y: np.ndarray


def drawn(shown: Shown, columns: str | None) -> Screen:
    """The picture of a table for the terminal that is there. InputError where it has none.

    ``columns``, as --columns names them, choose the error that a map shows.
    """
    name = shown.artefact.name if shown.artefact else ""
    if name not in PICTURES:
        raise InputError(
            Problem(
                f"{shown.path}",
                "there is no picture of this table for the terminal",
                ", ".join(PICTURES),
                "without --plot it is shown as a table",
            )
        )
    table = {each.name: each.values for each in shown.sheet.fields}
    table = {name: values if values.dtype.kind != "O" else _numbers(values)
             for name, values in table.items()}  # fmt: skip
    screen = Screen.here()
    screen.words(shown.sheet.title, "bold")
    if len(shown.sheet):
        PICTURES[name](screen, table, columns)
    return screen


def _numbers(values: np.ndarray) -> np.ndarray:
    """Whole numbers with gaps as floats with NaN; texts as they are."""
    if any(isinstance(each, str) for each in values):
        return values
    return np.array([np.nan if each is None else each for each in values], dtype=np.float64)


def _map(screen: Screen, table: Columns, columns: str | None) -> None:
    """Heat maps of the largest error, a panel per slice, all on one scale."""
    errors = {"position_max_mm": "position", "orientation_max_mrad": "orientation"}
    asked = (columns or "").replace(" ", "").split(",")
    column = next((each for each in asked if each in errors), "position_max_mm")
    unit = column.rpartition("_")[2]
    values = table[column]
    known = values[np.isfinite(values)]
    if not known.size:
        screen.words("no cell of these is reached")
        return
    low, high = float(known.min()), float(known.max())
    decimals = decimals_of(known)
    blocks = screen.has_colours and screen.has_unicode
    screen.words(f"largest {errors[column]} error in {unit}; across radius, up height, in mm")
    angles = np.unique(table["slice_deg"])
    panels = []
    for angle in angles:
        mine = table["slice_deg"] == angle
        panels.append(
            _panel(
                f"slice {angle:g} deg",
                table["radius_mm"][mine],
                table["height_mm"][mine],
                values[mine],
                lambda grid: (_in_blocks if blocks else _in_characters)(grid, low, high),
                lambda size: f"max {number(size, min(decimals, 3))} {unit}",
            )
        )
    margin = max(len(f"{each:g}") for each in np.unique(table["height_mm"])) + 1
    beside = max(1, (screen.width - margin + 2) // (max(len(each[0]) for each in panels) + 2))
    for first in range(0, len(panels), beside):
        heights = table["height_mm"]
        screen.picture(_beside(panels[first : first + beside], heights, margin))
    if blocks:
        bar = Text.assemble(*(("    ", Style(bgcolor=each)) for each in _COLOURS))
        ends = number(low, decimals), number(high, decimals)
        screen.picture(Text.assemble(f"{ends[0]} ", bar, f" {ends[1]} {unit}"))
    else:
        step = number((high - low) / len(_LEVELS), max(decimals, 2))
        least, most = number(low, decimals), number(high, decimals)
        screen.picture(Text(f"{least} {_LEVELS} {most} {unit}, {step} a step"))
    if known.size < values.size:
        screen.words("blank: not reached")


def _panel(
    name: str,
    radius: np.ndarray,
    height: np.ndarray,
    values: np.ndarray,
    shaded: Callable[[np.ndarray], list[Text]],
    said: Callable[[float], str],
) -> list[Text]:
    """Lines of one slice: its name and largest error, the map, its radii."""
    radii, heights = np.unique(np.round(radius, 3)), np.unique(np.round(height, 3))
    grid = np.full((heights.size, radii.size), np.nan)
    places = (
        np.searchsorted(heights, np.round(height, 3)),
        np.searchsorted(radii, np.round(radius, 3)),
    )
    grid[places] = values
    lines = shaded(grid)
    known = values[np.isfinite(values)]
    head = f"{name}, {said(known.max())}" if known.size else f"{name}, none"
    ends = f"{radii[0]:g}", f"{radii[-1]:g}"
    foot = ends[0] + ends[1].rjust(radii.size - len(ends[0]))
    width = max(len(head), radii.size, len(foot))
    panel = [Text(head), *lines, Text(foot)]
    for line in panel:
        line.pad_right(width - len(line))
    return panel


def _beside(panels: Sequence[list[Text]], heights: np.ndarray, margin: int) -> Text:
    """Panels side by side, heights at the left of the first."""
    rows = max(map(len, panels))
    side = [""] * rows
    side[1], side[rows - 2] = f"{heights.max():g}", f"{heights.min():g}"
    lines = []
    for row in range(rows):
        cells = [each[row] if row < len(each) else Text(" " * len(each[0])) for each in panels]
        lines.append(Text(side[row].rjust(margin - 1) + " ") + Text("  ").join(cells))
    return Text("\n").join(lines)


def _pairs(grid: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rows of a grid two by two, the highest first; NaN below the last of an odd number."""
    rows = [*grid[::-1]]
    rows += [np.full(grid.shape[1], np.nan)] * (len(rows) % 2)
    return list(zip(rows[::2], rows[1::2], strict=True))


def _level(value: float, low: float, high: float, count: int) -> int:
    share = (value - low) / (high - low) if high > low else 0.0
    return min(int(share * count), count - 1)


def _in_blocks(grid: np.ndarray, low: float, high: float) -> list[Text]:
    """Two cells a character, one above the other, as colours."""

    def colour(value: float) -> str | None:
        return None if np.isnan(value) else _COLOURS[_level(value, low, high, len(_COLOURS))]

    def cell(upper: float, lower: float) -> tuple[str, Style]:
        above, below = colour(upper), colour(lower)
        if above is None:
            return (" ", Style()) if below is None else ("▄", Style(color=below))
        return "▀", Style(color=above, bgcolor=below)

    return [
        Text.assemble(*(cell(*each) for each in zip(upper, lower, strict=True)))
        for upper, lower in _pairs(grid)
    ]


def _in_characters(grid: np.ndarray, low: float, high: float) -> list[Text]:
    """Two cells a character, the larger of them as a level."""

    def cell(upper: float, lower: float) -> str:
        if np.isnan(upper) and np.isnan(lower):
            return " "
        return _LEVELS[_level(float(np.nanmax([upper, lower])), low, high, len(_LEVELS))]

    return [
        Text("".join(cell(*each) for each in zip(upper, lower, strict=True)))
        for upper, lower in _pairs(grid)
    ]


def _errors(screen: Screen, table: Columns, _: str | None) -> None:
    """Histograms of position errors, held out where they are, one per comparison."""
    size = np.sqrt(sum(table[f"e{axis}_mm"] ** 2 for axis in "xyz"))
    held_out = table["estimate"] == "cross_validated"
    kept = held_out if held_out.any() else ~held_out
    names = list(dict.fromkeys(table["comparison"][kept]))
    measured = [name for name in names if name.endswith(f"_vs_{MEASURED}")] or names
    measured.sort(key=lambda name: not name.startswith(NOMINAL))
    largest = max(size[kept & (table["comparison"] == name)].max() for name in measured)
    where = "at held-out poses" if held_out.any() else "at poses the models were fitted to"
    screen.words(f"number of readings by position error in mm, {where}")
    bins = min(screen.width, _WIDEST) - _MARGIN
    edges = np.linspace(0.0, float(largest) * (1 + 1e-9) or 1.0, bins + 1)
    for place, name in enumerate(measured):
        mine = size[kept & (table["comparison"] == name)]
        model, _, of = name.partition("_vs_")
        screen.words(f"{model_name(model)} against {model_name(of)}", "bold")
        screen.words(
            f"{mine.size:,} readings, mean {mine.mean():.3f}, 99 % below "
            f"{np.quantile(mine, 0.99):.3f}, largest {mine.max():.3f}"
        )
        screen.picture(_bars(screen, np.histogram(mine, edges)[0], place))
        screen.picture(_axis(bins, float(edges[-1])))


def _bars(screen: Screen, counts: np.ndarray, place: int) -> Text:
    """Counts (n,) as bars, a character each; what is not nothing is seen."""
    eighths = np.ceil(counts / max(counts.max(), 1) * _LOW * 8).astype(int)
    style = Style(color=_ink(place)) if screen.has_colours else Style()
    lines = []
    for row in reversed(range(_LOW)):
        filled = np.clip(eighths - 8 * row, 0, 8)
        marks = _EIGHTHS if screen.has_unicode else "    #####" if row else " ########"
        said = f"{counts.max()}" if row == _LOW - 1 else "0" if row == 0 else ""
        bar = "".join(marks[each] for each in filled)
        lines.append(Text.assemble(said.rjust(_MARGIN - 2), " |", (bar, style)))
    return Text("\n").join(lines)


def _axis(width: int, high: float) -> Text:
    """Round numbers from 0 to ``high`` below ``width`` characters."""
    line = " " * (width + _MARGIN)
    ticks, said = _ticks(0.0, high, _TICKS)
    for tick, words in zip(ticks, said, strict=True):
        start = _MARGIN + int(tick / high * width)
        if start + len(words) <= len(line):
            line = line[:start] + words + line[start + len(words) :]
    return Text(line)


def _study(screen: Screen, table: Columns, _: str | None) -> None:
    """Mean assessed accuracy of every assessor against noise, and the true accuracy."""
    lines = []
    for name in dict.fromkeys(table["assessor"]):
        mine = table["assessor"] == name
        lines.append(_Line(str(name), table["noise_mm"][mine], table["mean_mm"][mine]))
    true = table["mean_mm"] - table["bias_mm"]
    noise = np.unique(table["noise_mm"])
    truth = np.array([true[table["noise_mm"] == each].mean() for each in noise])
    lines.append(_Line("true accuracy", noise, truth))
    screen.words("mean assessed accuracy in mm against noise, standard deviation per axis in mm")
    _curves(screen, lines)


def _orders(screen: Screen, table: Columns, _: str | None) -> None:
    """Held-out error against the order of the VEC model; the chosen order."""
    kept = np.isfinite(table["held_out_rms_mm"])
    if kept.sum() < 2:
        orders = ", ".join(f"{each:g}" for each in np.unique(table["order"]))
        screen.words(f"order {orders} was given, and no other was tried: there is no curve")
        return
    all_rows = np.isnan(table["fold"])
    kept &= all_rows if (kept & all_rows).any() else True
    best = kept & (table["chosen"] == 1)
    lines = [
        _Line(name, table["order"][mine], table["held_out_rms_mm"][mine])
        for name, mine in (("orders tried", kept), ("chosen", best))
    ]
    screen.words("position rms in mm at rows left out of the fit, against the order")
    _curves(screen, lines)


def _bounds(screen: Screen, table: Columns, _: str | None) -> None:
    """Bounds on the largest error as readings came in, of every target."""
    lines = []
    for target in dict.fromkeys(table["target"]):
        mine = (table["target"] == target) & (table["share"] == table["share"].max())
        for column, words in (("upper_mm", "upper bound"), ("lower_mm", "lower bound")):
            known = mine & np.isfinite(table[column])
            if known.any():
                label = f"{words}, {target}"
                lines.append(_Line(label, table["readings"][known], table[column][known]))
    if not lines:
        screen.words("no bound could be stated so far")
        return
    screen.words("bounds on the largest error in mm, against the number of readings")
    _curves(screen, lines)


def _curves(screen: Screen, lines: Sequence[_Line]) -> None:
    """Lines in one picture, told apart by colour, or by their characters where there is none."""
    figure = _figure(screen, _HEIGHT)
    by_marks = not (screen.has_colours and screen.has_unicode)
    legend = []
    for place, line in enumerate(lines):
        mark = _MARKS[place % len(_MARKS)] if by_marks else "●" if len(line.x) == 1 else "hd"
        signal = figure.signal(
            line.x.tolist(), line.y.tolist(), marker=_marker(screen, place, mark)
        )
        figure.draw(signal.lines(len(line.x) > 1))
        sign = 2 * mark if by_marks else "●" if len(line.x) == 1 else "━━"
        colour = "" if by_marks else Style(color=_ink(place))
        legend.append(Text.assemble((sign, colour), f" {line.label}"))
    every = [np.concatenate([getattr(each, axis) for each in lines]) for axis in "xy"]
    for axis, values in zip("xy", every, strict=True):
        _rule(figure, axis, float(values.min()), float(values.max()))
    _add(screen, figure)
    screen.parts.append(Text("   ").join(legend))


def _ink(place: int) -> str:
    return _INKS[place % len(_INKS)]


def _marker(screen: Screen, place: int, symbol: str):
    import plotext

    if not screen.has_colours:
        return plotext.marker(symbol)
    return plotext.marker(symbol, tuple(Color.parse(_ink(place)).triplet))


def _rule(figure, axis: str, low: float, high: float) -> None:
    """Let an axis go from ``low`` to ``high``, with ticks at round numbers."""
    if high <= low:
        low, high = low - 0.5, high + 0.5
    ticks, said = _ticks(low, high, _TICKS)
    figure.ruler(axis).lim(low, high).ticks(ticks.tolist(), said)


def _ticks(low: float, high: float, most: int) -> tuple[np.ndarray, list[str]]:
    """Round numbers from ``low`` to ``high``, and how they are written."""
    rough = (high - low) / most
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(each for each in (1, 2, 5, 10) if each * power >= rough * (1 - 1e-9))
    ticks = step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1)
    decimals = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    return ticks, [f"{each + 0.0:.{decimals}f}" for each in ticks]


def _figure(screen: Screen, height: int):
    """An empty figure as wide as the terminal, without the colours of a theme."""
    import plotext

    plotext.terminal.limit(False, False)
    figure = plotext.figure
    figure.clear()
    figure.plot_size(min(screen.width, _WIDEST), height)
    figure.theme("colorless")
    return figure


def _add(screen: Screen, figure) -> None:
    plain = not screen.has_colours
    text = figure.build().string(colorless=plain)
    screen.picture(Text(text.rstrip("\n")) if plain else Text.from_ansi(text.rstrip("\n")))


PICTURES: dict[str, Callable[[Screen, Columns, str | None], None]] = {
    "accuracy_map": _map,
    "pose_errors": _errors,
    "study_summary": _study,
    "vec_orders": _orders,
    "campaign_bounds": _bounds,
}
