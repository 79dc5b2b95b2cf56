"""The page that a fitter has beside the pendant."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinacc import __version__
from kinacc.report.rendering import environment

if TYPE_CHECKING:
    from kinacc.deployment.export.pendant import Pendant


def pendant_page(found: Pendant) -> str:
    """The page as HTML, to be printed."""
    template = environment().get_template("pendant.html")
    return template.render(found=found, version=__version__)
