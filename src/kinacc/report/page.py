"""A page as records, and its HTML: everything it needs stands in the one file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bokeh
import pandas as pd
from bokeh.core.types import ID
from bokeh.embed import json_item
from bokeh.models import LayoutDOM
from matplotlib.figure import Figure

from kinacc import __version__
from kinacc.figures.save import render
from kinacc.report.rendering import environment, text_of


@dataclass(frozen=True)
class Part:
    """A section: the template of its ``key``, the values it shows, figures and charts by name.

    The template sets title, population, shows, judged and to_do, and prints tables and pictures.
    DataFrames among the ``values`` become lists of rows. ``figures`` are drawn by matplotlib,
    ``charts`` by Bokeh in the reader's browser.
    """

    key: str
    values: Mapping[str, object]
    figures: Mapping[str, Figure] = field(default_factory=dict)
    charts: Mapping[str, LayoutDOM] = field(default_factory=dict)

    def rows(self) -> dict[str, object]:
        """The values, with lists of rows for tables."""
        return {
            name: value.to_dict("records") if isinstance(value, pd.DataFrame) else value
            for name, value in self.values.items()
        }


@dataclass(frozen=True)
class Page:
    """A whole page: the answer in sentences, a table and notes by topic, then the evidence.

    ``badge`` is a remark beside the title and whether it is a warning. ``rows`` are dicts, the text
    under ``remark`` stands behind its row; ``columns`` are [head, key] of texts or
    [head, key, format] of numbers. A note that begins with ``kinacc `` is shown as a command.
    """

    title: str
    subtitle: str
    badge: tuple[str, bool]
    answers: Sequence[str]
    caption: str
    rows: Sequence[Mapping[Any, object]]
    columns: Sequence[Sequence[str]]
    notes: Mapping[str, Sequence[str]]
    sections: Sequence[Part]


def html(page: Page, marks: Mapping[str, object]) -> str:
    """The page as one file.

    Parameters
    ----------
    page
        Answer and sections.
    marks
        Provenance by name.

    Returns
    -------
    str
        HTML with all styles, pictures and scripts in it.
    """
    charts = {
        f"chart-{part.key}-{name}": chart
        for part in page.sections
        for name, chart in part.charts.items()
    }
    scripts, library = Path(bokeh.__file__).parent / "server/static/js", ""
    if charts:
        names = ("bokeh.min.js", "bokeh-widgets.min.js")
        library = "\n".join((scripts / name).read_text("utf-8") for name in names)
    templates = environment()
    sections = []
    for part in page.sections:
        drawn = {
            name: f"data:image/svg+xml;base64,{b64encode(render(figure, ('svg',))['svg']).decode()}"
            for name, figure in part.figures.items()
        }
        drawn |= {name: f"chart-{part.key}-{name}" for name in part.charts}
        template = templates.get_template(f"{part.key}.html")
        body = template.make_module({**part.rows(), "pictures": drawn})
        sections.append({"key": part.key, "body": body})
    return templates.get_template("page.html").render(
        page=page,
        sections=sections,
        marks={"kinacc_version": __version__, **marks},
        style=text_of("page.css"),
        script=text_of("page.js"),
        library=library,
        charts={name: json_item(chart, ID(name)) for name, chart in charts.items()},
    )
