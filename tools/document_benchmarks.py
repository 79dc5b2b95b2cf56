"""Write docs/benchmarks.md and its pictures: ``python tools/document_benchmarks.py``.

``make bench`` measures first, into benchmarks/results. What a section says is the docstring of
the topic's file in benchmarks/works; its ``NOTES``, by the name of a work, say what was tried
where a wish was not met.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from kinacc.figures import save, style

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
RESULTS = ROOT / "benchmarks" / "results"
WORKS = ROOT / "benchmarks" / "works"
TITLES = {
    "kinematics": "Kinematics",
    "fits": "Fits",
    "orders": "Orders, folds and residuals",
    "stages": "Stages of the study",
    "commands": "Start of commands",
    "workflow": "The workflow",
    "memory": "Memory",
    "growth": "Growth",
}
PAGE = """\
# Benchmarks

What kinacc takes beside what one would have used otherwise, and beside an earlier kinacc,
commit {today}; what was wanted, what was measured, and what no program can go below.
`make bench` measures all of it anew, with the other libraries in an environment of their own;
what models reach on measured arms is [another page](../benchmarks/README.md).

{machine}

{summary}

{sections}
## How it is measured

- Contenders take turns, a sample each in every round. A ratio is the median of the rounds' own
  ratios, with quartiles in brackets; times are medians. `benchmarks/results/` has all of it, by
  topic.
- Before anything is timed all outputs are compared, to the tolerance the file of the topic
  states. That run, and some until a sample lasts 20 ms, are the warm-up: nothing is compiled
  later. A ratio is not that of the medians shown where the machine had other work in between.
- Times are CPU time of the process and of those it has waited for; where threads are the
  question, wall-clock time. BLAS has one thread, Python's garbage collector is off.
- The other commit runs in a process of its own, like the kinacc beside it, from its own sources.

Written by `python tools/document_benchmarks.py` from `benchmarks/results/`; do not edit.
"""


def read(folder: Path = RESULTS) -> dict[str, list[dict]]:
    """Rows of every topic that has been measured, in the order of the page."""
    found = {path.stem: pq.read_table(path).to_pylist() for path in folder.glob("*.parquet")}
    known = {topic: found.pop(topic) for topic in TITLES if topic in found}
    return known | dict(sorted(found.items()))


def text(tables: Mapping[str, Sequence[Mapping]]) -> str:
    """The page."""
    today = {
        row["version"]
        for rows in tables.values()
        for row in rows
        if row.get("contender") == "today"
    }
    return PAGE.format(
        today=" and ".join(sorted(today)) or "of an earlier day",
        machine=_machine(tables),
        summary=_summary(tables),
        sections="\n".join(_section(topic, rows) for topic, rows in tables.items()),
    )


def _machine(tables: Mapping[str, Sequence[Mapping]]) -> str:
    """One sentence for each machine, commit and day there was."""
    names = ("cpu", "cores", "write_gb_per_s", "python", "numpy", "commit", "measured_on")
    seen: dict[tuple, list[str]] = {}
    for topic, rows in tables.items():
        *facts, written = (rows[0][name] for name in names if name != "write_gb_per_s"), topic
        seen.setdefault(tuple(facts[0]), []).append(written)
    said = []
    for (cpu, cores, python, numpy, commit, day), topics in seen.items():
        write = np.median([tables[topic][0]["write_gb_per_s"] for topic in topics])
        which = "" if len(seen) == 1 else f"{', '.join(topics)}: "
        said.append(
            f"{which}{cpu}, {cores} cores, one thread writes {write:.1f} GB/s; Python {python},"
            f" numpy {numpy}; kinacc at {commit or 'no commit'}, {day}."
        )
    return "\n".join(said)


def _summary(tables: Mapping[str, Sequence[Mapping]]) -> str:
    """How many targets were met, and which were not, each once."""
    asked = {
        (topic, _what(row)): row["met"]
        for topic, rows in tables.items()
        for row in rows
        if row.get("met") is not None
    }
    missed = [
        f"{what} ({TITLES.get(topic, topic)})" for (topic, what), met in asked.items() if not met
    ]
    counts = f"Of {len(asked)} targets {len(asked) - len(missed)} are met."
    return counts if not missed else f"{counts} Not met: {'; '.join(missed)}."


def _what(row: Mapping) -> str:
    if "stage" in row:
        return f"memory of {row['stage']}"
    if "against" in row:
        return f"{row['work']} against {row['against']}"
    return f"{row['work']} beside {_who(row)}"


def _who(row: Mapping) -> str:
    """A contender with its version; an earlier kinacc by its commit."""
    if row["contender"] == "today":
        return f"commit {row['version']}".strip()
    return row["contender"]


def _section(topic: str, rows: Sequence[Mapping]) -> str:
    title = TITLES.get(topic, topic.capitalize())
    told, notes = _told(topic)
    lines = [f"## {title}", "", told, "", table(rows), ""]
    lines += [f"![{title}: what was measured and what was wanted](benchmarks/{topic}.png)", ""]
    said = [*_limits(rows), *(f"- {work}: {words}" for work, words in notes.items())]
    return "\n".join([*lines, *said, ""] if said else lines)


def _limits(rows: Sequence[Mapping]) -> list[str]:
    """What no program can go below, works with the same limit together."""
    works: dict[str, list[str]] = {}
    for row in rows:
        if row.get("limit"):
            works.setdefault(row["limit"], []).append(row["work"])
    return [f"- Limit of {', '.join(dict.fromkeys(of))}: {limit}." for limit, of in works.items()]


def _told(topic: str) -> tuple[str, dict[str, str]]:
    """The docstring of a topic's file and its notes, without running it."""
    path = WORKS / f"{topic}.py"
    if not path.exists():
        return "", {}
    tree = ast.parse(path.read_text(encoding="utf-8"))
    notes = [
        ast.literal_eval(each.value)
        for each in tree.body
        if isinstance(each, ast.Assign)
        and [ast.unparse(name) for name in each.targets] == ["NOTES"]
    ]
    return (ast.get_docstring(tree) or "").replace("``", "`"), notes[0] if notes else {}


