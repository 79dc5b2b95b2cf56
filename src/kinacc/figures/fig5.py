"""Fig. 5: iteration history of a simulation that invalidated the model."""

from __future__ import annotations

from kinacc.figures.history import draw

__all__ = ["draw"]
