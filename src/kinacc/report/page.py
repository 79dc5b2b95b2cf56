"""A page as records, and its HTML: everything it needs stands in the one file."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from kinacc import __version__
from kinacc.report.terminal import counted
from kinacc.tables.columns import Columns

if TYPE_CHECKING:
    from bokeh.models import Plot

TEMPLATES = "templates"
_WORDS = ("title", "population", "shows", "judged", "to_do")  # what the template of a Part sets
_MADE_BY = {"kinacc_version": __version__}
ROBOT_ITSELF = (
    "the robot itself improves only once the calibration is loaded into its controller, or its "
    "programs are compensated"
)


@dataclass(frozen=True)
class Table:
    """Rows of cells under heads, all of them text; numbers stand at the right.

    ``numeric`` says which columns hold numbers, ``marked`` which row is the one meant, in words
    behind it; ``folded`` tables are opened by the reader. ``picks`` are rows of the data of the
    picture ``picked_in``, one for each row of the table: a button there selects it. ``choices``
    are made first, for each row pairs: label of a control of that picture, label of its option.
    """

    caption: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: frozenset[int] = frozenset()
    marked: Mapping[int, str] = field(default_factory=dict)
    folded: bool = False
    picked_in: str = ""
    picks: tuple[int, ...] = ()
    choices: tuple[tuple[tuple[str, str], ...], ...] = ()


@dataclass(frozen=True)
class Text:
    """A paragraph; ``code`` is what a reader copies into a terminal."""

    words: str
    code: bool = False


@dataclass(frozen=True)
class Option:
    """One choice of a control: the properties it sets, as (name of a model, property, value)."""

    label: str
    sets: tuple[tuple[str, str, object], ...]


@dataclass(frozen=True)
class Control:
    """A choice above a picture; the first option is what the picture shows at first."""

    label: str
    options: tuple[Option, ...]


@dataclass(frozen=True)
class Picture:
    """A picture to explore.

    ``key`` is its name on the page and that of its data, ``described`` is read to who cannot see
    it. ``details`` maps a column of its data to what is said of a point that is selected, unless
    there is no value; ``names`` says by column what its numbers stand for, counted from 0.
    """

    key: str
    plot: Plot
    described: str = ""
    caption: str = ""
    controls: tuple[Control, ...] = ()
    details: Mapping[str, str] = field(default_factory=dict)
    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    invitation: str = "Select a point to see what it is."


Block = Table | Text | Picture


@dataclass(frozen=True)
class Section:
    """One subject: what it shows, what good and bad look like, what to do, and then the evidence.

    ``population``: whom the figures are about, told under the title.
    """

    key: str
    title: str
    population: str
    shows: str
    judged: str
    to_do: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Part:
    """A section whose words stand in the template of its ``key``, over values and pictures.

    The template sets title, population, shows, judged and to_do, and prints tables and pictures.
    """

    key: str
    values: Mapping[str, object]
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class FirstScreen:
    """What a reader sees without moving: the answer in words, a table, and what follows.

    ``badge`` is a remark at the right of the title and whether it is a warning; ``answers`` are
    sentences, the first the most important, unless the template of ``answer`` has them; ``notes``
    are lines under a name in capitals.
    """

    title: str
    subtitle: str
    badge: tuple[str, bool]
    answers: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    notes: tuple[tuple[str, tuple[Text, ...]], ...] = ()
    answer: Part | None = None


@dataclass(frozen=True)
class Page:
    """A whole page: the answer, then the evidence; ``marks`` say what it is about."""

    first: FirstScreen
    sections: tuple[Section | Part, ...]
    marks: Mapping[str, str] = field(default_factory=dict)


def html(
    page: Page, marks: Mapping[str, object] | None = None, read: Mapping[str, str] | None = None
) -> str:
    """The page as one file: the same bytes for the same page.

    ``marks`` are its provenance and ``read`` the digests of the files that were read for it, by
    what they are; both stand at its end, as far as they are known.
    """
    from kinacc.report.pictures import documents, library

    pictures = list(_pictures(page.sections))
    data, drawn = documents([each.plot for each in pictures])
    places = {
        each.key: {
            "document": document,
            "root": root,
            "details": dict(each.details),
            "names": dict(each.names),
        }
        for each, (document, root) in zip(pictures, drawn, strict=True)
    }
    environment = _environment()
    return environment.get_template("page.html").render(
        page=page,
        answer=page.first.answer and _made(page.first.answer),
        sections=[_laid_out(each) for each in page.sections],
        marks={k: str(v) for k, v in {**_MADE_BY, **page.marks, **(marks or {})}.items()},
        read=read or {},
        style=_text("page.css"),
        script=_text("page.js"),
        library=library() if pictures else "",
        pictures=_embedded({"documents": data, "places": places}),
    )


def records(table: Columns, rows: Sequence[int] | np.ndarray | None = None) -> list[dict]:
    """Rows of a table, all of them or those numbered, each as a dict by column."""
    order = range(max(map(len, table.values()), default=0)) if rows is None else rows
    return [{name: column[row] for name, column in table.items()} for row in order]


def cell(value: object, form: str = "") -> str:
    """A value as a table shows it: a number in the format given, a dash where there is none."""
    if (
        value is None
        or value == ""
        or (isinstance(value, (float, np.floating)) and np.isnan(value))
    ):
        return "–"
    return value if isinstance(value, str) else format(value, form)


def _laid_out(section: Section | Part) -> object:
    """What the page's template reads of a section: words by name, and its body."""
    if isinstance(section, Section):
        return section
    body = _made(section)
    words = {name: getattr(body, name) for name in _WORDS}
    return {**words, "key": section.key, "body": body}


def _made(part: Part):
    """The template of a part with its values."""
    pictures = {each.key: each for each in part.pictures}
    template = _environment().get_template(f"{part.key}.html")
    return template.make_module({**part.values, "pictures": pictures, "robot_itself": ROBOT_ITSELF})


def printed(words: str) -> str:
    """Words for a terminal as a page has them: with signs, and columns as parts of a sentence."""
    signs = {"+-": "±", "mm^2": "mm²"}
    words = re.sub("\u00a0{2,}", "; ", words)
    for plain, sign in signs.items():
        words = words.replace(plain, sign)
    return words.replace("\u00a0", " ")


def _pictures(sections: Sequence[Section | Part]) -> Iterator[Picture]:
    for each in sections:
        blocks = each.pictures if isinstance(each, Part) else each.blocks
        yield from (block for block in blocks if isinstance(block, Picture))


def _embedded(value: object) -> str:
    """JSON that can stand inside a script element, whatever texts it holds."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _text(name: str) -> str:
    return (files("kinacc.report") / TEMPLATES / name).read_text("utf-8")


@cache
def _environment():
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        loader=FunctionLoader(_text),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"cell": cell, "counted": counted, "printed": printed}
    environment.globals |= {"kind": lambda block: type(block).__name__, "plain": json.dumps}
    return environment
