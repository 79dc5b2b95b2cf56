"""What a reader finds in a section: its page is made and its HTML parsed once."""

from __future__ import annotations

from typing import NamedTuple

import lxml.html

from kinacc.report.page import Page, html


class Shown(NamedTuple):
    """A table of a page: cells as text, ``marked`` remarks by row."""

    caption: str
    rows: tuple[tuple[str, ...], ...]
    marked: dict[int, str]
    folded: bool


class Read(NamedTuple):
    """The whole text, the tables, and the captions of pictures of a section."""

    text: str
    tables: list[Shown]
    captions: list[str]


def as_page(*sections) -> str:
    """Sections as a page whose first screen is empty."""
    return html(Page("made up", "", ("", False), [], "", [], [], {}, sections), {})


def read(section) -> Read:
    """The section as it stands on a page."""
    tree = lxml.html.document_fromstring(as_page(section).encode())
    (found,) = tree.xpath(f'//section[@id="{section.key}"]')
    captions = [each.text_content() for each in found.xpath(".//figcaption")]
    return Read(found.text_content(), [_table(each) for each in found.xpath(".//table")], captions)


def _table(table) -> Shown:
    rows = table.xpath("./tbody/tr")
    remarks = [row.xpath("string(./td[@class='remark'])") for row in rows]
    cells = [row.xpath("./*[not(contains(@class, 'remark'))]") for row in rows]
    return Shown(
        table.xpath("string(./caption)"),
        tuple(tuple(cell.text_content() for cell in row) for row in cells),
        {number: remark for number, remark in enumerate(remarks) if remark},
        table.getparent().getparent().tag == "details",
    )


def table(section, caption: str) -> Shown:
    """The one table of a section whose caption begins so."""
    (found,) = (each for each in read(section).tables if each.caption.startswith(caption))
    return found
