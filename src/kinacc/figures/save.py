"""Turn a Figure into the bytes of its files: same figure and versions, same bytes.

Dates, versions and random identifiers are left out, fonts are embedded (PDF) or drawn as paths
(SVG), and the layout is settled once so that every format shows the same picture.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from kinacc.figures import style
from kinacc.tables.atomic import write_together

# Dots per inch (of the dense meshes inside the vector formats), and marks that are left out.
_SAVED = {
    "svg": (250, ("Date", "Creator")),
    "png": (200, ("Software",)),
    "pdf": (300, ("CreationDate", "ModDate", "Creator", "Producer")),
}
FORMATS = tuple(_SAVED)


def render(figure: Figure, formats: Iterable[str]) -> dict[str, bytes]:
    """The content of the files of a figure.

    Parameters
    ----------
    figure
        Its layout is settled by this.
    formats
        Of svg, png and pdf.

    Returns
    -------
    dict of bytes
        Content by format; the same bytes for the same figure and versions.
    """
    contents = {}
    with style.house():
        settle(figure)
        for name in formats:
            buffer, (dpi, marks) = BytesIO(), _SAVED[name]
            figure.savefig(buffer, format=name, dpi=dpi, metadata=dict.fromkeys(marks))
            contents[name] = buffer.getvalue()
    return contents


def settle(figure: Figure) -> None:
    """Run the layout once and freeze it, so later drawing neither repeats nor changes it."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        # "none" would leave a placeholder, for which matplotlib draws everything twice.
        figure.set_layout_engine(None)


def write(figure: Figure, paths: Mapping[str, Path]) -> None:
    """Write one file per format; each appears whole, and none appears unless all rendered.

    Parameters
    ----------
    figure
        See ``render``.
    paths
        Path by format.
    """
    contents = render(figure, paths)
    write_together({path: contents[name] for name, path in paths.items()})
