"""What a reader finds in a section: its page is made and its HTML parsed once."""

from __future__ import annotations

from dataclasses import dataclass, field

import lxml.html

from kinacc.report.page import FirstScreen, Page, html


@dataclass(frozen=True)
class Shown:
    """A table of a page: cells as text, ``marked`` remarks by row."""

    caption: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    marked: dict[int, str] = field(default_factory=dict)
    folded: bool = False


@dataclass(frozen=True)
class Read:
    """Words by their place, tables, paragraphs and captions of pictures of a section."""

    title: str
    population: str
    shows: str
    judged: str
    to_do: str
    tables: tuple[Shown, ...]
    paragraphs: tuple[str, ...]
    captions: tuple[str, ...]


def as_page(*sections) -> str:
    """Sections as a page whose first screen is empty."""
    return html(Page(FirstScreen("made up", "", ("", False)), sections))


def read(section) -> Read:
    """The section as it stands on a page."""
    tree = lxml.html.document_fromstring(as_page(section).encode())
    (own,) = tree.xpath(f'//section[@id="{section.key}"]')
    words = [each.text_content() for each in own.xpath('./dl[@class="reading"]/dd')]
    return Read(
        own.xpath("./h2")[0].text_content(),
        "".join(own.xpath('./p[@class="population"]/text()')),
        *words,
        tuple(map(_table, own.xpath(".//table"))),
        tuple(each.text_content() for each in own.xpath("./p[not(@class)]")),
        tuple(each.text_content() for each in own.xpath(".//figcaption")),
    )


def _table(table) -> Shown:
    rows, marked = [], {}
    for number, row in enumerate(table.xpath("./tbody/tr")):
        cells = row.xpath("./*[not(contains(@class, 'remark'))]")
        rows.append(tuple(each.text_content() for each in cells))
        remark = "".join(each.text_content() for each in row.xpath("./td[@class='remark']"))
        if remark:
            marked[number] = remark
    return Shown(
        table.xpath("./caption")[0].text_content(),
        tuple(each.text_content() for each in table.xpath("./thead/tr/th[not(span)]")),
        tuple(rows),
        marked,
        table.getparent().getparent().tag == "details",
    )


def table(section, caption: str) -> Shown:
    """The one table of a section whose caption begins so."""
    (found,) = (each for each in read(section).tables if each.caption.startswith(caption))
    return found


def words(section) -> str:
    """All paragraphs of a section."""
    return "\n".join(read(section).paragraphs)
