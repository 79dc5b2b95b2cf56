"""Jinja templates of pages and texts, how these write numbers, and a history in one sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from shlex import quote

import pandas as pd
from jinja2 import Environment, FunctionLoader, StrictUndefined

from kinacc.config.error_models import model_name
from kinacc.config.names import in_markdown
from kinacc.errors import as_seen


def cell(value: object, form: str = "") -> str:
    """A value as a table shows it: a number in the format ``form``, a dash where there is none."""
    if value is None or value == "" or value != value:
        return "–"
    return value if isinstance(value, str) else format(value, form)


def size(value: float) -> str:
    """A number with three significant digits, without an exponent: ``0.307``, ``4680``."""
    if not math.isfinite(value) or value == 0.0:
        return f"{value:.3g}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def counted(number: float, noun: str) -> str:
    """``1 pose``, ``2 poses``."""
    return f"{number:.0f} {noun}{'' if number == 1 else 's'}"


def few(texts: Iterable[str], most: int | None) -> list[str]:
    """The first ``most`` texts, all for None, and the number of the others."""
    texts = list(texts)
    more = len(texts) - len(texts[:most])
    return texts[:most] + ([f"and {more} more (--verbose)"] if more else [])


def text_of(name: str) -> str:
    """A file of the folder ``templates``."""
    return (files("kinacc.report") / "templates" / name).read_text("utf-8")


@cache
def environment(is_page: bool = True) -> Environment:
    """Templates of pages, which escape values, or of texts, which write each value in a line."""
    templates = Environment(
        loader=FunctionLoader(text_of),
        autoescape=is_page,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=None if is_page else _in_line,
    )
    # Charts refer to models defined before: sorted by name they would not.
    templates.policies["json.dumps_kwargs"] = {}
    filters = {"cell": cell, "counted": counted, "few": few, "size": size}
    templates.filters |= filters | {"md": in_markdown, "model": model_name, "quoted": quote}
    return templates


def _in_line(value: object) -> object:
    return as_seen(value.replace("\n", " ")) if isinstance(value, str) else value


def lines(template: str, **values: object) -> list[str]:
    """Lines of a text template that are not empty."""
    text = environment(is_page=False).get_template(template).render(values)
    return [line for line in text.splitlines() if line.strip()]


def history_sentence(history: pd.DataFrame) -> str:
    """What the last row of ``history.parquet`` states of the calibration in force.

    Parameters
    ----------
    history
        The table.

    Returns
    -------
    str
        The verdict with its evidence (mm), without a full stop.
    """
    line = history.iloc[-1]
    dates = dict(zip(history["series"], history["date"], strict=True))
    day = dates.get(line["in_force"], line["in_force"])
    return lines("history.txt", row=line, day=day)[0]
