"""Write docs/public-robots.md and its picture from docs/public-robots.csv.

``python tools/document_public_robots.py``; ``make public-robots`` makes the table anew first.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter
from public_robots import SETTINGS, TABLE, Row, commands, read

from kinacc.figures import save, style

DOCS = Path(__file__).parents[1] / "docs"
MODELS = ("nominal", "dh", "vec")
# Means of 20 poses in P. Jacobi's thesis (Tsinghua University, 2025), mm, as its abstract has them.
BEFORE_MM, AFTER_MM = 2.5664, 0.1549
SERIES = {
    "ur5_grid": "UR5",
    "ur10_b": "UR10, series B",
    "ur10_d": "UR10, series D",
}
_LOW_MM = 0.04  # where the picture's axis begins
COLOURS = {
    "nominal": (style.MUTED, "s", "nominal arm, best base and tool"),
    "dh": (style.BLUE, "o", "DH"),
    "vec": (style.VERMILION, "D", "VEC"),
}

Test = tuple[str, str, str]  # fitted, judged, where
PAGE = """\
# Public robots, calibrated blind

The measured arms in [examples/data](../examples/data/README.md), calibrated by the commands a
user would type, with every setting as `kinacc init` writes it, and judged at readings that no fit
has seen; beside them what the authors of the data published. `make public-robots` makes all of it
anew.

Position error in mm, mean / largest; the selected model in bold:

{table}

![Error of every model in each line of the table, from mean to largest](public-robots.png)

*Dot: mean; bar: from there to the largest; tick: 99 %. The scale is logarithmic.*

