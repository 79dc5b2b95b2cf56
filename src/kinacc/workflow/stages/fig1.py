"""Draw Fig. 1, the one-dimensional example."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from kinacc.figures import fig1


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure; it needs no table."""
    return fig1.draw()
