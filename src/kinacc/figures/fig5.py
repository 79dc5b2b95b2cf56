"""Fig. 5: iteration history of a simulation that invalidated the model."""

from __future__ import annotations

from functools import partial

from kinacc.figures import iterations

run = partial(iterations.run, example="rejected")