- **UR5.** At the authors' own {n} test poses the selected model is off by {best} mm on average
  (standard error {error}), {ratio} times the {after} mm that the thesis reports after DH
  calibration and a graph neural network; DH alone leaves {test_dh}. But these are
  [not the same quantity](#are-the-authors-figures-the-same-quantity).
- **UR10, among the poses that were measured.** VEC leaves {share_b} (B) and {share_d} (D) of the
  mean error that DH leaves.
- **UR10, elsewhere.** That gain does not travel. The VEC model of B says nothing at any pose of
  D: their joints lie outside its range. That of D speaks at {n_common} of the {n_b} poses of B,
  and is worse there than the nominal arm: {common_vec} against {common_nominal} mm (in D the
  flange always points one way, which leaves open how errors turn with it). DH travels: it
  leaves {to_d_dh} mm on D and {to_b_dh} on B, where DH models fitted there leave {d_dh} and
  {b_dh}. kinacc tells beforehand: by its
  [rule](using-a-calibration.md#where-a-calibration-was-measured) {like_d} of the {n_d} and
  {like_b} of the {n_b} poses lie where the other series was measured, and {like_test} of the {n}
  of the UR5.

## What stands in a line

**Instruments.** UR5 (CB3): GTS3800 laser tracker, one reflector, positions. UR10: Leica laser
tracker with T-Mac, full poses; the table is about their positions.

**Models.** Nominal is the arm as its maker describes it, with the best base and tool: the table
shows what a calibration adds to a good set-up, and not to a bad one. DH and VEC are fitted by
every run, and one is selected by held-out poses of the fitted series. All models of a line are
judged at the same readings.

**Base and tool.** UR5: those of the fit to the grid, for each model its own; nothing is fitted to
the {n} poses. UR10, within a series: those of fits without the share that is judged. UR10, from
one series to the other: the tracker stood elsewhere, and D had another tool. So base and tool, 12
numbers for each model, are fitted to the readings of the judged series, hundreds of them; the arm
is not touched. `kinacc verify` does that.

**Left out.** Within a series, fifths of the configurations dealt out at random. Neighbours of a
pose stay in the fit: such errors are about poses among those measured. For VEC on the UR5's grid
they are {grid_vec} / {grid_largest} mm ({grid_n} readings), much as at the test poses.

**Largest.** It is that of the readings there are: of {n} it says little, and none is a bound on
others ([campaigns](campaigns.md) make those). No row is left out; the three largest held-out
errors of VEC on B are at poses that `check-data` points at.

## What blind means

Nothing is told of an arm but which it is; for the UR5, which is not among the
[shipped robots](robots.md), by its maker's DH table (`examples/ur5.robot.yaml`). For each file
that is fitted, `init` writes the same settings:

```yaml
{settings}
```

It does not mean that nobody had seen the data. Defaults such as the highest order that is tried
were set with these sets at hand, the UR5's grid among them
([benchmarks](../benchmarks/README.md#the-order-of-the-vec-model)); the UR10's take that order,
{order_b}, the UR5 {order_grid}. Arms that judge the defaults fairly are those you measure.

## Are the authors' figures the same quantity?

No. By the data set's description the UR5 was measured again under each compensation. The thesis's
{after} mm hold the scatter of that run (the maker states a repeatability of 0.1 mm), and rest on
base and tool that were calibrated beforehand. The figures here are what models leave of the
readings of the first run, which is the one published, with base and tool fitted to the grid. An
arm that is corrected by these models shows its scatter on top.

Nor is "before" the same. The published differences of the {n} poses have a mean of 2.565 mm (the
thesis has {before}). With the best base and tool the nominal arm leaves {test_nominal}: most of
"before" is not the arm.

For the UR10 there is nothing to compare with: the files of Landgraf et al. (CASE 2021) come
without a split or errors, and the paper was not at hand.

**The sign of the UR5's differences** (`x_dif`) is not stated. The digits tell: in all 1,020 rows
`x_t + x_dif`, like y and z, has six decimals, as instruments write them, and `x_t - x_dif` has
not. So the measured point is target plus difference. To first order the other sign gives the
mirror image, with errors of the same size.

## What it does not say

- Two arms of one maker, one of each type. The UR5 moved in 7 to 21 % of its joints' ranges.
- From one series of the UR10 to the other the arm itself may have changed.
- Nothing of orientations: the UR5's were not measured; `kinacc summary` and `kinacc verify` give
  those of the UR10.
- Not here: series A and C of the UR10, which are large, and a FANUC R-2000iC, whose data state no
  licence; [benchmarks](../benchmarks/README.md) have both. Series D is read as its authors
  published it; `series_D.csv` holds the same readings.

## Again

`make public-robots` works in `public-robots/`: four minutes of one core, half a minute where all is
up to date. It writes [public-robots.csv](public-robots.csv), which has every error above with
99 % and rms, and from it this page. The commands, with the files of
[examples/data](../examples/data/README.md) under these names and, for the UR5, target plus
difference as `x_mm`, `y_mm`, `z_mm`:

<!-- not run: make public-robots types them, which takes minutes -->
```sh
{commands}
```

Written by `python tools/document_public_robots.py` from `docs/public-robots.csv`; do not edit.
"""


def tests(rows: Sequence[Row]) -> dict[Test, dict[str, Row]]:
    """The rows of every line of the page's table, by model."""
    found: dict[Test, dict[str, Row]] = {}
    own = [row for row in rows if row.fitted == row.judged]
    other = [row for row in rows if row.fitted != row.judged]
    first = [row for row in other if row.judged == "ur5_random"]
    for row in [*first, *own, *(row for row in other if row not in first)]:
        found.setdefault((row.fitted, row.judged, row.where), {})[row.model] = row
    return found


def text(rows: Sequence[Row]) -> str:
    """The page."""
    return PAGE.format_map(figures(rows))


def figures(rows: Sequence[Row]) -> dict[str, str]:
    """Every number and block that the page takes from the table, by the name it has there."""
    known = tests(rows)
    test, grid = known["ur5_grid", "ur5_random", "all"], known["ur5_grid", "ur5_grid", "all"]
    b, d = (known[each, each, "all"] for each in ("ur10_b", "ur10_d"))
    to_d, to_b = known["ur10_b", "ur10_d", "all"], known["ur10_d", "ur10_b", "all"]
    common = known["ur10_d", "ur10_b", "common"]
    best = next(row for row in test.values() if row.selected)
    error = math.sqrt(max(best.rms_mm**2 - best.mean_mm**2, 0.0) / (best.readings - 1))
    means = {
        "best": best,
        "test_dh": test["dh"],
        "test_nominal": test["nominal"],
        "grid_vec": grid["vec"],
        "b_dh": b["dh"],
        "d_dh": d["dh"],
        "to_d_dh": to_d["dh"],
        "to_b_dh": to_b["dh"],
        "common_vec": common["vec"],
        "common_nominal": common["nominal"],
    }
    return {
        **{name: f"{row.mean_mm:.3f}" for name, row in means.items()},
        "table": _table(known),
        "n": str(best.readings),
        "error": f"{error:.3f}",
        "ratio": f"{best.mean_mm / AFTER_MM:.2f}",
        "after": f"{AFTER_MM:.3f}",
        "before": f"{BEFORE_MM:.3f}",
        "share_b": f"{b['vec'].mean_mm / b['dh'].mean_mm:.2f}",
        "share_d": f"{d['vec'].mean_mm / d['dh'].mean_mm:.2f}",
        "n_common": str(common["vec"].readings),
        "n_b": f"{to_b['dh'].readings:,}",
        "n_d": f"{to_d['dh'].readings:,}",
        "like_b": str(to_b["dh"].like),
        "like_d": str(to_d["dh"].like),
        "like_test": str(best.like),
        "grid_largest": f"{grid['vec'].largest_mm:.3f}",
        "grid_n": f"{grid['vec'].readings:,}",
        "order_b": str(b["vec"].order),
        "order_grid": str(grid["vec"].order),
        "settings": yaml.safe_dump(SETTINGS, sort_keys=False).strip(),
        "commands": "\n".join(map(shlex.join, commands())),
    }


def _table(known: dict[Test, dict[str, Row]]) -> str:
    lines = [
        "| arm, fitted to | judged at | nominal | DH | VEC | the authors |",
        "|---|---|---|---|---|---|",
    ]
    for test, of in known.items():
        if test[:2] == ("ur5_grid", "ur5_grid"):
            continue
        published = "none at hand"
        if test[1] == "ur5_random":
            published = f"mean {BEFORE_MM:.3f} before, {AFTER_MM:.3f} after"
        covered = _covered(test, known)
        errors = [_cell(of[each]) if each in of else covered for each in MODELS]
        cells = [*_where(test, of, known), *errors, published]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _where(test: Test, of: dict[str, Row], known: dict[Test, dict[str, Row]]) -> tuple[str, str]:
    """What a model was fitted to, and the readings it is judged at, in words."""
    fitted, judged, where = test
    count = next(iter(of.values())).readings
    own = next(iter(known[fitted, fitted, "all"].values())).readings
    poses = f"{SERIES[fitted]}, {own:,} poses"
    if judged == "ur5_random":
        return f"{poses} of a grid", f"the authors' {count} random poses"
    if judged == fitted:
        return poses, "each fifth, left out in turn"
    series = SERIES[judged].partition(", ")[2]
    if where == "all":
        return poses, f"all {count:,} poses of {series}"
    return poses, f"{count:,} poses of {series}, those VEC covers"


def _covered(test: Test, known: dict[Test, dict[str, Row]]) -> str:
    """How many of the poses a VEC model covers that does not cover all."""
    common = known.get((*test[:2], "common"))
    return f"covers {common['vec'].readings if common else 'none'} of these"


def _cell(row: Row) -> str:
    errors = f"{row.mean_mm:.3f} / {row.largest_mm:.3f}"
    return f"**{errors}**" if row.selected else errors


def picture(rows: Sequence[Row]) -> Figure:
    """Mean to largest error of every model in every line of the table."""
    known = {test: of for test, of in tests(rows).items() if test[:2] != ("ur5_grid", "ur5_grid")}
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 0.62 * len(known) + 0.75)
        axes = figure.subplots()
        for place, (test, of) in enumerate(known.items()):
            for number, model in enumerate(MODELS):
                height = place + 0.22 * (number - 1)
                if model in of:
                    _bar(axes, height, of[model], place == 0)
                else:
                    covers = f"VEC {_covered(test, tests(rows))}"
                    _note(axes, _LOW_MM, height, covers, style.VERMILION)
        axes.plot([AFTER_MM, BEFORE_MM], [0.46, 0.46], "*", color=style.GREEN, ms=7)
        _note(axes, AFTER_MM, 0.46, "thesis, mean after", style.GREEN)
        _note(axes, BEFORE_MM, 0.46, "thesis, mean before", style.GREEN, "right")
        words = [_where(test, of, tests(rows)) for test, of in known.items()]
        axes.set_yticks(
            np.arange(len(known)), [f"fitted: {one}\njudged: {other}" for one, other in words]
        )
        axes.set(ylim=(len(known) - 0.55, -0.45), xscale="log", xlim=(_LOW_MM, 3.6))
        axes.set_xticks([0.05, 0.1, 0.2, 0.5, 1.0, 2.0])
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.xaxis.minorticks_off()
        axes.set_xlabel("position error at readings no fit has seen, mm (logarithmic)")
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", ncols=3)
    return figure


def _note(axes: Axes, x: float, y: float, words: str, colour: str, side: str = "left") -> None:
    """Words beside a point."""
    shift = 6 if side == "left" else -6
    axes.annotate(
        words, (x, y), (shift, 0), textcoords="offset points", ha=side, va="center",
        fontsize=style.SMALL_PT, color=style.darker(colour),
    )  # fmt: skip


def _bar(axes: Axes, place: float, row: Row, labelled: bool) -> None:
    colour, marker, words = COLOURS[row.model]
    label = words if labelled else None
    axes.plot([row.mean_mm, row.largest_mm], [place, place], color=colour, lw=1.6)
    axes.plot([row.quantile_99_mm], [place], "|", color=colour, ms=6)
    axes.plot([row.mean_mm], [place], marker, color=colour, ms=4.5, label=label)


def main() -> None:
    """Write page and picture."""
    rows = read(TABLE)
    (DOCS / "public-robots.md").write_text(text(rows), encoding="utf-8")
    save.write(picture(rows), {"png": DOCS / "public-robots.png"})


if __name__ == "__main__":
    main()
