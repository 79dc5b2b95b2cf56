"""Fig. 6: iteration history of a simulation that could not invalidate the model."""

from __future__ import annotations

from kinacc.figures.history import draw

__all__ = ["draw"]
