"""A page as records, and its HTML: everything it needs stands in the one file."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

from kinacc import __version__

if TYPE_CHECKING:
    from bokeh.models import Plot

TEMPLATES = "templates"
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
    described: str
    caption: str = ""
    controls: tuple[Control, ...] = ()
    details: Mapping[str, str] = field(default_factory=dict)
    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    invitation: str = "Select a point to see what it is."


@dataclass(frozen=True)
class Image:
    """A picture as it was drawn before: SVG or PNG bytes."""

    described: str
    content: bytes
    kind: str
    caption: str = ""

    @property
    def source(self) -> str:
        """The bytes as an address of the page's own."""
        media = {"svg": "image/svg+xml", "png": "image/png"}[self.kind]
        return f"data:{media};base64,{base64.b64encode(self.content).decode()}"


Block = Table | Text | Picture | Image


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
class FirstScreen:
    """What a reader sees without moving: the answer in words, a table, and what follows.

    ``badge`` is a remark at the right of the title and whether it is a warning; ``answers`` are
    sentences, the first the most important; ``notes`` are lines under a name in capitals.
    """

    title: str
    subtitle: str
    badge: tuple[str, bool]
    answers: tuple[str, ...]
    tables: tuple[Table, ...]
    notes: tuple[tuple[str, tuple[Text, ...]], ...]


@dataclass(frozen=True)
class Page:
    """A whole page: the answer, then the evidence; ``marks`` say what it is about."""

    first: FirstScreen
    sections: tuple[Section, ...]
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
    return _template().render(
        page=page,
        marks={k: str(v) for k, v in {**_MADE_BY, **page.marks, **(marks or {})}.items()},
        read=read or {},
        style=_text("page.css"),
        script=_text("page.js"),
        library=library() if pictures else "",
        pictures=_embedded({"documents": data, "places": places}),
        kind=lambda block: type(block).__name__,
        plain=json.dumps,
    )


def printed(words: str) -> str:
    """Words for a terminal as a page has them: with signs, and columns as parts of a sentence."""
    signs = {"+-": "±", "mm^2": "mm²"}
    words = re.sub("\u00a0{2,}", "; ", words)
    for plain, sign in signs.items():
        words = words.replace(plain, sign)
    return words.replace("\u00a0", " ")


def _pictures(sections: Sequence[Section]) -> Iterator[Picture]:
    return (block for each in sections for block in each.blocks if isinstance(block, Picture))


def _embedded(value: object) -> str:
    """JSON that can stand inside a script element, whatever texts it holds."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _text(name: str) -> str:
    return (files("kinacc.report") / TEMPLATES / name).read_text("utf-8")


@cache
def _template():
    from jinja2 import BaseLoader, Environment, StrictUndefined

    environment = Environment(
        loader=BaseLoader(),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.from_string(_text("page.html"))
