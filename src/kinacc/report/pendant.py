"""The page that a fitter has beside the pendant."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinacc import __version__
from kinacc.report.rendering import environment

if TYPE_CHECKING:
    from kinacc.deployment.export.pendant import Pendant


def pendant_page(pendant: Pendant) -> str:
    """The page on values to enter into a controller.

    Parameters
    ----------
    pendant
        Old and new values (deg, mm or as the controller has them) and mean errors.

    Returns
    -------
    str
        HTML, to be printed.
    """
    template = environment().get_template("pendant.html")
    return template.render(found=pendant, version=__version__)