def table(rows: Sequence[Mapping]) -> str:
    """The rows of a topic as a table of the page."""
    if "stage" in rows[0]:
        head = ["stage", "peak, MB", "at most"]
        body = [
            [r["stage"], f"{r['peak_mb']:.0f}", _wish(f"{r['wanted_mb']:.0f}", r["met"])]
            for r in rows
        ]
    elif "against" in rows[0]:
        head = [
            "work",
            "against",
            "sizes",
            "CPU time",
            "exponent",
            "at most",
            "peak, MB",
            "MB a thousand",
        ]
        body = [_grown(of) for of in _problems(rows).values()]
    else:
        head = ["work", "beside", "its time", "kinacc's", "kinacc is", "wanted"]
        own = _own(rows)
        body = [_cells(row, own[row["work"]]) for row in rows if row is not own[row["work"]]]
    cells = [head, ["---"] * len(head), *body]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def _problems(rows: Sequence[Mapping]) -> dict[str, list[Mapping]]:
    """The rows of growth, problem by problem."""
    found: dict[str, list[Mapping]] = {}
    for row in rows:
        found.setdefault(_what(row), []).append(row)
    return found


def _grown(rows: Sequence[Mapping]) -> list[str]:
    """One problem from its smallest to its largest size."""
    first, last = rows[0], rows[-1]
    return [
        first["work"],
        first["against"],
        f"{first['size']:,.0f} to {last['size']:,.0f}",
        f"{duration(1e9 * first['cpu_s'])} to {duration(1e9 * last['cpu_s'])}",
        f"{last['exponent']:.2f}",
        "" if last["wanted"] is None else _wish(f"{last['wanted']:.2f}", last["met"]),
        f"{first['peak_mb']:.0f} to {last['peak_mb']:.0f}",
        f"{last['mb_a_thousand']:.3g}",
    ]


def _own(rows: Sequence[Mapping]) -> dict[str, Mapping]:
    """kinacc's row of each work, its first."""
    found: dict[str, Mapping] = {}
    for row in rows:
        found.setdefault(row["work"], row)
    return found


def _cells(row: Mapping, own: Mapping) -> list[str]:
    """One contender beside kinacc."""
    who = _who(row) if row["contender"] == "today" else f"{_who(row)} {row['version']}".strip()
    if row["left_out"]:
        wanted = "" if row["wanted"] is None else _factor(row["wanted"])
        return [row["work"], who, row["left_out"], duration(own["ns"]), "", wanted]
    spread = ""
    if row["ratio_low"] is not None:
        turned = [x if row["ratio"] >= 1 else 1 / x for x in (row["ratio_low"], row["ratio_high"])]
        spread = " ({} to {})".format(*map(_number, sorted(turned)))
    a_unit = f" a {row['unit']}"
    if row["contender"] == "limit":
        reached, wanted = (
            f"{100 * row['ratio']:.0f} % of it",
            row["wanted"] and f"{100 * row['wanted']:.0f} %",
        )
    else:
        reached, wanted = (
            f"{_factor(row['ratio'])}{spread}",
            row["wanted"] and _factor(row["wanted"]),
        )
    wish = _wish(wanted, row["met"]) if wanted else ""
    return [row["work"], who, duration(row["ns"]) + a_unit, duration(own["ns"]), reached, wish]


