"""Fig. 6: iteration history of a simulation that could not invalidate the model."""

from __future__ import annotations

from functools import partial

from kinacc.figures import iterations

run = partial(iterations.run, example="not_rejected")
