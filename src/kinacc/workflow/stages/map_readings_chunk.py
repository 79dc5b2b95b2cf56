"""Stage: the sentences on Fig. 3 under some readings of it, each over arms drawn anew."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.artifacts.contract import columns_of
from kinacc.artifacts.error_models import ALWAYS
from kinacc.study.claims.claim import verdict
from kinacc.study.claims.map_sentences import map_claims
from kinacc.study.map_readings import READINGS, Reading
from kinacc.workflow import arm_search, in_memory


def run(inputs: Mapping, settings: Mapping, progress=None) -> dict[str, Columns]:
    """Return ``map_readings_chunk`` for ``settings["part"]`` (default: all readings).

    A calibration has to cover the poses it is judged on, so each reading has its own calibration
    plan and its own arms, drawn by the rule of the shipped ones; the maps have no say in that.
    """
    part = settings.get("part") or {"number": 1, "of": 1}
    config = {name: value for name, value in settings.items() if name != "part"}
    rows: list[dict] = []
    for reading in READINGS[part["number"] - 1 :: part["of"]]:
        rows += judged_arms(reading, config, progress)
    return {"map_readings_chunk": columns_of("map_readings_chunk", rows)}


def judged_arms(reading: Reading, config: Mapping, progress=None) -> Iterator[dict]:
    """Rows of ``map_readings`` under a reading: every sentence on every arm accepted."""
    own, wanted = reading.of(config), config["map_readings"]
    bench = arm_search.bench_of(own)
    found = arm_search.search(bench, int(wanted["arms"]), progress, int(wanted["seeds"]))
    for each in found:
        start = {"measurements": in_memory.without_folds(arm_search.measured(bench, each.draw))}
        tables = in_memory.run((*ALWAYS, "accuracy_map"), own, start)
        drawn = tables["accuracy_map"]
        for claim in map_claims():
            finding = claim.compute(tables)
            yield {
                "reference_frame": reading.reference_frame,
                "reference_orientation": reading.orientation,
                "rotations": reading.rotations,
                "seed": each.draw.seed,
                "reached": float(np.sum(drawn["solutions"]) / np.sum(drawn["wanted"])),
                "claim": claim.id,
                "reproduced": finding.value,
                "verdict": verdict(claim, finding),
            }
