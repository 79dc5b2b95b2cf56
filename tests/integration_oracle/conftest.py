"""A small but whole study of the synthetic arm, run stage by stage once for all tests here."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

SETTINGS = """
datasets:
  small:
    robot: mh180
    measurements: {source: synthetic}
seed: 4711
measurements:
  folds: 4
  validation_fold: 1
  synthetic: {poses: 160, tracker_noise_mm: 0.02}
calibration:
  vec: {order: 3}
evaluation:
  points: 24
map: {slices_deg: [0, 30], grid_mm: 225}
study: {noise_mm: [0.05, 0.3], repetitions: 2, measurements: 24, chunks: 2}
histories: {simulations_searched: 30}
figures: {formats: [svg]}
"""


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Path:
    """Folder of the finished data set; the figures are left out."""
    from kinacc.stages.plan import planned
    from kinacc.stages.runner import Job, perform

    folder = tmp_path_factory.mktemp("study")
    config = folder / "config.yaml"
    config.write_text(SETTINGS, encoding="utf-8")
    plan = planned([str(config)], results=str(folder / "results"))
    stages = [s for s in plan.stages("small").values() if not s.is_figure and not s.on_request]
    missing = [s.module for s in stages if importlib.util.find_spec(s.module) is None]
    if missing:
        pytest.skip(f"the study cannot run yet: no {', '.join(missing)}")
    for stage in stages:
        for part in plan.part_names(stage.name, "small"):
            perform(
                Job(
                    stage.module,
                    plan.inputs(stage.name, "small"),
                    plan.outputs(stage.name, "small", part),
                    plan.settings(stage.name, "small"),
                    plan.seed("small"),
                    part=part,
                    log=plan.log(stage.name, "small", part),
                )
            )
    sys.stdout.flush()
    return folder / "results" / "small"
