"""What a reader finds in a section: its page is made and its HTML parsed once."""

from __future__ import annotations

import json
from dataclasses import dataclass, field

import lxml.html

from kinacc.report.page import FirstScreen, Page, html


@dataclass(frozen=True)
class Shown:
    """A table of a page: cells as text, ``marked`` remarks, ``picks`` and ``choices`` by row."""

    caption: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    marked: dict[int, str] = field(default_factory=dict)
    folded: bool = False
    picked_in: str = ""
    picks: tuple[int, ...] = ()
    choices: tuple = ()


@dataclass(frozen=True)
class Read:
    """Words by their place, tables and paragraphs of a section."""

    title: str
    population: str
    shows: str
    judged: str
    to_do: str
    tables: tuple[Shown, ...]
    paragraphs: tuple[str, ...]
    described: dict[str, str]
    captions: dict[str, str]


def as_page(*sections) -> str:
    """Sections as a page whose first screen is empty."""
    return html(Page(FirstScreen("made up", "", ("", False), (), (), ()), sections))


def read(section) -> Read:
    """The section as it stands on a page."""
    tree = lxml.html.document_fromstring(as_page(section).encode())
    (own,) = tree.xpath(f'//section[@id="{section.key}"]')
    words = [each.text_content() for each in own.xpath('./dl[@class="reading"]/dd')]
    plots = {
        each.get("id").removeprefix("plot-"): each for each in own.xpath('.//div[@class="plot"]')
    }
    return Read(
        own.xpath("./h2")[0].text_content(),
        "".join(own.xpath('./p[@class="population"]/text()')),
        *words,
        tuple(map(_table, own.xpath(".//table"))),
        tuple(each.text_content() for each in own.xpath("./p[not(@class)]")),
        {key: plot.get("aria-label") for key, plot in plots.items()},
        {key: "".join(plot.xpath("../figcaption/text()")) for key, plot in plots.items()},
    )


def _table(table) -> Shown:
    rows, marked, picks, choices = [], {}, [], []
    for number, row in enumerate(table.xpath("./tbody/tr")):
        rows.append(
            tuple(
                each.text_content()
                for each in row.xpath(
                    "./*[not(contains(@class, 'screen') or contains(@class, 'remark'))]"
                )
            )
        )
        remark = "".join(
            each.text_content() for each in row.xpath("./td[contains(@class, 'remark')]")
        )
        if remark:
            marked[number] = remark
        for button in row.xpath(".//button"):
            picks.append(int(button.get("data-pick")))
            if button.get("data-choices"):
                choices.append(tuple(map(tuple, json.loads(button.get("data-choices")))))
    heads = table.xpath("./thead/tr/th[not(contains(@class, 'screen')) and not(span)]")
    return Shown(
        table.xpath("./caption")[0].text_content(),
        tuple(each.text_content() for each in heads),
        tuple(rows),
        marked,
        table.getparent().getparent().tag == "details",
        next(iter(table.xpath(".//button/@data-picture")), ""),
        tuple(picks),
        tuple(choices),
    )
