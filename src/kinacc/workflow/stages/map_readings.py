"""Stage: gather the sentences on Fig. 3 under its readings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.study.map_readings import READINGS


def run(inputs: Mapping, settings: Mapping) -> dict[str, Columns]:
    """Return ``map_readings``: by reading, then in order of the seeds and the sentences."""
    rows = inputs["map_readings_chunk"]
    place = {(r.reference_frame, r.orientation, r.rotations): i for i, r in enumerate(READINGS)}
    keys = zip(
        rows["reference_frame"], rows["reference_orientation"], rows["rotations"], strict=True
    )
    order = np.argsort([place[key] for key in keys], kind="stable")
    return {"map_readings": {name: np.asarray(column)[order] for name, column in rows.items()}}
