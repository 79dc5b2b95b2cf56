"""The command line as tests use it: one call, and results of a small study made through it."""

from __future__ import annotations

import json
from pathlib import Path

from click.testing import CliRunner, Result
from stages_by_hand import CALIBRATED, run_stages

from kinacc.cli.group import main


def call(*words: object, code: int | None = None, **more: object) -> Result:
    """Run a command as a person would; ``code`` is the exit code that it must have."""
    done = CliRunner().invoke(main, [str(word) for word in words], **more)
    assert code in (None, done.exit_code), done.output
    return done


def answer(*words: object, code: int | None = 0) -> dict:
    """The answer of a command as JSON; ``code`` as in ``call``."""
    return json.loads(call(*words, "--json", code=code).stdout)


def small_study(base: Path) -> Path:
    """Results folder of a small synthetic arm, made by the workflow's own stages."""
    config = base / "small.yaml"
    config.write_text(
        "datasets: {mh180: {robot: mh180}}\nmeasurements: {folds: 2, synthetic: {poses: 80}}\n"
        "calibration: {vec: {order: 1}}\n"
    )
    return run_stages(CALIBRATED, [config], base / "results")