def _wish(wanted: str, met: bool) -> str:
    return wanted if met else f"**{wanted}: not met**"


def _factor(ratio: float) -> str:
    """How the time of another compares with kinacc's."""
    return f"{_number(_size(ratio))} x {'faster' if ratio >= 1 else 'slower'}"


def _number(value: float) -> str:
    """Three digits, and no powers of ten."""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def _size(ratio: float) -> float:
    return ratio if ratio >= 1 else 1 / ratio


def duration(ns: float) -> str:
    """A time with three digits, in the unit that reads best."""
    for size, unit in ((1e9, "s"), (1e6, "ms"), (1e3, "µs")):
        if ns >= size:
            return f"{ns / size:.3g} {unit}"
    return f"{ns:.3g} ns"


def picture(topic: str, rows: Sequence[Mapping]) -> Figure:
    """What was measured in a topic, and what was wanted."""
    with style.house():
        if "stage" in rows[0]:
            bars = [(row["stage"], row["peak_mb"], row["wanted_mb"], row["met"]) for row in rows]
            return _bars(bars, 0.0, "peak resident memory, MB; mark: at most")
        if "against" in rows[0]:
            return _growth(_problems(rows))
        own = _own(rows)
        bars = [
            (f"{row['work']}\nbeside {_who(row)}", row["ratio"], row["wanted"], row["met"])
            for row in rows
            if row is not own[row["work"]] and row["ratio"] is not None
        ]
        return _bars(bars, 1.0, "time over kinacc's (logarithmic); mark: wanted; orange: not met")


def _bars(
    rows: Sequence[tuple[str, float, float | None, bool | None]], start: float, words: str
) -> Figure:
    """Bars from ``start``, on a logarithmic scale where that is 1, with a mark at the wish."""
    figure = style.new_figure(style.DOUBLE_COLUMN_IN, 0.3 * len(rows) + 0.6)
    axes = figure.subplots()
    for place, (_, value, wanted, met) in enumerate(rows):
        colour = {None: style.MUTED, True: style.BLUE, False: style.VERMILION}[met]
        axes.barh(place, value - start, left=start, height=0.6, color=colour)
        if wanted is not None:
            axes.plot([wanted, wanted], [place - 0.4, place + 0.4], color=style.INK, lw=1.5)
    if start:
        axes.set_xscale("log")
        _plain_ticks(axes.xaxis)
        axes.axvline(start, color=style.INK, lw=0.6)
    axes.set_yticks(range(len(rows)), [each[0] for each in rows])
    axes.set(ylim=(len(rows) - 0.4, -0.6), xlabel=words)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)
    return figure


def _growth(problems: Mapping[str, Sequence[Mapping]]) -> Figure:
    """Time and memory of every problem by its size, relative to the smallest."""
    figure = style.new_figure(style.DOUBLE_COLUMN_IN, 3.6)
    both = figure.subplots(1, 2, sharex=True)
    colours = [style.BLUE, style.VERMILION, style.GREEN, style.ORANGE, style.PURPLE, style.SKY]
    colours += [style.INK, style.MUTED, "#A6761D", "#CC79A7"]
    for number, (name, rows) in enumerate(problems.items()):
        size = np.array([row["size"] for row in rows]) / rows[0]["size"]
        look = {"color": colours[number % len(colours)], "marker": "osDv^P"[number % 6], "ms": 3.5}
        both[0].plot(size, [row["cpu_s"] / rows[0]["cpu_s"] for row in rows], label=name, **look)
        both[1].plot(size, [row["peak_mb"] for row in rows], **look)
    largest = max(rows[-1]["size"] / rows[0]["size"] for rows in problems.values())
    both[0].plot([1.0, largest], [1.0, largest], "--", color=style.INK, lw=0.8, label="linear")
    both[0].set(xscale="log", yscale="log", ylabel="CPU time over that of the smallest")
    both[1].set(yscale="log", ylabel="peak resident memory, MB")
    for axes in both:
        axes.set_xlabel("size over the smallest")
        _plain_ticks(axes.xaxis)
        _plain_ticks(axes.yaxis)
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def _plain_ticks(axis: Axis) -> None:
    """Numbers, not powers, at the places of a logarithmic axis."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda number, _: f"{number:g}"))
    axis.set_minor_locator(NullLocator())


def main() -> None:
    """Write page and pictures."""
    tables = read()
    (DOCS / "benchmarks").mkdir(exist_ok=True)
    (DOCS / "benchmarks.md").write_text(text(tables), encoding="utf-8")
    for topic, rows in tables.items():
        save.write(picture(topic, rows), {"png": DOCS / "benchmarks" / f"{topic}.png"})


if __name__ == "__main__":
    main()
