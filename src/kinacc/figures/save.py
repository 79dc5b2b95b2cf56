"""Turn a Figure into the bytes of its files: same figure and versions, same bytes.

Dates, versions and random identifiers are left out, fonts are embedded (PDF) or drawn as paths
(SVG), and the layout is settled once so that every format shows the same picture.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from kinacc.errors import InputError, Problem
from kinacc.figures import style
from kinacc.tables.atomic import write_together

FORMATS = ("svg", "png", "pdf")
PNG_DPI = 200
RASTER_DPI = 300  # of the dense meshes inside the vector formats

_METADATA = {
    "svg": {"Date": None, "Creator": None},
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "ModDate": None, "Creator": None, "Producer": None},
}


def render(figure: Figure, formats: Iterable[str]) -> dict[str, bytes]:
    """Return the file content for each format; InputError for others than svg, png and pdf."""
    formats = tuple(formats)
    unknown = [name for name in formats if name not in FORMATS]
    if unknown:
        raise InputError(
            [Problem("figures.formats", f"{name!r}", ", ".join(FORMATS)) for name in unknown]
        )
    with style.house():
        settle(figure)
        return {name: _bytes(figure, name) for name in formats}


def settle(figure: Figure) -> None:
    """Run the layout once and freeze it, so later drawing neither repeats nor changes it."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        # "none" would leave a placeholder, for which matplotlib draws everything twice.
        figure.set_layout_engine(None)


def write(figure: Figure, paths: Mapping[str, Path]) -> None:
    """Write one file per format; each appears whole, and none appears unless all rendered."""
    contents = render(figure, paths)
    write_together({path: contents[name] for name, path in paths.items()})


def _bytes(figure: Figure, name: str) -> bytes:
    buffer = BytesIO()
    dpi = PNG_DPI if name == "png" else RASTER_DPI
    with _lean_pdf() if name == "pdf" else nullcontext():
        figure.savefig(buffer, format=name, dpi=dpi, metadata=_METADATA[name])
    return buffer.getvalue()


@contextmanager
def _lean_pdf() -> Iterator[None]:
    """Embed fonts without their rules for setting text, and keep of a mesh what is drawn.

    Reading the rules is most of the time that a PDF takes, and matplotlib places every letter
    itself. A mesh is cut out of a raster of the whole figure, which would be kept for each.
    """
    from fontTools import subset
    from matplotlib.backends.backend_pdf import PdfFile

    load, add = subset.load_font, PdfFile.imageObject

    def load_font(*args, **options):
        font = load(*args, **options)
        for rules in {"GDEF", "GPOS", "GSUB", "kern"} & set(font.keys()):
            del font[rules]
        return font

    with (
        _replaced(subset, "load_font", load_font),
        _replaced(PdfFile, "imageObject", lambda file, image: add(file, image.copy())),
    ):
        yield


@contextmanager
def _replaced(owner: object, name: str, value: object) -> Iterator[None]:
    kept = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, kept)
