"""Fig. 5: iteration history of a simulation that invalidated the model."""

from __future__ import annotations

from functools import partial

from kinacc.figures import history

run = partial(history.run, example="rejected")
