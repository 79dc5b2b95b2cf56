"""Draw Fig. 3, the accuracy maps."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from kinacc.figures import fig3


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``accuracy_map``."""
    return fig3.draw(inputs["accuracy_map"], dataset=settings.get("dataset"))
